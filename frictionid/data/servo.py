"""Servos: unmeasured torque that follows from a controller's target, the motion, and the motor.

    c = P (q*(t - d) - q_seen) + D (w*(t - d) - w) + f(t - d),   within +-limit

is what the controller puts out: a torque ("torque"), the motor's current ("current"), its voltage
("voltage"), or a share of the supply ("duty"). Of a voltage V, with K = ratio kt,

    u = efficiency K (V - K w)/R,    exactly zero while the motor is disconnected

K/R is the gain of the voltage V, and K^2/R acts like viscous friction while the motor is
connected (back-EMF). In a prediction u depends on the predicted w.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from frictionid.data.signals import Array, Signal, holds, sample
from frictionid.programs.loops import compiled

Output = Literal["duty", "voltage", "current", "torque"]
_JUST = 1e-6  # of a sample, by which a value stands before the step that follows


@dataclass(frozen=True, eq=False)
class Servo:
    """Motors under the controller of their firmware [Duclusaud2025].

        duty = gain (goal - q), within +-limit;  V = supply duty;  u = kt (V - kt w)/R

    Numbers are one for all joints, or one for each where it says (n,).

    Attributes
    ----------
    goal : Signal, n columns [rad], in the frame of the recorded angles; [rad/s] of velocities
    enabled : Signal, n columns: 1 while the motor is connected, 0 while it is not
    gain : (n,) output per radian, of velocities per rad/s; limit : largest output
    supply : [V], or a Signal of one column
    kt : torque constant [N m/A], or [V s/rad]; R : resistance [Ohm]
    damping : (n,) output per rad/s of velocity error; goal_velocity : [rad/s], zero where None
    feedforward : Signal in the unit of the output, or None
    target : what the goal is; output : what the controller puts out
    current_limit : [A]; ratio : (n,) turns of the motor for one of the joint; efficiency : (n,)
    target_delay : [s] by which targets act later than by the clock of the angles
    backlash : (n,) [rad] between the joint and the encoder that the controller reads, see `play`

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
    gain: float | Array
    limit: float | Array
    supply: float | Signal = float("nan")
    kt: float = float("nan")
    R: float = float("nan")
    damping: float | Array = 0.0
    goal_velocity: Signal | None = None
    feedforward: Signal | None = None
    target: Literal["position", "velocity"] = "position"
    output: Output = "duty"
    current_limit: float = float("inf")
    ratio: float | Array = 1.0
    efficiency: float | Array = 1.0
    target_delay: float = 0.0
    backlash: float | Array = 0.0

    @property
    def has_motor(self) -> bool:
        """Whether torque follows from a voltage, by kt and R."""
        return self.output in ("duty", "voltage")

    def command(self, time: Array, q: Array, w: Array | float = 0.0) -> Array:
        """Output (K, n) of the controller before its limit, with the joints seen at q and w."""
        then = time - self.target_delay
        aim = sample(self.goal, then)
        if self.target == "velocity":
            out = self.gain * (aim - w)
        else:
            rate = 0.0 if self.goal_velocity is None else sample(self.goal_velocity, then)
            out = self.gain * (aim - q) + self.damping * (rate - w)
        return out if self.feedforward is None else out + sample(self.feedforward, then)

    def voltage(self, time: Array, q: Array, w: Array | float = 0.0) -> Array:
        """Voltage (K, n) [V] of the controller at times (K,) with the joints at q (K, n)."""
        volts = 1.0 if self.output == "voltage" else self._supply(time)
        return volts * np.clip(self.command(time, q, w), -self.limit, self.limit)

    def torque(self, time: Array, q: Array, w: Array) -> Array:
        """Torque (K, n) [N m] at times (K,), joints seen at q (K, n), moving at w (K, n)."""
        on = self.connected(time)
        if not self.has_motor:
            out = np.clip(self.command(time, q, w), -self.limit, self.limit)
            share = self.ratio * self.kt if self.output == "current" else 1.0
            return self.efficiency * share * out * on
        K = self.ratio * self.kt
        u = np.clip(
            motor_torque(self.voltage(time, q, w), w, K, self.R),
            -K * self.current_limit,
            K * self.current_limit,
        )
        return self.efficiency * u * on

    def damping_at(self, time: Array, q: Array, w: Array) -> Array:
        """How much torque (K, n) [N m s/rad] a velocity takes off; none where a limit holds."""
        command, on = self.command(time, q, w), self.connected(time)
        by_w = self.gain if self.target == "velocity" else self.damping
        by_w = np.where(np.abs(command) < self.limit, by_w, 0.0)
        if not self.has_motor:
            share = self.ratio * self.kt if self.output == "current" else 1.0
            return self.efficiency * share * by_w * on
        K, volts = self.ratio * self.kt, 1.0
        if self.output == "duty":
            volts = float(np.median(self._supply(time)))
        u = motor_torque(self.voltage(time, q, w), w, K, self.R)
        on = on * (np.abs(u) < K * self.current_limit)
        return self.efficiency * K * (K + volts * by_w) / self.R * on

    def connected(self, time: Array) -> Array:
        """Whether the motors are connected at times (K,): 1 or 0, shape (K, n)."""
        return np.where(sample(self.enabled, time) > 0.5, 1.0, 0.0)

    def with_motor(self, kt: float, R: float) -> Servo:
        """The servo with other motors under its controller."""
        return replace(self, kt=float(kt), R=float(R))

    def steps(self) -> Array:
        """Times [s] at which the output steps: held targets that change, and switches."""
        steps = [_changes(self.enabled)]
        for aim in (self.goal, self.goal_velocity, self.feedforward):
            if aim is not None and holds(aim):
                steps.append(_changes(aim) + self.target_delay)
        return np.unique(np.concatenate(steps))

    def _supply(self, time: Array) -> float | Array:
        return sample(self.supply, time) if isinstance(self.supply, Signal) else self.supply


