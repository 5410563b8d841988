"""Torque of servos in shooting: u = A(t) - B w of target, recorded angle and predicted velocity.

A controller's torque u(t, q, w) is taken at the recorded angles, but at the predicted velocity:

    u = A(t) - B w,    A(t) = u(t, q_recorded, w_recorded) + B w_recorded

with B = -du/dw of each sample interval, so that D gains and back-EMF damp the prediction, and
nothing where a limit holds or the motor is disconnected. A is a torque like any other; B acts like
a friction, with `BackEMF`. What is free of the servo changes A, by differences; what that changes
in B acts on the difference of predicted and recorded velocity only, and has no derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.calibration import Calibration, calibrated_servo
from frictionid.data.integrals import SignalIntegrals, integrals_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import Servo, seen_by_encoder, with_steps
from frictionid.data.signals import Signal, sample
from frictionid.data.state_estimators import States
from frictionid.dynamics.tangent.tensor_law import SmoothedLaw
from frictionid.errors import InputError
from frictionid.fitting.parameters.blocks import MOTOR
from frictionid.fitting.parameters.parameter_block import Estimate, FreeBlock, ParameterBlock
from frictionid.fitting.shooting.sample_intervals import Intervals
from frictionid.friction import Inputs, LawParameter, Memory
from frictionid.friction.coordinates import refuse_coupled
from frictionid.friction.law import NUMERICAL_WIDTH

_SHARE = 1e-4  # of a constant, by which it is changed for a difference
_CHANGE = {"s": 1e-4, "rad": 1e-4, "m": 1e-4}  # of what may be zero
_SHARPER = 0.2  # of the smoothing of the other law
_PARTS = 8  # of an interval, in which the torque goes from line to line


class Change(NamedTuple):
    """Integrals of A with a parameter above and below its value, and how far that is apart."""

    above: SignalIntegrals
    below: SignalIntegrals
    apart: float


class Drive(NamedTuple):
    """Motor torque of K intervals, before gain and bias: integrals of A, or of what was logged.

    changes : of A by each free parameter of the servos; B : (K, n) [N m s/rad], None without servos
    """

    torque: SignalIntegrals
    changes: tuple[Change, ...] = ()
    B: Array | None = None


def drive_of(intervals: Intervals, estimate: Estimate, blocks: Sequence[FreeBlock]) -> Drive:
    """The torque of an estimate's servos where blocks free these, else the logged one."""
    servos = [free.block for free in blocks if free.block.enters == "actuator"]
    if not servos:
        return Drive(intervals.torque)
    B, changes = damping(intervals, estimate.calibration, estimate.mechanism.motors), []
    for block in servos:
        for parameter in block.parameters(estimate):
            value = parameter.value
            step = _CHANGE.get(parameter.unit, _SHARE * abs(value))
            ends = value + step, max(value - step, parameter.low)
            changed = (block.with_values(estimate, [(parameter, end)]) for end in ends)
            above, below = (torque_signals(intervals, e.calibration, B) for e in changed)
            changes.append(Change(above, below, ends[0] - ends[1]))
    return Drive(torque_signals(intervals, estimate.calibration, B), tuple(changes), B)


def damping(intervals: Intervals, calibration: Calibration, motors: Array) -> Array:
    """B (K, n) [N m s/rad] of the servos in each interval, by the motion in its middle."""
    out = np.zeros((len(intervals.dt), intervals.n))
    middle = intervals.time + intervals.dt / 2 - float(calibration.delay)
    for r, (recording, states) in enumerate(_pairs(intervals)):
        if recording.servo is not None:
            rows = intervals.recording == r
            servo = calibrated_servo(recording.servo, calibration)
            motion = ServoMotion.along(recording, states, servo)
            out[rows] = servo.damping_at(middle[rows], *motion.at(middle[rows])) * motors
    return out


def torque_signals(intervals: Intervals, calibration: Calibration, B: Array) -> SignalIntegrals:
    """Integrals of A along all recordings; those without a servo have the torque as it is logged.

    B : (K, n), of each interval
    """
    signals = []
    for r, (recording, states) in enumerate(_pairs(intervals)):
        if recording.servo is None:
            signals.append(recording.torque)
            continue
        servo = calibrated_servo(recording.servo, calibration)
        rows = intervals.recording == r
        edges = intervals.time[rows] - float(calibration.delay)
        motion = ServoMotion.along(recording, states, servo)
        signals.append(torque_signal(servo, motion, edges, B[rows]))
    return integrals_of(signals)


