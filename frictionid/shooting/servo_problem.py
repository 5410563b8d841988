"""Intervals of recordings that a servo drives: torque follows from voltage and predicted motion.

u = (kt/R) V - (kt^2/R) w while the motor is connected, else zero. The first term is a torque like
any other, of a logged V with the gain kt/R; the second acts like a friction, with `BackEMF`. So the
inner problem has the voltage for a torque, and gain and back-EMF as free parameters; derivatives in
kt and R follow by the chain rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import applied_voltage
from frictionid.data.signals import Signal
from frictionid.errors import InputError
from frictionid.friction.coordinates import refuse_coupled
from frictionid.shooting.back_emf import with_back_emf
from frictionid.shooting.parameters.actuator import MOTOR
from frictionid.shooting.parameters.friction import FrictionBlock
from frictionid.shooting.parameters.parameter_block import Estimate, ParameterBlock, free_blocks
from frictionid.shooting.parameters.sensors import VoltageBlock
from frictionid.shooting.problem import Linearisation, ShootingProblem, shooting_problem
from frictionid.shooting.sample_intervals import Intervals
from frictionid.shooting.settings import Settings


@dataclass(frozen=True, eq=False)
class ServoProblem(ShootingProblem):
    """The problem of recordings that a servo drives.

    inner : with the voltage for a torque, gain and back-EMF free
    """

    inner: ShootingProblem

    def linearise(self, estimate: Estimate, nodes: Array, rows: Array) -> Linearisation:
        """End states and derivatives of some intervals (k,) that begin at nodes (K, s)."""
        out = Linearisation.zeros(nodes, self._angle())
        connected = self.connected(estimate)
        for pattern in np.unique(connected[rows], axis=0):
            some = rows[(connected[rows] == pattern).all(axis=1)]
            own = self.inner.linearise(_inside(estimate, pattern), nodes, some)
            out.end[some], out.by_start[some] = own.end[some], own.by_start[some]
            out.by[some] = own.by[some] @ self.chain_rule(estimate, pattern)
        return out

    def connected(self, estimate: Estimate) -> Array:
        """Whether (K, n) the motor of a joint is connected in the middle of an interval: 1 or 0."""
        intervals = self.intervals
        out = np.zeros((len(intervals.dt), intervals.n))
        middle = intervals.time + intervals.dt / 2 - float(estimate.calibration.delay)
        driven = estimate.mechanism.motors
        for r, recording in enumerate(intervals.dataset.recordings):
            if recording.servo is not None:
                own = intervals.recording == r
                out[own] = recording.servo.connected(middle[own]) * driven
        return out

    def chain_rule(self, estimate: Estimate, connected: Array) -> Array:
        """Derivatives (D', D) of the inner parameters in the free ones, by joints' connection."""
        kt, R = (float(x) for x in np.asarray(estimate.calibration.motor))
        by_motor = {
            "gain": {"kt": 1 / R, "R": -kt / R**2},
            "back_emf": {"kt": 2 * kt / R, "R": -((kt / R) ** 2)},
        }
        column = {(p.block, p.name): k for k, p in enumerate(self.parameters)}
        out = np.zeros((self.inner.count, self.count))
        last = len(estimate.friction.law.names)
        for row, p in enumerate(self.inner.parameters):
            if (p.block, p.name) in column:
                out[row, column[p.block, p.name]] = 1.0
                continue
            emf = p.block == "friction" and p.place[1] == last
            share = connected[p.place[0]] if emf else 1.0
            for name in MOTOR:
                if ("actuator", name) in column:
                    slope = by_motor["back_emf" if emf else "gain"][name]
                    out[row, column["actuator", name]] = share * slope
        return out


def _inside(estimate: Estimate, connected: Array) -> Estimate:
    """The estimate of the inner problem, with the motors (n,) that are connected."""
    kt, R = (float(x) for x in np.asarray(estimate.calibration.motor))
    friction, n = estimate.friction, estimate.mechanism.n
    theta = np.asarray(friction.theta, dtype=float)
    emf = (kt**2 / R * connected)[:, None]
    law = with_back_emf(friction.law)
    theta = np.concatenate([theta, emf], axis=-1)
    friction = replace(friction, law=law, theta=theta, constraints=None)
    calibration = replace(estimate.calibration, gain=np.full(n, kt / R), motor=None)
    return estimate._replace(friction=friction, calibration=calibration)


def has_actuator(blocks: Sequence[ParameterBlock]) -> bool:
    """Whether torque is to follow from a servo's voltage."""
    return any(b.name == "actuator" for b in blocks)


def with_motor(estimate: Estimate, dataset: Dataset) -> Estimate:
    """The estimate with motor constants: those that the friction brings, or the recordings'.

    Raises
    ------
    InputError
        Where no recording knows its servo, some do not, or they have different motors.
    """
    if estimate.calibration.motor is not None:
        return estimate
    own = estimate.friction.parameters
    found = {(r.servo.kt, r.servo.R) for r in dataset.recordings if r.servo is not None}
    where = f"data set {dataset.name!r}, block 'actuator'"
    remedy = "leave the block out, and free 'gain' for a wrong torque constant"
    if not found:
        raise InputError(f"{where}: no recording knows the servo that drives it: {remedy}")
    for r in dataset.recordings:
        if r.servo is None and np.any(r.torque.value):
            raise InputError(
                f"{where}: recording {r.name!r} has a torque and no servo: leave it out, or "
                f"{remedy}"
            )
    if len(found) > 1:
        raise InputError(
            f"{where}: the recordings have {len(found)} different motors (kt, R): fit those of "
            "each motor alone"
        )
    motor = np.array([own.get("kt") or 0.0, own.get("R") or 0.0])
    motor = motor if (motor > 0).all() else np.array(found.pop())
    return estimate._replace(calibration=replace(estimate.calibration, motor=motor))


def servo_problem(
    intervals: Intervals, estimate: Estimate, blocks: Sequence[ParameterBlock], settings: Settings
) -> ServoProblem:
    """The problem of intervals whose torque follows from the voltage of servos.

    Raises
    ------
    InputError
        For blocks that no data, or not these, can tell apart.
    """
    refuse_coupled(estimate.mechanism, "block 'actuator'")
    law = estimate.friction.law
    if hasattr(estimate.friction.theta, "detach") or law.sample_time is not None:
        raise InputError(
            f"block 'actuator': {law} learns by reverse mode, which knows no voltages: leave the "
            "block out"
        )
    own = next((b for b in blocks if b.enters == "friction"), None)
    friction = FrictionBlock(law.names if own is None else own.fixed)
    others = [b for b in blocks if b.name not in ("actuator", "friction")]
    volts = replace(
        intervals.dataset, recordings=tuple(_as_voltage(r) for r in intervals.dataset.recordings)
    )
    outer = free_blocks(blocks, estimate)
    inner = shooting_problem(
        replace(intervals, dataset=volts),
        _inside(estimate, np.ones(intervals.n)),
        (friction, *others, VoltageBlock()),
        settings,
    )
    problem = ServoProblem(intervals, outer, settings, inner.reads, inner)
    _check(problem, estimate)
    return problem


def _as_voltage(recording: Recording) -> Recording:
    """The recording with the voltage [V] of its motors in the place of their torque."""
    if recording.servo is None:
        return recording
    volts: Signal = applied_voltage(recording.servo, recording.angle)
    return replace(recording, torque=volts)


def _check(problem: ServoProblem, estimate: Estimate) -> None:
    """Refuse what these recordings cannot tell of motor, machine and friction together."""
    parameters = {own.block.name: own.parameters for own in problem.blocks}
    free = {p.name for p in parameters["actuator"]}
    known = any(np.isfinite(p.prior) for p in problem.parameters)
    remedy = "fix actuator.kt or actuator.R, or give a prior of the block"
    if "gain" in parameters:
        raise InputError(
            "blocks 'gain' and 'actuator': a gain of the torque is one of kt/R: leave one out"
        )
    everything = len(estimate.mechanism.base_names)
    scale = len(parameters.get("inertia", ())) == everything and parameters.get("friction")
    if scale and "R" in free and not known:
        raise InputError(
            "blocks 'actuator' and 'inertia' with all base parameters free: a smaller R with "
            "larger inertias and friction gives the same motion: fix actuator.R, or one base "
            f"parameter that you are sure of, such as {estimate.mechanism.base_names[-1]!r}, or "
            "give a prior"
        )
    viscous = any(p.name.startswith("viscous") for p in parameters.get("friction", ()))
    rows = problem.connected(estimate)
    passive = bool((rows == 0).all(axis=1).any())
    if free == set(MOTOR) and viscous and not (known or passive or problem.reads.u):
        raise InputError(
            "block 'actuator': while the motor is connected only kt/R and the sum of viscous "
            f"friction and kt^2/R show in the motion: {remedy}, or add recordings in which it is "
            "disconnected"
        )