def motor_torque(volts: Array, w: Array, kt: float | Array, R: float | Array) -> Array:
    """Torque u [N m] of a DC motor at a voltage and a velocity w [rad/s].

    >>> float(motor_torque(np.array(4.0), np.array(2.0), kt=0.5, R=2.0))
    0.75
    """
    return kt * (volts - kt * w) / R


def play(angle: Signal, width: float | Array) -> Signal:
    """Play z [rad] between joints and what follows them, |z| <= width/2: an encoder behind a gear.

    dz = dq while |z| < width/2: the encoder stands, held by the friction on its side, until the
    joint has crossed the backlash; it then shows q - z. Its hysteresis is independent of the rate
    [Nordin2002]. At first the joint is in the middle.

    >>> there_and_back = Signal(np.arange(5.0), np.array([[0.0], [2.0], [5.0], [4.5], [2.0]]))
    >>> play(there_and_back, 2.0).value.ravel()
    array([ 0. ,  1. ,  1. ,  0.5, -1. ])
    """
    q = np.asarray(angle.value, float)
    half = np.broadcast_to(np.asarray(width, float) / 2, q.shape[1:])
    return Signal(angle.time, _followed(np.ascontiguousarray(q), np.array(half)), "linear")


@compiled
def _followed(q: Array, half: Array) -> Array:
    """Play (T, n) along joints q (T, n) with half-widths (n,)."""
    z = np.zeros_like(q)
    for k in range(1, len(q)):
        for j in range(q.shape[1]):
            z[k, j] = min(max(z[k - 1, j] + q[k, j] - q[k - 1, j], -half[j]), half[j])
    return z


def seen_by_encoder(servo: Servo, angle: Signal, smooth: Signal | None = None) -> Signal:
    """Angles that the controller reads: the recorded ones, less the play of their smooth motion."""
    if not np.any(servo.backlash):
        return angle
    z = play(angle if smooth is None else smooth, servo.backlash)
    return Signal(angle.time, angle.value - sample(z, angle.time), "linear")


def terminal_voltage(servo: Servo, angle: Signal) -> Signal:
    """Voltage [V] along recorded angles, zero while disconnected."""
    time = angle.time
    return Signal(time, servo.voltage(time, angle.value) * servo.connected(time), "linear")


def servo_torque(
    servo: Servo, angle: Signal, delay: float = 0.0, rate: Signal | None = None
) -> Signal:
    """Torque [N m] along recorded angles.

    delay : [s] by which the voltage acts later than by the clock of the angles
    rate : velocities [rad/s], those by central differences where there are none
    """
    time, seen = angle.time, seen_by_encoder(servo, angle)
    if rate is None:
        rate = Signal(time, np.gradient(angle.value, time, axis=0))
    if holds(servo.goal):
        time = with_steps(time, servo.steps() + delay)
    then = time - delay
    return Signal(time, servo.torque(then, sample(seen, then), sample(rate, time)), "linear")


def with_steps(time: Array, steps: Array) -> Array:
    """Times (T,), and each step within them with a moment just before.

    >>> with_steps(np.array([0.0, 1.0, 2.0]), np.array([1.0, 1.5, 7.0]))
    array([0.      , 0.999999, 1.      , 1.499999, 1.5     , 2.      ])
    """
    inside = steps[(steps > time[0]) & (steps <= time[-1])]
    just = inside - _JUST * float(np.median(np.diff(time)))
    return np.unique(np.concatenate([time, just, inside]))


def _changes(signal: Signal) -> Array:
    """Times of the samples that differ from the one before."""
    change = (np.diff(signal.value, axis=0) != 0).any(axis=1)
    return np.asarray(signal.time, float)[1:][change]
