"""Servos: unmeasured torque that follows from the voltage of a DC motor.

    u = kt (V - kt w)/R = (kt/R) V - (kt^2/R) w,    exactly zero while the motor is disconnected

kt/R is the gain of the voltage V, and kt^2/R acts like viscous friction while the motor is
connected (back-EMF). In a prediction the recorded V is an input; u depends on the predicted w.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frictionid.data.signals import Array, Signal, sample


@dataclass(frozen=True, eq=False)
class Servo:
    """Motors under the position controller of their firmware [Duclusaud2025].

        duty = gain (goal - q), within +-limit;  V = supply duty;  u = kt (V - kt w)/R

    Attributes
    ----------
    goal : Signal, n columns [rad], in the frame of the recorded angles
    enabled : Signal, n columns: 1 while the motor is connected, 0 while it is not
    gain : duty per radian [1/rad]; limit : largest duty; supply : [V]
    kt : torque constant [N m/A], or [V s/rad]; R : resistance [Ohm]

    Examples
    --------
    >>> time = np.array([0.0, 1.0])
    >>> goal, on = Signal(time, np.array([[0.5], [0.5]])), Signal(time, np.ones((2, 1)))
    >>> servo = Servo(goal, on, gain=4.0, limit=1.0, supply=7.0, kt=0.4, R=4.0)
    >>> servo.voltage(time, np.array([[0.25], [0.0]])).ravel()
    array([7., 7.])
    """

    goal: Signal
    enabled: Signal
    gain: float
    limit: float
    supply: float
    kt: float
    R: float

    def voltage(self, time: Array, q: Array) -> Array:
        """Voltage (K, n) [V] of the controller at times (K,) with the joints at q (K, n)."""
        duty = self.gain * (sample(self.goal, time) - q)
        return self.supply * np.clip(duty, -self.limit, self.limit)

    def connected(self, time: Array) -> Array:
        """Whether the motors are connected at times (K,): 1 or 0, shape (K, n)."""
        return np.where(sample(self.enabled, time) > 0.5, 1.0, 0.0)

    def with_motor(self, kt: float, R: float) -> Servo:
        """The same controller with other motors."""
        return replace(self, kt=float(kt), R=float(R))


def motor_torque(volts: Array, w: Array, kt: float | Array, R: float | Array) -> Array:
    """Torque u [N m] of a DC motor at a voltage and a velocity w [rad/s].

    >>> float(motor_torque(np.array(4.0), np.array(2.0), kt=0.5, R=2.0))
    0.75
    """
    return kt * (volts - kt * w) / R


def terminal_voltage(servo: Servo, angle: Signal) -> Signal:
    """Voltage [V] along recorded angles, zero while disconnected."""
    time = angle.time
    return Signal(time, servo.voltage(time, angle.value) * servo.connected(time), "linear")


def servo_torque(servo: Servo, angle: Signal, delay: float = 0.0) -> Signal:
    """Torque [N m] along recorded angles, with velocities by central differences.

    delay : [s] by which the voltage acts later than by the clock of the angles
    """
    time = angle.time
    then = time - delay
    w = np.gradient(angle.value, time, axis=0)
    torque = motor_torque(servo.voltage(then, sample(angle, then)), w, servo.kt, servo.R)
    return Signal(time, torque * servo.connected(then), "linear")


def applied_voltage(servo: Servo, angle: Signal) -> Signal:
    """Voltage [V] along recorded angles, with steps where motors are switched.

    A sample is inserted just before each switch, with the voltage until then.
    """
    time, on = angle.time, servo.connected(angle.time)
    volts = servo.voltage(time, angle.value)
    at = 1 + np.flatnonzero((np.diff(on, axis=0) != 0).any(axis=1))
    just = time[at] - 1e-6 * np.diff(time)[at - 1]
    volts_on = np.insert(volts * on, at, volts[at] * on[at - 1], axis=0)
    return Signal(np.insert(time, at, just), volts_on, "linear")
