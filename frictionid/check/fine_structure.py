"""Fine structure of logged signals: quantisation step, noise floor, and what explains the noise.

A sensor's readings scatter about any smooth curve, at all times, and most come in steps. A computed
value follows a smooth curve to many digits, at least while the controller feeds back no noise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array

# Neighbours on each side from which a sample is predicted; the best of these counts.
NEIGHBOURS = (1, 2, 3)
# Stretches of a recording whose noise is compared, and the fewest samples of one.
STRETCHES, FEWEST = 50, 100
# Fewest different readings that show a quantisation step.
DISTINCT = 12
_MAD = 1.4826  # standard deviation over median absolute deviation, of normal noise


class Noise(NamedTuple):
    """Noise of one column.

    level : standard deviation, of the whole recording; floor : of its quietest stretch; steady :
    whether it is white and equal in all of several stretches, as a sensor's
    """

    level: float
    floor: float
    steady: bool


def resolution(values: Array) -> float:
    """Step of which all differences between readings are multiples, 0 where there is none.

    >>> resolution(np.array([0.1, 0.3, 0.2, 0.6, 0.2])).__round__(6)
    0.1
    """
    return _step(np.unique(values))


def _step(readings: Array) -> float:
    """Step of different readings in increasing order."""
    gaps = np.diff(readings)
    if len(gaps) < 2:
        return 0.0
    step = float(np.quantile(gaps, 0.1))
    ratio = gaps / step
    return step if np.mean(np.abs(ratio - np.rint(ratio)) < 0.05) > 0.9 else 0.0


def quantisation(values: Array) -> float:
    """Quantisation step of a sensor, 0 where there is none or too few readings differ."""
    readings = np.unique(values)
    return _step(readings) if len(readings) >= DISTINCT else 0.0


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


def repeated(values: Array) -> float:
    """Share of the readings that equal the one before."""
    return float(np.mean(np.diff(values) == 0.0)) if len(values) > 1 else 0.0


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
    return float(_MAD * both.mean())


def run_edges(flags: Array) -> tuple[Array, Array]:
    """First samples of the runs of true flags (T,), and the samples behind them.

    >>> [edge.tolist() for edge in run_edges(np.array([True, True, False, True]))]
    [[0, 3], [2, 4]]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return edges[::2], edges[1::2]
