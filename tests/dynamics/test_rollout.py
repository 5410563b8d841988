"""Laws of prediction: batches, folds, divergence, clocks, memory, tensors, resolution."""

from itertools import pairwise

import numpy as np
import pytest
import torch
from fixtures.memory_laws import FILM, STRIBECK, Sampled, SampledFollower
from fixtures.refusals import assert_refused
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from frictionid.data.signals import Signal
from frictionid.data.state_estimators import Backward
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import Instant, State
from frictionid.dynamics.step import adaptive_step
from frictionid.dynamics.step_size import StepSize
from frictionid.friction import Friction, Inputs, Nodes, at_rest, memory_along
from frictionid.friction.laws import (
    CoulombViscous,
    NoFriction,
    Stribeck,
)
from frictionid.mechanics import Plant, acrobot, double_pendulum, pendulum
from frictionid.simulate.integrate import TrueSystem
from frictionid.simulate.integrate import integrate_motion as simulated
from frictionid.simulate.true_friction import Curve
from frictionid.simulate.true_friction import Stribeck as Truth

METHODS = ("rk4", "euler", "semi_implicit")
PLANT = Plant.from_parameters(double_pendulum(), {})
SAMPLED = Friction(Sampled(), [[0.02], [0.01]])
FRICTIONS = {"stribeck": STRIBECK, "film lag": FILM, "sampled": SAMPLED}
T = 16
EVEN = np.full(T, 1 / 60)
RESOLUTION = 2e-3  # [rad], where joints stick and slip: what another number of substeps changes


def starts(rng, size=7):
    """Start states, some at rest, and torques, by a generator or its seed."""
    rng = default_rng(rng)
    q, w = rng.uniform(-2, 2, (size, 2)), rng.uniform(-4, 4, (size, 2))
    w[::3, 1] = 0.0
    return State(q, w), 0.3 * rng.normal(size=(T, size, 2))


def alone(start, k):
    return State(start.q[k], start.w[k])


# ---------------------------------------------------------------- one motion


def test_held_torques_on_an_uneven_clock_are_followed_exactly():
    plant = Plant.from_parameters(pendulum(), {"mass": 0.5, "length": 0.2})
    friction = Friction(CoulombViscous(), [[0.0, 0.05]])
    rng = default_rng(3)
    dt, u = rng.uniform(0.01, 0.1, 20), rng.normal(size=(20, 1))

    def rate(t, y):
        held = u[min(np.searchsorted(np.cumsum(dt), t, side="right"), 19)]
        M, h = plant.dynamics(y[:1], y[1:])
        return [y[1], (h + held - friction.torque(at_rest(y[1:])))[0] / M[0, 0]]

    y = [1.0, 0.0]
    motion = rollout(plant, friction, State(np.array([1.0]), np.zeros(1)), u, dt, refine=4)
    for k in range(20):
        begin = dt[:k].sum() + 1e-9
        y = solve_ivp(lambda _, y, at=begin: rate(at, y), (0, dt[k]), y, "DOP853", rtol=1e-10).y[
            :, -1
        ]
        assert_allclose([motion.q[k + 1, 0], motion.w[k + 1, 0]], y, rtol=0, atol=1e-6)


def test_a_step_near_rest_converges_as_it_is_halved():
    """1000 steps of 1/60 s from rest and slow motion, beside steps of 16 us near rest."""
    plant, rng, count = Plant.from_parameters(acrobot(), {}), default_rng(7), 1000
    friction = Friction(Stribeck(), [[0.165, 0.0, 1.0, 0.01], [0.055, 0.03, 1.5, 0.003]])
    w = rng.choice([0.0, 0.05, 1.0], (count, 2)) * rng.normal(size=(count, 2))
    start = State(rng.uniform(-2, 2, (count, 2)), w)
    u = 0.2 * rng.normal(size=(count, 1)) * plant.mechanism.motors
    now = Instant(plant, friction, start, u)

    def end(parts):
        return adaptive_step(now, np.full((count, 1), 1 / 60), StepSize(2, parts)).w

    finest = end(256)
    error = [np.sqrt(np.mean((end(parts) - finest) ** 2)) for parts in (1, 4, 16, 64)]
    assert all(finer < coarser / 3 for coarser, finer in pairwise(error))
    assert error[2] < 1e-3  # [rad/s]


