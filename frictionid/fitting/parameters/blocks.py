"""Blocks of what sensors and clocks do: torque gain, bias and delay, angle offsets, voltage gain.

u = gain u_logged(t - delay) + bias,    q_measured = q + offset
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.fitting.parameters.parameter_block import (
    Estimate,
    Logged,
    Parameter,
    ParameterBlock,
    Values,
    check_fixed,
    prior_deviation,
    relative_deviation,
    with_known,
)
from frictionid.friction import Friction, SpeedRange, constraints_of
from frictionid.mechanics import Mechanism, configurations


@dataclass(frozen=True)
class _JointSensor(ParameterBlock):
    """One value for each joint, kept in the calibration under the name of the block.

    fixed : joints whose value stays
    """

    fixed: tuple[str, ...] = ()
    prior: float | None = None
    known: tuple[tuple[str, float], ...] = ()
    label: ClassVar[str]
    low: ClassVar[float] = -float("inf")

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        d, deviation = estimate.mechanism, prior_deviation(self.prior, self.name)
        check_fixed(self.fixed, d.joints, self.name, f"{d.kind} has no joint")
        values = getattr(estimate.calibration, self.name)
        units = {"bias": d.torque_units, "offset": d.position_units}.get(self.name, ("1",) * d.n)
        free = (
            Parameter(
                block=self.name,
                name=f"{self.label} of {d.joints[j]}",
                unit=units[j],
                value=float(values[j]),
                low=self.low,
                prior=deviation,
                place=(j,),
            )
            for j in range(estimate.mechanism.n)
            if (d.driven[j] or self.enters == "angle") and d.joints[j] not in self.fixed
        )
        return with_known(free, self.known)

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        new = np.array(getattr(estimate.calibration, self.name), dtype=float)
        for parameter, value in values:
            new[parameter.place[0]] = value
        return estimate._replace(calibration=replace(estimate.calibration, **{self.name: new}))


class GainBlock(_JointSensor):
    """Factor between logged and true motor torque of each driven joint: a wrong gear ratio."""

    name, enters, label, low = "gain", "torque", "torque gain", 0.0

    def torque_slope(self, estimate: Estimate, own: Sequence[Parameter], u: Logged) -> Array:
        return u.torque * _own_joint(own, u.torque)


class BiasBlock(_JointSensor):
    """Constant torque beside the logged one, of each driven joint; `prior` in N m."""

    name, enters, label = "bias", "torque", "torque bias"

    def torque_slope(self, estimate: Estimate, own: Sequence[Parameter], u: Logged) -> Array:
        return 0.0 * u.torque + _own_joint(own, u.torque)


class OffsetBlock(_JointSensor):
    """Measured angle of each joint less the true one; `prior` in rad."""

    name, enters, label = "offset", "angle", "angle offset"


def _own_joint(parameters: Sequence[Parameter], torque: Array) -> Array:
    """One at each parameter's own joint, zero elsewhere, (E, 1, ..., n)."""
    n = torque.shape[-1]
    own = np.eye(n)[np.array([p.place[0] for p in parameters], dtype=int)]
    return own.reshape(len(parameters), *(1,) * (torque.ndim - 1), n)


@dataclass(frozen=True)
class DelayBlock(ParameterBlock):
    """How much later than logged the motor torque acts [s], within `most` either way.

    It is continuous: the logged torque is averaged over each piece of time as it was logged, held
    or interpolated. `prior` in s; `where_sampled`: only where a motor's torque is sampled.
    """

    most: float = 0.2
    prior: float | None = None
    where_sampled: bool = False
    known: tuple[tuple[str, float], ...] = ()
    name, enters = "delay", "torque"

    def __post_init__(self) -> None:
        if not self.most > 0:
            raise InputError(f"block 'delay': most = {self.most} s must be positive")

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        deviation = prior_deviation(self.prior, self.name)
        value = float(estimate.calibration.delay)
        own = Parameter(self.name, "torque delay", "s", value, -self.most, self.most, deviation)
        return with_known([own], self.known)

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        delay = np.asarray(float(values[0][1]))
        return estimate._replace(calibration=replace(estimate.calibration, delay=delay))

    def torque_slope(self, estimate: Estimate, own: Sequence[Parameter], u: Logged) -> Array:
        return (estimate.calibration.gain * u.by_delay)[None]


