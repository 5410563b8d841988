"""Laws of one-step problems: the true friction leaves nothing; outliers of torques."""

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from fixtures.memory_laws import FILM as LAG
from fixtures.memory_laws import STRIBECK as SHARP
from fixtures.refusals import assert_refused
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from frictionid.arrays import inverse, times
from frictionid.data.integrals import averages
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal, sample
from frictionid.data.state_estimators import RTS, States
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import Instant, State
from frictionid.dynamics.step import euler_step
from frictionid.fitting.one_step.residual import (
    IN_TURN,
    mask_stiction,
    one_step_problem,
    stiction_mask,
)
from frictionid.fitting.one_step.torque_outliers import (
    torque_outliers,
    without_torque_outliers,
)
from frictionid.friction import Friction, along, at_rest, memory_along
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import Plant, acrobot, double_pendulum
from frictionid.simulate import Camera, Curve, Rig, Run, Sine, simulate
from frictionid.simulate import Stribeck as TrueStribeck

MACHINE = double_pendulum()
PROBLEMS = {name: partial(one_step_problem, name) for name in ("euler", "integral")}
SMOOTH = Friction(CoulombViscous(width=4.0), [[0.1, 0.02], [0.05, 0.01]])


def plants(count, **parameters):
    """Plant with one entry for each recording."""
    own = {name: np.broadcast_to(value, count) for name, value in parameters.items()}
    return Plant.from_parameters(MACHINE, {"m1": np.full(count, 0.5), **own})


@pytest.fixture(params=PROBLEMS)
def build(request):
    return PROBLEMS[request.param]


def made_up(rng, length=30, torque_length=200):
    """A recording and states that obey nothing: laws of algebra hold for them as well."""
    rng = default_rng(rng)
    time = np.cumsum(rng.uniform(0.005, 0.03, length))
    clock = np.linspace(-0.02, time[-1] + 0.02, torque_length)  # another clock
    torque = Signal(clock, rng.normal(size=(torque_length, 2)), "previous")
    q, w = rng.normal(size=(length, 2)), 3 * rng.normal(size=(length, 2))
    return Recording("r", Signal(time, q), torque), States(time, q, w)


# ---------------------------------------------------------------- the true friction leaves nothing


def true_motion(dt, duration=0.6):
    """Recording and exact states of a motion under a torque with corners every 0.1 s."""
    knots = np.arange(0, duration + 0.05, 0.1)
    rng = default_rng(1)
    torque = Signal(knots, 0.4 * rng.normal(size=(len(knots), 2)), "linear")
    plant = Plant.from_parameters(MACHINE, {})

    def rate(t, y):
        M, h = plant.dynamics(y[:2], y[2:])
        u = [np.interp(t, knots, column) for column in torque.value.T]
        return np.concatenate([y[2:], np.linalg.solve(M, h + u - SMOOTH.torque(at_rest(y[2:])))])

    time = np.arange(round(duration / dt) + 1) * dt
    y, parts = np.array([1.0, -0.5, 4.0, -5.0]), []
    for begin, end in pairwise(knots):  # smooth between the corners
        inside = np.clip(time[(time >= begin - 1e-9) & (time < end - 1e-9)], begin, end)
        found = solve_ivp(
            rate, (begin, end), y, "DOP853", np.append(inside, end), rtol=1e-12, atol=1e-12
        )
        parts.append(found.y.T[:-1])
        y = found.y[:, -1]
    motion = np.concatenate([*parts, y[None]])
    states = States(time, motion[:, :2], motion[:, 2:])
    return Recording("true", Signal(time, states.q), torque), states


@pytest.mark.parametrize(("name", "order"), [("euler", 2), ("integral", 5)])
def test_the_residual_of_the_true_friction_vanishes_with_the_order_of_the_rule(name, order):
    steps, residuals = (1 / 80, 1 / 160, 1 / 320), []
    for dt in steps:
        recording, states = true_motion(dt)
        problem = PROBLEMS[name](plants(1), [recording], [states])
        residual = problem.residual(along(SMOOTH, problem.nodes))
        residuals.append(np.sqrt((residual**2).mean()))
    slope = np.polyfit(np.log(steps), np.log(residuals), 1)[0]
    assert slope == pytest.approx(order, abs=0.1)


# ---------------------------------------------------------------- by hand