def test_a_second_is_that_of_the_simulator_with_its_real_stick():
    plant, rng = Plant.from_parameters(acrobot(), {}), default_rng(20)
    theta = np.array([[0.165, 0.165, 0.0, 0.0, 1.0, 0.01], [0.055, 0.06, 0.03, 0.05, 1.5, 0.003]])
    start = State(rng.uniform(-2, 2, (16, 2)), rng.uniform(-6, 6, (16, 2)))
    u = np.zeros((60, 16, 2))
    u[..., 1] = 0.14 * np.sin(8 * np.arange(60)[:, None] / 60 + rng.uniform(0, 6, 16))
    up, down, peak_up, peak_down, ws, viscous = map(tuple, theta.T)
    system = TrueSystem(
        plant.mechanism, plant.p, Truth(Curve(up, down, viscous, peak_up, peak_down, ws))
    )
    true = simulated(system, start.q, start.w, u, np.arange(61) / 60, 5e-4)
    for width, most in ((0.02, 4e-4), (0.005, 1e-4)):
        friction = Friction(Stribeck(width=width, symmetric=False), theta)
        motion = rollout(plant, friction, start, u, np.full(60, 1 / 60))
        error = np.abs(motion.q - true[:, 0]).max(axis=-1)
        assert np.median(error[-1]) < most and error[-1].max() < 0.01
    sticks = (true[:, 1] == 0.0).mean()
    assert sticks > 0.02 and (motion.w == 0.0).mean() == pytest.approx(sticks, abs=0.01)


def test_the_semi_implicit_step_undoes_backward_differences():
    start, u = starts(6, 1)
    motion = rollout(PLANT, STRIBECK, start, u, EVEN, method="semi_implicit")
    assert_allclose(motion.q[1:], motion.q[:-1] + motion.w[1:] / 60, rtol=0, atol=1e-14)
    time = np.arange(T + 1) / 60
    seen = Backward()([Signal(time, motion.q[:, 0])])[0]
    assert_allclose(seen.w, motion.w[1:, 0], rtol=0, atol=1e-11)


def test_an_unknown_method_is_refused():
    start, u = starts(7)
    with assert_refused("'heun' is unknown; known are 'rk4', 'euler'"):
        rollout(PLANT, STRIBECK, start, u, EVEN, method="heun")


# ---------------------------------------------------------------- many motions


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", FRICTIONS)
def test_many_starts_are_each_start_alone(name, method):
    start, u = starts(8)
    together = rollout(PLANT, FRICTIONS[name], start, u, EVEN, method=method)
    for k in range(7):
        one = rollout(PLANT, FRICTIONS[name], alone(start, k), u[:, k], EVEN, method=method)
        assert_array_equal(together.q[:, k], one.q)
        assert_array_equal(together.w[:, k], one.w)


@pytest.mark.parametrize("name", FRICTIONS)
def test_stacked_folds_are_each_fold_alone(name):
    start, u = starts(9)
    friction = FRICTIONS[name]
    factor = default_rng(10).uniform(0.8, 1.2, (3, 1, 1, 1))
    many = Friction(friction.law, friction.theta * factor)
    together = rollout(PLANT, many, start, u, EVEN)
    assert together.q.shape == (T + 1, 3, 7, 2)
    for f in range(3):
        one = rollout(PLANT, many[f], start, u, EVEN)
        # the steepest fold sets the substeps of all
        assert_allclose(together.q[:, f], one.q, rtol=0, atol=RESOLUTION)


