"""Torque left: zero for the truth, what is missing for anything else, the same by every command."""

import numpy as np
import pytest
from fixtures import driven_wrist as wrist
from fixtures.driven_pendulum import simulated
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.data.plants import plant_of
from frictionid.evaluation import (
    EstimatedStates,
    Prepared,
    Protocol,
    torque_example,
    torque_frame,
    torque_left,
)
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, NoFriction
from frictionid.simulate import Camera, Drive, Multisine, Run

NOISE = 0.01  # of each motor's torque
TRUTH = np.stack([wrist.COULOMB, wrist.VISCOUS], axis=1)
MAP = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 1.0]])  # of parts


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return wrist.mechanism(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def data(arm):
    return wrist.dataset(arm, wrist.frame(arm, 8.0, rate=100.0))


def ready(data):
    return Prepared(data, Protocol(), EstimatedStates(data), plant_of(data))


def left(data, theta):
    law = CoulombViscous() if len(theta[0]) else NoFriction()
    frame = torque_frame(map(tuple, torque_left(Friction(law, theta), ready(data))))
    return frame.set_index("joint")


def of_the_joints(w):
    """True friction (T, n) on the joints at their velocities."""
    v = w @ MAP.T
    return (wrist.COULOMB * np.sign(v) + wrist.VISCOUS * v) @ MAP


def test_the_true_friction_leaves_less_than_the_noise(data):
    # 9 of 10 samples within a window: noise averages out, reversals do not count
    assert (left(data, TRUTH)["left"] < NOISE).all()


@pytest.mark.parametrize(("rate", "noise"), [(60.0, 5e-4), (60.0, 1.5e-3), (200.0, 2e-3)])
def test_what_the_true_friction_leaves_is_at_most_what_noise_of_the_angles_does(rate, noise):
    torque = (Multisine(1.2, (0.7, 1.1, 1.6)),)
    runs = (Run(f"{i}", (0.2 * i,), torques=torque) for i in range(3))
    camera, drive = Camera(int(12 * rate), rate, noise), Drive(rate=rate)
    data = simulated(0.1, 0.02, camera, runs, drive=drive, substeps=2)
    frame = left(data, np.array([[0.1, 0.02]]))
    assert 0.02 < frame["left"]["all"] < 1.1 * frame["noise"]["all"] < 1.8 * frame["left"]["all"]


def test_without_friction_all_of_it_is_left(data):
    frame, w = left(data, np.zeros((4, 0))), ready(data).smoothed[0].w
    usual = np.sqrt((of_the_joints(w) ** 2).mean(axis=0))
    assert_allclose(frame["left_rms"][:3], usual, rtol=0.1)
    assert_allclose(frame["left"], frame["nominal"], rtol=1e-12)


def test_what_is_missing_in_one_joint_is_left_there(data):
    less = TRUTH - [[0.0, 0.0], [1.5, 0.0], [0.0, 0.0], [0.0, 0.0]]
    frame = left(data, less)
    assert frame["left_rms"]["2"] == pytest.approx(1.5, rel=0.02)
    assert (frame["left"][["1", "3"]] < NOISE).all()
    squares = (frame["left_rms"][:3] ** 2).sum() / (frame["measured_rms"][:3] ** 2).sum()
    assert frame["left"]["all"] ** 2 == pytest.approx(squares, rel=0.1)  # joints slide at all times


def test_an_angle_that_jumps_is_no_torque(data, arm):
    frame = wrist.frame(arm, 8.0, rate=100.0)
    joint = frame.columns.get_loc("q2")
    frame.iloc[350:375, joint] = frame.iloc[350, joint]
    frozen = left(wrist.dataset(arm, frame), TRUTH)
    assert (frozen["left"] < 0.1).all()  # else .3
    assert_allclose(frozen["nominal"], left(data, TRUTH)["nominal"], rtol=0.1)


def test_the_shown_torque_is_measured_and_friction_fills_the_rest(data):
    """With the true friction the model is the measured torque, with that friction in it."""
    shown = torque_example(Friction(CoulombViscous(), TRUTH), ready(data))
    measured, model, rigid = (shown[name] for name in ("measured", "model", "rigid"))
    usual = np.sqrt((measured**2).mean(axis=0))
    assert (np.median(np.abs(measured - model), axis=0) < NOISE * usual).all()
    w = ready(data).smoothed[0]
    at = np.stack([np.interp(shown["time"], w.time, column) for column in w.w.T], axis=1)
    off = np.abs(model - rigid - of_the_joints(at))
    assert (np.median(off, axis=0) < 0.05 * usual).all()


def test_fit_evaluation_and_comparison_say_the_same(data):
    fit = fid.fit(data, "coulomb_viscous", method="inverse_dynamics")
    frame = fit.torque_left.set_index("joint")
    assert frame["left"]["all"] < NOISE < 0.1 < frame["nominal"]["all"]
    with pytest.warns(UserWarning, match="training data"):
        scores = fid.evaluate({"given": fit}, data, (0.1,))
    own = ["fold", "score", "statistic", "horizon_s", "joint", "value", "unit"]
    again = torque_frame(scores[own].itertuples(index=False)).set_index("joint")
    assert_allclose(again["left"], frame["left"], rtol=0.1)
    bench = fid.compare(data, {"given": fit, "none": "none"}, folds=3, horizons=(0.1,))
    held = bench["given"].scores
    assert_allclose(torque_frame(held.itertuples(index=False))["left"], again["left"], rtol=0.1)
    shares = held[(held["score"] == "torque_left") & (held["joint"] == "all")]
    assert list(shares["fold"]) == ["0", "1", "2", "all"]
    line = next(x for x in repr(bench).splitlines() if x.startswith("torque left"))
    assert ", given 0." in line and "; no friction, nominal" in line


def test_the_commands_print_it_without_a_file_to_write(tmp_path, run):
    fit = fid.fit("acrobot_clean", "coulomb_viscous", method="one_step")
    fit.save(tmp_path / "model.json")
    code, out, _ = run(tmp_path, "evaluate model.json acrobot_clean --horizons 0.1")
    assert code == 0 and "Torque left" in out and "no friction, nominal" in out
    assert not list(tmp_path.glob("*.csv"))


def test_nothing_is_said_of_motion_without_torque():
    time = np.arange(0.0, 4.0, 0.01)
    swing = {"time": time, "angle": np.exp(-0.3 * time) * np.sin(5.0 * time)}
    rig = fid.mechanisms.pendulum(mass=1.0, length=0.4)
    data = fid.Dataset.from_arrays({"a": swing}, rig)
    assert fid.fit(data, "coulomb_viscous").torque_left.empty


def test_masses_alone_are_fitted_to_torques_too_and_leave_the_friction(data):
    left_over = fid.fit(data, "none", method="inverse_dynamics").torque_left["left"]
    assert left_over.iloc[-1] > 10 * NOISE
