"""Identifiers of one's own, as the documentation shows them, and published friction."""

import sys
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from fixtures.exact_problems import explained_by, fit_to_all
from fixtures.paths import DATA, ROOT
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.comparison.suite import IdentifierEntry, identifier_named, identifier_of
from frictionid.fitting.identifiers import Published, check_identifier
from frictionid.fitting.identifiers.check_identifier import (
    synthetic_problem,
    synthetic_weights,
)
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, check_law

FILE = ROOT / "comparisons/own_friction.py"


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
    assert f"```python\n{text}```" in (ROOT / "docs/python/own_law.md").read_text("utf-8")


def test_the_identifier_of_the_documentation_keeps_to_the_protocol(tmp_path, monkeypatch):
    page = (ROOT / "docs/identifiers.md").read_text(encoding="utf-8")
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
    fitted = fit_to_all(own, problem)
    assert_allclose(fitted.theta[0], true, rtol=1e-6)


# --- Published friction ---------------------------------------------------------------------------

DFKI = DATA / "dfki_c1"
NUMBERS = np.array([[0.3, 0.01], [0.1, 0.02]])
OTHERS = Friction(CoulombViscous(), NUMBERS, {"m1": 0.5}, {"source": "a paper"})


def test_it_is_the_same_in_every_fold_whatever_data_weights_and_seed():
    problem = synthetic_problem(2)
    other = replace(problem, r=problem.r + 1.0)
    found = Published(OTHERS).fit(problem, synthetic_weights(problem), 0)
    again = Published(OTHERS).fit(other, np.ones((3, len(problem.r))), 5)
    assert_array_equal(found.theta, np.broadcast_to(NUMBERS, (3, 2, 2)))
    assert_array_equal(again.theta, found.theta)
    assert (found.law, found.parameters) == (OTHERS.law, {"m1": 0.5})
    assert found.provenance.notes == {"source": "a paper"}
    found.theta[...] = 0.0  # nobody can change the published numbers through a fit
    assert OTHERS.theta.all()


@pytest.mark.parametrize(
    ("friction", "joints"),
    [(OTHERS, 1), (OTHERS[:1], 2), (replace(OTHERS, theta=NUMBERS[None]), 2)],
)
def test_friction_of_another_number_of_joints_or_of_many_folds_is_refused(friction, joints):
    problem = synthetic_problem(joints)
    with assert_refused(rf"theta of shape .*, the data {joints} joints"):
        Published(friction).fit(problem, synthetic_weights(problem), 0)


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_the_models_of_the_real_acrobot_hold_friction_and_their_own_inertias(version):
    made = identifier_named("published", {"file": str(DFKI / f"model_{version}.json")})
    problem = synthetic_problem(2)
    found = made.fit(problem, synthetic_weights(problem), 0)
    assert found.theta.shape == (3, 2, len(found.law.names))
    assert {"m1", "m2", "l1", "I1", "I2"} <= set(found.parameters)
    level = found.law.limit(found.theta[0], problem.nodes.inputs, ())
    assert ((level > 0.01) & (level < 1.0)).all()
