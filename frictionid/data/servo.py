"""Servos: unmeasured torque that follows from a controller's target, the motion, and the motor.

    c = P (q*(t - d) - q_seen) + D (w*(t - d) - w) + f(t - d),   within +-limit

is what the controller puts out: a torque ("torque"), the motor's current ("current"), its voltage
("voltage"), or a share of the supply ("duty"). Of a voltage V, with K = ratio kt,

    u = efficiency K (V - K w)/R,    exactly zero while the motor is disconnected

K/R is the gain of the voltage V, and K^2/R acts like viscous friction while the motor is
connected (back-EMF). A torque or current may have an `Envelope` over the speed; that of a voltage
follows from it. In a prediction u depends on the predicted w.
"""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from frictionid.programs.machine_code import compiled

from .envelope import Envelope, of_motor
from .signals import Array, Signal, holds, sample

Output = Literal["duty", "voltage", "current", "torque"]
UNKNOWN_GAIN = 1.0  # P and D of a controller, until somebody gives them
BY_CONTROLLER = "it is computed from the targets and gains of a controller"
_AFTER = 1e-10  # [s] behind a step, where rounding does not decide whether it has come


class Linear(NamedTuple):
    """Torque u (K, n) at a motion, and its slopes: du = by_command dc - K dq - B dw.

    feedback (K, 2, n) : K [N m/rad] and B [N m s/rad]; nothing of what a limit holds
    """

    torque: Array
    by_command: Array
    feedback: Array


class Controller(NamedTuple):
    """Torque of servos at some instants as a function of the motion (K, n), piecewise linear in it.

        u = scale clip(v, most) + bias,    v within +-stall - slope w
        v = share clip(command - by_q q - by_w w, limit) - back_emf w

    Entries broadcast to (K, n); clip(x, a) is x within +-a.
    """

    command: Array
    by_q: float | Array
    by_w: float | Array
    limit: float | Array
    share: float | Array
    back_emf: float | Array
    most: float | Array
    scale: float | Array
    bias: float | Array
    stall: float | Array = float("inf")
    slope: float | Array = 0.0

    def output(self, q: Array, w: Array | float) -> Array:
        """What the controller puts out, within its limit."""
        return np.clip(self.command - self.by_q * q - self.by_w * w, -self.limit, self.limit)

    def torque(self, q: Array, w: Array) -> Array:
        """Torque at a motion."""
        u = self._within_stall(self.share * self.output(q, w) - self.back_emf * w, w)
        return self.scale * np.clip(u, -self.most, self.most) + self.bias

    def _within_stall(self, asked: Array, w: Array) -> Array:
        return np.clip(asked, -self.stall - self.slope * w, self.stall - self.slope * w)

    def linear(self, q: Array, w: Array) -> Linear:
        """Torque at a motion, and its slopes there: none of what a limit holds."""
        out = self.output(q, w)
        asked = self.share * out - self.back_emf * w
        u = self._within_stall(asked, w)
        moves = np.where(np.abs(u) < self.most, self.scale, 0.0) + 0.0 * u
        falls = u != asked
        by_command = np.where((np.abs(out) < self.limit) & ~falls, moves * self.share, 0.0)
        damping = moves * np.where(falls, self.slope, self.back_emf)
        feedback = by_command * self.by_q, by_command * self.by_w + damping
        torque = self.scale * np.clip(u, -self.most, self.most) + self.bias
        return Linear(torque, by_command, np.stack(feedback, axis=-2))


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
    delay : [s] by which the torque acts later than by the clock of the angles
    bias : (n,) [N m] constant torque beside it
    envelope : of a torque or current, before the efficiency, or None

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
    delay: float = 0.0
    bias: float | Array = 0.0
    envelope: Envelope | None = None

    @property
    def has_motor(self) -> bool:
        """Whether torque follows from a voltage, by kt and R."""
        return self.output in ("duty", "voltage")

    @property
    def targets(self) -> tuple[tuple[float | Array, Signal], ...]:
        """Signals, and what one of each adds to the controller's output."""
        by_rate = self.goal_velocity is not None and self.target == "position"
        rate = ((self.damping, self.goal_velocity),) if by_rate else ()
        ahead = () if self.feedforward is None else ((1.0, self.feedforward),)
        return ((self.gain, self.goal), *rate, *ahead)

    def at(self, time: Array) -> Controller:
        """The torque at times (K,), as a function of the motion."""
        then, has_motor = time - self.target_delay, self.has_motor
        K = self.ratio * self.kt
        share = {"torque": 1.0, "current": K}.get(self.output, self._volts(time) * K / self.R)
        motor = self.envelope
        controller = Controller(
            command=np.sum([factor * _sampled(x, then) for factor, x in self.targets], axis=0),
            by_q=self.gain if self.target == "position" else 0.0,
            by_w=self.damping if self.target == "position" else self.gain,
            limit=self.limit,
            share=share,
            back_emf=K**2 / self.R if has_motor else 0.0,
            most=K * self.current_limit if has_motor else float("inf"),
            scale=self.efficiency * self.connected(time),
            bias=self.bias,
        )
        if has_motor or motor is None:
            return controller
        return controller._replace(most=motor.peak, stall=motor.stall, slope=motor.slope)

    def voltage(self, time: Array, q: Array) -> Array:
        """Voltage (K, n) [V] of the controller at times (K,) with the joints at q (K, n)."""
        return self._volts(time) * self.at(time).output(q, 0.0)

    def torque(self, time: Array, q: Array, w: Array) -> Array:
        """Torque (K, n) [N m] at times (K,), joints seen at q (K, n), moving at w (K, n)."""
        return self.at(time).torque(q, w)

    def connected(self, time: Array) -> Array:
        """Whether the motors are connected at times (K,): 1 or 0, shape (K, n)."""
        on = self.enabled.value > 0.5
        if on.all():
            return np.ones((len(time), on.shape[1]))
        return np.where(_sampled(self.enabled, time) > 0.5, 1.0, 0.0)

    @property
    def torque_speed(self) -> Envelope | None:
        """Envelope at the joint: its own, or that of its motor by the least voltage.

        None where neither is known.
        """
        envelope = self.envelope
        if self.has_motor:
            K, limit = self.ratio * self.kt, np.asarray(self.limit, dtype=float)
            supply = self.supply.value.min() if isinstance(self.supply, Signal) else self.supply
            volts = limit if self.output == "voltage" else limit * supply
            ends = bool((np.isfinite(volts) & (volts > 0)).all())
            envelope = of_motor(volts, K, self.R, K * self.current_limit) if ends else None
        if envelope is None:
            return None
        return envelope._replace(peak=self.efficiency * envelope.peak)

    def with_motor(self, kt: float, R: float) -> "Servo":
        """The servo with other motors under its controller."""
        return replace(self, kt=float(kt), R=float(R))

    def steps(self) -> Array:
        """Times [s] at which the output steps: held targets that change, and switches."""
        steps = [_changes(self.enabled)]
        for aim in (self.goal, self.goal_velocity, self.feedforward):
            if aim is not None and holds(aim):
                steps.append(_changes(aim) + self.target_delay)
        return np.unique(np.concatenate(steps))

    def _volts(self, time: Array) -> float | Array:
        """Voltage [V] of an output of one."""
        if self.output == "voltage":
            return 1.0
        return sample(self.supply, time) if isinstance(self.supply, Signal) else self.supply


