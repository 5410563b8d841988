"""Facts of the recordings, joint by joint: motion, torque, clock, noise and resolution.

A sensor's readings scatter about any smooth curve, at all times, and most come in steps. A computed
value follows a smooth curve to many digits, at least while the controller feeds back no noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from frictionid.arrays import MAD, Array, rms
from frictionid.data.recordings import Recording
from frictionid.data.state_estimators import resolutions

from .motion import Motion, speeds_of


@dataclass(frozen=True)
class JointFacts:
    """Facts of one joint; SI units.

    range : span of all angles ; fast : speed exceeded in 5 % of the time ; top : largest speed ;
    forward : share of the moving time in the positive direction ; at_rest : share of the time below
    `rest_speed` ; reversals : changes of direction ; torque : RMS ; torque_top ; torque_noise and
    angle_noise : standard deviations ; velocity_noise : of the smoothed velocity ; angle_step and
    torque_step : resolution, 0 where there is none
    """

    joint: int
    range: float
    fast: float
    top: float
    rest_speed: float
    at_rest: float
    forward: float
    reversals: int
    torque: float
    torque_top: float
    angle_noise: float
    velocity_noise: float
    torque_noise: float
    angle_step: float
    torque_step: float


def joints_of(recordings: Sequence[Recording], motions: Sequence[Motion]) -> list[JointFacts]:
    """Facts of each joint."""
    q = np.concatenate([r.angle.value for r in recordings])
    u = np.concatenate([r.torque.value for r in recordings])
    w = np.concatenate([m.states.w for m in motions])
    threshold, fast = speeds_of(motions)
    moving = np.abs(w) > threshold
    second = np.concatenate([np.diff(r.torque.value, n=2, axis=0) for r in recordings])
    columns = {
        "range": np.ptp(q, axis=0),
        "fast": fast,
        "top": np.abs(w).max(0),
        "rest_speed": threshold,
        "at_rest": 1 - moving.mean(0),
        "forward": (moving & (w > 0)).sum(0) / np.maximum(moving.sum(0), 1),
        "reversals": np.sum([_reversals(m.states.w, threshold) for m in motions], axis=0),
        "torque": rms(u, 0),
        "torque_top": np.abs(u).max(0),
        "angle_noise": np.median([m.angle_noise for m in motions], axis=0),
        "velocity_noise": np.median([m.velocity_noise for m in motions], axis=0),
        # white noise, from second differences, robustly
        "torque_noise": np.array([scatter_of(column) for column in second.T]) / np.sqrt(6),
        "angle_step": resolutions(q),
        "torque_step": resolutions(u),
    }
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    return [JointFacts(j, **dict(zip(columns, row, strict=True))) for j, row in enumerate(rows, 1)]


def _reversals(w: Array, threshold: Array) -> list[int]:
    """Changes of direction of each joint, above its threshold."""
    sides = (np.sign(w[np.abs(w[:, j]) > least, j]) for j, least in enumerate(threshold))
    return [int((side[1:] != side[:-1]).sum()) for side in sides]


# Neighbours on each side from which a sample is predicted; the best of these counts.
NEIGHBOURS = (1, 2, 3)
# Stretches of a recording whose noise is compared, and the fewest samples of one.
STRETCHES, FEWEST = 50, 100


class Noise(NamedTuple):
    """Noise of one column.

    level : standard deviation, of the whole recording; floor : of its quietest stretch; steady :
    whether it is white and equal in all of several stretches, as a sensor's
    """

    level: float
    floor: float
    steady: bool


def deviations(time: Array, values: Array, neighbours: int = 2) -> Array:
    """Deviations (T - 2 neighbours, n) of samples (T, n) from the polynomial through neighbours.

    Divided by the factor that white noise has in them, so that they have its standard deviation.

    >>> time = np.array([0.0, 0.1, 0.25, 0.3, 0.5])
    >>> float(abs(deviations(time, time[:, None] ** 2)).max()) < 1e-15
    True
    """
    inner = np.arange(neighbours, len(time) - neighbours)
    others = np.r_[-neighbours:0, 1 : neighbours + 1]
    at = inner[:, None] + others
    apart = time[at] - time[inner, None]
    weight = np.ones(at.shape)
    for a in range(at.shape[1]):
        for b in range(at.shape[1]):
            if a != b:
                weight[:, a] *= apart[:, b] / (apart[:, b] - apart[:, a])
    left = values[inner] - np.einsum("ta,tan->tn", weight, values[at])
    out: Array = left / np.sqrt(1.0 + (weight**2).sum(1))[:, None]
    return out


def noise_of(time: Array, values: Array) -> Noise:
    """Noise of one column (T,), robustly; curvature of the signal counts as noise where it shows.

    Stretches in which the readings merely repeat say nothing and are left out.
    """
    each = [deviations(time, values[:, None], m)[:, 0] for m in NEIGHBOURS]
    levels = [scatter_of(d) for d in each]
    best = each[int(np.argmin(levels))]
    count = min(STRETCHES, max(len(best) // FEWEST, 1))
    repeats = np.append(np.diff(values) == 0.0, False)
    stretches = [
        scatter_of(stretch)
        for stretch, same in zip(
            np.array_split(best, count), np.array_split(repeats, count), strict=True
        )
        if same.mean() < 0.5
    ] or [min(levels)]
    # predictions from more or fewer neighbours agree on the level of white noise only
    white = max(levels) < 1.3 * min(levels)
    even = len(stretches) > 3 and max(stretches) < 2.5 * min(stretches)
    return Noise(min(levels), min(stretches), white and even)


def unexplained_noise(time: Array, values: Array, readings: Array) -> float:
    """Share (0 to 1) of a column's noise that the noise of readings (T, m) leaves.

    A controller that differentiates readings feeds their noise back into its command; of a sensor's
    own noise they explain nothing. Robust least squares (Huber weights) on the last five rows.
    """
    lags = 5
    noise, causes = deviations(time, values[:, None])[:, 0], deviations(time, readings)
    rows = len(noise) - lags
    if rows < 10 * lags * readings.shape[1] or not noise.any():
        return 1.0
    columns = np.hstack([causes[lags - k : len(noise) - k] for k in range(lags)])
    target, weight = noise[lags:], np.ones(rows)
    for _ in range(6):
        root = np.sqrt(weight)[:, None]
        x = np.linalg.lstsq(columns * root, target * root[:, 0], rcond=1e-10)[0]
        left = target - columns @ x
        weight = 1.0 / np.maximum(np.abs(left) / (1.5 * scatter_of(left) + 1e-300), 1.0)
    return float(min(scatter_of(left) / max(scatter_of(target), 1e-300), 1.0))


def scatter_of(values: Array) -> float:
    """Standard deviation of normal noise about zero, by the median of its sizes."""
    if not len(values):
        return 0.0
    size, middle = np.abs(values), len(values) // 2
    size.partition((middle - 1, middle))  # the median, at a quarter of its time for few values
    both = size[middle - 1 : middle + 1] if len(size) % 2 == 0 else size[middle : middle + 1]
    return float(MAD * both.mean())
