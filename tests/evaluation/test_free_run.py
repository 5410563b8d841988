"""Free runs: whole recordings from their start, with the servo's controller in the loop."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.changed_data import changed, each, subset
from fixtures.memory_laws import Sampled, SampledFollower
from fixtures.refusals import assert_refused
from fixtures.score_frames import lines
from fixtures.shared import shared
from fixtures.tiny_pendulums import dataset as torque_driven
from fixtures.tiny_pendulums import recordings as torque_driven_recordings
from fixtures.true_curves import true_states
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from frictionid.data.plants import Calibration, calibrated_dataset, plant_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import Servo, motor_torque, servo_torque
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import KalmanFilter, States
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.evaluation import (
    Protocol,
    Split,
    free_run,
    free_run_scores,
    make_folds,
    make_trajectory,
    prepare,
    score_folds,
    score_model,
    trajectory_folds,
    true_friction,
    with_motor_torque,
    with_parameters,
)
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous

MASS, LENGTH, KT, R = 0.5, 0.1, 0.37, 2.9
TABLE = {"kind": "pendulum", "motor": True, "parameters": {"mass": MASS, "length": LENGTH}}
VISCOUS = 0.006  # alone: nothing ever sticks, so that SciPy integrates the truth
TRUTH = Friction(CoulombViscous(), [[0.0, VISCOUS]])


WHOLE = Protocol((0.3,), history=0.0, whole=True)


def servo(time, rate, gain, stop):
    goal = np.sin(rate * time)[:, None]
    enabled = (time < stop).astype(float)[:, None]
    on = Signal(time, enabled, hold="previous")
    return Servo(Signal(time, goal), on, gain, limit=1.0, supply=7.4, kt=KT, R=R)


def recorded(name, seed, seconds=1.5, stop=9.0):
    """A servo log: exact motion by SciPy, from rest, sampled unevenly."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(4e-3, 6e-3, round(seconds / 5e-3)))
    drive = servo(time, *rng.uniform((2.0, 0.3), (6.0, 2.0)), stop)

    def slope(t, x, on):
        q, w = x
        volts = drive.voltage(np.array([t]), np.array([[q]]))[0, 0]
        u = on * motor_torque(volts, w, KT, R)
        gravity = MASS * 9.81 * LENGTH * np.sin(q)
        return w, (u - gravity - VISCOUS * w) / (MASS * LENGTH**2)

    last = min(int(np.searchsorted(time, stop)), len(time) - 1)
    parts, x = [np.array([[0.2], [0.0]])], np.array([0.2, 0.0])
    for on, clock in ((1.0, time[: last + 1]), (0.0, time[last:])):
        if len(clock) > 1:
            span, limits = (clock[0], clock[-1]), dict(rtol=1e-7, atol=1e-9)
            found = solve_ivp(slope, span, x, args=(on,), t_eval=clock[1:], **limits).y
            parts.append(found)
            x = found[:, -1]
    q, w = np.concatenate(parts, axis=1)
    angle = Signal(time, q[:, None])
    one = Recording(name, angle, servo_torque(drive, angle), servo=drive)
    return one, States(time, q[:, None], w[:, None])


@shared
def logs():
    """Data set of four logs, one of them longer, one let go; and their true states."""
    pairs = [recorded("a", 0), recorded("b", 1, 2.5), recorded("c", 2), recorded("d", 3, 1.5, 0.7)]
    recordings, states = zip(*pairs, strict=True)
    return Dataset("logs", TABLE, recordings), states


def run_of(data, states, friction=TRUTH, begin=0.0):
    trajectory = make_trajectory(data, states, begin)
    return free_run(plant_of(data), friction, trajectory), trajectory


@shared
def usual(logs):
    """What the true friction gives from the begin of the logs, and the trajectory."""
    return run_of(*logs)


# --- Truth in, truth out -------------------------------------------------------------------------


@pytest.mark.parametrize("begin", [0.0, 0.4])
def test_the_true_friction_follows_the_whole_motion(logs, begin):
    data, states = logs
    q, trajectory = run_of(data, states, begin=begin)
    error = np.abs(q - trajectory.measured)[np.isfinite(trajectory.measured)]
    moved = np.ptp(np.concatenate([s.q for s in states]))
    assert moved > 1.0 and error.max() < 2e-3 and error.mean() < 3e-4


