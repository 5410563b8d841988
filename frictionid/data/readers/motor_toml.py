"""Schema of the table [motor] of a dataset.toml: what is between its columns and the joints."""

from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, field_validator, model_validator

from frictionid.config import Strict
from frictionid.data.gears import Gears

_SINGULAR = 1e9  # condition number of a coupling


def as_list(value: object) -> object:
    """A value as a list of one, a list as it is."""
    return value if isinstance(value, list) else [value]


Constants = Annotated[list[float], Field(min_length=1), BeforeValidator(as_list)]
Side = Literal["joint", "motor"]
TorqueAt = Literal["motor", "link", "command"]


class TorquePlace(Strict):
    """What the torques are.

    at : "motor", the motors', before the friction of motor and gear; "link", of sensors behind the
        gears; "command", what the motors were asked for
    """

    at: TorqueAt = "motor"


class Motor(Strict):
    """Motors and gears between what the columns hold and the joints.

    motor angle = C (joint angle - offset) and joint torque = C' motor torque, with C = coupling, or
    gear on its diagonal. Of currents, motor torque = kt current.

    kt : torque constant at the motor's shaft [N m/A]: one, or one per joint
    gear : turns of the motor for one of the joint, negative where they turn against each other
    coupling : turns of each motor (rows) for one of each joint, where motors turn several, as at a
        wrist; in place of gear
    offset : joint angles [rad] at which the motors' are zero: one, or one per joint
    angle, torque : "motor" where the columns are of the motors; currents and per mille always are
    rated_torque, rated_current : of the motor [N m], [A], where the unit of torque is "permille";
        0x6076 and 0x6075 of a CiA 402 drive, which has them in mN m and mA
    counts_per_turn : of the encoder, where the unit of angle is "counts"
    """

    kt: Constants | None = None
    rated_torque: Constants | None = None
    rated_current: Constants | None = None
    counts_per_turn: Constants | None = None
    gear: Constants = [1.0]
    coupling: list[list[float]] | None = None
    offset: Constants = [0.0]
    angle: Side = "joint"
    torque: Side = "joint"

    @field_validator("kt", "gear", "rated_torque", "rated_current", "counts_per_turn")
    @classmethod
    def _not_zero(cls, values: list[float] | None) -> list[float] | None:
        if 0.0 in (values or ()):
            raise ValueError(f"{values} must not hold a zero: no reading would count")
        return values

    @model_validator(mode="after")
    def _gear_or_coupling(self) -> Self:
        if self.coupling is None:
            return self
        if "gear" in self.model_fields_set:
            raise ValueError("gear and coupling exclude each other; coupling holds the gears, too")
        n = len(self.coupling)
        square = all(len(row) == n for row in self.coupling) and n
        if not square or not np.linalg.cond(np.array(self.coupling, dtype=float)) < _SINGULAR:
            raise ValueError(
                f"coupling = {self.coupling} must be a square matrix with an inverse: one row per "
                "motor, with its turns for one turn of each joint"
            )
        return self

    @model_validator(mode="after")
    def _one_rating(self) -> Self:
        if self.rated_current is not None and (self.kt is None or self.rated_torque is not None):
            raise ValueError("rated_current needs kt beside it, and excludes rated_torque")
        return self

    @property
    def torque_at_shaft(self) -> bool:
        """Whether the columns of torque are of the motors.

        >>> [Motor(gear=9.0, **more).torque_at_shaft for more in ({}, {"torque": "motor"})]
        [False, True]
        """
        return self.torque == "motor" or self.kt is not None or self.rated_torque is not None

    def unit(self, quantity: str) -> NDArray[np.float64]:
        """SI value of the motor's own unit of a quantity: one ampere, count, or rated torque.

        >>> Motor(rated_torque=2.5).unit("torque"), Motor(counts_per_turn=1000).unit("angle")
        (array([2.5]), array([0.001]))
        """
        if quantity != "torque":
            return 1.0 / np.array(self.counts_per_turn or [1.0])
        kt = np.array(self.rated_torque or self.kt or [1.0])
        return kt * np.array(self.rated_current or [1.0])

    def gears(self, joints: int) -> Gears:
        """What stands between the columns and the joints."""
        zero = np.broadcast_to(np.array(self.offset, dtype=float), joints)
        return Gears(self.matrix(joints), zero, self.angle == "motor", self.torque_at_shaft)

    def matrix(self, joints: int) -> NDArray[np.float64]:
        """C (n, n): turns of each motor for one of each joint."""
        if self.coupling is not None:
            return np.array(self.coupling, dtype=float)
        return np.diag(np.broadcast_to(np.array(self.gear, dtype=float), joints))
