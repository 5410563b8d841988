"""Gears between the motors that columns are of and the joints."""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.arrays import Array


@dataclass(frozen=True, eq=False)
class Gears:
    """How the angles and torques of joints were computed from those of motors.

    motor angle = C (joint angle - zero) and joint torque = C' motor torque

    turns : array, shape (n, n), C: turns of each motor for one of each joint
    zero : array, shape (n,) [rad], joint angles at which the motors' are zero
    angles, torques : whether the columns of the angles, of the torques, are of the motors
    """

    turns: Array
    zero: Array
    angles: bool
    torques: bool