@pytest.mark.parametrize(("method", "off"), [("rk4", RESOLUTION), ("semi_implicit", 0.0)])
def test_every_start_may_have_its_own_plant_friction_and_clock(method, off):
    rng = default_rng(11)
    start, u = starts(rng)
    plants = Plant.from_parameters(double_pendulum(), {"m2": rng.uniform(0.3, 0.6, 7)})
    own = Friction(Stribeck(), STRIBECK.theta * rng.uniform(0.8, 1.2, (7, 1, 1)))
    dt = rng.uniform(0.005, 0.03, (T, 7))
    together = rollout(plants, own, start, u, dt, method=method)
    for k in range(7):
        one = rollout(plants[k], own[k], alone(start, k), u[:, k], dt[:, k], method=method)
        assert_allclose(together.q[:, k], one.q, rtol=0, atol=off)
    same = rollout(PLANT, STRIBECK, start, u, dt, method=method)
    assert np.abs(together.q - same.q)[-1].max() > 1e-2  # masses do matter


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["stribeck", "film lag"])
def test_a_motion_that_diverges_is_nan_from_there_on_and_alone(name, method):
    start, u = starts(13)
    calm = rollout(PLANT, FRICTIONS[name], start, u, EVEN, method=method)
    u[5, 2] = 1e9
    u[10, 4] = np.inf
    motion = rollout(PLANT, FRICTIONS[name], start, u, EVEN, method=method)
    for k, first in ((2, 6), (4, 11)):
        assert_array_equal(motion.q[:first, k], calm.q[:first, k])
        assert np.isnan(motion.q[first:, k]).all() and np.isnan(motion.w[first:, k]).all()
    others = [0, 1, 3, 5, 6]
    assert_array_equal(motion.q[:, others], calm.q[:, others])


def test_arguments_are_left_as_they_were():
    start, u = starts(15)
    copies = [x.copy() for x in (start.q, start.w, u, EVEN)]
    rollout(PLANT, STRIBECK, start, u, EVEN)
    for given, copy in zip((start.q, start.w, u, EVEN), copies, strict=True):
        assert_array_equal(given, copy)


# ---------------------------------------------------------------- memory


def test_without_a_memory_the_motion_begins_with_a_new_one():
    start, u = starts(16)
    x = Inputs(start.q, start.w, u[0], 0 * start.q)
    given = start._replace(memory=FILM.law.start(FILM.theta, x))
    a, b = (rollout(PLANT, FILM, s, u, EVEN) for s in (start, given))
    assert_array_equal(a.q, b.q)
    warm = start._replace(memory=(np.full((7, 2), 5.0),))
    assert np.abs(rollout(PLANT, FILM, warm, u, EVEN).q - a.q).max() > 1e-4


