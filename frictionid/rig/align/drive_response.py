"""Response of a drive to its command: gain, bias, delay and saturation, with intervals.

measured(t) = clip(gain command(t - delay) + bias, low, high)
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from frictionid.arrays import MAD, Array, rms, usual_step

_BLOCKS = 24  # stretches of time whose scatter gives the standard errors
_MAX_DELAY = 0.3  # [s]
_MIN_SATURATED = 20  # samples beyond a level that make it one
_MAX_SAMPLES = 60_000


class DriveResponse(NamedTuple):
    """How a drive follows its command; SI units, torques at the joint.

    Attributes
    ----------
    gain [1], bias [N m], delay [s]
    error : array, shape (3,), standard errors of gain, bias and delay
    t_quantile : half-width of a 95 % interval in standard errors
    low, high : levels of saturation [N m], infinite where there is none
    rms : root mean square of the unexplained torque [N m]
    """

    gain: float
    bias: float
    delay: float
    error: Array
    t_quantile: float
    low: float
    high: float
    rms: float


class _Record(NamedTuple):
    """Time (K,) [s], command and measured torque (K,) [N m]."""

    time: Array
    command: Array
    measured: Array

    def delayed(self, delay: float) -> Array:
        """Command at time - delay."""
        return np.interp(self.time - delay, self.time, self.command)

    def residual(self, theta: Array) -> Array:
        """Predicted minus measured torque for theta = (gain, bias, delay, low, high)."""
        return self.predicted(theta) - self.measured

    def predicted(self, theta: Array) -> Array:
        gain, bias, delay, low, high = theta
        return np.clip(gain * self.delayed(delay) + bias, low, high)


def drive_response(time: Array, command: Array, measured: Array) -> DriveResponse | None:
    """Response of a drive, or None where its command never changes.

    Parameters
    ----------
    time : (K,) [s], increasing; command, measured : (K,) [N m]
    """
    spread = float(np.ptp(command))
    if len(time) < 4 * _BLOCKS or spread <= 1e-9 * max(float(np.abs(command).max()), 1e-300):
        return None
    used = slice(0, min(len(time), _MAX_SAMPLES))
    record = _Record(time[used], command[used], measured[used])
    theta = _without_idle_levels(_fitted(record), record)
    gain, bias, delay, low, high = (float(v) for v in theta)
    return DriveResponse(
        gain=gain,
        bias=bias,
        delay=delay,
        error=_errors(theta, record),
        t_quantile=float(stdtrit(_BLOCKS - 1, 0.975)),
        low=low,
        high=high,
        rms=float(rms(record.residual(theta))),
    )


def _fitted(record: _Record) -> Array:
    """Robust least squares for (gain, bias, delay, low, high), from the best delay of a grid."""
    step = usual_step(record.time)
    spread = max(float(np.ptp(record.measured)), 1e-12)
    scale = np.array([1.0, spread, step, spread, spread])
    levels = np.quantile(record.measured, [0.01, 0.99])
    start = np.array([*_best_delay(record), *levels]) / scale

    def residual(x: Array) -> Array:
        return record.residual(x * scale)

    fit = least_squares(residual, start, loss="soft_l1", f_scale=_noise(residual(start)))
    return fit.x * scale


def _best_delay(record: _Record) -> tuple[float, float, float]:
    """Gain, bias and delay [s] of the best line measured = gain command(t - delay) + bias."""
    time, measured = record.time, record.measured
    step = usual_step(time)
    longest = min(_MAX_DELAY, (time[-1] - time[0]) / 10)
    least, best = np.inf, (1.0, 0.0, 0.0)
    for delay in np.arange(-longest / 3, longest + step / 2, max(step, longest / 150)):
        c = record.delayed(float(delay))
        c0, m0 = c - c.mean(), measured - measured.mean()
        gain = float(c0 @ m0) / max(float(c0 @ c0), 1e-300)
        squares = float(((m0 - gain * c0) ** 2).sum())
        if squares < least:
            least = squares
            best = gain, float(measured.mean() - gain * c.mean()), float(delay)
    return best


def _without_idle_levels(theta: Array, record: _Record) -> Array:
    """Theta with infinite levels where the command hardly ever asks to exceed them."""
    low, high = theta[3:]
    unlimited = record.predicted(np.array([*theta[:3], -np.inf, np.inf]))
    noise = _noise(record.residual(theta))
    low = low if (unlimited < low - 2 * noise).sum() >= _MIN_SATURATED else -np.inf
    high = high if (unlimited > high + 2 * noise).sum() >= _MIN_SATURATED else np.inf
    return np.array([*theta[:3], low, high])


def _noise(residual: Array) -> float:
    """Standard deviation by the median absolute residual."""
    return max(MAD * float(np.median(np.abs(residual))), 1e-12)


def _errors(theta: Array, record: _Record) -> Array:
    """Standard errors (3,) of gain, bias and delay: sandwich covariance clustered by blocks.

    J by central differences; B / (B - 1) (J'J)^-1 sum_b s_b s_b' (J'J)^-1 with s_b = J_b' r_b of
    each of B blocks of time.
    """
    step = np.array([1e-4, 1e-6 * max(float(np.ptp(record.measured)), 1e-12), 1e-5])
    columns = [
        (record.predicted(theta + s) - record.predicted(theta - s)) / (2 * s.sum())
        for s in np.pad(np.diag(step), ((0, 0), (0, 2)))
    ]
    J = np.stack(columns, axis=1)
    residual = record.measured - record.predicted(theta)
    block = np.arange(len(record.time)) * _BLOCKS // len(record.time)
    scale = 1.0 / np.sqrt(np.maximum((J**2).sum(axis=0), 1e-300))
    J = J * scale
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-10, hermitian=True)
    scores = np.stack([J[block == b].T @ residual[block == b] for b in range(_BLOCKS)])
    matrix = _BLOCKS / (_BLOCKS - 1) * inverse @ (scores.T @ scores) @ inverse
    return np.sqrt(np.diag(matrix)) * scale
