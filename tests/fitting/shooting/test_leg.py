"""A leg in the air: a joint that follows slow triangles of held targets by PD, no torque logged."""

from functools import cache

import numpy as np
import pytest

import frictionid as fid
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import Servo, servo_torque
from frictionid.data.signals import Signal
from frictionid.fitting.shooting.settings import WINDOWS

INERTIA, GRAVITY, COULOMB, VISCOUS = 0.024, 1.0, 0.2, 0.3
P, D = 20.0, 1.5
RATE, SECONDS, FINE = 200, 7.0, 50


@cache
def leg(peak=0.0):
    """One recording, simulated by drift and kick, friction as what stops the joint at most.

    peak : [N m] more of it below some 0.1 rad/s
    """
    time = np.arange(int(RATE * SECONDS)) / RATE
    turns = np.cumsum(0.3 + 0.02 * time) / RATE
    targets = 0.3 * (4.0 * np.abs(turns % 1.0 - 0.5) - 1.0)
    h, q, w, angles = 1.0 / RATE / FINE, targets[0], 0.0, []
    damped = 1.0 + h / INERTIA * (D + VISCOUS)
    for target in targets:
        angles.append(q)
        for _ in range(FINE):
            q += h / 2 * w
            wanted = (w + h / INERTIA * (P * (target - q) - GRAVITY * np.sin(q))) / damped
            most = h / INERTIA * (COULOMB + peak * np.exp(-((w / 0.1) ** 2))) / damped
            w = np.sign(wanted) * max(abs(wanted) - most, 0.0)
            q += h / 2 * w
    noise = 5e-4 * np.random.default_rng(0).normal(size=len(time))
    held = {"hold": "previous"}
    goal, on = Signal(time, targets[:, None], **held), Signal(time, np.ones((len(time), 1)), **held)
    servo = Servo(goal, on, gain=P, limit=50.0, damping=D, output="torque")
    angle = Signal(time, (np.array(angles) + noise)[:, None])
    recording = Recording("leg", angle, servo_torque(servo, angle), servo=servo)
    rig = {"mass": 0.5, "length": 0.1, "rotor": INERTIA - 0.005, "g": GRAVITY / 0.05}
    return Dataset("leg", {"kind": "pendulum", "parameters": rig}, (recording,))


@pytest.mark.parametrize("sample_time", [None, 0.02])
def test_samples_of_any_distance_give_the_same_leg(sample_time):
    free, fixed = ["friction", "inertia", "target_delay"], ["inertia.gravity"]
    settings = {"free": free, "fixed": fixed, "sample_time": sample_time}
    fit = fid.fit(leg(), "coulomb_viscous", method="shooting", **settings)
    values = fit.frame.set_index("parameter").value
    assert fit.convergence.settled
    assert values["coulomb"] == pytest.approx(COULOMB, rel=0.05)
    assert values["viscous"] == pytest.approx(VISCOUS, rel=0.07)
    assert values["inertia"] == pytest.approx(INERTIA, rel=0.02)


def test_windows_are_longer_where_many_are_lost():
    """Those that hold a reversal are lost, and with them what friction is like there."""
    data = leg(peak=1.35)
    fits = [
        fid.fit(data, "coulomb_viscous", method="shooting", free=["friction"], windows=windows)
        for windows in (None, tuple(w + 1e-9 for w in WINDOWS))
    ]
    longer, short = (fit.convergence.windows for fit in fits)
    assert short == 3 * longer
    errors = [np.square(f.q1 - f.measured_q1).mean() for f in (x.predict(whole=True) for x in fits)]
    assert errors[0] < errors[1]
