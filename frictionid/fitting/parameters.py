"""Blocks of parameters: friction, base parameters, sensors and clocks, servos.

u = gain u_logged(t - delay) + bias,    q_measured = q + offset
u = controller(q*(t - target_delay), q - z, w),   dz = dq while |z| < backlash/2
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import DataRange, Friction, constraints_of, present
from frictionid.mechanics import Mechanism, configurations

from .parameter_block import FREE, Estimate, Parameter, ParameterBlock, check_fixed

MOTOR = ("kt", "R")
_UNITS = ("N m/A", "Ohm")
_LEAST = 0.05  # of where a motor's constant begins: it stays positive
_FLANGE = 0.01  # of the largest inertia of any joint
_HEAVIEST = 30.0  # of the largest inertia of a joint: a rotor, seen at the joint
_KEPT = 0.05  # of the nominal mass matrix that is left in any direction
_ROTORS = 0.01  # of the rotors, in that


@dataclass(frozen=True)
class FrictionBlock(ParameterBlock):
    """Parameters of the law.

    `support` are the places (joint, parameter) that may be free, None for all: see `on_support`.
    Those of equal joints, as the friction's constraints name them, are shared.
    """

    support: tuple[tuple[int, int], ...] | None = None
    name, enters, relative = "friction", "friction", True

    def names(self, estimate: Estimate) -> tuple[Sequence[str], str]:
        return estimate.friction.law.names, f"{estimate.friction.law} has no parameter"

    def listed(self, estimate: Estimate) -> Iterator[Parameter]:
        friction, joints = estimate.friction, estimate.mechanism.friction_names
        law, theta = friction.law, self.numbers(estimate)
        has = law.has_parameters(len(theta))
        nothing = DataRange(np.full(len(theta), 1e-9), np.full(len(theta), np.inf))
        limits = friction.constraints or constraints_of(law, nothing)
        for j in np.unique(limits.owner).tolist():
            twins = [int(k) for k in np.flatnonzero(limits.owner == j) if k != j]
            units = friction.units_at(j)
            for i, name in enumerate(law.names):
                if not has[j, i] or (self.support is not None and (j, i) not in self.support):
                    continue
                deviation = float(limits.deviation[j, i])
                yield Parameter(
                    *(self.name, f"{name} of {joints[j]}", units[i]),
                    float(theta[j, i]),
                    *(float(limits.low[j, i]), float(limits.high[j, i]), deviation),
                    (j, i),
                    float(limits.mean[j, i]) if np.isfinite(deviation) else None,
                    tuple((f"{name} of {joints[k]}", (k, i)) for k in twins),
                    size=float(limits.size[j, i]),
                )

    def numbers(self, estimate: Estimate) -> Array:
        return np.asarray(estimate.friction.theta, dtype=float)

    def with_numbers(self, estimate: Estimate, numbers: Array) -> Estimate:
        return estimate._replace(friction=replace(estimate.friction, theta=numbers))


def on_support(blocks: Sequence[ParameterBlock], friction: Friction) -> tuple[ParameterBlock, ...]:
    """The blocks; of terms that are optional friction's only frees those that friction has."""
    law, theta = friction.law, np.asarray(friction.theta)
    there = present(law, theta)
    if (there == law.has_parameters(len(theta))).all():
        return tuple(blocks)
    has = tuple((int(j), int(i)) for j, i in np.argwhere(there))
    return tuple(replace(b, support=has) if isinstance(b, FrictionBlock) else b for b in blocks)


@dataclass(frozen=True)
class InertiaBlock(ParameterBlock):
    """Base parameters; the inertia of a rotor does not become negative.

    M(q) stays positive definite for all q, see `inside`, where it must be `definite`: many that
    nothing determines would hold the others up. Tolerances of the mechanism are priors about the
    nominal values. A prior is relative to each value; of a value that is zero, to the mean size of
    those with the same unit.
    """

    definite: bool = field(default=True, repr=False)
    name, enters, part, relative = "inertia", "base", "base", True

    def names(self, estimate: Estimate) -> tuple[Sequence[str], str]:
        mechanism = estimate.mechanism
        return mechanism.base_names, f"{mechanism.kind} has no base parameter"

    def sizes(self, parameters: Sequence[Parameter]) -> list[float]:
        sizes = {
            unit: float(np.mean([abs(p.value) for p in parameters if p.unit == unit]))
            for unit in {p.unit for p in parameters}
        }
        return [abs(p.value) or sizes[p.unit] for p in parameters]

    def listed(self, estimate: Estimate) -> Iterator[Parameter]:
        base, mechanism = self.numbers(estimate), estimate.mechanism
        rotors = {p.name for p in mechanism.parameters if p.rotor}
        tolerances = mechanism.base_tolerances()
        nominal, most = mechanism.nominal_base, heaviest_rotors(mechanism)
        names = zip(mechanism.base_names, mechanism.base_units, strict=True)
        for i, (name, unit) in enumerate(names):
            low, tolerance = 0.0 if name in rotors else -np.inf, float(tolerances[i])
            mean = float(nominal[i]) if np.isfinite(tolerance) else None
            value = float(base[i])
            high = max(float(most[i]), value)
            yield Parameter(self.name, name, unit, value, low, high, tolerance, (i,), mean)

    def with_numbers(self, estimate: Estimate, numbers: Array) -> Estimate:
        base = inside(estimate.mechanism, numbers) if self.definite else numbers
        return super().with_numbers(estimate, base)


