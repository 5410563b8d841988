"""What servos' controllers do along recorded motion: torque as a signal, damping as a number.

A controller's torque u(t, q, w) is taken at the recorded angles, but at the predicted velocity:

    u = A(t) - B w,    A(t) = u(t, q_recorded, w_recorded) + B w_recorded

with B = -du/dw of each sample interval, so that D gains and back-EMF damp the prediction, and
nothing where a limit holds or the motor is disconnected.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.calibration import Calibration, calibrated_servo
from frictionid.data.integrals import SignalIntegrals, integrals_of
from frictionid.data.recordings import Recording
from frictionid.data.servo import Servo, seen_by_encoder, with_steps
from frictionid.data.signals import Signal, sample
from frictionid.data.state_estimators import States
from frictionid.fitting.shooting.sample_intervals import Intervals


def damping(intervals: Intervals, calibration: Calibration, motors: Array) -> Array:
    """B (K, n) [N m s/rad] of the servos in each interval, by the motion in its middle."""
    out = np.zeros((len(intervals.dt), intervals.n))
    middle = intervals.time + intervals.dt / 2 - float(calibration.delay)
    for r, (recording, states) in enumerate(_each(intervals)):
        if recording.servo is not None:
            own = intervals.recording == r
            servo = calibrated_servo(recording.servo, calibration)
            motion = ServoMotion.of(recording, states, servo)
            out[own] = servo.damping_at(middle[own], *motion.at(middle[own])) * motors
    return out


def torque_signals(intervals: Intervals, calibration: Calibration, B: Array) -> SignalIntegrals:
    """Integrals of A along all recordings; those without a servo have the torque as it is logged.

    B : (K, n), of each interval
    """
    signals = []
    for r, (recording, states) in enumerate(_each(intervals)):
        if recording.servo is None:
            signals.append(recording.torque)
            continue
        servo = calibrated_servo(recording.servo, calibration)
        own = intervals.recording == r
        edges = intervals.time[own] - float(calibration.delay)
        motion = ServoMotion.of(recording, states, servo)
        signals.append(torque_signal(servo, motion, edges, B[own]))
    return integrals_of(signals)


def torque_signal(servo: Servo, motion: ServoMotion, edges: Array, B: Array) -> Signal:
    """A along one recording, B (K, n) from each of the edges (K,) [s] on."""
    changes = edges[1:][(np.diff(B, axis=0) != 0).any(axis=1)]
    fine = _refined(motion.seen.time)
    time = with_steps(fine, np.concatenate([servo.steps(), changes]))
    q, w = motion.at(time)
    own = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, len(edges) - 1)
    return Signal(time, servo.torque(time, q, w) + B[own] * w, "linear")


_PARTS = 8  # of an interval, in which the torque goes from line to line


class ServoMotion(NamedTuple):
    """Angles as the controller's encoder shows them, smoothed velocities, and how angles curve.

    curve : (T - 1, n, 2) [rad] of each interval, its Hermite cubic less its chord at s is
        s (1 - s) ((1 - s) curve[..., 0] - s curve[..., 1]); without it a stiff gain would act on
        the chords, which looks like inertia
    """

    seen: Signal
    w: Signal
    curve: Array | None = None

    @staticmethod
    def of(recording: Recording, states: States, servo: Servo) -> ServoMotion:
        smooth = Signal(states.time, states.q, "linear")
        seen = seen_by_encoder(servo, recording.angle, smooth)
        dt = np.diff(states.time)[:, None]
        ends = states.w[:-1] * dt, states.w[1:] * dt
        curve = np.stack(ends, axis=-1) - np.diff(states.q, axis=0)[..., None]
        same = np.array_equal(states.time, seen.time)
        return ServoMotion(seen, Signal(states.time, states.w, "linear"), curve if same else None)

    def at(self, time: Array) -> tuple[Array, Array]:
        """Both (K, n) at times (K,)."""
        q, w, clock = sample(self.seen, time), sample(self.w, time), self.seen.time
        if self.curve is None:
            return q, w
        k = np.clip(np.searchsorted(clock, time, side="right") - 1, 0, len(clock) - 2)
        s = np.clip((time - clock[k]) / np.diff(clock)[k], 0.0, 1.0)[:, None]
        first, last = np.moveaxis(self.curve[k], -1, 0)
        return q + s * (1 - s) * ((1 - s) * first - s * last), w


def _refined(time: Array) -> Array:
    """Times (T,) with others between them."""
    share = np.arange(_PARTS) / _PARTS
    between = time[:-1, None] + np.diff(time)[:, None] * share
    return np.append(between.ravel(), time[-1])


def _each(intervals: Intervals) -> list[tuple[Recording, States]]:
    return list(zip(intervals.dataset.recordings, intervals.states, strict=True))
