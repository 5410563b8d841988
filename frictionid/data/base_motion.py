"""Motion of a floating base, from an IMU on it or from its pose.

What the joints feel of the base are nine numbers in its frame: its angular velocity, its angular
acceleration, and the proper acceleration of its origin, in which gravity and acceleration enter
together: an IMU measures them, whatever the orientation. Sensors are smoothed as angles are.
"""

from collections.abc import Sequence

import numpy as np

from frictionid.arrays import Array, usual_step
from frictionid.errors import InputError

from .kalman import padded_series
from .outliers import smoothed
from .signals import Signal, check_signal, check_span

BASE_COLUMNS = 9
_LATE = 5.0  # usual gaps, by which it may begin late or end early
_UNIT = 0.1  # by which quaternions may be longer or shorter than 1
_GRAVITY = np.array([0.0, 0.0, -9.81])  # [m/s^2] in the world, whose z axis points up


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


def check_base_motion(where: str, angle: Signal, motion: Signal) -> None:
    """Check the motion of a base: finite columns that cover the angles.

    Raises
    ------
    InputError
        Saying `where` the first fault is.
    """
    where = f"{where}, motion of the base"
    check_signal(where, motion)
    if motion.value.shape[1] != BASE_COLUMNS or motion.hold == "previous":
        raise InputError(f"{where}: it needs {BASE_COLUMNS} columns, interpolated")
    usual = usual_step(motion.time) + usual_step(angle.time)
    check_span(f"{where}: it is", motion, angle, _LATE * usual)
