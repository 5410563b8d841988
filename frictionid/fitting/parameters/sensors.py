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
    with_known,
)


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
class VoltageBlock(ParameterBlock):
    """Gain kt/R between voltage and torque, one for all joints: part of the block `actuator`."""

    name, enters = "voltage", "torque"

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        return (Parameter(self.name, "kt/R", "N m/V", float(estimate.calibration.gain[0])),)

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        gain = np.full(estimate.mechanism.n, float(values[0][1]))
        return estimate._replace(calibration=replace(estimate.calibration, gain=gain))

    def torque_slope(self, estimate: Estimate, own: Sequence[Parameter], u: Logged) -> Array:
        return u.torque[None]
