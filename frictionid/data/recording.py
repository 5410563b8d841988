"""One uninterrupted measurement, checked when it is made."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError

from .base_motion import check_base_motion
from .servo import Servo
from .signals import TORQUE_HOLD, Signal, check_clocks, check_signal, column_count, sample

TEMPERATURE = "temperature"


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """Noise-free motion of a simulation.

    Attributes
    ----------
    angle : Signal, n columns [rad]
    velocity : Signal, n columns [rad/s]
    """

    angle: Signal
    velocity: Signal


@dataclass(frozen=True, eq=False)
class Recording:
    """One uninterrupted measurement of a mechanism with n joints.

    A prismatic joint has [m], [m/s] and [N] in place of [rad], [rad/s] and [N m].

    Attributes
    ----------
    name : str
    angle : Signal, n columns [rad]
        At least two samples.
    torque : Signal, n columns [N m]
        One column per joint, zero where there is no motor. Its clock may differ from the angles'
        clock, but both count from the same instant. It is held between its samples unless its
        `hold` says otherwise.
    velocity : Signal, n columns [rad/s], or None
        Measured velocity, where there is one.
    parameters : those of the mechanism that differ in this recording, such as an exchangeable mass
    covariates : other measured quantities, in the unit of the file (temperature, voltage)
    truth : the noise-free motion, of simulated recordings
    servo : controller and motors that make the torque, where known; `torque` follows from motion
    base_motion, base_wrench : Signal or None
        Of a floating base: 9 columns, see `with_base_motion`; forces and moments on it [N],
        [N m] beside gravity, at its origin in its frame, where known.

    Raises
    ------
    InputError
        Where times do not increase, a value is not finite, or columns and joints disagree.

    Examples
    --------
    >>> time = np.arange(3.0)
    >>> Recording("rest", Signal(time, np.zeros((3, 2))), Signal(time, np.zeros((3, 2))))
    Recording('rest': 2 joints, 3 samples, 2 s)
    """

    name: str
    angle: Signal
    torque: Signal
    velocity: Signal | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    covariates: Mapping[str, Signal] = field(default_factory=dict)
    truth: TrueMotion | None = None
    servo: Servo | None = None
    base_motion: Signal | None = None
    base_wrench: Signal | None = None

    def __post_init__(self) -> None:
        where = f"recording {self.name!r}"
        motions = {"angle": self.angle, "torque": self.torque}
        if self.velocity is not None:
            motions["velocity"] = self.velocity
        if self.truth is not None:
            motions |= {"true angle": self.truth.angle, "true velocity": self.truth.velocity}
        if self.servo is not None:
            motions |= {"goal": self.servo.goal, "enabled": self.servo.enabled}
        for label, signal in motions.items():
            check_signal(f"{where}, {label}", signal)
            if column_count(signal) != column_count(self.angle):
                raise InputError(
                    f"{where}: {label} has {column_count(signal)} columns and angle has "
                    f"{column_count(self.angle)}; give one column per joint"
                )
        if self.torque.hold is None:
            object.__setattr__(self, "torque", self.torque._replace(hold=TORQUE_HOLD))
        for name, signal in self.covariates.items():
            check_signal(f"{where}, covariate {name!r}", signal)
        if len(self.angle.time) < 2:
            raise InputError(f"{where}: angle needs at least 2 samples, it has 1")
        check_clocks(where, self.angle, self.torque)
        if self.base_motion is not None:
            check_base_motion(where, self.angle, self.base_motion)
        for name, value in self.parameters.items():
            if not math.isfinite(value):
                raise InputError(f"{where}: parameter {name!r} must be finite, not {value}")

    def __repr__(self) -> str:
        samples, joints = np.shape(self.angle.value)
        span = self.angle.duration
        return f"Recording({self.name!r}: {joints} joints, {samples} samples, {span:g} s)"

    def changed(
        self, motion: Callable[[Signal], Signal], inputs: Callable[[Signal], Signal]
    ) -> "Recording":
        """The recording with other signals: of its motion and covariates, and of what acts on it.

        What acts are the torque, the motion of its base and the wrench there.
        """
        truth, velocity = self.truth, self.velocity
        base, wrench = self.base_motion, self.base_wrench
        return replace(
            self,
            angle=motion(self.angle),
            torque=inputs(self.torque),
            velocity=velocity and motion(velocity),
            covariates={key: motion(signal) for key, signal in self.covariates.items()},
            truth=truth and TrueMotion(motion(truth.angle), motion(truth.velocity)),
            base_motion=base and inputs(base),
            base_wrench=wrench and inputs(wrench),
        )

    def temperature_at(self, time: Array, joints: Sequence[str]) -> Array | None:
        """Temperature (K, n) [degC] of each joint at times (K,) [s]; None unless all have one.

        A joint has the covariate `temperature_NAME` with its name, else `temperature_2` with its
        number from 1, else `temperature` of the whole machine.

        >>> angle, warm = (Signal(np.array([0.0, 1.0]), np.array([[20.0], [30.0]])),) * 2
        >>> run = Recording("a", angle, angle, covariates={"temperature": warm})
        >>> run.temperature_at(np.array([0.5]), ["hip", "knee"])
        array([[25., 25.]])
        """
        columns = []
        for number, joint in enumerate(joints, 1):
            names = f"{TEMPERATURE}_{joint}", f"{TEMPERATURE}_{number}", TEMPERATURE
            covariates = [self.covariates[name] for name in names if name in self.covariates]
            if not covariates:
                return None
            columns.append(sample(covariates[0], time)[:, 0])
        return np.stack(columns, axis=-1)
