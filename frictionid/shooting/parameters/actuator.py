"""The block of a servo's motor: what a voltage becomes at the joint, and motion takes off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frictionid.shooting.parameters.parameter_block import (
    Estimate,
    Parameter,
    ParameterBlock,
    Values,
    check_fixed,
    relative_deviation,
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
