"""Intervals of recordings that a servo drives: torque follows from target and predicted motion.

u = A(t) - B w, see `servo_signals`. The first term is a torque like any other; the second acts like
a friction, with `BackEMF`. What is free of the servo changes A, by differences; what that changes
in B acts on the difference of predicted and recorded velocity only, and has no derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, inverse
from frictionid.data.integrals import SignalIntegrals, pieces_of
from frictionid.data.recordings import Dataset
from frictionid.data.servo import Servo
from frictionid.dynamics.tangent.end_states import MotorTorque
from frictionid.dynamics.tangent.tensor_law import SmoothedLaw
from frictionid.errors import InputError
from frictionid.fitting.parameters.actuator import MOTOR
from frictionid.fitting.parameters.parameter_block import (
    Estimate,
    Parameter,
    ParameterBlock,
    free_blocks,
)
from frictionid.fitting.shooting.problem import Linearisation, ShootingProblem, shooting_problem
from frictionid.fitting.shooting.sample_intervals import Intervals
from frictionid.fitting.shooting.servo_signals import damping, torque_signals
from frictionid.fitting.shooting.settings import Settings
from frictionid.friction import Inputs, Law, LawParameter, Memory
from frictionid.friction.coordinates import refuse_coupled
from frictionid.friction.law import NUMERICAL_WIDTH

_SHARPER = 0.2  # of the smoothing of the other law


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
        own: Array = self.law.torque(theta[..., :-1], _felt(theta, x), memory)
        return own + theta[..., -1] * x.w

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return self.law.advance(theta[..., :-1], _felt(theta, x), memory, dt)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        # w says nothing but the direction here: the joint is at rest
        level: Array = self.law.limit(theta[..., :-1], x, memory)
        return level


def _felt(theta: Array, x: Inputs) -> Inputs:
    return x._replace(u=x.u - theta[..., -1] * x.w)


def with_back_emf(law: Law) -> BackEMF:
    """The law with back-EMF, its smoothing so narrow that the step asks at the joint's velocity.

    Where the step goes round a law's smoothing it asks for the torque at a speed just beyond. That
    does not matter for friction, which hardly changes there, but back-EMF changes more.
    """
    if 0 < law.width <= NUMERICAL_WIDTH:
        law = law.with_width(_SHARPER * law.width)
    return BackEMF(law, law.width, "")


_SHARE = 1e-4  # of a constant, by which it is changed for a difference
_CHANGE = {"s": 1e-4, "rad": 1e-4, "m": 1e-4}  # of what may be zero


class Change(NamedTuple):
    """Integrals of A with a parameter above and below its value, and how far that is apart."""

    above: SignalIntegrals
    below: SignalIntegrals
    apart: float


@dataclass(frozen=True, eq=False)
class DrivenProblem(ShootingProblem):
    """Intervals under the torque A, whose changes with the servo's free parameters are known.

    A varies within a piece of time, and moves a joint by M^-1 moment further than its mean would:
    the damping B acts on that, too, and takes B M^-1 moment off its impulse.
    """

    changes: tuple[Change, ...] = ()
    B: Array | None = None

    def _torque_between(self, estimate: Estimate, rows: Array, share: Array) -> MotorTorque:
        motor = super()._torque_between(estimate, rows, share)
        intervals, calibration = self.intervals, estimate.calibration
        edges = intervals.time[rows, None] + intervals.dt[rows, None] * share
        edges = edges - float(calibration.delay)
        of, scale = intervals.recording[rows], calibration.gain * estimate.mechanism.motors
        assert motor.moment_by is not None
        by, moment_by = [motor.by], [motor.moment_by]
        for change in self.changes:
            up, down = (pieces_of(own, of, edges) for own in change[:2])
            by.append(((up.mean - down.mean) * scale / change.apart)[:, None])
            moment_by.append(((up.moment - down.moment) * scale / change.apart)[:, None])
        whole = motor._replace(by=np.concatenate(by, 1), moment_by=np.concatenate(moment_by, 1))
        return self._damped(estimate, whole, rows, np.diff(edges, axis=1).T)

    def _damped(
        self, estimate: Estimate, motor: MotorTorque, rows: Array, width: Array
    ) -> MotorTorque:
        """The torque of intervals (k,), less what damping takes off in pieces of a width (S, k)."""
        if self.B is None or not self.B.any():
            return motor
        assert motor.moment is not None and motor.moment_by is not None
        plant = self._plant(estimate)[self.intervals.recording[rows]]
        M = plant.mechanism.inertia(plant.p, self.intervals.q[rows])
        share = self.B[:, None] * inverse(M) / width[..., None, None]
        off = (share @ motor.moment[..., None])[..., 0]
        off_by = (share[:, None] @ motor.moment_by[..., None])[..., 0]
        return motor._replace(u=motor.u - off, by=motor.by - off_by)


@dataclass(frozen=True, eq=False)
class ServoProblem(ShootingProblem):
    """The problem of recordings that a servo drives.

    inner : blocks of the same parameters, friction's with back-EMF
    """

    inner: ShootingProblem

    def linearise(self, estimate: Estimate, nodes: Array, rows: Array) -> Linearisation:
        """End states and derivatives of some intervals (k,) that begin at nodes (K, s)."""
        out = Linearisation.zeros(nodes, self._angle())
        B, driven = self.damping(estimate), self._driven(estimate)
        for own in np.unique(B[rows], axis=0):
            some = rows[(B[rows] == own).all(axis=1)]
            inside = _inside(estimate, own)
            emf = np.asarray(inside.friction.theta)[:, -1]
            found = replace(driven, B=emf).linearise(inside, nodes, some)
            out.end[some], out.by_start[some] = found.end[some], found.by_start[some]
            out.by[some] = found.by[some]
        return out

    def damping(self, estimate: Estimate) -> Array:
        """B (K, n) [N m s/rad] of the servos in each interval."""
        return damping(self.intervals, estimate.calibration, estimate.mechanism.motors)

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

    def _driven(self, estimate: Estimate) -> DrivenProblem:
        """The inner problem under the torque of an estimate's servos."""
        intervals, B = self.intervals, self.damping(estimate)
        own = replace(intervals)
        own.__dict__["torque"] = torque_signals(intervals, estimate.calibration, B)
        changes = tuple(
            self._change(estimate, block.block, p, B)
            for block in self.blocks
            if block.block.enters == "actuator"
            for p in block.block.parameters(estimate)
        )
        inner = self.inner
        return DrivenProblem(own, inner.blocks, inner.settings, inner.reads, changes)

    def _change(
        self, estimate: Estimate, block: ParameterBlock, parameter: Parameter, B: Array
    ) -> Change:
        value = parameter.value
        step = _CHANGE.get(parameter.unit, _SHARE * abs(value))
        values = (value + step, max(value - step, parameter.low))
        above, below = (
            torque_signals(
                self.intervals, block.with_values(estimate, [(parameter, v)]).calibration, B
            )
            for v in values
        )
        return Change(above, below, values[0] - values[1])


