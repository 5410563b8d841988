"""Schema of [base]: what recordings say of the motion of a floating base."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from frictionid.config import Strict

from .column_toml import Column

Three = Annotated[list[Column], Field(min_length=3, max_length=3)]
Numbers = Annotated[list[float], Field(min_length=3, max_length=3)]
_QUANTITIES = ("angular_velocity", "specific_force", "orientation", "position", "wrench")


class BaseUnits(Strict):
    """Units of the columns of the base."""

    angular_velocity: Literal["rad/s", "deg/s"] = "rad/s"
    specific_force: Literal["m/s^2", "g"] = "m/s^2"
    position: Literal["m", "mm"] = "m"

    def scale(self, quantity: str) -> float:
        """SI value of the unit of a quantity."""
        scales = {"deg/s": np.pi / 180.0, "g": 9.80665, "mm": 1e-3}
        return scales.get(getattr(self, quantity, ""), 1.0)


class Base(Strict):
    """Sensors of the motion of the base link.

    angular_velocity, specific_force : columns of an IMU, in its frame; the accelerometer shows
        +9.81 m/s^2 upwards at rest
    orientation, position : columns of the sensor's pose in a world whose z axis points up,
        quaternion (w, x, y, z); position "fixed" where the sensor turns and does not accelerate
    wrench : columns of forces [N] and moments [N m] on the base at its origin in its frame, beside
        gravity, or "none" in flight; not given where they are not known
    time : column of their clock, that of the angles if not given
    sensor_position, sensor_rotation : of the sensor in the frame of the base link, [m], and roll,
        pitch and yaw [rad]
    """

    angular_velocity: Three | None = None
    specific_force: Three | None = None
    orientation: Annotated[list[Column], Field(min_length=4, max_length=4)] | None = None
    position: Three | Literal["fixed"] | None = None
    wrench: Annotated[list[Column], Field(min_length=6, max_length=6)] | Literal["none"] | None = (
        None
    )
    time: Column | None = None
    units: BaseUnits = BaseUnits()
    sensor_position: Numbers = [0.0, 0.0, 0.0]
    sensor_rotation: Numbers = [0.0, 0.0, 0.0]

    @model_validator(mode="after")
    def _turns_and_accelerates(self) -> Self:
        if not (self.angular_velocity or self.orientation):
            raise ValueError(
                "nothing says how the base turns: give angular_velocity (a gyroscope's), or "
                "orientation"
            )
        if not (self.specific_force or (self.orientation and self.position)):
            raise ValueError(
                "nothing says how the base accelerates: what that does to the links passes for "
                "friction, first moments of links and bias of torques, in every fit; give "
                "specific_force (an accelerometer's), or orientation and position, or position = "
                '"fixed" where the base only turns about the sensor'
            )
        return self

    @property
    def columns(self) -> dict[str, list[str]]:
        """Columns of each quantity that has some."""
        named = {quantity: getattr(self, quantity) for quantity in _QUANTITIES}
        return {quantity: names for quantity, names in named.items() if isinstance(names, list)}
