"""State estimation: velocities by backward differences, local polynomials, or Kalman/RTS smoothing.

An estimator takes the angle signals of some recordings and returns one `States` for each, on its
own time stamps. Recordings are independent of each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from frictionid.arrays import Array, scatter, usual_step
from frictionid.errors import InputError

from .kalman import by_length, causal_states
from .outliers import smoothed
from .signals import Signal, relative_noise

_NO_WEIGHT = 1e6  # times the usual standard deviation


class States(NamedTuple):
    """Estimated motion: time (T,) [s], q (T, n) [rad], w (T, n) [rad/s].

    left_out : (T, n) of bool, measured angles that are gross outliers and so had no influence, or
        None for an estimator that uses all
    noise : (n,) [rad/s], standard deviation of the noise in w; zero where it is not known
    base_motion : (T, 9) of a floating base, or None
    """

    time: Array
    q: Array
    w: Array
    left_out: Array | None = None
    noise: Array | float = 0.0
    base_motion: Array | None = None

    @property
    def motion(self) -> tuple[Array, Array, Array]:
        """Time, q and w."""
        return self.time, self.q, self.w


class Estimator(Protocol):
    """Estimates states; each depends on `support` samples to either side."""

    @property
    def support(self) -> int: ...

    def __call__(self, angles: Sequence[Signal]) -> tuple[States, ...]: ...


@dataclass(frozen=True)
class Backward:
    """Backward differences, w_k = (q_k - q_{k-1})/(t_k - t_{k-1}): the study's [DeMeester2020].

    The first sample has no velocity and is dropped.

    >>> ramp = Signal(np.array([0.0, 0.1, 0.2]), np.array([[0.0], [0.1], [0.3]]))
    >>> Backward()([ramp])[0].w.ravel().round(6)
    array([1., 2.])
    """

    support: int = 1

    def __call__(self, angles: Sequence[Signal]) -> tuple[States, ...]:
        return tuple(
            States(a.time[1:], a.value[1:], np.diff(a.value, axis=0) / np.diff(a.time)[:, None])
            for a in angles
        )


@dataclass(frozen=True)
class SavitzkyGolay:
    """Local polynomials of `order` over `window` samples [SavitzkyGolay1964], on any time stamps.

    At the ends the window is one-sided.

    >>> t = np.linspace(0.0, 1.0, 11)
    >>> s = SavitzkyGolay(window=5, order=2)([Signal(t, t[:, None] ** 2)])[0]
    >>> bool(np.allclose(s.w[:, 0], 2 * t))
    True
    """

    window: int = 7
    order: int = 3

    def __post_init__(self) -> None:
        if self.window % 2 == 0 or not 1 <= self.order < self.window:
            raise InputError(
                f"savgol: window = {self.window} must be odd and larger than order = {self.order}, "
                "which must be at least 1"
            )

    @property
    def support(self) -> int:
        """Samples to either side that a state depends on."""
        return self.window // 2

    def __call__(self, angles: Sequence[Signal]) -> tuple[States, ...]:
        return tuple(self._fitted(angle) for angle in angles)

    def _fitted(self, angle: Signal) -> States:
        time, value = angle.time, angle.value
        if len(time) < self.window:
            raise InputError(f"savgol: {len(time)} samples are fewer than window = {self.window}")
        start = np.clip(np.arange(len(time)) - self.support, 0, len(time) - self.window)
        index = start[:, None] + np.arange(self.window)[None]
        span = (time[index[:, -1]] - time[index[:, 0]])[:, None] / 2
        x = (time[index] - time[:, None]) / span
        powers = x[..., None] ** np.arange(self.order + 1)
        coefficients = np.linalg.pinv(powers) @ value[index]
        return States(time, coefficients[:, 0], coefficients[:, 1] / span)


@dataclass(frozen=True)
class RTS:
    """Kinematic Kalman/RTS smoother driven by white jerk [RauchTungStriebel1965].

    The ratio of jerk intensity to measurement noise maximises the innovation likelihood of each
    recording and joint: there is no window to choose. Uneven sampling and gaps are exact. Gross
    outliers are left out, see `frictionid.data.outliers`.

    >>> t = np.linspace(0.0, 2.0, 121)
    >>> s = RTS()([Signal(t, np.sin(3 * t)[:, None])])[0]
    >>> bool(np.abs(s.w[:, 0] - 3 * np.cos(3 * t)).max() < 0.01)
    True
    """

    support: int = 6

    def __call__(self, angles: Sequence[Signal]) -> tuple[States, ...]:
        return tuple(
            _with_noise(States(angle.time, mean[..., 0], mean[..., 1], left_out), angle, rho)
            for angle, (mean, rho, left_out) in zip(
                angles, by_length(angles, smoothed), strict=True
            )
        )


@dataclass(frozen=True)
class KalmanFilter:
    """Causal Kalman filter: each state depends on samples up to its own time only.

    So does its ratio of jerk to noise, the likeliest so far. Rollouts start from these states.
    """

    support: int = 0

    def __call__(self, angles: Sequence[Signal]) -> tuple[States, ...]:
        each = by_length(angles, lambda series: (causal_states(series),))
        return tuple(
            States(angle.time, mean[..., 0], mean[..., 1])
            for angle, (mean,) in zip(angles, each, strict=True)
        )


def thin(states: States, sample_time: float) -> States:
    """States at samples at least `sample_time` [s] apart, on their own time stamps.

    >>> t = np.arange(5) * 0.01
    >>> thin(States(t, t[:, None], t[:, None]), 0.02).time.tolist()
    [0.0, 0.02, 0.04]
    """
    slack = 0.25 * usual_step(states.time)
    keep = [0]
    for k, time in enumerate(states.time):
        if time >= states.time[keep[-1]] + sample_time - slack:
            keep.append(k)
    index = np.unique(keep)
    left_out = None if states.left_out is None else states.left_out[index]
    return States(states.time[index], states.q[index], states.w[index], left_out, states.noise)


def slowest_speeds(states: States) -> Array:
    """Slowest speeds (n,) [rad/s] of each joint that estimated states resolve.

    Three standard deviations of the velocities' noise, or half of what a moving joint's velocity
    changes by from sample to sample: slower friction effects pass between two samples.

    >>> w = np.arange(5.0)[:, None]
    >>> slowest_speeds(States(0.1 * w[:, 0], w, w, noise=np.array([0.01])))
    array([0.5])
    """
    floor = 3.0 * states.noise + np.zeros(states.w.shape[1])
    return np.maximum(floor, 0.5 * usual_changes([states.w], floor))


def usual_changes(velocities: Sequence[Array], threshold: Array) -> Array:
    """Usual change (n,) [rad/s] of velocities (T, n) from sample to sample.

    Median over the samples with a speed above the threshold (n,); zero of joints at rest.
    """
    change = np.concatenate([np.abs(np.diff(w, axis=0)) for w in velocities])
    speed = np.concatenate([np.abs(w[1:]) for w in velocities])
    moving = [c[s > least] for c, s, least in zip(change.T, speed.T, threshold, strict=True)]
    return np.array([np.median(c) if len(c) else 0.0 for c in moving])


def without_outliers(angles: Sequence[Signal], states: Sequence[States]) -> tuple[Signal, ...]:
    """The angles with next to no weight, a large `sigma`, of the samples that states leave out.

    >>> time = np.arange(3.0)
    >>> angle, states = Signal(time, np.zeros((3, 1))), States(time, *np.zeros((2, 3, 1)))
    >>> found = without_outliers([angle], [states._replace(left_out=time[:, None] == 1.0)])
    >>> found[0].sigma.ravel().tolist()
    [1.0, 1000000.0, 1.0]
    """
    pairs = zip(angles, states, strict=True)
    return tuple(
        angle
        if s.left_out is None or not s.left_out.any()
        else angle._replace(sigma=relative_noise(angle) * np.where(s.left_out, _NO_WEIGHT, 1.0))
        for angle, s in pairs
    )


def noise_left(rho: Array, dt: float) -> tuple[Array, Array, Array]:
    """What smoothers at jerk ratios rho (S,) and a sample time dt [s] leave of angle noise.

    The Wiener smoother of white jerk at a jerk ratio rho has the bandwidth w0 = (rho/dt)^(1/6) and
    leaves of the measurement variance s^2, from the integrals of its frequency response,

        var q = s^2 dt w0 / 3,    var w = s^2 dt w0^3 / 6

    Bandwidth w0 (S,) [rad/s]; share (S,) of the variance that stays in q; standard deviation (S,)
    [1/s] of w over that of the angles, no more than that of differences between neighbours,
    2^(1/2)/dt.

    >>> noise_left(np.array([1e-3]), 0.01)[1].round(4)
    array([0.0023])
    """
    w0 = np.minimum((rho / dt) ** (1 / 6), np.pi / dt)
    velocity = np.minimum(np.sqrt(dt * w0**3 / 6), np.sqrt(2) / dt)
    return w0, dt * w0 / 3, velocity


def _with_noise(states: States, angle: Signal, rho: Array) -> States:
    """Smoothed states with the noise (n,) [rad/s] of their velocities, at jerk ratios rho (n,).

    The angle noise follows from what the smoother took off, and is no less than that of rounding to
    the resolution of the angles.
    """
    _, share, velocity = noise_left(rho, usual_step(angle.time))
    off = scatter(angle.value - states.q)
    noise = off / np.sqrt(1.0 - np.minimum(share, 0.9))
    noise = np.maximum(noise, resolutions(angle.value) / np.sqrt(12)) * velocity
    return states._replace(noise=noise)


def resolution(values: Array, fewest: int = 3) -> float:
    """Step of which all differences between readings are multiples, 0 where there is none.

    fewest : different readings that show one

    >>> resolution(np.array([0.1, 0.3, 0.2, 0.6, 0.2])).__round__(6)
    0.1
    """
    gaps = np.diff(np.unique(values))
    if len(gaps) + 1 < fewest:
        return 0.0
    step = float(np.quantile(gaps, 0.1))
    ratio = gaps / step
    return step if np.mean(np.abs(ratio - np.rint(ratio)) < 0.05) > 0.9 else 0.0


def resolutions(values: Array, fewest: int = 3) -> Array:
    """Resolution (n,) of each column of readings (T, n)."""
    return np.array([resolution(column, fewest) for column in np.asarray(values).T])