def test_the_euler_residual_is_the_prediction_of_an_euler_step_minus_the_measurement():
    recording, states = made_up(2)
    problem = PROBLEMS["euler"](plants(1), [recording], [states])
    begin = State(states.q[:-1], states.w[:-1])
    dt = np.diff(states.time)[:, None]
    u = averages(recording.torque, states.time)
    predicted = euler_step(Instant(plants(1)[0], SHARP, begin, u), dt)
    residual = problem.residual(along(SHARP, problem.nodes))
    assert_allclose(residual, predicted.w - states.w[1:], rtol=0, atol=1e-12)


def test_the_integral_residual_is_the_momentum_balance():
    recording, states = made_up(4)
    plant = plants(1)[0]
    problem = PROBLEMS["integral"](plants(1), [recording], [states])
    residual = problem.residual(along(SHARP, problem.nodes))
    u = averages(recording.torque, states.time)
    for k in (0, 7, 28):
        (q0, q1), (w0, w1) = states.q[k : k + 2], states.w[k : k + 2]
        dt = states.time[k + 1] - states.time[k]
        q = (q0 + q1) / 2 + dt / 8 * (w0 - w1)
        w = 1.5 * (q1 - q0) / dt - (w0 + w1) / 4
        a, m, b = plant.terms(q0, w0), plant.terms(q, w), plant.terms(q1, w1)
        Tf = [SHARP.torque(at_rest(x)) for x in (w0, w, w1)]
        force = (a.dLdq + 4 * m.dLdq + b.dLdq) / 6 + u[k] - (Tf[0] + 4 * Tf[1] + Tf[2]) / 6
        predicted = np.linalg.solve(b.M, a.M @ w0 + dt * force)
        assert_allclose(residual[k], predicted - w1, rtol=0, atol=1e-11)


def test_joints_without_motor_feel_no_torque(build):
    recording, states = made_up(5)
    plant = Plant.from_parameters(acrobot(), {"m4": np.zeros(1)})
    value = recording.torque.value * [100.0, 1.0]
    loud = Recording("r", recording.angle, recording.torque._replace(value=value))
    a, b = (build(plant, [r], [states]) for r in (recording, loud))
    assert_array_equal(a.r, b.r)


# ---------------------------------------------------------------- affine in friction


def test_G_is_what_an_impulse_of_friction_does(build):
    recording, states = made_up(9)
    problem = build(plants(1), [recording], [states])
    at = states.q[:-1] if build is PROBLEMS["euler"] else states.q[1:]
    M = plants(1)[0].mechanism.inertia(plants(1).p[0], at)
    dt = np.diff(states.time)
    assert_allclose(problem.G, inverse(M) * dt[:, None, None], rtol=1e-12)
    assert_array_equal(problem.dt, dt)
    torque = default_rng(7).normal(size=problem.nodes.inputs.w.shape)
    change = times(problem.G, problem.mean(torque))
    assert_allclose(problem.r - problem.residual(torque), change, atol=1e-12)


# ---------------------------------------------------------------- recordings, history, clocks


def three(seed):
    rng = default_rng(seed)
    pairs = [made_up(rng, length) for length in (12, 25, 18)]
    return [list(column) for column in zip(*pairs, strict=True)]


def test_several_recordings_are_each_alone_with_its_own_parameters(build):
    recordings, states = three(10)
    plant = plants(3, m2=np.array([0.3, 0.5, 0.6]))
    together = build(plant, recordings, states)
    residual = together.residual(along(LAG, together.nodes))
    for i in range(3):
        alone = build(plant[i : i + 1], recordings[i : i + 1], states[i : i + 1])
        rows = together.recording == i
        assert_array_equal(together.r[rows], alone.r)
        assert_array_equal(together.G[rows], alone.G)
        own = alone.residual(along(LAG, alone.nodes))
        assert_allclose(residual[rows], own, rtol=0, atol=1e-13)
    other = build(plants(3), recordings, states)
    assert (np.abs(other.r - together.r).max(axis=1) > 0)[together.recording == 0].all()


def test_history_drops_the_first_rows_of_each_recording_and_nothing_else(build):
    recordings, states = three(11)
    whole, late = (build(plants(3), recordings, states, history=h) for h in (0, 5))
    first = np.concatenate([s.time[:5] for s in states])
    keep = ~np.isin(whole.time, first)
    assert late.history == 5 and keep.sum() == 11 + 24 + 17 - 15
    for name in ("r", "G", "stencil", "recording", "time", "dt"):
        assert_array_equal(getattr(late, name), getattr(whole, name)[keep])
    for friction in (SHARP, LAG):  # memory still begins with the recording
        residual = whole.residual(along(friction, whole.nodes))
        assert_array_equal(late.residual(along(friction, late.nodes)), residual[keep])


