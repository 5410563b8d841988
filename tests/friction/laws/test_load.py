"""Friction that grows with the load: of the motor, and of the bearing."""

import numpy as np
import pytest
from fixtures.exact_problems import along_inputs, assert_recovered
from numpy.testing import assert_allclose

from frictionid.dynamics.state import Instant, State
from frictionid.dynamics.step import acceleration
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.friction import Friction, Inputs
from frictionid.friction.laws import CoulombViscous, LoadDependent, MotorLoad
from frictionid.mechanics import Plant, pendulum

MOTOR = np.array([[0.01, 0.005, 0.3]])


def test_the_gear_passes_on_less_when_driving_and_holds_more_when_braking():
    law = MotorLoad()
    fast = np.array([[5.0]])
    for sign, passed in ((1.0, 0.7), (-1.0, 1.3)):
        x = Inputs(0 * fast, sign * fast, np.array([[0.2]]), 0 * fast)
        share = 0.2 - law.torque(np.array([[0.0, 0.0, 0.3]]), x, ())
        assert_allclose(share, 0.2 * passed)


def test_a_fit_finds_the_truth_and_plain_coulomb_friction_is_biased():
    rng = np.random.default_rng(3)
    w, u = rng.normal(scale=3.0, size=(400, 1)), rng.normal(scale=0.3, size=(400, 1))
    x = Inputs(0.0 * w, w, u, 0.0 * w)
    problem, weights = along_inputs(Friction(MotorLoad(), MOTOR), x), np.ones((1, 400))
    found = LeastSquares(MotorLoad()).fit(problem, weights, 0)
    assert_allclose(found.theta[0], MOTOR, rtol=1e-5)
    plain = LeastSquares(CoulombViscous()).fit(problem, weights, 0)
    assert plain.theta[0, 0, 0] > 5 * MOTOR[0, 0]


BEARING = np.array([[0.04, 0.01, 0.02], [0.02, 0.005, 0.01]])
PEAKED = np.array([[0.04, 0.03, 1.5, 0.01, 0.02], [0.02, 0.03, 2.5, 0.005, 0.01]])
BOTH = pytest.mark.parametrize(
    ("law", "theta"), [(LoadDependent(), BEARING), (LoadDependent(stribeck=True), PEAKED)], ids=str
)


def drawn(seed=0):
    q, w, u, load = np.random.default_rng(seed).normal(size=(4, 60, 2))
    return Inputs(q, 3 * w, u, 10 * np.abs(load))


@BOTH
def test_the_level_grows_with_the_load_by_its_coefficient(law, theta):
    x, place = drawn(), law.names.index("load_coefficient")
    more = law.torque(theta, x._replace(load=x.load + 7.0), ()) - law.torque(theta, x, ())
    expected = 7.0 * theta[:, place] * np.tanh(x.w / 0.02)
    assert_allclose(more, expected, rtol=1e-9, atol=1e-12)


def test_the_load_is_that_of_the_mechanism():
    """A pendulum that turns fast pulls at its bearing with m l w^2 and its weight."""
    plant = Plant.from_parameters(pendulum(), {"mass": 0.5, "length": 0.3})
    friction = Friction(LoadDependent(), np.array([[0.0, 0.01, 0.0]]))
    now = Instant(plant, friction, State(np.zeros(1), np.array([10.0])), np.zeros(1))
    pull = 0.5 * (0.3 * 10.0**2 + 9.81)
    assert friction.torque(now.inputs)[0] == pytest.approx(0.01 * pull)
    free = acceleration(now._replace(friction=Friction(CoulombViscous(), np.zeros((1, 2)))))
    assert (acceleration(now) - free)[0] == pytest.approx(-0.01 * pull / (0.5 * 0.3**2))


@BOTH
def test_truth_in_truth_out(law, theta):
    assert np.ptp(synthetic_problem(2).nodes.inputs.load, axis=0).min() > 1.0
    assert_recovered(law, theta)


def test_the_coefficient_of_a_prismatic_joint_has_no_unit():
    friction = Friction(LoadDependent(), BEARING, position_units=("m",) * len(BEARING))
    assert friction.units_at(0) == ("N", "N/N", "N s/m")
