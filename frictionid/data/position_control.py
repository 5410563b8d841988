"""A servo's controller as simulators hold it: gains, limit and damping at the joint."""

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array

from .servo import Servo


class PositionControl(NamedTuple):
    """Position control at the joint, of each of n joints.

        u = clip(kp (q*(t - delay) - q) - kv w, limit) - back_emf w + bias

    kp : [N m/rad]; kv, back_emf : [N m s/rad]; limit : [N m], infinite where there is none
    delay : [s] of the targets; bias : [N m]
    """

    kp: Array
    kv: Array
    limit: Array
    back_emf: Array
    delay: float
    bias: Array


def position_control(servo: Servo, n: int) -> PositionControl | None:
    """What n servos do, None of those whose targets are velocities or torques.

    Of a motor under a voltage, limit is the stall torque and back_emf its damping K^2/R.
    """
    if servo.target != "position" or not np.any(servo.gain):
        return None
    c = servo.at(servo.goal.time[:1])
    scale = np.asarray(servo.efficiency)
    kp, kv, limit, back_emf = (
        np.broadcast_to(scale * x, (1, n))[0]
        for x in (c.share * c.by_q, c.share * c.by_w, c.share * c.limit, c.back_emf)
    )
    return PositionControl(
        kp, kv, limit, back_emf, float(servo.target_delay), np.broadcast_to(servo.bias, n)
    )
