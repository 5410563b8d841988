"""What a fit frees of servos: where it begins, and what recordings cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset
from frictionid.data.servo import Servo
from frictionid.errors import InputError
from frictionid.fitting.parameters.blocks import MOTOR
from frictionid.fitting.parameters.parameter_block import Estimate, FreeBlock, ParameterBlock
from frictionid.fitting.shooting.sample_intervals import Intervals
from frictionid.friction.coordinates import refuse_coupled


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