def torque_signal(servo: Servo, motion: ServoMotion, edges: Array, B: Array) -> Signal:
    """A along one recording, B (K, n) from each of the edges (K,) [s] on."""
    changes = edges[1:][(np.diff(B, axis=0) != 0).any(axis=1)]
    clock, share = motion.seen.time, np.arange(_PARTS) / _PARTS
    fine = np.append((clock[:-1, None] + np.diff(clock)[:, None] * share).ravel(), clock[-1])
    time = with_steps(fine, np.concatenate([servo.steps(), changes]))
    q, w = motion.at(time)
    place = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, len(edges) - 1)
    return Signal(time, servo.torque(time, q, w) + B[place] * w, "linear")


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
    def along(recording: Recording, states: States, servo: Servo) -> ServoMotion:
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


def _pairs(intervals: Intervals) -> list[tuple[Recording, States]]:
    return list(zip(intervals.dataset.recordings, intervals.states, strict=True))


@dataclass(frozen=True, eq=False, repr=False)
class BackEMF(SmoothedLaw):
    """Tf = Tf_law + back_emf w, where the other law sees the torque u - back_emf w of the motor.

    u is the torque that the voltage alone would make. The last number of a joint is back_emf =
    kt^2/R [N m s/rad], all others are the other law's. The step must not narrow its smoothing, see
    `with_back_emf`.
    """

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        return (*self.law.parameters, LawParameter("back_emf", "N m s/rad"))

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return tuple((*start, 0.0) for start in self.law.initial)

    def start(self, theta: Array, x: Inputs) -> Memory:
        return self.law.start(theta[..., :-1], _felt(theta, x))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return np.asarray(
            self.law.torque(theta[..., :-1], _felt(theta, x), memory) + _emf(theta, x)
        )

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return self.law.advance(theta[..., :-1], _felt(theta, x), memory, dt)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        # w says nothing but the direction here: the joint is at rest
        return np.asarray(self.law.limit(theta[..., :-1], x, memory))


def _felt(theta: Array, x: Inputs) -> Inputs:
    return x._replace(u=x.u - _emf(theta, x))


def _emf(theta: Array, x: Inputs) -> Array:
    return np.asarray(theta[..., -1] * x.w)


def inside(estimate: Estimate, B: Array) -> Estimate:
    """The estimate whose friction has back-EMF with damping B (n,) of the servos.

    Its law is so narrow that the step asks at the joint's velocity: where the step goes round a
    law's smoothing it asks for the torque at a speed just beyond. That does not matter for
    friction, which hardly changes there, but back-EMF changes more.
    """
    friction, law = estimate.friction, estimate.friction.law
    if 0 < law.width <= NUMERICAL_WIDTH:
        law = law.with_width(_SHARPER * law.width)
    back_emf = (np.asarray(estimate.calibration.gain) * B)[:, None]
    theta = np.concatenate([np.asarray(friction.theta, dtype=float), back_emf], axis=-1)
    law = BackEMF(law, law.width, "")
    return estimate._replace(friction=replace(friction, law=law, theta=theta, constraints=None))


def has_actuator(blocks: Sequence[ParameterBlock]) -> bool:
    """Whether torque is to follow from a servo's target and the predicted motion."""
    return any(b.enters == "actuator" for b in blocks)


def with_servo(estimate: Estimate, dataset: Dataset, blocks: Sequence[ParameterBlock]) -> Estimate:
    """The estimate with what blocks free of servos, if any: the friction's, or the recordings'.

    Raises
    ------
    InputError
        Where no recording knows its servo, some do not, or they have different motors.
    """
    names = {b.name for b in blocks if b.enters == "actuator"}
    if not names:
        return estimate
    servos = [r.servo for r in dataset.recordings if r.servo is not None]
    where = f"data set {dataset.name!r}, block {min(names)!r}"
    remedy = "leave the block out, and free 'gain' for a wrong torque constant"
    if not servos:
        raise InputError(f"{where}: no recording knows the servo that drives it: {remedy}")
    for r in dataset.recordings:
        if r.servo is None and np.any(r.torque.value):
            raise InputError(
                f"{where}: recording {r.name!r} has a torque and no servo: leave it out, or "
                f"{remedy}"
            )
    new = estimate.calibration
    if "actuator" in names and new.motor is None:
        new = replace(new, motor=_motor(estimate, servos, where, remedy))
    if "target_delay" in names and new.target_delay is None:
        new = replace(new, target_delay=np.array(np.mean([s.target_delay for s in servos])))
    if "backlash" in names and new.backlash is None:
        n = estimate.mechanism.n
        new = replace(new, backlash=np.mean([s.backlash + np.zeros(n) for s in servos], axis=0))
    return estimate._replace(calibration=new)


