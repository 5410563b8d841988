"""One uninterrupted measurement, checked when it is made, and the motion of a floating base.

What joints feel of their base are nine numbers in its frame: its angular velocity, its
angular acceleration, and the proper acceleration of its origin, in which gravity and acceleration
enter together: an IMU measures them, whatever the orientation. Sensors are smoothed as angles are.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from frictionid.arrays import Array, usual_step
from frictionid.errors import InputError

from .kalman import padded_series
from .outliers import smoothed
from .servo import Servo
from .signals import (
    TORQUE_HOLD,
    Signal,
    check_clocks,
    check_signal,
    check_span,
    column_count,
    sample,
)

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
            _check_base_motion(where, self.angle, self.base_motion)
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


# --- Motion of a floating base --------------------------------------------------------------------

_BASE_COLUMNS = 9
_LATE = 5.0  # usual gaps, by which it may begin late or end early
_UNIT = 0.1  # by which quaternions may be longer or shorter than 1
_GRAVITY = np.array([0.0, 0.0, -9.81])  # [m/s^2] in the world, whose z axis points up


def _check_base_motion(where: str, angle: Signal, motion: Signal) -> None:
    """Refuse a motion of a base without finite columns that cover the angles."""
    where = f"{where}, motion of the base"
    check_signal(where, motion)
    if motion.value.shape[1] != _BASE_COLUMNS or motion.hold == "previous":
        raise InputError(f"{where}: it needs {_BASE_COLUMNS} columns, interpolated")
    usual = usual_step(motion.time) + usual_step(angle.time)
    check_span(f"{where}: it is", motion, angle, _LATE * usual)


def base_motion(
    angular_velocity: Signal | None = None,
    specific_force: Signal | None = None,
    orientation: Signal | None = None,
    position: Signal | None = None,
    *,
    turn: Sequence[float] = (0.0, 0.0, 0.0),
    place: Sequence[float] = (0.0, 0.0, 0.0),
) -> Signal:
    """Motion (T, 9) of the base by a sensor, see `mechanics.plant.with_base_motion`.

    Parameters
    ----------
    angular_velocity : (T, 3) [rad/s] in the sensor's frame; else from the orientation
    specific_force : (T, 3) [m/s^2], what an accelerometer shows; else from pose and position
    orientation : (T, 4), quaternions (w, x, y, z) of the sensor in a world whose z axis points up
    position : (T, 3) [m] of the sensor in the world; None: it does not accelerate
    turn, place : of the sensor in the frame of the base: roll, pitch, yaw [rad], and [m]

    >>> time = np.linspace(0.0, 1.0, 101)
    >>> up = Signal(time, np.tile([0.0, 0.0, 9.81], (101, 1)))
    >>> turning = Signal(time, np.tile([0.0, 0.0, 2.0], (101, 1)))
    >>> base_motion(turning, up, place=(0.1, 0.0, 0.0)).value[50].round(6) + 0.0
    array([0.  , 0.  , 2.  , 0.  , 0.  , 0.  , 0.4 , 0.  , 9.81])
    """
    from scipy.spatial.transform import Rotation  # which fixed bases do not need

    pose = None if orientation is None else _smoothed(_continued(orientation))
    if angular_velocity is not None:
        omega, rate, _ = _smoothed(angular_velocity)
    else:
        assert pose is not None
        omega, rate = (2.0 * _from_body(pose[0], change) for change in pose[1:])
    if specific_force is not None:
        force = _smoothed(specific_force)[0]
    else:
        assert pose is not None
        force = -_GRAVITY + (0.0 if position is None else _smoothed(position)[2])
        force = Rotation.from_quat(np.roll(pose[0], -1, axis=1)).inv().apply(force)
    onto = Rotation.from_euler("xyz", turn)
    omega, rate, force = (onto.apply(x) for x in (omega, rate, force))
    force = force - np.cross(rate, place) - np.cross(omega, np.cross(omega, place))
    clock = next(s for s in (angular_velocity, orientation) if s is not None).time
    return Signal(clock, np.concatenate([omega, rate, force], axis=-1), "linear")


def _smoothed(signal: Signal) -> tuple[Array, Array, Array]:
    """Smoothed columns (T, n), and their first and second derivatives."""
    value, rate, second = np.moveaxis(smoothed(padded_series([signal])).mean, -1, 0)
    return value, rate, second


def _continued(orientation: Signal) -> Signal:
    """Unit quaternions without jumps to the opposite one, which is the same orientation."""
    size = np.linalg.norm(orientation.value, axis=1, keepdims=True)
    if np.abs(size - 1.0).max() > _UNIT:
        at = int(np.argmax(np.abs(size - 1.0)))
        raise InputError(
            f"[base] orientation: at {orientation.time[at]:g} s its length is {size[at, 0]:.3g}; "
            "quaternions (w, x, y, z) have 1"
        )
    q = orientation.value / size
    same = np.where((q[1:] * q[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    return orientation._replace(value=q * np.cumprod([1.0, *same])[:, None], sigma=None)


def _from_body(q: Array, change: Array) -> Array:
    """Vector part (T, 3) of the product of conjugate quaternions with a change of them."""
    w, v = q[:, :1], q[:, 1:]
    product = w * change[:, 1:] - change[:, :1] * v - np.cross(v, change[:, 1:])
    return product / (q**2).sum(axis=1, keepdims=True)
