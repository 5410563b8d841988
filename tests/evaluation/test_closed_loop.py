"""Stiff position control: what is fitted and predicted has the controller in the loop."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from drive_logs import ServoPendulum
from fixtures.changed_data import changed, each, subset
from fixtures.servo_logs import by_controller
from fixtures.slopes import assert_slopes
from numpy.testing import assert_allclose

from frictionid.data.plants import Calibration, calibrated_dataset
from frictionid.data.signals import Signal
from frictionid.evaluation import Protocol, free_run, prepare
from frictionid.evaluation.predicted_motion import predict
from frictionid.fitting.parameters import BiasBlock, FrictionBlock, InertiaBlock, TargetDelayBlock
from frictionid.fitting.shooting import Settings, refine
from frictionid.fitting.shooting.sample_intervals import intervals_of
from frictionid.fitting.shooting.servo import changes_of, drive_of
from frictionid.fitting.shooting.stages import prepare_fit
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, MotorLoad

P, D, NOISE = 60.0, 1.5, 2e-3
RIG = ServoPendulum(coulomb=0.2, viscous=0.2, noise=NOISE)
TRUTH = Friction(CoulombViscous(), [[RIG.coulomb, RIG.viscous]])
INERTIA = RIG.mass * RIG.length**2


@cache
def logs(rig=RIG, runs=4, seconds=6.0):
    frames = {f"{k}": rig.log(P, D, seed=k, seconds=seconds) for k in range(runs)}
    return by_controller(rig, frames, P=P, D=D, delay=rig.delay)


def rollouts(data, friction, horizon, states="filter"):
    """Errors (T + 1, S) [rad] of predictions."""
    view = prepare(data, Protocol(horizons=(horizon,), initial_states=states))
    initial = view.initial_states
    owner = np.zeros(len(initial.recording), dtype=int)
    motion = predict(view.plant[initial.recording], friction[None][owner], initial, view.preceding)
    return np.abs(motion.q - initial.measured)[..., 0]


@pytest.mark.parametrize("states", ["filter", "model"])
def test_predictions_of_the_true_model_stay_at_the_noise_level_for_seconds(states):
    data = logs(runs=2)
    error = rollouts(data, TRUTH, 3.0, states)
    assert np.median(error) < 0.75 * NOISE  # 0.67 of a normal distribution's
    assert np.quantile(error[-50:], 0.99) < 3.5 * NOISE
    logged = each(data, lambda r: replace(r, servo=None))
    drifting = rollouts(logged, TRUTH, 3.0, states)
    assert np.median(drifting[-50:]) > 5 * np.median(error[-50:])


def test_the_truth_is_found_where_noise_of_recorded_angles_would_pass_for_torque():
    """By recorded angles: viscous friction 0.58, inertia 0.024, 3.6 ms; their intervals miss."""
    late = logs(replace(RIG, delay=0.010))
    data = each(late, lambda r: replace(r, servo=replace(r.servo, target_delay=0.0)))
    blocks = (FrictionBlock(), InertiaBlock(), BiasBlock(), TargetDelayBlock())
    settings = Settings(windows=(0.1, 0.2, 0.5), significance=1.0)
    start = Friction(CoulombViscous(), [[0.1, 0.1]])
    fit = refine(start, data, blocks, settings)
    true = np.array([0.2, 0.2, INERTIA, 9.81 * RIG.mass * RIG.length, 0.0, 0.010])
    low, high = fit.covariance.interval(0.99).T
    assert ((low <= true) & (true <= high)).all()
    assert_allclose(fit.covariance.values[[0, 2, 3]], true[[0, 2, 3]], rtol=0.1)
    assert fit.diagnostics.angle_noise[0] == pytest.approx(NOISE, rel=0.05)


def test_a_free_run_is_a_prediction_of_the_whole_recording():
    data = logs(runs=1, seconds=2.0)
    view = prepare(data, Protocol(horizons=(1.5,), every=9.0, history=0.2, whole=True))
    initial = view.initial_states
    motion = predict(view.plant[initial.recording], TRUTH, initial)
    whole = free_run(view.plant, TRUTH, view.trajectory)
    assert_allclose(motion.q, whole[: len(motion.q)], atol=1e-12)


def test_recordings_with_a_torque_log_beside_servos_keep_it():
    data = logs(runs=2)
    first, second = data.recordings
    u = RIG.log(P, D, seed=1, seconds=6.0)["u"][:, None]
    logged = replace(second, servo=None, torque=Signal(second.torque.time[:1], u[:1]))
    logged = replace(logged, torque=Signal(second.angle.time, u, "previous"))
    both = replace(data, recordings=(first, logged))
    mixed, closed, alone = (
        rollouts(subset(both, *rows), TRUTH, 0.1) for rows in ((0, 2), (0, 1), (1, 2))
    )
    half = closed.shape[1]
    assert_allclose(mixed[:, :half], closed, atol=1e-6)
    assert_allclose(mixed[:, half:], alone, atol=1e-6)


def test_friction_of_gears_sees_the_torque_of_the_closed_loop():
    rig = ServoPendulum(coulomb=0.02, viscous=0.02, load=0.1, noise=2e-4)
    friction = Friction(MotorLoad(), [[0.02, 0.02, 0.1]])
    assert np.median(rollouts(logs(rig), friction, 2.0)) < 0.75 * rig.noise


def test_gain_bias_and_offset_of_a_calibration_are_those_of_the_loop():
    """The same motion, in other units: nothing changes but the angles' frame."""
    data, (gain, bias, offset) = logs(runs=1), np.array([[2.0], [-0.1], [0.05]])
    calibration = replace(Calibration.ideal(1), gain=gain, bias=bias, offset=offset)

    def shifted(r):
        goal = r.servo.goal
        forward = goal._replace(value=0.0 * goal.value + 0.05)
        goal = goal._replace(value=goal.value + 0.05)
        servo = replace(r.servo, goal=goal, feedforward=forward, gain=P / 2, damping=D / 2)
        return replace(r, servo=servo)

    moved = changed(each(data, shifted), "angle", lambda q: q + 0.05)
    same = calibrated_dataset(moved, calibration)
    assert_allclose(rollouts(same, TRUTH, 1.0), rollouts(data, TRUTH, 1.0), atol=1e-9)


@pytest.mark.parametrize("limit", [20.0, 0.5])
def test_late_targets_shift_a_torque_that_no_limit_holds(limit):
    """Nothing is computed anew for its derivative, and a sample between its steps is enough."""
    log = RIG.log(P, D, seed=0, seconds=2.0)
    data = by_controller(RIG, {"a": log}, P=P, D=D, delay=RIG.delay, limit=limit)
    blocks = (FrictionBlock(), TargetDelayBlock())
    problem, estimate = prepare_fit(TRUTH, intervals_of(data), blocks, Settings())
    drive = drive_of(problem.intervals, estimate.calibration, estimate.mechanism)
    ((late, _, _),) = changes_of(problem.intervals, estimate, problem.blocks, drive)
    assert (late.area is drive.torque.area) == (limit > 1.0)
    assert (len(late.clock) < 4 * len(log["t"])) == (limit > 1.0)
    assert assert_slopes(problem, estimate, np.arange(20, 300, 9), time=1 / RIG.rate) == 3
