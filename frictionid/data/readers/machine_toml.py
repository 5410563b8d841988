"""Schemas of [actuator], controllers that make the torque, and [base], sensors of a moving base."""

from collections.abc import Sequence
from fnmatch import fnmatchcase
from itertools import product
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, ValidationError, model_validator

from frictionid.config import Strict, nearest
from frictionid.data.envelope import Envelope, of_motor
from frictionid.errors import InputError

from .column_toml import Column, Each, Names, check_per_joint

_Gains = Each[NonNegativeFloat]
_Positives = Each[PositiveFloat]
# Keys that say nothing of some outputs, and keys that these cannot do without.
_SENSELESS = {
    "torque": ("kt", "R", "supply", "current_limit", "gear"),
    "current": ("R", "supply", "current_limit"),
    "voltage": ("supply",),
    "duty": (),
}
# Keys that say an envelope of a torque or current: directly, or by the motor.
_ENVELOPE, _MOTOR = {"peak_torque", "knee_speed", "no_load_speed"}, {"kt", "R", "supply"}
_NEEDED = {"torque": (), "current": ("kt",), "voltage": ("kt", "R"), "duty": ("kt", "R", "supply")}


class Actuator(Strict):
    """Controllers and motors, in place of a measured torque, see `Servo`.

    Gains, limits and the motor's numbers may differ between recordings: see `recordings`.

    target : columns of the targets, one per joint
    kind : what the targets are: of "position" or "velocity", in the units of angle and velocity
    target_velocity : columns of the target's velocity for D; without them D brakes
    feedforward : columns of what is added to the output, in its SI unit
    time : time column of the targets, that of the angles where there is none
    hold : between two targets: "previous" (held) or "linear"
    enabled : column that is above 0.5 while the motors are connected
    output : what P, D and feed-forward add up to, and `limit` limits: "torque" [N m] at the joint,
        "current" [A], "voltage" [V], or "duty", a share of the supply
    P, D : output per radian and per rad/s of error, of a velocity controller P per rad/s; scale :
        factor of both, where a firmware counts in units of its own
    supply : [V], or the column of a supply that sags
    current_limit : [A] of a controller that puts out a voltage
    kt, R : torque constant [N m/A] and resistance [Ohm] of the motor; gear : turns of the motor
        for one of the joint; efficiency : of the gear, where the motor drives
    peak_torque, knee_speed, no_load_speed : [N m] and [rad/s] at the joint, of a torque or current,
        see `Envelope`; or kt, R and supply, which with the limit make one
    delay : [s] by which targets act later than by their clock; backlash : [rad], see `play`
    recordings : keys that differ, by names or patterns of recordings, such as other gains
    """

    target: Names
    kind: Literal["position", "velocity"] = "position"
    target_velocity: Names | None = None
    feedforward: Names | None = None
    time: Column | None = None
    hold: Literal["previous", "linear"] = "previous"
    enabled: Column | None = None
    output: Literal["torque", "current", "voltage", "duty"]
    P: _Gains
    D: _Gains = [0.0]
    scale: PositiveFloat = 1.0
    limit: _Positives | None = None
    supply: PositiveFloat | Column | None = None
    current_limit: PositiveFloat | None = None
    kt: PositiveFloat | None = None
    R: PositiveFloat | None = None
    gear: _Positives = [1.0]
    efficiency: Each[Annotated[float, Field(gt=0, le=1)]] = [1.0]
    peak_torque: _Positives | None = None
    knee_speed: _Gains | None = None
    no_load_speed: _Positives | None = None
    delay: float = 0.0
    backlash: _Gains = [0.0]
    recordings: dict[str, dict[str, Any]] = {}

    @model_validator(mode="after")
    def _that_of_its_output(self) -> Self:
        there = self.model_fields_set
        has_motor = self.output in ("torque", "current") and there >= _MOTOR
        for key in (*_SENSELESS[self.output], *(_ENVELOPE if "R" in _NEEDED[self.output] else ())):
            if key in there and not (has_motor and key in {*_MOTOR, "gear"}):
                raise ValueError(f'{key} says nothing where output = "{self.output}"; delete it')
        for key in _NEEDED[self.output]:
            if getattr(self, key) is None:
                raise ValueError(f'output = "{self.output}" needs the key {key!r}; add it')
        if there & _ENVELOPE and (not there >= _ENVELOPE or has_motor or self._falls_late):
            raise ValueError(
                "an envelope is peak_torque, knee_speed and a higher no_load_speed, or kt, R and a "
                "supply: give one of these"
            )
        if has_motor and isinstance(self.supply, str):
            raise ValueError("an envelope has one supply [V]: give a number, or peak_torque")
        if self.kind == "velocity" and (any(self.D) or self.target_velocity):
            raise ValueError(
                'kind = "velocity" has P only, of the velocity: delete D and target_velocity'
            )
        if not any(self.P) and not any(self.D) and self.feedforward is None:
            raise ValueError("P = 0 without D and feedforward never moves a motor: give the gains")
        for name in self.recordings:
            self.in_recording(name)
        return self

    @property
    def _falls_late(self) -> bool:
        """Whether a knee is not below the no-load speed."""
        knee, no_load = self.knee_speed or [], self.no_load_speed or []
        single = min(len(knee), len(no_load)) == 1
        pairs = product(knee, no_load) if single else zip(knee, no_load, strict=False)
        return any(a >= b for a, b in pairs)

    @property
    def envelope(self) -> Envelope | None:
        """Envelope of a torque or current, by speeds or by the motor."""
        if self.peak_torque and self.knee_speed and self.no_load_speed:
            keys = self.peak_torque, self.knee_speed, self.no_load_speed
            return Envelope(*map(np.array, keys))
        if self.output not in ("torque", "current") or not self.model_fields_set >= _MOTOR:
            return None
        assert self.kt and self.R and not isinstance(self.supply, str)
        K = self.kt * np.array(self.gear)
        limit = np.array(self.limit or [np.inf]) * (K if self.output == "current" else 1.0)
        return of_motor(float(self.supply or 0.0), K, self.R, limit)

    def in_recording(self, name: str) -> "Actuator":
        """The actuator in the recording of a name, with the keys that differ there."""
        values = {key: getattr(self, key) for key in self.model_fields_set - {"recordings"}}
        for pattern, keys in self.recordings.items():
            if name == pattern or fnmatchcase(name, pattern):
                for key in keys:
                    if key in _COLUMNS or key not in Actuator.model_fields:
                        raise ValueError(
                            f"recordings.{pattern}: {key!r} is none of the keys that may differ; "
                            f"{nearest(key, _NUMBERS)}"
                        )
                values |= keys
        try:
            return Actuator(**values)
        except ValidationError as error:
            first = error.errors()[0]
            at = next(iter(first["loc"]), "")
            what = first["msg"].removeprefix("Value error, ")
            raise ValueError(f"recordings.{name}: {at}: {what}") from None

    def columns(self) -> list[str]:
        """All columns that it reads, each once."""
        names = [*self.target, *(self.target_velocity or []), *(self.feedforward or [])]
        names += [self.time or "", self.enabled or ""]
        supplies = [self.supply, *(keys.get("supply") for keys in self.recordings.values())]
        names += [supply for supply in supplies if isinstance(supply, str)]
        return [name for name in dict.fromkeys(names) if name]

    def check_joints(self, joints: Sequence[str]) -> None:
        """Check that everything is one, or one per joint.

        Raises
        ------
        ValueError
            With the first key that is not.
        """
        for key in ("target", "target_velocity", "feedforward"):
            names = getattr(self, key) or joints
            if len(names) != len(joints):
                raise ValueError(
                    f"actuator.{key} names {len(names)} columns for {len(joints)} joints; give one "
                    "per joint"
                )
        keys = ("P", "D", "limit", "gear", "efficiency", "backlash", *sorted(_ENVELOPE))
        check_per_joint({f"actuator.{key}": getattr(self, key) for key in keys}, joints)

    def check_recordings(self, names: Sequence[str], where: str) -> None:
        """Check that each pattern of `recordings` is of some recording."""
        for pattern in self.recordings:
            if not any(name == pattern or fnmatchcase(name, pattern) for name in names):
                raise InputError(
                    f"{where}actuator.recordings: {pattern!r} matches no recording; "
                    f"{nearest(pattern, names)}"
                )


_COLUMNS = (
    *("target", "target_velocity", "feedforward", "time", "enabled"),
    *("hold", "kind", "output", "recordings"),
)
_NUMBERS = [key for key in Actuator.model_fields if key not in _COLUMNS]


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
