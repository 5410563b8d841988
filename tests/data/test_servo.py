"""Servos: the torque of their motors follows from voltage and motion, and from nothing else."""

import json
from dataclasses import replace

import numpy as np
import pytest
from fixtures.reader_files import MOTOR, bam_log, column
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.readers.formats.bam import XL330_GAIN
from frictionid.data.readers.formats.bam import read as read_bam
from frictionid.data.recordings import Recording
from frictionid.data.servo import Servo, motor_torque, servo_torque, terminal_voltage
from frictionid.data.signals import Signal

TIME = np.linspace(0.0, 1.0, 51)


def servo(goal=None, enabled=None, **changes):
    goal = np.sin(4 * TIME) if goal is None else goal
    enabled = np.ones_like(TIME) if enabled is None else enabled
    numbers = dict(gain=1.5, limit=0.8, supply=7.4, kt=0.4, R=3.0)
    return Servo(
        Signal(TIME, goal[:, None]),
        Signal(TIME, enabled[:, None], hold="previous"),
        **{**numbers, **changes},
    )


def test_power_is_conserved_what_goes_in_is_heat_and_work():
    rng = np.random.default_rng(0)
    volts, w = rng.standard_normal((2, 100))
    kt, R = 0.4, 3.0
    current = motor_torque(volts, w, kt, R) / kt
    assert_allclose(volts * current, R * current**2 + kt * current * w)


def test_a_disconnected_motor_gives_no_torque_and_keeps_its_state_until_reconnected():
    enabled = (TIME < 0.5).astype(float)
    s = servo(enabled=enabled)
    angle = Signal(TIME, np.cos(TIME)[:, None])
    torque, volts = servo_torque(s, angle), terminal_voltage(s, angle)
    assert np.all(torque.value[TIME >= 0.5] == 0.0) and np.all(volts.value[TIME >= 0.5] == 0.0)
    assert np.all(torque.value[TIME < 0.5] != 0.0)
    last = TIME[np.flatnonzero(enabled)[-1]]
    assert_array_equal(s.connected(np.array([last + 0.01])), [[1.0]])


def test_torque_along_a_steady_turn_is_that_of_voltage_and_velocity():
    s, angle = servo(), Signal(TIME, (0.2 + 1.7 * TIME)[:, None])
    expected = motor_torque(s.voltage(TIME, angle.value), 1.7, 0.4, 3.0)
    assert_allclose(servo_torque(s, angle).value, expected)
    weak = servo_torque(s.with_motor(0.4, 6.0), angle).value
    assert_allclose(weak, expected / 2)


def test_a_servo_is_checked_like_every_signal():
    still = Signal(TIME, np.zeros((51, 1)))
    assert Recording("a", still, still, servo=servo()).servo is not None
    two = replace(servo(), goal=Signal(TIME, np.zeros((51, 2))))
    with assert_refused("goal has 2 columns and angle has 1"):
        Recording("a", still, still, servo=two)
    with assert_refused("goal, sample 3"):
        Recording("a", still, still, servo=servo(goal=np.where(TIME == TIME[3], np.nan, 0.0)))


@pytest.mark.parametrize("phase", ["all", "driven", "passive"])
def test_bam_logs_tell_voltage_and_servo_and_the_torque_is_theirs(tmp_path, phase):
    log = bam_log()
    path = tmp_path / "a.json"
    path.write_text(json.dumps(log))
    r = read_bam(path, {**MOTOR, "offset": 0.1, "limit": 0.5, "phase": phase})
    assert r.servo is not None and (r.servo.kt, r.servo.R) == (MOTOR["kt"], MOTOR["R"])
    time, q = column(log, "timestamp"), column(log, "position")
    duty = np.clip(XL330_GAIN * 400 * (column(log, "goal_position") - q), -0.5, 0.5)
    driven = column(log, "torque_enable") > 0
    shown = np.isin(time, r.angle.time)
    volts = r.covariates["voltage"].value[:, 0]
    assert_allclose(volts, (7.4 * duty * driven)[shown], atol=1e-12)
    # all but the ends of a phase, whose velocity knows what lies beyond
    assert_allclose(servo_torque(r.servo, r.angle).value[1:-1], r.torque.value[1:-1], atol=1e-12)