@dataclass(frozen=True)
class FrictionBlock(ParameterBlock):
    """Parameters of the law, but for those whose names are `fixed`.

    `prior` is a standard deviation relative to each value. `support` are the places (joint,
    parameter) that may be free, None for all: see `on_support`. Those of equal joints, as the
    friction's constraints name them, are shared.
    """

    fixed: tuple[str, ...] = ()
    prior: float | None = None
    support: tuple[tuple[int, int], ...] | None = None
    name, enters = "friction", "friction"

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        law, theta = estimate.friction.law, np.asarray(estimate.friction.theta)
        check_fixed(self.fixed, law.names, self.name, f"{law} has no parameter")
        joints = estimate.mechanism.friction_names
        has = law.has_parameters(len(theta))
        own = estimate.friction.constraints
        own = own or constraints_of(law, _no_range(len(theta)))
        owner = own.owner
        return tuple(
            Parameter(
                block=self.name,
                name=f"{name} of {joints[j]}",
                unit=estimate.friction.units_at(j)[i],
                value=float(theta[j, i]),
                low=float(own.low[j, i]),
                high=float(own.high[j, i]),
                prior=min(
                    relative_deviation(self.prior, self.name, float(theta[j, i])),
                    float(own.deviation[j, i]),
                ),
                place=(j, i),
                mean=float(own.mean[j, i]) if np.isfinite(own.deviation[j, i]) else None,
                shared=tuple(
                    (f"{name} of {joints[k]}", (int(k), i))
                    for k in np.flatnonzero(owner == j)
                    if k != j
                ),
            )
            for j in np.unique(owner).tolist()
            for i, name in enumerate(law.names)
            if name not in self.fixed
            and has[j, i]
            and (self.support is None or (j, i) in self.support)
        )

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        theta = np.array(estimate.friction.theta, dtype=float)
        for parameter, value in values:
            for place in parameter.places:
                theta[place] = value
        return estimate._replace(friction=replace(estimate.friction, theta=theta))


def _no_range(n: int) -> SpeedRange:
    """Range of speeds of n joints about whose motion nothing is known."""
    return SpeedRange(np.full(n, 1e-9), np.full(n, np.inf))


def on_support(blocks: Sequence[ParameterBlock], friction: Friction) -> tuple[ParameterBlock, ...]:
    """The blocks; where the law is sparse, friction's only frees what the friction (n, P) has."""
    if not friction.law.is_sparse:
        return tuple(blocks)
    has = tuple((int(j), int(i)) for j, i in np.argwhere(np.asarray(friction.theta) != 0))
    return tuple(replace(b, support=has) if isinstance(b, FrictionBlock) else b for b in blocks)


_KEPT = 0.05  # of the nominal mass matrix that is left in any direction


@dataclass(frozen=True)
class InertiaBlock(ParameterBlock):
    """Base parameters, but for those whose names are `fixed`.

    M(q) stays positive definite for all q, see `inside`. `prior` is a standard deviation relative
    to each value; of a value that is zero, to the mean size of those with the same unit. The
    inertia of a rotor does not become negative.
    """

    fixed: tuple[str, ...] = ()
    prior: float | None = None
    known: tuple[tuple[str, float], ...] = ()
    name, enters = "inertia", "base"

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        base, mechanism = np.asarray(estimate.calibration.base), estimate.mechanism
        names, units = mechanism.base_names, mechanism.base_units
        check_fixed(self.fixed, names, self.name, f"{mechanism.kind} has no base parameter")
        sizes = _sizes(base, units)
        rotors = {p.name for p in mechanism.parameters if p.rotor}
        free = (
            Parameter(
                block=self.name,
                name=name,
                unit=unit,
                value=float(base[i]),
                low=0.0 if name in rotors else -np.inf,
                prior=relative_deviation(self.prior, self.name, sizes[i]),
                place=(i,),
            )
            for i, (name, unit) in enumerate(zip(names, units, strict=True))
            if name not in self.fixed
        )
        return with_known(free, self.known)

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        new = np.array(estimate.calibration.base, dtype=float)
        for parameter, value in values:
            new[parameter.place] = value
        nominal = estimate.mechanism.base(estimate.mechanism.nominal())
        base = inside(estimate.mechanism, np.asarray(nominal, dtype=float), new)
        return estimate._replace(calibration=replace(estimate.calibration, base=base))


def _sizes(base: Array, units: tuple[str, ...]) -> list[float]:
    """Sizes of base parameters: of one that is zero, the mean of those with its unit."""
    pairs = [(abs(float(b)), unit) for b, unit in zip(base, units, strict=True)]
    mean = {unit: float(np.mean([b for b, own in pairs if own == unit])) for unit in units}
    return [b or mean[unit] for b, unit in pairs]


def inside(mechanism: Mechanism, base: Array, wanted: Array) -> Array:
    """Base parameters on the way from `base` to the `wanted` ones, with M positive definite.

    Where M of the wanted ones, relative to that of `base`, the nominal machine, has no eigenvalue
    below 0.05 at any q, they are reached; otherwise the way p + s (wanted - p) ends before it:
    s = 0.95 / (1 - smallest eigenvalue). So steps may go on along the border.

    >>> from frictionid.mechanics import pendulum
    >>> m = pendulum()
    >>> inside(m, np.array([1.0, 2.0]), np.array([1.5, 3.0])).round(9)
    array([1.5, 3. ])
    >>> inside(m, np.array([1.0, 2.0]), np.array([-4.0, 2.0])).round(9)
    array([0.05, 2.  ])
    """
    q = configurations(mechanism.n, 13)
    now, then = (mechanism.inertia(p, q) for p in (base, wanted))
    root = np.linalg.inv(np.linalg.cholesky(now))
    least = float(np.linalg.eigvalsh(root @ then @ np.swapaxes(root, -1, -2)).min())
    share = 1.0 if least >= _KEPT else (1.0 - _KEPT) / (1.0 - least)
    return base + share * (wanted - base)