def test_another_friction_or_another_motor_does_not(logs, usual):
    (data, states), (q, trajectory) = logs, usual
    good = np.nanmean(np.abs(q - trajectory.measured))
    heavy = Friction(CoulombViscous(), [[0.0, 2 * VISCOUS]])
    weak = servoed(data, lambda servo: servo.with_motor(KT, 1.1 * R))
    for other, friction in ((data, heavy), (weak, TRUTH)):
        q, trajectory = run_of(other, states, friction)
        assert np.nanmean(np.abs(q - trajectory.measured)) > 20 * good


def servoed(data, change):
    return each(data, lambda r: replace(r, servo=change(r.servo)))


def test_a_delay_of_the_rig_makes_the_controller_late_and_takes_damping(logs):
    data, states, d = subset(logs[0], 0, 1), logs[1][:1], 0.004
    servo = data.recordings[0].servo
    free = servoed(data, lambda servo: replace(servo, limit=1e9))
    calibration = replace(Calibration.ideal(1), delay=np.array(d))
    corrected, _ = run_of(calibrated_dataset(free, calibration), states)

    def later(servo):
        goal, on = (x._replace(time=x.time + d) for x in (servo.goal, servo.enabled))
        return replace(servo, goal=goal, enabled=on, limit=1e9)

    less = VISCOUS - KT / R * servo.supply * servo.gain * d
    other = Friction(CoulombViscous(), [[0.0, less]])
    shifted, _ = run_of(servoed(data, later), states, other)
    change = np.abs(corrected - run_of(free, states)[0]).max()
    assert change > 1e-3 and np.abs(corrected - shifted).max() < 0.1 * change


def test_nothing_of_the_recorded_motion_is_seen_after_the_start(logs, usual):
    data, states = logs
    spoilt = changed(data, "angle", lambda q: np.where(np.arange(len(q))[:, None] > 0, 9.0, q))
    spoilt = changed(spoilt, "torque", lambda u: u + 1.0)
    q = free_run(plant_of(data), TRUTH, make_trajectory(spoilt, states))
    assert_array_equal(q, usual[0])


# --- Routes that must agree ----------------------------------------------------------------------


def test_together_is_as_alone(logs, usual):
    (data, states), (q, trajectory) = logs, usual
    for i in range(len(states)):
        alone, _ = run_of(subset(data, i, i + 1), states[i : i + 1])
        known = np.isfinite(trajectory.measured[:, i, 0])
        # pieces of an interval may differ where another recording has a longer one
        assert_allclose(q[known, i], alone[:, 0], atol=2e-4)


@pytest.mark.parametrize(
    "friction",
    [
        TRUTH,
        Friction(Sampled(), [[0.01]]),
        Friction(SampledFollower(), [[0.01]]),
    ],
    ids=["static", "samples", "follower"],
)
def test_without_a_connected_motor_it_is_a_rollout_without_torque(logs, friction):
    """Also for a law that remembers samples: its memory advances once a sample."""
    data, states = logs

    def off(servo):
        return replace(servo, enabled=servo.enabled._replace(value=0 * servo.goal.value))

    q, trajectory = run_of(servoed(subset(data, 0, 1), off), states[:1], friction)
    start = State(trajectory.q, trajectory.w)
    free = rollout(plant_of(data)[:1], friction, start, 0 * trajectory.u, trajectory.dt)
    assert_allclose(q, free.q, atol=1e-5)
    assert np.ptp(q) > 0.1


def test_without_servos_the_recorded_torque_drives():
    data = torque_driven()
    trajectory = make_trajectory(data, true_states(data), 0.15)
    friction, plant = true_friction(data.truth), plant_of(data)
    q = free_run(plant, friction, trajectory)
    own = rollout(plant, friction, State(trajectory.q, trajectory.w), trajectory.u, trajectory.dt)
    assert_array_equal(q, own.q)
    assert trajectory.servos == () and np.nanmean(np.abs(q - trajectory.measured)) < 2e-3


# --- A model's own motor -------------------------------------------------------------------------


