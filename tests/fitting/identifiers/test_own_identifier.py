"""The documentation's identifier of one's own: short, whole, and as good as ours on its own law."""

import sys
from importlib import import_module

import numpy as np
import pytest
from fixtures.exact_problems import everything, explained_by
from fixtures.paths import ROOT
from numpy.testing import assert_allclose

from frictionid.comparison.suite import IdentifierEntry, identifier_of
from frictionid.fitting.identifiers import check_identifier
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