def _inside(estimate: Estimate, B: Array) -> Estimate:
    """The estimate of the inner problem, with damping (n,) of the servos."""
    friction = estimate.friction
    theta = np.asarray(friction.theta, dtype=float)
    emf = (np.asarray(estimate.calibration.gain) * B)[:, None]
    theta = np.concatenate([theta, emf], axis=-1)
    law = with_back_emf(friction.law)
    return estimate._replace(friction=replace(friction, law=law, theta=theta, constraints=None))


def has_actuator(blocks: Sequence[ParameterBlock]) -> bool:
    """Whether torque is to follow from a servo's target and the predicted motion."""
    return any(b.enters == "actuator" for b in blocks)


def with_servo(estimate: Estimate, dataset: Dataset, blocks: Sequence[ParameterBlock]) -> Estimate:
    """The estimate with what the blocks free of the servos: the friction's, or the recordings' own.

    Raises
    ------
    InputError
        Where no recording knows its servo, some do not, or they have different motors.
    """
    names = {b.name for b in blocks if b.enters == "actuator"}
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
    found = {(s.kt, s.R) for s in servos}
    if len(found) > 1:
        raise InputError(
            f"{where}: the recordings have {len(found)} different motors (kt, R): fit those of "
            "each motor alone"
        )
    own = estimate.friction.parameters
    motor = np.array([own.get("kt") or 0.0, own.get("R") or 0.0])
    return motor if (motor > 0).all() else np.array(found.pop())


def servo_problem(
    intervals: Intervals, estimate: Estimate, blocks: Sequence[ParameterBlock], settings: Settings
) -> ServoProblem:
    """The problem of intervals whose torque follows from the targets of servos.

    Raises
    ------
    InputError
        For blocks that no data, or not these, can tell apart.
    """
    name = next(b.name for b in blocks if b.enters == "actuator")
    refuse_coupled(estimate.mechanism, f"block {name!r}")
    law = estimate.friction.law
    if hasattr(estimate.friction.theta, "detach") or law.sample_time is not None:
        raise InputError(
            f"block {name!r}: {law} learns by reverse mode, which knows no voltages: leave the "
            "block out"
        )
    outer = free_blocks(blocks, estimate)
    inner = shooting_problem(intervals, _inside(estimate, np.zeros(intervals.n)), blocks, settings)
    inner = replace(inner, blocks=outer)  # back-EMF is not free
    problem = ServoProblem(intervals, outer, settings, inner.reads, inner)
    _check(problem, estimate)
    return problem


def _check(problem: ServoProblem, estimate: Estimate) -> None:
    """Refuse what these recordings cannot tell of motor, machine and friction together."""
    parameters = {own.block.name: own.parameters for own in problem.blocks}
    free = {p.name for p in parameters.get("actuator", ())}
    known = any(np.isfinite(p.prior) for p in problem.parameters)
    remedy = "fix actuator.kt or actuator.R, or give a prior of the block"
    if "gain" in parameters and "actuator" in parameters:
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
