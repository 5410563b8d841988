"""Blocks of a servo: constants of its motor, delay of its targets, backlash before its encoder."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frictionid.errors import InputError
from frictionid.fitting.parameters.parameter_block import (
    Estimate,
    Parameter,
    ParameterBlock,
    Values,
    check_fixed,
    prior_deviation,
    relative_deviation,
    with_known,
)

MOTOR = ("kt", "R")
_UNITS = ("N m/A", "Ohm")
_LEAST = 0.05  # of where a constant begins: it stays positive


@dataclass(frozen=True)
class ActuatorBlock(ParameterBlock):
    """Torque constant kt and resistance R of the motors, but for those that are `fixed`.

    With this block motor torque is no input: u = kt (V - kt w)/R of the recorded voltage V and the
    *predicted* velocity w while the motor is connected, and nothing while it is not. The back-EMF
    kt^2/R w acts like viscous friction, only that it goes with the connection: recordings with the
    motor disconnected, a fixed constant, or a prior tell the two apart. `prior` is a standard
    deviation relative to each value.
    """

    fixed: tuple[str, ...] = ()
    prior: float | None = None
    name, enters = "actuator", "actuator"

    def __post_init__(self) -> None:
        check_fixed(self.fixed, MOTOR, self.name, "a motor has no constant")

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        values = np.asarray(estimate.calibration.motor, dtype=float)
        return tuple(
            Parameter(
                block=self.name,
                name=name,
                unit=unit,
                value=float(value),
                low=_LEAST * float(value),
                prior=relative_deviation(self.prior, self.name, float(value)),
            )
            for name, unit, value in zip(MOTOR, _UNITS, values, strict=True)
            if name not in self.fixed
        )

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        motor = np.array(estimate.calibration.motor, dtype=float)
        for parameter, value in values:
            motor[MOTOR.index(parameter.name)] = value
        return estimate._replace(calibration=replace(estimate.calibration, motor=motor))


@dataclass(frozen=True)
class TargetDelayBlock(ParameterBlock):
    """How much later than logged a servo's targets act [s], up to `most`.

        u(t) = controller(q*(t - target_delay), q(t), w(t))

    Bus and controller are late with a new target, but not with what the encoder reads: unlike a
    late torque that takes no damping. `prior` in s.
    """

    most: float = 0.1
    prior: float | None = None
    known: tuple[tuple[str, float], ...] = ()
    name, enters = "target_delay", "actuator"

    def __post_init__(self) -> None:
        if not self.most > 0:
            raise InputError(f"block 'target_delay': most = {self.most} s must be positive")

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        value = float(np.asarray(estimate.calibration.target_delay))
        deviation = prior_deviation(self.prior, self.name)
        own = Parameter(self.name, "target delay", "s", value, -self.most, self.most, deviation)
        return with_known([own], self.known)

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        delay = np.asarray(float(values[0][1]))
        return estimate._replace(calibration=replace(estimate.calibration, target_delay=delay))


@dataclass(frozen=True)
class BacklashBlock(ParameterBlock):
    """Backlash [rad] between each driven joint and the encoder that its controller reads.

        u = controller(q*, q - z, w),    dz = dq while |z| < backlash/2

    With a gain P that is a torque of +-P backlash/2 with hysteresis: one gain alone shows it by its
    hysteresis only, several gains tell it from friction. `prior` in rad.
    """

    fixed: tuple[str, ...] = ()
    prior: float | None = None
    known: tuple[tuple[str, float], ...] = ()
    name, enters = "backlash", "actuator"

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        d = estimate.mechanism
        check_fixed(self.fixed, d.joints, self.name, f"{d.kind} has no joint")
        deviation = prior_deviation(self.prior, self.name)
        free = (
            Parameter(
                block=self.name,
                name=f"backlash of {d.joints[j]}",
                unit=d.position_units[j],
                value=float(np.asarray(estimate.calibration.backlash)[j]),
                low=0.0,
                prior=deviation,
                place=(j,),
            )
            for j in range(d.n)
            if d.driven[j] and d.joints[j] not in self.fixed
        )
        return with_known(free, self.known)

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        new = np.array(estimate.calibration.backlash, dtype=float)
        for parameter, value in values:
            new[parameter.place[0]] = value
        return estimate._replace(calibration=replace(estimate.calibration, backlash=new))