def _motor(estimate: Estimate, servos: Sequence[Servo], where: str, remedy: str) -> Array:
    """Constants kt and R that a fit begins with."""
    if any(not s.has_motor for s in servos):
        raise InputError(f'{where}: output = "{servos[0].output}" knows no kt and R: {remedy}')
    motors = {(s.kt, s.R) for s in servos}
    if len(motors) > 1:
        raise InputError(
            f"{where}: the recordings have {len(motors)} different motors (kt, R): fit those of "
            "each motor alone"
        )
    parameters = estimate.friction.parameters
    motor = np.array([parameters.get("kt") or 0.0, parameters.get("R") or 0.0])
    return motor if (motor > 0).all() else np.array(motors.pop())


def refuse_open(estimate: Estimate, blocks: Sequence[ParameterBlock]) -> None:
    """Refuse mechanisms and laws with which no servo's loop can be closed.

    Raises
    ------
    InputError
        With the first of the servo's blocks.
    """
    name = next(b.name for b in blocks if b.enters == "actuator")
    refuse_coupled(estimate.mechanism, f"block {name!r}")
    law = estimate.friction.law
    if hasattr(estimate.friction.theta, "detach") or law.sample_time is not None:
        raise InputError(
            f"block {name!r}: {law} learns by reverse mode, which knows no voltages: leave the "
            "block out"
        )


def check_servo(
    intervals: Intervals, estimate: Estimate, blocks: Sequence[FreeBlock], reads_torque: bool
) -> None:
    """Refuse what recordings cannot tell of motor, machine and friction together.

    reads_torque : whether friction depends on the motor's torque

    Raises
    ------
    InputError
        Saying which blocks, and the way out.
    """
    parameters = {free.block.name: free.parameters for free in blocks}
    names = {p.name for p in parameters.get("actuator", ())}
    informed = any(np.isfinite(p.tolerance) for group in parameters.values() for p in group)
    remedy = "fix actuator.kt or actuator.R, or give a prior of the block"
    if "gain" in parameters and "actuator" in parameters:
        raise InputError(
            "blocks 'gain' and 'actuator': a gain of the torque is one of kt/R: leave one out"
        )
    everything = len(estimate.mechanism.base_names)
    scale = len(parameters.get("inertia", ())) == everything and parameters.get("friction")
    if scale and "R" in names and not informed:
        raise InputError(
            "blocks 'actuator' and 'inertia' with all base parameters free: a smaller R with "
            "larger inertias and friction gives the same motion: fix actuator.R, or one base "
            f"parameter that you are sure of, such as {estimate.mechanism.base_names[-1]!r}, or "
            "give a prior"
        )
    viscous = any(p.name.startswith("viscous") for p in parameters.get("friction", ()))
    rows = _connected(intervals, estimate)
    passive = bool((rows == 0).all(axis=1).any())
    if names == set(MOTOR) and viscous and not (informed or passive or reads_torque):
        raise InputError(
            "block 'actuator': while the motor is connected only kt/R and the sum of viscous "
            f"friction and kt^2/R show in the motion: {remedy}, or add recordings in which it is "
            "disconnected"
        )


def _connected(intervals: Intervals, estimate: Estimate) -> Array:
    """Whether (K, n) the motor of a joint is connected in the middle of an interval: 1 or 0."""
    out = np.zeros((len(intervals.dt), intervals.n))
    middle = intervals.time + intervals.dt / 2 - float(estimate.calibration.delay)
    for r, recording in enumerate(intervals.dataset.recordings):
        if recording.servo is not None:
            rows = intervals.recording == r
            out[rows] = recording.servo.connected(middle[rows]) * estimate.mechanism.motors
    return out