def heaviest_rotors(mechanism: Mechanism) -> Array:
    """Largest plausible base parameters (nb,): a rotor outweighs its joint 30 times; others inf.

    A joint that a huge rotor holds fast shows nothing any more, and a fit would not come back. A
    flange alone is as good as nothing: 1 % of the machine's largest inertia counts at least.
    """
    rotors, base = {p.name for p in mechanism.parameters if p.rotor}, mechanism.nominal_base
    q, out = configurations(mechanism.n, 9), np.full(len(base), np.inf)
    inertia = np.diagonal(mechanism.inertia(base, q), axis1=-2, axis2=-1)
    units = np.array(mechanism.position_units)
    alike = units[:, None] == units  # masses and moments of inertia are not compared
    largest = inertia.max(axis=0)
    most = _HEAVIEST * np.maximum(largest, _FLANGE * (alike * largest).max(axis=1))
    for i, name in enumerate(mechanism.base_names):
        if name in rotors:
            unit = mechanism.inertia(base + np.eye(len(base))[i], q)
            by = (np.diagonal(unit, axis1=-2, axis2=-1) - inertia).max(axis=0)
            out[i] = np.min(most[by > 0] / by[by > 0])
    return out


def inside(mechanism: Mechanism, wanted: Array) -> Array:
    """Base parameters on the way from the nominal to the `wanted` ones, with M positive definite.

    Where M of the wanted ones less the least one is positive definite at all q, they are reached;
    otherwise the way p + s (wanted - p) ends where it no longer is, so that steps may go on along
    the border.

    >>> from frictionid.mechanics import pendulum
    >>> m = pendulum(mass=1.0, length=1.0)
    >>> [inside(m, share * m.nominal_base) / m.nominal_base for share in (2.0, -3.0)]
    [array([2., 2.]), array([0.05, 0.05])]
    """
    q, least, root = _least_inertia(mechanism)
    over = mechanism.inertia(wanted, q) - least
    with suppress(np.linalg.LinAlgError):  # far cheaper than eigenvalues, and nearly always enough
        np.linalg.cholesky(over)
        return wanted
    lowest = float(np.linalg.eigvalsh(root @ over @ np.swapaxes(root, -1, -2)).min())
    nominal = mechanism.nominal_base
    return nominal + (wanted - nominal) / max(1.0 - lowest, 1.0)


@lru_cache(maxsize=8)
def _least_inertia(mechanism: Mechanism) -> tuple[Array, Array, Array]:
    """Positions q (C, n), the least M (C, n, n) there, and R: R (M - least) R' is 1 of nominal M.

    A twentieth of the nominal M, in which rotors count little: a file may make them up.
    """
    q, light = configurations(mechanism.n, 13), mechanism.nominal()
    light |= {p.name: _ROTORS * light[p.name] for p in mechanism.parameters if p.rotor}
    least = _KEPT * mechanism.inertia(mechanism.base(light), q)
    nominal = mechanism.inertia(mechanism.nominal_base, q)
    return q, least, np.linalg.inv(np.linalg.cholesky(nominal - least))


# --- Sensors, clocks and servos ---------------------------------------------------------------


@dataclass(frozen=True)
class _Late(ParameterBlock):
    """A delay [s] of at most `most`, either way."""

    most: float = 0.1
    label: ClassVar[str]

    def __post_init__(self) -> None:
        if not self.most > 0:
            raise InputError(f"block {self.name!r}: most = {self.most} s must be positive")

    @property
    def least(self) -> float:
        """Lower bound [s]."""
        return -self.most

    def listed(self, estimate: Estimate) -> Iterator[Parameter]:
        value = float(self.numbers(estimate))
        yield Parameter(self.name, self.label, "s", value, self.least, self.most)


@dataclass(frozen=True)
class DelayBlock(_Late):
    """How much later than logged the motor torque acts [s], within `most` either way.

    It is continuous: the logged torque is averaged over each piece of time as it was logged, held
    or interpolated.
    """

    most: float = 0.2
    name, enters, label = "delay", "torque", "torque delay"

    def torque_slope(
        self, estimate: Estimate, free: Sequence[Parameter], u: Array, by_delay: Array
    ) -> Array:
        return (estimate.calibration.gain * by_delay)[None]