def test_recordings_shorter_than_the_history_give_no_rows_and_none_at_all_is_an_error(build):
    recordings, states = three(12)
    problem = build(plants(3), recordings, states, history=17)
    assert set(problem.recording) == {1}
    with assert_refused("no recording is longer than the 24 samples of history"):
        build(plants(3), recordings, states, history=24)


def test_no_row_bridges_a_gap_and_all_others_stay_as_they_are(build):
    recordings, states = three(15)
    whole = build(plants(3), recordings, states)
    s = states[1]
    lost = slice(8, 16)  # of 25 samples
    holed = States(*(np.delete(part, lost, axis=0) for part in s.motion))
    problem = build(plants(3), recordings, [states[0], holed, states[2]])
    assert problem.dt.max() < 2 * np.median(np.diff(s.time))
    gone = (whole.recording == 1) & (whole.time >= s.time[7] - 1e-9) & (whole.time < s.time[16])
    assert_array_equal(problem.r, whole.r[~gone])


def test_nodes_are_in_order_and_rows_find_theirs():
    recordings, states = three(13)
    problem = PROBLEMS["integral"](plants(3), recordings, states, history=2)
    nodes = problem.nodes
    assert_array_equal(np.diff(nodes.first), [23, 49, 35])
    assert nodes.per_sample == 2 and len(nodes.time) == nodes.first[-1]
    for i, s in enumerate(states):
        own = slice(nodes.first[i], nodes.first[i + 1])
        assert (np.diff(nodes.time[own]) > 0).all()
        assert_array_equal(nodes.time[own][::2], s.time)
        assert_array_equal(nodes.inputs.w[own][::2], s.w)
        rows = problem.stencil[problem.recording == i]
        assert (nodes.first[i] <= rows).all() and (rows < nodes.first[i + 1]).all()
    begin, middle, end = nodes.time[problem.stencil.T]
    assert_array_equal(begin, problem.time)
    assert_allclose(middle, (begin + end) / 2)
    assert_allclose(end - begin, problem.dt)
    memories = memory_along(LAG, nodes)
    assert len(memories) == 49 and memories[0][0].shape == (3, 2)
    assert_array_equal(memories[0][0], np.abs(nodes.inputs.w[nodes.first[:-1]]))


def test_laws_see_torque_and_bearing_load_at_their_nodes():
    recording, states = made_up(16)
    plant = plants(1)[0]
    nodes = PROBLEMS["integral"](plants(1), [recording], [states]).nodes
    assert_array_equal(nodes.inputs.u[1::2], averages(recording.torque, states.time))
    assert_array_equal(nodes.inputs.u[::2], sample(recording.torque, states.time))
    assert_array_equal(nodes.inputs.load, plant.load(*nodes.inputs[:3]))


# ---------------------------------------------------------------- joints at rest


def slow(rng, build):
    """A problem in which joints now and then are slow or reverse."""
    rng = default_rng(rng)
    recording, states = made_up(rng, 60)
    w = 1.0 + rng.random(states.w.shape)
    w *= rng.choice([1.0, 1.0, 1.0, 0.01, -1.0], states.w.shape)
    q = np.cumsum(w * np.gradient(states.time)[:, None], axis=0)
    return build(plants(1), [recording], [states._replace(q=q, w=w)])


def test_the_stiction_mask_marks_joints_that_are_slow_at_a_node_or_reverse(build):
    problem = slow(17, build)
    mask = stiction_mask(problem, 0.2)
    for k, nodes in enumerate(problem.stencil):
        for j, w in enumerate(problem.nodes.inputs.w[nodes].T):
            assert mask[k, j] == (np.abs(w).min() < 0.2 or w.min() < 0 < w.max())


def test_a_slow_recording_slides_unless_joints_move_in_turn():
    """Beside a fast one it has the mask that it has alone; for torques it is at rest."""
    recording, states = made_up(17, 60)
    fast = states._replace(q=states.time[:, None] + np.zeros(2), w=1.0 + 0.5 * np.sin(states.q))
    crawl = fast._replace(w=1e-4 * fast.w, q=1e-4 * fast.q)
    build = PROBLEMS["integral"]
    alone = build(plants(1), [recording], [crawl])
    both = build(plants(2), 2 * [recording], [fast, crawl])
    second = both.recording == 1
    assert not stiction_mask(alone, None).any() and not stiction_mask(both, None)[second].any()
    assert (stiction_mask(both, None, IN_TURN) == second[:, None]).all()


