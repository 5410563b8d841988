"""Friction that grows with the load: of the motor, and of the bearing."""

import numpy as np
import pytest
from fixtures.exact_problems import along_inputs
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose

from frictionid.dynamics.state import Instant, State
from frictionid.dynamics.step import acceleration
from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction import Friction, Inputs
from frictionid.friction.laws import (
    CoulombViscous,
    GearLoad,
    LoadDependent,
    MotorLoad,
    Stribeck,
)
from frictionid.mechanics import Plant, pendulum


def test_the_gear_passes_on_less_when_driving_and_holds_more_when_braking():
    law = MotorLoad()
    fast = np.array([[5.0]])
    for sign, passed in ((1.0, 0.7), (-1.0, 1.3)):
        x = Inputs(0 * fast, sign * fast, np.array([[0.2]]), 0 * fast)
        share = 0.2 - law.torque(np.array([[0.0, 0.0, 0.3]]), x, ())
        assert_allclose(share, 0.2 * passed)


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
    friction = Friction(LoadDependent(), [[0.0, 0.01, 0.0]])
    now = Instant(plant, friction, State(np.zeros(1), np.array([10.0])), np.zeros(1))
    pull = 0.5 * (0.3 * 10.0**2 + 9.81)
    assert friction.torque(now.inputs)[0] == pytest.approx(0.01 * pull)
    free = acceleration(now._replace(friction=Friction(CoulombViscous(), np.zeros((1, 2)))))
    assert (acceleration(now) - free)[0] == pytest.approx(-0.01 * pull / (0.5 * 0.3**2))


def test_the_coefficient_of_a_prismatic_joint_has_no_unit():
    friction = Friction(LoadDependent(), BEARING, position_units=("m",) * len(BEARING))
    assert friction.units_at(0) == ("N", "N/N", "N s/m")


# ---------------------------------------------------------------- gears

MOMENT = 0.5
GEAR = GearLoad(MOMENT)
# a published model in its order of size
M6 = dict(
    coulomb=0.005,
    viscous=0.005,
    motor=0.27,
    external=0.02,
    peak=0.005,
    peak_motor=0.03,
    peak_external=0.08,
    quadratic_motor=0.4,
    quadratic_external=0.2,
    stribeck_velocity=2.9,
    exponent=3.0,
)


def theta(law=GEAR, **changes):
    return np.array([[{**M6, **changes}[name] for name in law.names]])


def inputs(rows=400, seed=0):
    rng = np.random.default_rng(seed)
    q, w, u = (rng.normal(scale=s, size=(rows, 1)) for s in (1.0, 3.0, 0.3))
    return Inputs(q, w, u, 0.0 * q)


def at(q=0.0, w=0.0, u=0.0):
    return Inputs(*(np.array([[float(value)]]) for value in (q, w, u, 0.0)))


def test_its_external_torque_is_that_of_gravity_on_a_pendulum():
    """Held off the vertical by its motor alone it is loaded by u - te = 2 u, hanging by nothing."""
    only = dict.fromkeys(M6, 0.0) | {"stribeck_velocity": 1.0, "exponent": 2.0}
    same = np.array([[{**only, "motor": 0.3, "external": 0.3}[name] for name in GEAR.names]])
    q = 0.7
    holding = MOMENT * np.sin(q)
    assert GEAR.limit(same, at(q, u=holding), ()) == pytest.approx(0.3 * 2 * holding)
    assert GEAR.limit(same, at(q, u=-holding), ()) == pytest.approx(0.0)
    assert GEAR.limit(same, at(), ()) == 0.0


def test_without_motor_torque_it_depends_on_the_angle_only_through_gravity():
    x = inputs()._replace(u=np.zeros((400, 1)))
    hanging = x._replace(q=np.zeros((400, 1)))
    bare = Friction(GearLoad(0.0), theta()).torque(x)
    assert_allclose(Friction(GEAR, theta()).torque(hanging), bare)
    lifted = Friction(GEAR, theta()).torque(x)
    assert np.all(np.abs(lifted) >= np.abs(bare) - 1e-15) and np.any(np.abs(lifted) > np.abs(bare))


def test_the_squares_count_only_where_motor_and_gravity_oppose_and_are_those_of_the_weaker():
    other = theta(quadratic_motor=0.0, quadratic_external=0.0)

    def square(u, q):
        return float(
            (GEAR.limit(theta(), at(q, u=u), ()) - GEAR.limit(other, at(q, u=u), ()))[0, 0]
        )

    te = -MOMENT * np.sin(0.5)
    assert square(0.1, 0.5) == pytest.approx(0.4 * 0.1**2)  # gravity wins: the motor's square
    assert square(0.4, 0.5) == pytest.approx(0.2 * te**2)  # the motor wins: gravity's
    assert square(-0.1, 0.5) == square(-0.4, 0.5) == square(0.0, 0.5) == 0.0


def test_it_contains_the_simpler_laws():
    x = inputs()
    zero = dict.fromkeys(("motor", "external", "peak_motor", "peak_external"), 0.0)
    zero |= {"quadratic_motor": 0.0, "quadratic_external": 0.0}

    def torque(**changes):
        return GEAR.torque(theta(**{**zero, **changes}), x, ())

    m2 = Stribeck().torque(np.array([[0.005, 0.005, 2.9, 0.005]]), x, ())
    assert_allclose(torque(exponent=2.0), m2)
    loaded = MotorLoad().torque(np.array([[0.005, 0.005, 0.27]]), x, ())
    assert_allclose(torque(peak=0.0, motor=0.27), loaded)


@pytest.mark.parametrize("law", [GEAR, MotorLoad(squared=True)], ids=str)
def test_truth_in_truth_out(law):
    truth = theta() if law is GEAR else np.array([[0.01, 0.005, 0.3, 0.2]])
    problem = along_inputs(Friction(law, truth), inputs(3000))
    found = LeastSquares(law, iterations=300).fit(problem, np.ones((1, 3000)), 0)
    assert_allclose(found.theta[0], truth, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("moment", [-0.1, np.inf, np.nan])
def test_a_moment_that_means_nothing_is_refused(moment):
    words = "GearLoad: moment: it should be (greater than or equal to 0|a finite number)"
    with assert_refused(words):
        GearLoad(moment)