class TargetDelayBlock(_Late):
    """How much later than logged a servo's targets act [s], up to `most`.

    Bus and controller are late with a new target, but not with what the encoder reads: unlike a
    late torque that takes no damping.
    """

    name, enters, label = "target_delay", "actuator", "target delay"
    least = 0.0  # no controller acts on a target before it gets it


@dataclass(frozen=True)
class _EachJoint(ParameterBlock):
    """One value for each driven joint, of an angle's sensor for each joint."""

    label: ClassVar[str]
    low: ClassVar[float] = -FREE

    def listed(self, estimate: Estimate) -> Iterator[Parameter]:
        d, values = estimate.mechanism, self.numbers(estimate)
        positions = d.position_units
        units = {"bias": d.torque_units, "offset": positions, "backlash": positions}
        for j, joint in enumerate(d.joints):
            if d.driven[j] or self.enters == "angle":
                unit = units.get(self.name, ("1",) * d.n)[j]
                name, value = f"{self.label} of {joint}", float(values[j])
                yield Parameter(self.name, name, unit, value, self.low, place=(j,))


class GainBlock(_EachJoint):
    """Factor between logged and true motor torque of each driven joint: a wrong gear ratio."""

    name, enters, label, low = "gain", "torque", "torque gain", 0.0

    def torque_slope(
        self, estimate: Estimate, free: Sequence[Parameter], u: Array, by_delay: Array
    ) -> Array:
        return u * _at_joints(free, u)


class BiasBlock(_EachJoint):
    """Constant torque beside the logged one, of each driven joint; `prior` in N m."""

    name, enters, label = "bias", "torque", "torque bias"

    def torque_slope(
        self, estimate: Estimate, free: Sequence[Parameter], u: Array, by_delay: Array
    ) -> Array:
        return 0.0 * u + _at_joints(free, u)


class OffsetBlock(_EachJoint):
    """Measured angle of each joint less the true one; `prior` in rad."""

    name, enters, label = "offset", "angle", "angle offset"


class BacklashBlock(_EachJoint):
    """Backlash [rad] between each driven joint and the encoder that its controller reads.

    With a gain P that is a torque of +-P backlash/2 with hysteresis: one gain alone shows it by its
    hysteresis only, several gains tell it from friction. `prior` in rad.
    """

    name, enters, label, low = "backlash", "actuator", "backlash", 0.0


class EnvelopeBlock(ParameterBlock):
    """Peak torque, knee and no-load speed of each driven joint, see `Envelope`.

    Those of a servo that has an envelope, by which a fit begins; where no torque reaches a part of
    it, that part is not identified. `prior` is relative.
    """

    name, enters, relative = "envelope", "actuator", True
    labels: ClassVar = ("peak torque", "knee speed", "no-load speed")

    def names(self, estimate: Estimate) -> tuple[Sequence[str], str]:
        return (*self.labels, *estimate.mechanism.joints), "there is no joint, and no part"

    def listed(self, estimate: Estimate) -> Iterator[Parameter]:
        d, values = estimate.mechanism, self.numbers(estimate)
        for i, label in enumerate(self.labels):
            for j in np.flatnonzero(d.driven).tolist():
                unit = d.torque_units[j] if i == 0 else f"{d.position_units[j]}/s"
                name, value = f"{label} of {d.joints[j]}", float(values[j, i])
                yield Parameter(self.name, name, unit, value, _LEAST * value, place=(j, i))


def _at_joints(parameters: Sequence[Parameter], torque: Array) -> Array:
    """One at each parameter's joint, zero elsewhere, (E, 1, ..., n)."""
    n = torque.shape[-1]
    rows = np.eye(n)[np.array([p.place[0] for p in parameters], dtype=int)]
    return rows.reshape(len(parameters), *(1,) * (torque.ndim - 1), n)


@dataclass(frozen=True)
class ActuatorBlock(ParameterBlock):
    """Torque constant kt and resistance R of the motors.

    With this block motor torque is no input: u = kt (V - kt w)/R of the recorded voltage V and the
    *predicted* velocity w while the motor is connected, and nothing while it is not. The back-EMF
    kt^2/R w acts like viscous friction, only that it goes with the connection: recordings with the
    motor disconnected, a fixed constant, or a prior tell the two apart. `prior` is relative.
    """

    name, enters, part, relative = "actuator", "actuator", "motor", True

    def __post_init__(self) -> None:
        check_fixed(self.fixed, MOTOR, "a motor has no constant", self.name)

    def names(self, estimate: Estimate) -> tuple[Sequence[str], str]:
        return MOTOR, "a motor has no constant"

    def listed(self, estimate: Estimate) -> Iterator[Parameter]:
        values = self.numbers(estimate).tolist()
        for name, unit, value in zip(MOTOR, _UNITS, values, strict=True):
            yield Parameter(self.name, name, unit, value, _LEAST * value)

    def places(self, parameter: Parameter) -> Sequence[int]:
        return [MOTOR.index(parameter.name)]
