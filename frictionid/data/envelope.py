"""Torque-speed envelope of a motor: the torque that it can make at a speed, in four quadrants.

    top(w) = clip(stall - slope w, peak),    bottom(w) = -top(-w),    clip(x, a) is x within +-a

The peak, as its drive limits the current, holds while braking and up to the knee. Beyond the torque
falls to zero at the no-load speed, where the back-EMF is the supply; further on the motor brakes.
"""

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array

_APART = 1e-6  # of the no-load speed, by which the knee is below it at least


class Envelope(NamedTuple):
    """Peak torque [N m], knee and no-load speed [rad/s] at the joint, one or (n,).

    >>> motor = Envelope(peak=2.0, knee=10.0, no_load=20.0)
    >>> float(motor.stall), float(motor.slope)
    (4.0, 0.2)
    >>> motor.top(np.array([-30.0, 0.0, 10.0, 15.0, 20.0, 25.0]))
    array([ 2.,  2.,  2.,  1.,  0., -1.])
    """

    peak: float | Array
    knee: float | Array
    no_load: float | Array

    @property
    def stall(self) -> float | Array:
        """Torque [N m] at rest if nothing limited the current."""
        return self.slope * self.no_load

    @property
    def slope(self) -> float | Array:
        """Torque [N m s/rad] that each rad/s costs beyond the knee."""
        return self.peak / np.maximum(self.no_load - self.knee, _APART * np.abs(self.no_load))

    def top(self, w: Array) -> Array:
        """Greatest torque (..., n) [N m] at velocities w; the least is -top(-w)."""
        return np.clip(self.stall - self.slope * w, -np.asarray(self.peak), self.peak)


def of_motor(
    volts: float | Array, K: float | Array, R: float | Array, limit: float | Array = np.inf
) -> Envelope:
    """Envelope of a motor at a supply [V], by K [N m/A] at the joint and R [Ohm].

    limit : of the torque [N m], as the current has one

    >>> motor = of_motor(10.0, K=0.5, R=2.0, limit=2.0)
    >>> float(motor.peak), round(float(motor.knee), 9), motor.no_load
    (2.0, 4.0, 20.0)
    """
    stall, no_load = K * volts / R, volts / K
    peak = np.minimum(limit, stall)
    return Envelope(peak, no_load * (1.0 - peak / stall), no_load)


class Estimated(NamedTuple):
    """A number with half the width of its 95 % interval."""

    value: float
    half_width: float

    def __str__(self) -> str:
        digits = max(0, 1 - int(np.floor(np.log10(max(self.half_width, 1e-3 * abs(self.value))))))
        return f"{self.value:.{digits}f} +- {self.half_width:.{digits}f}"


class Reached(NamedTuple):
    """What data show of one motor's envelope, None for what they do not reach.

    joint : from 1; peak [N m]; knee, no_load [rad/s]
    torque [N m], at : the largest torque, and the speed [rad/s] there
    speed [rad/s], by : the largest speed, and the torque there
    """

    joint: int
    peak: Estimated | None
    knee: Estimated | None
    no_load: Estimated | None
    torque: float
    at: float
    speed: float
    by: float

    @property
    def is_reached(self) -> bool:
        """Whether anything of it is."""
        return self.peak is not None or self.no_load is not None

    @property
    def envelope(self) -> Envelope | None:
        """The envelope, where all of it is reached."""
        parts = [part.value for part in (self.peak, self.knee, self.no_load) if part]
        return Envelope(*parts) if len(parts) == 3 else None

    @property
    def sentence(self) -> str:
        """What is reached, and how near the data come to the rest.

        >>> Reached(1, Estimated(2.0, 0.012), None, None, 2.04, 3.0, 9.0, 0.4).sentence
        'torque 1 has a peak of 2.000 +- 0.012 N m; its fall is not reached: 0.4 N m at 9 rad/s'
        """
        near = f"{self.by:.2g} N m at {self.speed:.3g} rad/s"
        most = f"{self.torque:.3g} N m at {self.at:.2g} rad/s"
        head = f"torque {self.joint}"
        if self.peak and self.knee and self.no_load:
            return (
                f"{head} has a peak of {self.peak} N m up to {self.knee} rad/s, and falls to zero "
                f"at {self.no_load} rad/s"
            )
        if self.peak:
            return f"{head} has a peak of {self.peak} N m; its fall is not reached: {near}"
        if self.no_load:
            return f"{head} falls to zero at {self.no_load} rad/s; its peak is not reached: {most}"
        return f"{head} reaches no limit of its motor: {most}, {near}"