def test_a_masked_residual_is_the_least_that_any_friction_of_masked_joints_leaves(build):
    """So it depends on the friction of the other joints alone, and on all of it where none is."""
    rng = default_rng(18)
    problem = slow(rng, build)
    masked, mask = mask_stiction(problem, 0.2), stiction_mask(problem, 0.2)
    assert set(mask.sum(axis=1)) == {0, 1, 2}
    torque = rng.normal(size=problem.nodes.inputs.w.shape)
    residual, least = problem.residual(torque), masked.residual(torque)
    for k, resting in enumerate(mask):
        free = problem.G[k][:, resting]
        left = residual[k] - free @ np.linalg.pinv(free) @ residual[k]
        assert_allclose(least[k], left, rtol=0, atol=1e-9)


# --- Outliers of torques --------------------------------------------------------------------------


def states_of(data):
    return RTS()([r.angle for r in data.recordings])


def with_wild_torques(data, share, size, rng):
    recordings, masks = [], []
    for r in data.recordings:
        value = np.array(r.torque.value)
        wild = (rng.random(value.shape) < share) & value.any(axis=0)
        value += wild * rng.choice([-size, size], value.shape)
        recordings.append(replace(r, torque=r.torque._replace(value=value)))
        masks.append(wild)
    return replace(data, recordings=tuple(recordings)), masks


@pytest.mark.parametrize(("share", "hold"), [(0.01, "previous"), (0.1, "linear")])
def test_torques_that_the_motion_denies_are_replaced_by_their_neighbours(clean, share, hold):
    held = tuple(replace(r, torque=r.torque._replace(hold=hold)) for r in clean.recordings)
    data = replace(clean, recordings=held)
    wild, masks = with_wild_torques(data, share, 1.0, default_rng(0))
    found = torque_outliers(wild, plant_of(wild), states_of(wild))
    missed = sum((a & ~b).sum() for a, b in zip(masks, found, strict=True))
    assert missed <= 0.1 * sum(a.sum() for a in masks)
    assert not any((b & ~a).any() for a, b in zip(masks, found, strict=True))
    mended = without_torque_outliers(wild, plant_of(wild), states_of(wild))
    off = []
    each = zip(data.recordings, wild.recordings, mended.recordings, found, strict=True)
    for before, logged, after, mask in each:
        assert_array_equal(after.torque.value[~mask], logged.torque.value[~mask])
        off.append(np.abs(after.torque.value - before.torque.value)[mask])
    assert np.quantile(np.concatenate(off), 0.9) < 0.1  # but beside one that was missed


def test_torques_of_clean_data_stay_steps_and_all(clean):
    assert without_torque_outliers(clean, plant_of(clean), states_of(clean)) is clean


def test_short_pulses_that_acted_stay():
    """A pendulum that is struck: one sample of torque in twenty, far off its neighbours."""
    strokes = (Sine(1.5, 0.4),)
    rig = Rig(
        "struck",
        {"kind": "pendulum"},
        TrueStribeck(Curve((0.3,), (0.3,), (0.05,))),
        Camera(300, 60.0, 1e-3),
        (Run("a", (1.0,), (), strokes),),
        substeps=4,
    )
    data = simulate(rig)
    recording = data.recordings[0]
    rng = default_rng(1)
    wild = rng.random(recording.torque.value.shape) < 0.05
    pulses = recording.torque.value + 6.0 * wild * rng.choice([-1.0, 1.0], wild.shape)
    struck = replace(recording, torque=recording.torque._replace(value=pulses))
    # the pulses are logged, but did not act: all are denied
    logged = replace(data, recordings=(struck,))
    found = torque_outliers(logged, plant_of(logged), states_of(logged))[0]
    assert (found & wild).sum() >= 0.9 * wild.sum()
    # the motion of a pendulum that they did act on shows them: none is
    acted = replace(data, recordings=(moved_by(struck, data),))
    assert not torque_outliers(acted, plant_of(acted), states_of(acted))[0].any()


def moved_by(recording, data):
    """The recording with the motion under its own torque and viscous friction, and angle noise."""
    time, torque = recording.angle.time, recording.torque
    viscous = Friction(CoulombViscous(), [[0.0, 0.3]])
    start = State(recording.angle.value[0], np.zeros(1))
    q = rollout(plant_of(data)[0], viscous, start, torque.value[: len(time) - 1], np.diff(time)).q
    noise = 1e-3 * default_rng(2).normal(size=q.shape)
    held = torque._replace(hold="previous")
    return replace(recording, angle=Signal(time, q + noise), torque=held, truth=None)
