"""The physics step against exact solutions: orders of convergence, memory, substeps, tensors."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from fixtures.steps import step, substeps
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import Instant, State
from frictionid.dynamics.step import euler_step, semi_implicit_step
from frictionid.dynamics.step_size import slopes, step_size_of, stiffness
from frictionid.friction import Friction, at_rest
from frictionid.friction.laws import CoulombViscous, FilmLag, NoFriction
from frictionid.mechanics import Plant, acrobot, double_pendulum, pendulum


class Case(NamedTuple):
    """A motion that never comes to rest, so that everything about it is smooth."""

    plant: Plant
    friction: Friction
    q: tuple[float, ...]
    w: tuple[float, ...]
    u: tuple[float, ...]


def viscous(*levels):
    return Friction(CoulombViscous(), [[0.0, v] for v in levels])


WIDE = Friction(CoulombViscous(width=3.0), [[0.1, 0.01], [0.05, 0.01]])
CASES = {
    "pendulum": Case(
        Plant.from_parameters(pendulum(), {"mass": 0.5, "length": 0.2}),
        viscous(0.02),
        (1.0,),
        (4.0,),
        (0.1,),
    ),
    "double": Case(
        Plant.from_parameters(double_pendulum(), {}),
        viscous(0.02, 0.01),
        (1.0, -0.5),
        (5.0, -4.0),
        (0.3, -0.1),
    ),
    "acrobot": Case(
        Plant.from_parameters(acrobot(), {}),
        viscous(0.01, 0.003),
        (0.5, 1.0),
        (6.0, 3.0),
        (0.0, 0.1),
    ),
    "wide sign": Case(
        Plant.from_parameters(double_pendulum(), {}), WIDE, (0.3, 0.2), (5.0, -5.0), (0.5, -0.1)
    ),
}
DURATION = 0.3


def integrated(rate, begin, duration):
    """State after the duration, by an integrator of order eight with tolerance 1e-12."""
    return solve_ivp(rate, (0, duration), begin, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]


def order_of(counts, errors):
    return -np.polyfit(np.log(counts), np.log(errors), 1)[0]


@cache
def reference(name):
    case = CASES[name]
    n = case.plant.n

    def rate(_, y):
        q, w = y[:n], y[n:]
        M, h = case.plant.dynamics(q, w)
        driven = np.array(case.u) * np.diag(case.plant.mechanism.B)
        Tf = case.friction.torque(at_rest(w))
        return np.concatenate([w, np.linalg.solve(M, h + driven - Tf)])

    return integrated(rate, [*case.q, *case.w], DURATION)


def advanced(case, count):
    state = State(np.array(case.q), np.array(case.w))
    end = step(case.plant, case.friction, state, np.array(case.u), np.array([DURATION]), count)
    return np.concatenate([end.q, end.w])


@pytest.mark.parametrize("name", CASES)
def test_the_error_falls_with_the_order_of_the_method(name):
    exact, counts = reference(name), (16, 32, 64, 128)
    errors = [np.abs(advanced(CASES[name], c) - exact).max() for c in counts]
    assert order_of(counts, errors) == pytest.approx(4, abs=0.25)
    assert_allclose(advanced(CASES[name], 400), exact, rtol=0, atol=1e-8)


def test_the_simple_steps_are_their_formulas():
    case = CASES["double"]
    q, w, u, dt = (np.array(x) for x in (case.q, case.w, case.u, [0.01]))
    M, h = case.plant.dynamics(q, w)
    after = w + 0.01 * np.linalg.solve(M, h + u - case.friction.torque(at_rest(w)))
    now = Instant(case.plant, case.friction, State(q, w), u)
    euler, semi = euler_step(now, dt), semi_implicit_step(now, dt)
    assert_allclose(euler.w, after, rtol=1e-13)
    assert_array_equal(semi.w, euler.w)
    assert_array_equal(euler.q, q + 0.01 * w)
    assert_array_equal(semi.q, q + 0.01 * semi.w)


def test_torques_of_joints_without_motor_do_nothing():
    case = CASES["acrobot"]
    pushed = advanced(case._replace(u=(9.0, case.u[1])), 60)
    assert_array_equal(pushed, advanced(case, 60))


# ---------------------------------------------------------------- batches


def test_all_joints_of_a_batch_with_two_axes_may_stop_within_one_substep():
    plant = CASES["pendulum"].plant
    frictions = Friction(CoulombViscous(), [0.5, 0.0] * np.ones((2, 1, 1, 2)))
    state = State(np.full((2, 2, 1), 0.1), np.full((2, 2, 1), 0.01))
    u, dt = np.zeros((2, 2, 1)), np.array([0.02])
    together = step(plant, frictions, state, u, dt, 1)
    alone = step(plant, frictions[0, 0], State(state.q[0, 0], state.w[0, 0]), u[0, 0], dt, 1)
    assert_array_equal(together.q, np.broadcast_to(alone.q, (2, 2, 1)))
    assert_array_equal(together.w, np.zeros((2, 2, 1)))


# ---------------------------------------------------------------- memory


def lagging_reference(plant, friction, q, w, u, duration):
    """Film lag with its height as a state of its own."""
    law, theta, n = friction.law, friction.theta, plant.n

    def rate(_, y):
        q, w, z = y[:n], y[n : 2 * n], y[2 * n :]
        M, h = plant.dynamics(q, w)
        a = np.linalg.solve(M, h + u - law.torque(theta, at_rest(w), (z,)))
        return np.concatenate([w, a, (np.abs(w) - z) / theta[:, 4]])

    return integrated(rate, [*q, *w, *np.zeros(n)], duration)


def test_memory_makes_the_step_one_of_second_order():
    plant = CASES["double"].plant
    theta = np.array([[0.05, 0.2, 3.0, 0.02, 0.05], [0.03, 0.1, 3.0, 0.01, 0.08]])
    friction = Friction(FilmLag(width=1.0), theta)
    q, w, u = np.array([0.3, 0.2]), np.array([5.0, -6.0]), np.array([0.5, -0.1])
    exact = lagging_reference(plant, friction, q, w, u, 0.2)
    counts, errors = (10, 20, 40, 80), []
    for count in counts:
        end = step(plant, friction, State(q, w, (np.zeros(2),)), u, np.array([0.2]), count)
        errors.append(np.abs(np.concatenate([end.q, end.w, end.memory[0]]) - exact).max())
    assert order_of(counts, errors) == pytest.approx(2, abs=0.2)
    assert errors[-1] < 2e-4


# ---------------------------------------------------------------- how many substeps


class Squeezed(CoulombViscous):
    """Viscous friction that grows with the bearing load, or with the motor torque."""

    uses_load = True
    by = "load"

    def torque(self, theta, x, memory):
        return theta[..., 1] * abs(getattr(x, self.by)) * x.w

    def gradient(self, theta, x):
        raise AssertionError("inherited, of a torque that does not depend on the load")


class Pressed(Squeezed):
    uses_load = False
    by = "u"


@pytest.mark.parametrize(("law", "size"), [(Squeezed(), 1.0), (Pressed(), 0.2)])
def test_the_substeps_follow_friction_that_grows_with_load_or_motor_torque(law, size):
    mass, length = 1.0, 0.2
    plant = Plant.from_parameters(pendulum(), {"mass": mass, "length": length})
    friction = Friction(law, [[0.0, 3.0]])
    most = 3.0 * mass * 9.81 * size / (mass * length**2)  # held still against gravity
    assert most <= stiffness(plant, friction) * 1.01 < 1.3 * most


@pytest.mark.parametrize("beyond", [0.0, 0.005, 0.03, 0.5])
def test_slopes_beyond_a_speed_are_those_of_the_curve_there(beyond):
    """Of smoothed Coulomb friction the steepest is the slowest."""
    friction = Friction(CoulombViscous(width=0.02), [[0.1, 0.003]])
    found = slopes(friction, beyond) if beyond else slopes(friction)
    x = np.array([[beyond - 1e-6], [beyond + 1e-6]])
    below, above = np.asarray(friction.law.torque(friction.theta, at_rest(x), ()))
    assert_allclose(found, (above - below) / 2e-6, rtol=1e-3)


def test_friction_that_grows_with_motor_torque_is_flat_without_it():
    friction = Friction(Pressed(), [[0.0, 3.0]])
    assert slopes(friction) == 0.0 < slopes(friction, u=np.array([0.2]))


def test_the_substeps_follow_the_fastest_rate():
    plant = Plant.from_parameters(pendulum(), {"mass": 1.0, "length": 0.1})  # 0.01 kg m^2
    steep = Friction(CoulombViscous(width=0.001), [[0.1, 0.0]])
    assert stiffness(plant, steep) == pytest.approx(0.1 / 0.001 / 0.01, rel=1e-3)
    free = Friction(NoFriction(), np.zeros((1, 0)))
    assert stiffness(plant, free) == 0.0
    assert step_size_of(plant, free, 1 / 60).pieces == 4  # at most 5 ms each
    assert step_size_of(plant, free, 1e-4).pieces == 1


def test_the_rate_of_coupled_joints_is_the_worst_over_all_positions():
    plant = CASES["double"].plant
    friction = Friction(CoulombViscous(), [[0.0, 0.3], [0.0, 0.1]])
    q = np.random.default_rng(4).uniform(-np.pi, np.pi, (2000, 2))
    M, _ = plant.dynamics(q, 0 * q)
    rates = np.linalg.eigvals(np.linalg.solve(M, np.diag([0.3, 0.1]))).real.max(axis=1)
    assert rates.max() <= stiffness(plant, friction) * (1 + 1e-6) < rates.max() * 1.05


def test_a_batch_has_the_rate_of_its_worst():
    plant = Plant.from_parameters(pendulum(), {"mass": np.array([1.0, 0.2]), "length": 0.1})
    many = Friction(CoulombViscous(), [[[0.1, 0.0]], [[0.4, 0.0]], [[0.2, 0.0]]])
    rates = [stiffness(plant[k], many[f]) for k in range(2) for f in range(3)]
    assert stiffness(plant, many) == max(rates) > min(rates)


@pytest.mark.parametrize("width", [0.02, 0.001, 0.0001])
def test_the_default_count_is_stable_where_a_third_of_it_is_not(width):
    plant = Plant.from_parameters(pendulum(), {"mass": 1.0, "length": 0.1, "g": 0.0})
    # viscous friction of the law's slope, without any level that could hold the joint
    friction = viscous(0.1 / width)
    begin, duration = State(np.zeros(1), np.ones(1)), np.array([200 / stiffness(plant, friction)])
    count = substeps(plant, friction, duration[0])
    assert count in (100, 101)
    assert abs(step(plant, friction, begin, np.zeros(1), duration, count).w[0]) < 1e-30
    assert abs(step(plant, friction, begin, np.zeros(1), duration, count // 3).w[0]) > 1e30


def test_a_law_too_steep_for_any_step_is_refused():
    absurd = Friction(CoulombViscous(), [[0.1, 5e7], [0.1, 0.0]])
    words = r"slope of [\d.e+]+ N m s/rad .* needs \d+ substeps in 0.0167 s: widen the law's"
    with assert_refused(words):
        step_size_of(CASES["double"].plant, absurd, 1 / 60)


def test_a_steep_rise_at_rest_takes_no_more_steps_than_a_break_away():
    """A joint is held there, however steep; the motion is that of a rise a thousand times wider."""
    plant, theta = CASES["double"].plant, np.array([[50.0, 0.1], [0.1, 0.01]])
    steep, wide = (Friction(CoulombViscous(width=width), theta) for width in (1e-6, 1e-3))
    assert step_size_of(plant, steep, 1 / 60) == step_size_of(plant, wide, 1 / 60)
    start, u = State(np.array([0.3, -0.8]), np.array([1.0, 2.0])), np.zeros((120, 2))
    ends = [rollout(plant, f, start, u, np.full(120, 1 / 60)).q[-1] for f in (steep, wide)]
    assert_allclose(ends[0], ends[1], atol=1e-3)
