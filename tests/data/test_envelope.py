"""Torque-speed envelopes: four quadrants, as a voltage makes them, as tables name them."""

import numpy as np
import pandas as pd
import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.data.envelope import Envelope, of_motor
from frictionid.data.servo import Servo, position_control
from frictionid.data.signals import Signal

TIME = np.linspace(0.0, 1.0, 51)
ON = Signal(TIME, np.ones((51, 1)), "previous")
W = np.linspace(-25.0, 25.0, 51)[:, None]
MOTOR = Envelope(0.8, 4.0, 12.0)


def servo(goal, **numbers):
    return Servo(Signal(TIME, np.full((51, 1), goal)), ON, **numbers)


def as_isaac_lab_clips(effort, w, motor):
    """DCMotor of Isaac Lab: saturation effort, effort limit and velocity limit."""
    w = np.clip(w, *(s * motor.no_load * (1 + motor.peak / motor.stall) for s in (-1, 1)))
    top = np.clip(motor.stall * (1 - w / motor.no_load), None, motor.peak)
    bottom = np.clip(motor.stall * (-1 - w / motor.no_load), -motor.peak, None)
    return np.clip(effort, bottom, top)


@pytest.mark.parametrize("goal", [-9.0, -0.1, 0.0, 0.1, 9.0])
def test_a_servo_saturates_as_a_motor_of_isaac_lab_does(goal):
    s = servo(goal, gain=2.0, limit=np.inf, damping=0.01, output="torque", envelope=MOTOR)
    asked = 2.0 * goal - 0.01 * W
    assert_allclose(s.torque(TIME, 0 * W, W), as_isaac_lab_clips(asked, W, MOTOR))


def test_a_limited_current_under_a_voltage_is_the_envelope_of_that_motor():
    numbers = dict(kt=0.4, R=2.0, output="voltage")
    volts = servo(9.0, gain=50.0, limit=8.0, current_limit=2.0, **numbers)
    wide = servo(
        9.0, gain=50.0, limit=np.inf, output="torque", envelope=of_motor(8.0, 0.4, 2.0, 0.8)
    )
    assert_allclose(volts.torque(TIME, 0 * W, W), wide.torque(TIME, 0 * W, W), atol=1e-12)
    assert volts.torque_speed == wide.torque_speed == Envelope(0.8, 10.0, 20.0)
    control = position_control(volts, 1)
    assert control.envelope(0) == pytest.approx(Envelope(0.8, 10.0, 20.0))
    asked = control.kp * 0.1 - control.kv * W  # within the voltage's limit
    near = servo(0.1, gain=50.0, limit=8.0, current_limit=2.0, **numbers).torque(TIME, 0 * W, W)
    assert_allclose(near, as_isaac_lab_clips(asked, W, control.envelope(0)), atol=1e-12)


def test_without_a_largest_voltage_there_is_none():
    endless = servo(1.0, gain=2.0, limit=np.inf, kt=0.4, R=2.0, output="voltage")
    assert endless.torque_speed is None and servo(1.0, gain=2.0, limit=9.0).torque_speed is None
    assert position_control(endless, 1).envelope(0) is None


SERVOS = [
    dict(limit=1.5, damping=0.01, output="torque", envelope=MOTOR),
    dict(limit=np.inf, output="torque"),
    dict(limit=0.4, damping=0.3, output="torque"),
    dict(limit=0.9, damping=0.05, supply=7.0, kt=0.4, R=3.0, current_limit=0.3),
]


@pytest.mark.parametrize("numbers", SERVOS)
@pytest.mark.parametrize("goal", [-9.0, -0.1, 0.1, 9.0])
def test_slopes_are_those_of_the_torque(goal, numbers):
    s = servo(goal, gain=2.0, **numbers)
    at, step, q = s.at(TIME), 1e-6, 0 * W
    w = W + 0.123  # off the corners
    K, B = np.moveaxis(at.linear(q, w).feedback, -2, 0)
    by_q = at.linear(q + step, w).torque - at.linear(q - step, w).torque
    by_w = at.linear(q, w + step).torque - at.linear(q, w - step).torque
    assert_allclose(-K, by_q / (2 * step), atol=1e-8)
    assert_allclose(-B, by_w / (2 * step), atol=1e-8)


FRAME = pd.DataFrame({"t": TIME, "q": np.sin(TIME), "aim": np.cos(TIME)})
RIG = {"kind": "pendulum", "parameters": {"mass": 0.5, "length": 0.1}}
PD = dict(target="aim", output="torque", P=3.0)
SPEEDS = dict(peak_torque=0.8, knee_speed=4.0, no_load_speed=12.0)


def envelope(**more):
    data = fid.Dataset.from_frames(FRAME, RIG, time="t", angle="q", actuator={**PD, **more})
    return [float(np.ravel(x)[0]) for x in data.recordings[0].servo.envelope]


def test_a_table_names_it_by_speeds_or_by_the_motor():
    assert envelope(**SPEEDS) == [0.8, 4.0, 12.0]
    assert envelope(kt=0.04, gear=10.0, R=2.0, supply=8.0, limit=0.8) == [0.8, 10.0, 20.0]
    current = dict(output="current", kt=0.04, gear=10.0, R=2.0, supply=8.0, limit=2.0)
    assert envelope(**current) == pytest.approx([0.8, 10.0, 20.0])


MISTAKES = """
peak_torque = 0.8 => an envelope is peak_torque, knee_speed and a higher no_load_speed
peak_torque = 0.8; knee_speed = 12.0; no_load_speed = 12.0 => a higher no_load_speed
peak_torque = 0.8; knee_speed = 4.0; no_load_speed = 12.0; kt = 1.0; R = 1.0; supply = 8.0
    => give one of these
kt = 1.0; R = 1.0; supply = "q" => an envelope has one supply
kt = 1.0; R = 1.0 => says nothing where output = "torque"
peak_torque = 0.8; knee_speed = [1.0, 2.0]; no_load_speed = 12.0 => give one, or one per joint
peak_torque = 0.8; knee_speed = 4.0; no_load_speed = 12.0; kt = 1.0; R = 1.0; output = "voltage"
    => says nothing where output = "voltage"
"""


@mistakes(MISTAKES)
def test_half_an_envelope_is_one_clear_line(wrong, words):
    with assert_refused(words):
        envelope(**changes(wrong))
