"""The compiled step gives the motion of the step on arrays: two routes to one answer."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from fixtures.random_robots import mechanism as robot
from fixtures.steps import looped
from numpy.random import default_rng
from numpy.testing import assert_allclose

from frictionid.dynamics import rollout as prediction
from frictionid.dynamics.compiled.loops import machine_of
from frictionid.dynamics.state import State
from frictionid.friction import Friction
from frictionid.friction import laws as known
from frictionid.mechanics import (
    Body,
    Joint,
    Parameter,
    Plant,
    acrobot,
    double_pendulum,
    from_bodies,
    pendulum,
)

STARTS, SAMPLES = 24, 10


def crane():
    """A carriage with two pendulums: three joints."""
    a, b, c, m = sp.symbols("a b c m")
    swings = [Body(m, a + 0.3 * sp.sin(x), -0.3 * sp.cos(x), joint=k) for k, x in ((1, b), (2, c))]
    joints = [Joint("a", a, "m"), Joint("b", b), Joint("c", c)]
    parameters = [Parameter("m", 0.4, "kg", "of each body"), Parameter("g", 9.81, "m/s^2", "")]
    return from_bodies([Body(m, a, 0), *swings], joints, parameters)


NETWORK = known.MLP(hidden=(4, 4))
LAWS = {
    "none": (known.NoFriction(), []),
    "coulomb": (known.CoulombViscous(), [0.03, 0.01]),
    "stribeck": (known.Stribeck(symmetric=False), [0.02, 0.03, 0.01, 0.02, 0.5, 0.01]),
    "a wide smoothing": (known.CoulombViscous(width=0.1), [0.03, 0.01]),
    "an arctangent": (known.CoulombViscous(shape="arctan"), [0.03, 0.01]),
    "motor load": (known.MotorLoad(), [0.02, 0.01, 0.1]),
    "bearing load": (known.LoadDependent(), [0.02, 0.002, 0.01]),
    "bristles": (known.LuGre(), [0.03, 0.02, 1.0, 0.01, 0.02, 0.02, 0.3]),
    "a film": (known.FilmLag(), [0.03, 0.02, 0.5, 0.01, 0.05]),
    "play": (known.Play(), [0.03, 0.01, 0.02]),
    "a network": (NETWORK, list(0.1 + np.arange(len(NETWORK.names)) / 100)),
}
MECHANISMS = {
    "pendulum": pendulum(mass=0.5, length=0.3),
    "acrobot": acrobot(),
    "coupled": replace(double_pendulum(), coupled=(("both", (1.0, -2.0)),)),
    "crane": crane(),
    "robot": robot(seed=2, n=4),
}
CASES = [
    *((law, "acrobot") for law in LAWS),
    *(("stribeck", "pendulum"), ("bristles", "crane"), ("bearing load", "crane")),
    *(("an arctangent", "coupled"), ("a film", "coupled")),
    *(("stribeck", "robot"), ("bristles", "robot"), ("bearing load", "robot")),
]
LOOPS = [
    *(("coulomb", "coupled"), ("motor load", "acrobot"), ("bearing load", "coupled")),
    *(("an arctangent", "pendulum"), ("bristles", "acrobot")),
]
GAINS = [*((*case, (0.0, 0.0)) for case in CASES), *((*case, (4.0, 0.3)) for case in LOOPS)]


def starts(mechanism):
    """Starts with joints at rest and slow ones among them, torques that change sides."""
    random, n = default_rng(3), mechanism.n
    q, w = random.normal(size=(2, STARTS, n))
    w[::4] = 0.0
    w[1::4] *= 0.05
    w[2::4, 0] = 0.0
    time = np.arange(SAMPLES)[:, None, None] / 60
    u = 0.1 * np.sin(20.0 * time + random.uniform(0, 6, size=(1, STARTS, n))) * mechanism.motors
    return State(q, w), u, np.full((SAMPLES, STARTS), 1 / 60)


def both(monkeypatch, plant, friction):
    state, u, dt = starts(plant.mechanism)
    assert machine_of(plant, friction) is not None
    motions = []
    for many in (10**9, 0):
        monkeypatch.setattr(prediction, "MANY", many)
        motions.append(prediction.rollout(plant, friction, state, u, dt))
    return motions[0], motions[1]


@pytest.mark.parametrize(("law", "mechanism", "gains"), GAINS)
def test_the_motion_is_that_of_arrays(law, mechanism, gains, monkeypatch):
    """Also under a controller, and of laws that see its torque."""
    own, numbers = LAWS[law]
    plant = looped(MECHANISMS[mechanism], STARTS, gains)
    friction = Friction(own, np.tile(numbers, (plant.parts, 1)))
    arrays, fast = both(monkeypatch, plant, friction)
    assert_allclose(fast.q, arrays.q, rtol=0, atol=1e-9)
    assert_allclose(fast.w, arrays.w, rtol=0, atol=1e-7)
    assert np.array_equal(fast.w == 0.0, arrays.w == 0.0)  # the same joints rest at the same time


def test_each_start_has_its_own_machine_and_friction(monkeypatch):
    random, machine = default_rng(4), double_pendulum()
    masses = {"m1": random.uniform(0.5, 1.0, STARTS)}
    plant = Plant.from_parameters(machine, masses)
    theta = random.uniform(0.01, 0.05, size=(STARTS, 2, 2))
    arrays, fast = both(monkeypatch, plant, Friction(known.CoulombViscous(), theta))
    assert_allclose(fast.q, arrays.q, rtol=0, atol=1e-9)


def test_joints_that_stop_and_free_each_other_move_as_in_finer_steps(
    monkeypatch,
):
    """Strong friction near rest: a joint that stops, or is freed, changes what pulls at the other.

    3000 starts of one step of 20 ms, on arrays and compiled, beside 50 times as many substeps.
    """
    random, count = default_rng(0), 3000
    plant = Plant.from_parameters(double_pendulum(), {})
    friction = Friction(known.CoulombViscous(), [[0.5, 0.01], [0.5, 0.01]])
    q = random.uniform(-3, 3, size=(count, 2))
    w = 0.3 * random.normal(size=(count, 2))
    w[::3, 0] = w[1::3, 1] = 0.0
    u, dt = 0.6 * random.normal(size=(1, count, 2)), np.full((1, count), 0.02)
    ends = []
    for many, refine in ((10**9, 1), (0, 1), (0, 50)):
        monkeypatch.setattr(prediction, "MANY", many)
        motion = prediction.rollout(plant, friction, State(q, w), u, dt, refine=refine)
        ends.append(motion.w[-1])
    arrays, fast, finer = ends
    assert np.abs(fast - arrays).max() < 1e-4
    assert np.mean(np.abs(fast - arrays).max(axis=-1) > 1e-7) < 1e-3  # just at the edge of rest
    assert np.mean((arrays == 0.0) != (finer == 0.0)) < 1e-3
    assert np.abs(arrays - finer).max(axis=-1).mean() < 4e-4


def test_motions_that_diverge_are_no_numbers_from_then_on(monkeypatch):
    machine = pendulum(mass=0.5, length=0.3)
    plant = Plant.from_parameters(machine, {})
    driving = Friction(known.CoulombViscous(), [[0.0, -3.0]])  # feeds the motion
    arrays, fast = both(monkeypatch, plant, driving)
    assert np.isnan(fast.q).any()
    assert np.array_equal(np.isnan(fast.q), np.isnan(arrays.q))


@pytest.mark.parametrize("law", [known.Thermal(), known.MLP((64, 64)), known.WindowMLP()])
def test_laws_that_have_no_compiled_form_are_left_to_arrays(law):
    theta = np.array(law.initial[:1])
    plant = Plant.from_parameters(pendulum(mass=0.5, length=0.3), {})
    assert machine_of(plant, Friction(law, theta)) is None


def test_long_chains_are_left_to_arrays():
    law = Friction(known.CoulombViscous(), np.tile([0.03, 0.01], (11, 1)))
    assert machine_of(Plant.from_parameters(robot(seed=1, n=11, serial=True), {}), law) is None