def open_loop(torque: Signal) -> Servo:
    """A servo that makes a torque, whatever the motion.

    >>> torque = Signal(np.array([0.0, 1.0]), np.array([[0.5], [0.7]]), hold="previous")
    >>> open_loop(torque).torque(np.array([0.9]), np.ones((1, 1)), np.ones((1, 1)))
    array([[0.5]])
    """
    zero = torque._replace(value=0.0 * torque.value)
    on = zero._replace(value=zero.value + 1.0)
    return Servo(zero, on, 0.0, float("inf"), output="torque", feedforward=torque)


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

    delay : [s] by which the voltage acts later than by the clock of the angles, beside the servo's
    rate : velocities [rad/s], those by central differences where there are none
    """
    delay = delay + servo.delay
    time, seen = angle.time, seen_by_encoder(servo, angle)
    if rate is None:
        rate = Signal(time, np.gradient(angle.value, time, axis=0))
    if holds(servo.goal):
        time = with_steps(time, servo.steps() + delay)
    then = time - delay
    return Signal(time, servo.torque(then, sample(seen, then), sample(rate, time)), "linear")


def with_steps(time: Array, steps: Array) -> Array:
    """Times (T,), and each step within them with a moment just before.

    >>> with_steps(np.array([0.0, 1.0, 2.0]), np.array([1.0, 1.5, 7.0])).round(6)
    array([0. , 1. , 1. , 1.5, 1.5, 2. ])
    """
    inside = steps[(steps > time[0]) & (steps <= time[-1])]
    just = inside - 10 * _AFTER
    merged = np.sort(np.concatenate([time, just, inside]), kind="stable")  # of sorted parts: quick
    return merged[np.diff(merged, prepend=-np.inf) > 0]


def _sampled(signal: Signal, time: Array) -> Array:
    """Values (K, n), at the time of a step those behind it, whatever rounding says."""
    return sample(signal, time + _AFTER if holds(signal) else time)


def _changes(signal: Signal) -> Array:
    """Times of the samples that differ from the one before."""
    change = (np.diff(signal.value, axis=0) != 0).any(axis=1)
    return np.asarray(signal.time, float)[1:][change]


# --- As simulators hold it ---------------------------------------------------------------------


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
