"""Torque of servos in shooting: their controllers act on the predicted motion.

A controller's torque u(t, q, w) is piecewise linear in the motion. In each sample interval

    u = A(t) - K q - B w,    A(t) = u(t, q_recorded, w_recorded) + K q_recorded + B w_recorded

with K = -du/dq and B = -du/dw at the recorded motion, none where a limit holds or the motor is
disconnected. A is a torque like any other, and knows nothing of the recorded motion while no limit
holds; K and B are a feedback in the physics step. A controller that is late by d sees q - d w. What
is free of the servo changes A, by differences; what that changes in K and B acts on the difference
of predicted and recorded motion only, and has no derivative.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.integrals import SignalIntegrals, integrals_of
from frictionid.data.plants import Calibration, calibrated_servo
from frictionid.data.recordings import Dataset
from frictionid.data.servo import Servo, with_steps
from frictionid.data.signals import Signal, holds
from frictionid.errors import InputError
from frictionid.mechanics import Mechanism

from ..parameter_block import (
    Estimate,
    FreeBlock,
    Parameter,
    ParameterBlock,
    have_prior,
)
from ..parameters import MOTOR
from .sample_intervals import Intervals, ServoGroup, ServoMotion

_SHARE = 1e-4  # of a constant, by which it is changed for a difference
_CHANGE = {"s": 1e-4, "rad": 1e-4, "m": 1e-4}  # of what may be zero
_PARTS = 8  # of an interval, in which the torque goes from line to line


# Integrals of A with E parameters above and below their values, and shares (E, n): one over how far
# these are apart, at the joints whose torque each changes.
Change = tuple[SignalIntegrals, SignalIntegrals, Array]


class Loop(NamedTuple):
    """Servos in closed loop in K intervals.

    feedback (K, 2, n) : K and B, before the gain; q, w (K, n) : recorded motion in the middle of
    each; late (K, 2, n) : stiffness and damping of controllers that see q - delay w, with the gain;
    still : whether A follows from the targets alone, without limit or backlash
    """

    feedback: Array
    q: Array
    w: Array
    late: Array
    still: bool


class Drive(NamedTuple):
    """Motor torque of K intervals, before gain and bias: integrals of A, or of what was logged.

    loop : None without servos; changes : of A by each free parameter of the servos
    """

    torque: SignalIntegrals
    loop: Loop | None = None
    changes: tuple[Change, ...] = ()


def drive_of(intervals: Intervals, calibration: Calibration, mechanism: Mechanism) -> Drive:
    """The torque of the recordings' servos, where there are any, else the logged one."""
    if not intervals.dataset.servos:
        return Drive(intervals.torque)
    loop = loop_of(intervals, calibration, mechanism.motors)
    return Drive(torques_of(intervals, calibration, loop.feedback), loop)


def changes_of(
    intervals: Intervals, estimate: Estimate, blocks: Sequence[FreeBlock], drive: Drive
) -> Iterator[Change]:
    """What free parameters of servos change in the torque of an estimate, in their order.

    Those of joints, each of which changes the torque of its joint alone, are changed together.
    """
    if drive.loop is None:
        return
    for block in (free.block for free in blocks if free.block.enters == "actuator"):
        parameters = block.parameters(estimate)
        kinds = dict.fromkeys(p.place[1:] for p in parameters)
        each = [tuple(p for p in parameters if p.place[1:] == kind) for kind in kinds]
        for group in each if all(p.place for p in parameters) else [(p,) for p in parameters]:
            yield _change(intervals, estimate, block, group, drive.torque, drive.loop)


def _change(
    intervals: Intervals,
    estimate: Estimate,
    block: ParameterBlock,
    group: Sequence[Parameter],
    drive: SignalIntegrals,
    loop: Loop,
) -> Change:
    steps = [_CHANGE.get(p.unit, _SHARE * abs(p.value)) for p in group]
    above = [p.value + step for p, step in zip(group, steps, strict=True)]
    below = [max(p.value - step, p.low) for p, step in zip(group, steps, strict=True)]
    if block.name == "target_delay" and loop.still:
        up, down = (
            drive._replace(begin=drive.begin + x - group[0].value) for (x,) in (above, below)
        )
    else:
        pairs = ([*zip(group, x, strict=True)] for x in (above, below))
        changed = (block.with_values(estimate, values).calibration for values in pairs)
        up, down = (torques_of(intervals, each, loop.feedback) for each in changed)
    joints = [p.place[0] if p.place else slice(None) for p in group]
    share = np.zeros((len(group), intervals.n))
    for row, at, apart in zip(share, joints, np.subtract(above, below), strict=True):
        row[at] = 1.0 / apart
    return up, down, share


