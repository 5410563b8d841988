"""Sums of laws: each term once, truth in and truth out, and what is no sum."""

import numpy as np
import pytest
from fixtures.exact_problems import everything, explained_by

from frictionid.comparison.suite_identifiers import identifier_named
from frictionid.errors import InputError
from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction import Inputs
from frictionid.friction.laws import (
    LoadDependent,
    MotorLoad,
    Quadratic,
    Stribeck,
    Sum,
)

X = Inputs(*np.random.default_rng(0).normal(size=(4, 60, 2)))._replace(
    load=np.random.default_rng(1).uniform(1.0, 5.0, (60, 2))
)


def torque(law, *theta):
    return law.torque(np.array([theta, theta]), X, ())


def test_a_sum_is_the_sum_of_its_laws_with_each_term_once():
    both = torque(Sum(), 0.1, 0.05, 1.5, 0.02, 0.3)
    apart = torque(Stribeck(), 0.1, 0.05, 1.5, 0.02) + torque(MotorLoad(), 0.0, 0.0, 0.3)
    np.testing.assert_allclose(both, apart, rtol=1e-13)


def test_levels_by_direction_stand_for_a_level_of_both():
    law = Sum((Stribeck(symmetric=False), "motor_load"))
    assert "coulomb" not in law.names and law.names[-1] == "loss"
    both = torque(law, 0.1, 0.2, 0.05, 0.03, 1.5, 0.02, 0.3)
    own = torque(Stribeck(symmetric=False), 0.1, 0.2, 0.05, 0.03, 1.5, 0.02)
    np.testing.assert_allclose(both, own + torque(MotorLoad(), 0.0, 0.0, 0.3), rtol=1e-13)


def test_of_laws_that_hold_each_other_the_larger_one_is_the_sum():
    for laws, whole in (
        (("stribeck", LoadDependent(stribeck=True)), LoadDependent(stribeck=True)),
        (("motor_load", MotorLoad(squared=True)), MotorLoad(squared=True)),
        (("coulomb_viscous", "quadratic"), Quadratic()),
    ):
        law = Sum(laws)
        numbers = dict(zip(whole.names, np.linspace(0.1, 0.9, len(whole.names)), strict=True))
        both = torque(law, *(numbers[name] for name in law.names))
        np.testing.assert_allclose(both, torque(whole, *numbers.values()), rtol=1e-13)


def test_truth_in_truth_out():
    theta = np.array([[0.1, 0.04, 1.5, 0.02, 0.15], [0.05, 0.03, 0.8, 0.01, 0.3]])
    problem = explained_by(Sum(), theta)
    found = LeastSquares(Sum()).fit(problem, everything(problem), 0)
    np.testing.assert_allclose(found.theta[0], theta, rtol=1e-6)


def test_a_suite_names_its_laws():
    own = identifier_named("sum", {"laws": ["quadratic", "motor_load"]})
    assert own == LeastSquares(Sum(("quadratic", "motor_load")))


@pytest.mark.parametrize(
    ("laws", "words"),
    [
        (("dahl", "stribeck"), "'dahl' has a memory"),
        (("stribeck", "coulomb_viscous"), "'coulomb_viscous' adds nothing to the laws before it"),
        (("none", "stribeck"), "'none' adds nothing"),
        (("stribeck",), "at least 2 items"),
    ],
)
def test_what_is_no_sum_is_refused(laws, words):
    with pytest.raises(InputError, match=words):
        Sum(laws)
