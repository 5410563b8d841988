"""The documentation's identifier of one's own: short, whole, and as good as ours on its own law."""

import sys
from importlib import import_module

import numpy as np
import pytest
from fixtures import tiny_pendulums as tiny
from fixtures.compared import compare
from fixtures.exact_problems import everything, explained_by
from fixtures.paths import ROOT
from numpy.testing import assert_allclose

from frictionid.comparison.suite import IdentifierEntry, identifier_of
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.fitting.identifiers import Frictionless, check_identifier
from frictionid.fitting.one_step.formulation import INTEGRAL, STUDY
from frictionid.friction.laws import check_law

FILE = ROOT / "comparisons" / "own_friction.py"


@pytest.fixture
def own(monkeypatch):
    """The identifier as a suite in comparisons/ names it."""
    monkeypatch.setattr(sys, "path", list(sys.path))  # a suite adds its folder to it
    table = IdentifierEntry.model_validate({"kind": "own_friction:quadratic", "width": 0.01})
    name, identifier, only = identifier_of(table, FILE.parent, [STUDY, INTEGRAL], trust=True)
    assert (name, only) == ("quadratic", None)
    return identifier


def test_the_page_shows_this_file_and_it_has_under_forty_lines():
    text = FILE.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 40
    assert f"```python\n{text}```" in (ROOT / "docs" / "python" / "own_law.md").read_text("utf-8")


def test_the_identifier_of_the_documentation_keeps_to_the_protocol(tmp_path, monkeypatch):
    page = (ROOT / "docs" / "identifiers.md").read_text(encoding="utf-8")
    code = page.split("```python\n")[1].split("```")[0]
    (tmp_path / "viscous_of_the_docs.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    check_identifier(import_module("viscous_of_the_docs").Viscous())


def test_it_keeps_to_the_contracts(own):
    check_identifier(own)
    check_law(own.law)


def test_it_finds_the_numbers_of_its_own_law(own):
    true = np.array([[0.16, 0.01, 0.003], [0.05, 0.002, 0.0004]])
    problem = explained_by(own.law, true)
    fitted = own.fit(problem, everything(problem), 0)
    assert_allclose(fitted.theta[0], true, rtol=1e-6)


def test_it_takes_part_in_a_comparison_side_by_side_with_ours(own):
    dataset = tiny.dataset()
    folds = make_folds(dataset.recordings, Split(count=3))
    protocol = Protocol(horizons=(0.1, 0.3))
    results = compare(dataset, {"none": Frictionless(), "own": own}, folds, protocol=protocol)
    theirs, ours = (results[name, "integral"] for name in ("none", "own"))
    assert ours.friction.theta.shape == (3, 1, 3)
    far = [r.value("rollout_angle", "median", 0.3) for r in (ours, theirs)]
    assert far[0] < far[1] / 2
