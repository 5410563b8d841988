"""Envelopes of servos in closed loop: identified where motors saturate, not identified elsewhere.

The motion is of a simulated servo by code of its own; nothing of its torque is logged.
"""

import mujoco
import numpy as np
import pytest
from drive_logs import ServoPendulum
from fixtures.servo_logs import by_controller

import frictionid as fid

MOTOR = (0.4, 2.0, 5.0)
NAMES = ("peak_torque", "knee_speed", "no_load_speed")
TORN = ServoPendulum(**dict(zip(("peak", "knee", "no_load"), MOTOR, strict=True)))


def dataset(rig, given):
    logs = {f"{k}": rig.log(10.0, 0.15, seed=k, seconds=6.0) for k in range(3)}
    envelope = {} if given is None else dict(zip(NAMES, given, strict=True))
    return by_controller(rig, logs, P=10.0, D=0.15, delay=rig.delay, **envelope)


def error(fit, data):
    run = fit.predict(data, whole=True)
    return float(np.sqrt(np.mean((run["q1"] - run["measured_q1"]) ** 2)))


@pytest.fixture(scope="module")
def found():
    data = dataset(TORN, (0.5, 1.6, 5.5))
    free = ["target_delay", "envelope"]
    return fid.fit(data, "coulomb_viscous", method="shooting", free=free)


def test_peak_knee_and_no_load_speed_follow_from_the_motion(found):
    rows = found.frame[found.frame.block == "envelope"]
    assert rows.value.to_numpy() == pytest.approx(MOTOR, rel=0.01)
    assert rows.identified.all() and ((rows.high_95 - rows.low_95) < 0.03 * rows.value).all()
    friction = found.frame[found.frame.block == "friction"].value.to_numpy()
    assert friction == pytest.approx([TORN.coulomb, TORN.viscous], rel=0.02)


def test_free_runs_with_the_envelope_are_at_the_noise_and_without_it_far_off(found):
    assert error(found, dataset(TORN, MOTOR)) < 2 * TORN.noise
    plain = fid.fit(dataset(TORN, None), "coulomb_viscous", method="one_step")
    assert error(plain, dataset(TORN, None)) > 50 * TORN.noise


def test_mujoco_predicts_the_same_by_its_own_motor(found, tmp_path):
    made = found.export("mujoco", tmp_path / "rig.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "rig.xml"))
    assert model.actuator_dyntype[0] == mujoco.mjtDyn.mjDYN_DCMOTOR
    assert made.round_trip.mean_apart < 1e-3 and not made.lost


def test_where_no_motor_saturates_it_is_not_identified():
    data = dataset(ServoPendulum(), (0.9, 9.0, 18.0))
    fit = fid.fit(data, "coulomb_viscous", method="shooting", free=["target_delay", "envelope"])
    rows = fit.frame[fit.frame.block == "envelope"]
    assert not rows.identified.any() and rows.value.tolist() == pytest.approx([0.9, 9.0, 18.0])
    assert any("never reaches the limit of its motor" in s for s in fit.friction.provenance.limits)


def test_without_an_envelope_to_begin_with_there_is_one_clear_line():
    with pytest.raises(fid.InputError, match="give the envelope that the fit begins with"):
        fid.fit(dataset(TORN, None), "coulomb_viscous", method="shooting", free=["envelope"])
