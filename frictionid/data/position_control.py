"""A servo's controller as simulators hold it: gains, limit and damping at the joint."""

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array

from .envelope import Envelope
from .servo import Servo


class PositionControl(NamedTuple):
    """Position control at the joint, of each of n joints.

        u = clip(kp (q*(t - delay) - q) - kv w, limit) - back_emf w + bias

    Of a motor with an `Envelope` the limit is its peak, and its clip lies within stall - slope w
    and -stall - slope w, too.

    kp : [N m/rad]; kv, back_emf : [N m s/rad]; limit : [N m], infinite where there is none
    delay : [s] of the targets; bias : [N m]; stall : [N m], None without envelope
    slope : [N m s/rad]
    """

    kp: Array
    kv: Array
    limit: Array
    back_emf: Array
    delay: float
    bias: Array
    stall: Array | None = None
    slope: Array | None = None

    def envelope(self, j: int) -> Envelope | None:
        """Envelope of a joint, None where there is none."""
        if self.stall is None or self.slope is None:
            return None
        peak, stall, slope = (float(np.ravel(x)[j]) for x in (self.limit, self.stall, self.slope))
        return Envelope(peak, (stall - peak) / slope, stall / slope)


def position_control(servo: Servo, n: int) -> PositionControl | None:
    """What n servos do, None of those whose targets are velocities or torques.

    Of a motor under a voltage, limit is the stall torque and back_emf its damping K^2/R, unless the
    current is limited as well: then it has an envelope.
    """
    if servo.target != "position" or not np.any(servo.gain):
        return None
    c = servo.at(servo.goal.time[:1])
    scale = np.asarray(servo.efficiency)
    kp, kv, limit, back_emf = (
        np.broadcast_to(scale * x, (1, n))[0]
        for x in (c.share * c.by_q, c.share * c.by_w, c.share * c.limit, c.back_emf)
    )
    delay, bias = float(servo.target_delay), np.broadcast_to(servo.bias, n)
    motor, is_cut = servo.torque_speed, bool(np.isfinite(c.most).all())
    if motor is None or not is_cut:
        return PositionControl(kp, kv, limit, back_emf, delay, bias)
    peak, stall, slope = (np.broadcast_to(x, n) for x in (motor.peak, motor.stall, motor.slope))
    peak = np.minimum(peak, limit)
    return PositionControl(kp, kv + back_emf, peak, 0.0 * kv, delay, bias, stall, slope)