@pytest.mark.parametrize("method", METHODS)
def test_the_memory_of_a_predicted_motion_is_that_along_it(method):
    # a sampled law remembers the same, whether it predicts a motion or reads it from a recording
    start, u = starts(17, 1)
    u = u[:, 0]
    motion = rollout(PLANT, SAMPLED, alone(start, 0), u, EVEN, method=method)
    x = Inputs(motion.q[:-1], motion.w[:-1], u, 0 * u)
    nodes = Nodes(x, np.arange(T) / 60, np.array([0, T]))
    for k, memory in enumerate(memory_along(SAMPLED, nodes)):
        begin = State(motion.q[k], motion.w[k], tuple(entry[0] for entry in memory))
        rest = rollout(PLANT, SAMPLED, begin, u[k:], EVEN[k:], method=method)
        assert_allclose(rest.q[-1], motion.q[-1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_a_memory_of_samples_advances_by_the_whole_interval(method):
    """With dz/dt = (w - z)/0.1 s at w = 1, z = 1 - exp(-t/0.1) at each sample, held until the next.

    So weak a friction takes gain/J sum z dt of the velocity.
    """
    gain, inertia = 1e-6, 0.01
    rotor = Plant.from_parameters(pendulum(), {"mass": 1.0, "length": 0.1, "g": 0.0})
    dt = default_rng(20).uniform(0.01, 0.03, T)
    start = State(np.zeros(1), np.ones(1))
    friction = Friction(SampledFollower(), [[gain]])
    w = rollout(rotor, friction, start, np.zeros((T, 1)), dt, method=method).w
    z = 1.0 - np.exp(-np.concatenate([[0.0], np.cumsum(dt)[:-1]]) / 0.1)
    assert (1.0 - w[-1, 0]) * inertia / gain == pytest.approx((z * dt).sum(), rel=1e-3)


# ---------------------------------------------------------------- tensors


def tensor(x):
    return torch.as_tensor(x, dtype=torch.float64)


def on_tensors(friction, start, u, dt, plant=PLANT, **options):
    """Rollout with everything a tensor."""
    begin = State(*map(tensor, start[:2]))
    machine = Plant(plant.mechanism, {}, tensor(plant.p))
    return rollout(machine, friction, begin, tensor(u), tensor(dt), **options)


@pytest.mark.parametrize(
    ("name", "method"),
    [*((name, "rk4") for name in (*FRICTIONS, "none")), *(("stribeck", m) for m in METHODS[1:])],
)
def test_tensors_give_the_same_motion(name, method):
    start, u = starts(19)
    friction = FRICTIONS.get(name) or Friction(NoFriction(), np.zeros((2, 0)))
    expected = rollout(PLANT, friction, start, u, EVEN, method=method)
    other = Friction(friction.law, tensor(friction.theta))
    found = on_tensors(other, start, u, EVEN, method=method)
    assert_allclose(found.q, expected.q, rtol=0, atol=1e-10)
    assert_array_equal(found.w.numpy() == 0, expected.w == 0)


def test_gradients_flow_to_friction_and_plant():
    plant = Plant.from_parameters(double_pendulum(), {"m2": 0.45})
    theta, dt = np.array([[0.02, 0.02], [0.01, 0.01]]), np.full(12, 1 / 60)
    start = State(np.array([0.5, 1.0]), np.array([6.0, -8.0]))  # fast: no joint comes to rest
    u = np.zeros((12, 2))

    def end(theta, m2):
        return rollout(
            Plant.from_parameters(plant.mechanism, {"m2": m2}),
            Friction(CoulombViscous(), theta),
            start,
            u,
            dt,
        ).q[-1]

    leaf, m2 = tensor(theta).requires_grad_(), tensor(0.45).requires_grad_()
    begin = State(tensor(start.q), tensor(start.w))
    machine = Plant.from_parameters(plant.mechanism, {"m2": m2})
    motion = rollout(machine, Friction(CoulombViscous(), leaf), begin, tensor(u), tensor(dt))
    motion.q[-1].sum().backward()
    for index in np.ndindex(2, 2):
        shift = np.zeros((2, 2))
        shift[index] = 1e-5
        change = (end(theta + shift, 0.45) - end(theta - shift, 0.45)).sum() / 2e-5
        assert leaf.grad[index].item() == pytest.approx(change, rel=1e-5, abs=1e-7)
    change = (end(theta, 0.45 + 1e-5) - end(theta, 0.45 - 1e-5)).sum() / 2e-5
    assert m2.grad.item() == pytest.approx(change, rel=1e-5)


def test_friction_of_a_stuck_joint_has_no_influence():
    theta = tensor([[0.0, 0.02], [0.5, 0.01]]).requires_grad_()
    start, u = State(np.array([0.3, 0.2]), np.array([1.0, 0.0])), np.zeros((12, 2))
    motion = on_tensors(Friction(CoulombViscous(width=0.5), theta), start, u, np.full(12, 1 / 60))
    motion.q[-1].sum().backward()
    assert (motion.q[:, 1] == 0.2).all()
    assert (theta.grad[1] == 0.0).all() and (theta.grad[0, 1] != 0.0).all()