def test_a_models_motor_replaces_that_of_the_recordings(logs):
    data, _ = logs
    plant = plant_of(data, {"kt": 2 * KT, "R": R})
    for before, after in zip(
        data.recordings, with_motor_torque(data, plant).recordings, strict=True
    ):
        assert (after.servo.kt, after.servo.R) == (2 * KT, R)
        again = servo_torque(before.servo.with_motor(2 * KT, R), before.angle)
        assert_array_equal(after.torque.value, again.value)


def test_without_motor_constants_torques_stay_as_they_are(logs):
    data, _ = logs
    same = with_motor_torque(data, plant_of(data)).recordings
    assert all(a is b for a, b in zip(data.recordings, same, strict=True))
    other = torque_driven()
    assert with_motor_torque(other, plant_of(other)) is other


def test_scores_of_a_model_are_those_under_its_own_motor(logs):
    """A data set that tells a wrong motor, and a model that brings the right one."""

    def weaker(r):
        servo = r.servo.with_motor(KT, 1.5 * R)
        return replace(r, servo=servo, torque=servo_torque(servo, r.angle))

    wrong = each(logs[0], weaker)
    prepared = prepare(wrong, WHOLE)

    def scores(p):
        rows, *_ = score_model(TRUTH, p)
        return {(r.score, r.statistic): r.value for r in lines(rows) if r.joint == "all"}

    corrected, own = scores(prepared), scores(with_parameters(prepared, {"kt": KT, "R": R}))
    for key in (("free_run", "mean"), ("rollout_angle", "median"), ("one_step_integral", "rms")):
        assert own[key] < 0.3 * corrected[key]
    assert own == scores(
        prepare(with_motor_torque(wrong, plant_of(wrong, {"kt": KT, "R": R})), WHOLE)
    )


# --- Scores --------------------------------------------------------------------------------------


def rows_of(error, trajectory, fold):
    rows = free_run_scores(trajectory.measured + error, trajectory, np.array(fold), ("rad",))
    return {(r.fold, r.statistic): r.value for r in rows if r.joint == "all"}


def test_each_recording_counts_alike_whatever_its_length(usual):
    _, trajectory = usual
    rows = rows_of(np.array([0.1, 0.2, 0.3, 0.4])[:, None], trajectory, [0, 1, 0, -1])
    for key in (("all", "mean"), ("0", "mean"), ("1", "rms"), ("1", "mean"), ("all", "mean b")):
        assert rows[key] == pytest.approx(0.2)
    assert rows["all", "rms"] == pytest.approx(np.sqrt(np.mean([0.01, 0.04, 0.09])))
    assert ("all", "mean d") not in rows  # nobody holds it out


def test_a_motion_that_diverged_is_infinitely_wrong(usual):
    _, trajectory = usual
    error = np.zeros_like(trajectory.measured)
    error[50, 0] = np.nan
    rows = rows_of(error, trajectory, [0, 1, 2, 3])
    assert rows["all", "mean"] == rows["0", "mean"] == np.inf
    assert rows["1", "mean"] == 0.0


def test_folds_judge_what_they_hold_out(logs):
    data, _ = logs
    prepared = prepare(data, WHOLE)
    folds = make_folds(data.recordings, Split(count=4))
    held = trajectory_folds(prepared.trajectory, folds)
    assert sorted(held) == [0, 1, 2, 3]
    # one fold has the true friction, the others none
    theta = np.zeros((4, 1, 2))
    theta[held[1]] = TRUTH.theta
    rows, *_ = score_folds(Friction(CoulombViscous(), theta), TRUTH, prepared, folds)
    own = {r.fold: r.value for r in lines(rows) if (r.score, r.statistic) == ("free_run", "mean")}
    assert all(own[str(held[1])] < 0.1 * own[str(f)] for f in held if f != held[1])


def test_folds_that_hold_out_no_whole_recording_are_refused():
    data = torque_driven()
    trajectory = make_trajectory(data, KalmanFilter()([r.angle for r in data.recordings]))
    blocks = make_folds(torque_driven_recordings(), Split(count=40, kind="blocks", gap=0.0))
    with assert_refused('whole = true: no fold.*folds.kind = "recordings"'):
        trajectory_folds(trajectory, blocks)


def test_a_history_as_long_as_a_recording_is_refused(logs):
    data, states = logs
    with assert_refused("recording 'a' ends within the history of 2 s"):
        make_trajectory(data, states, 2.0)