def loop_of(intervals: Intervals, calibration: Calibration, motors: Array) -> Loop:
    """The servos' feedback by the recorded motion in the middle of each interval."""
    n, middle, still = intervals.n, intervals.middle - calibration.delay, True
    feedback, (q, w) = np.zeros((len(middle), 2, n)), np.zeros((2, len(middle), n))
    for group, servo, motion, rows, r in _groups(intervals, calibration):
        then = middle[rows] - servo.delay
        within = np.clip(then, group.begin[r], group.end[r]) + group.later[r]
        seen, w[rows] = motion.at(within)
        q[rows] = seen + motion.play_at(within)
        linear = servo.at(then + group.later[r]).linear(seen, w[rows])
        feedback[rows] = linear.feedback * motors
        feedback[rows, 1] -= servo.delay * feedback[rows, 0]
        still &= not np.any(servo.backlash) and not np.ptp(feedback[rows], axis=0).any()
    K, B = np.moveaxis(feedback, 1, 0)
    late = np.stack([K, B - calibration.delay * K], axis=1)
    return Loop(feedback, q, w, calibration.gain * late, still)


def torques_of(intervals: Intervals, calibration: Calibration, feedback: Array) -> SignalIntegrals:
    """Integrals of A along all recordings; those without a servo have the torque as it is logged.

    feedback : (K, 2, n), of each interval
    """
    signals = [recording.torque for recording in intervals.dataset.recordings]
    for group, servo, motion, rows, r in _groups(intervals, calibration):
        edges = intervals.time[rows] - calibration.delay - servo.delay + group.later[r]
        torque = torque_signal(servo, motion, edges, feedback[rows])
        for m in group.members:
            ends = np.array([group.begin[m], group.end[m]]) + group.later[m] + servo.delay
            first, last = np.searchsorted(torque.time, ends)
            inside = slice(first, last + 1)
            # moments that only rounding keeps apart may fall together
            time, kept = np.unique(torque.time[inside] - group.later[m], return_index=True)
            signals[m] = Signal(time, torque.value[inside][kept], "linear")
    return integrals_of(signals)


def _groups(
    intervals: Intervals, calibration: Calibration
) -> Iterator[tuple[ServoGroup, Servo, ServoMotion, Array, Array]]:
    """Groups with their servo and motion, their intervals (k,) and the recording (k,) of each."""
    for group in intervals.servos:
        rows = np.flatnonzero(np.isfinite(group.later[intervals.recording]))
        servo = calibrated_servo(group.servo, calibration)
        motion = group.motion.behind(servo.backlash)
        yield group, servo, motion, rows, intervals.recording[rows]


def torque_signal(servo: Servo, motion: ServoMotion, edges: Array, feedback: Array) -> Signal:
    """A along one recording, with feedback (K, 2, n) from each of the edges (K,) [s] on."""
    changes = edges[1:][(np.diff(feedback, axis=0) != 0).any(axis=(1, 2))]
    feedback = feedback if len(changes) else feedback[:1]
    # without limits A is constant while targets are held
    parts = _PARTS if len(changes) or not all(holds(x) for _, x in servo.targets) else 1
    clock, share = motion.seen.time, np.arange(parts) / parts
    fine = np.append((clock[:-1, None] + np.diff(clock)[:, None] * share).ravel(), clock[-1])
    time = with_steps(fine, np.concatenate([servo.steps(), changes]))
    q, w = motion.at(time)
    place = np.clip(np.searchsorted(edges[: len(feedback)], time, "right") - 1, 0, None)
    K, B = np.moveaxis(feedback[place], 1, 0)
    q_joint, B = q + motion.play_at(time), B + servo.delay * K
    torque = servo.torque(time, q, w) + K * q_joint + B * w
    return Signal(time + servo.delay, torque, "linear")


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
    servos = dataset.servos
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
    if "envelope" in names and new.envelope is None:
        new = replace(new, envelope=_envelope(servos, estimate.mechanism.n, where))
    return estimate._replace(calibration=new)


def _envelope(servos: Sequence[Servo], n: int, where: str) -> Array:
    """Peaks, knees and no-load speeds (n, 3) that a fit begins with."""
    if any(s.envelope is None for s in servos):
        raise InputError(
            f"{where}: give the envelope that the fit begins with: peak_torque, knee_speed and "
            "no_load_speed of [actuator]"
        )
    each = [np.broadcast_to(x, n) for s in servos if s.envelope is not None for x in s.envelope]
    return np.reshape(each, (-1, 3, n)).mean(axis=0).T


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


def check_servo(
    intervals: Intervals, estimate: Estimate, blocks: Sequence[FreeBlock], reads_torque: bool
) -> None:
    """Refuse what recordings cannot tell of motor, machine and friction together.

    reads_torque : whether friction depends on the motor's torque
    """
    parameters = {free.block.name: free.parameters for free in blocks}
    names = {p.name for p in parameters.get("actuator", ())}
    informed = have_prior(parameters)
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
    middle = intervals.middle - estimate.calibration.delay
    for r, recording in enumerate(intervals.dataset.recordings):
        if recording.servo is not None:
            rows = intervals.recording == r
            out[rows] = recording.servo.connected(middle[rows]) * estimate.mechanism.motors
    return out
