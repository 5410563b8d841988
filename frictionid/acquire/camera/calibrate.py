"""Tilt and lens of a camera from what it sees: links do not change their length."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from frictionid.arrays import Array
from frictionid.data.marker_geometry import Plane, flattened

_MOST = 600  # frames that are used
_PRIORS = np.array([0.01, 0.01, 0.05, 0.05, 0.05])  # of stretch, slant and bulge, see Plane
_FREE, _SLACK = 3.0, 0.3  # [px] of a pivot that someone has pointed at; of a link beyond the noise
_ENOUGH, _HUBER = 200, 2.0
_RATIO = 0.1  # by which the links' lengths may contradict the picture


class Calibration(NamedTuple):
    """What a video says of its camera.

    plane : how the picture's points lie in the plane of motion; pivot (2,) and lengths (n,) [px]
    there; residual (T, n) [px], by which links seem longer, nan where an end is hidden
    """

    plane: Plane
    pivot: Array | None
    lengths: Array
    residual: Array


def calibrate(
    markers: Array,
    sigma: Array,
    found: Array,
    size: tuple[int, int],
    *,
    fixed: bool,
    view: bool = True,
    lengths: Array | None = None,
) -> Calibration:
    """Plane in which links keep their lengths, robustly, least changed from the picture itself.

    Parameters
    ----------
    markers : array, shape (T, n + 1, 2) [px]
    sigma : array, shape (T, n + 1) [px]
    found : array of bool, shape (T, n + 1)
    size : width and height of the picture [px]
    fixed : bool
        Whether the first marker is one place that someone has pointed at, which is then corrected.
    view : bool
        False leaves tilt and lens alone and corrects the pivot only.
    lengths : array, shape (n,), optional
        Of the links, in any unit: their ratio is known then.
    """
    n = markers.shape[1] - 1
    both = found[:, 1:] & found[:, :-1]
    rows = np.flatnonzero(both.any(axis=1))
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), _MOST)).astype(int)]
    seen, use = markers[rows], both[rows]
    noise = np.sqrt(np.nan_to_num(sigma[rows, 1:]) ** 2 + np.nan_to_num(sigma[rows, :-1]) ** 2)
    noise = np.hypot(noise, 0.05)
    start = np.array([np.median(link[u]) for link, u in zip(_links(seen).T, use.T, strict=True)])
    trust = np.sqrt(min(1.0, _ENOUGH / max(int(use.sum()), 1)))
    # one circle looks like a circle through many a perspective and lens
    shape = np.array([1.0, 1.0, n > 1, n > 1, n > 1]) * view
    told = None if lengths is None else np.asarray(lengths) / np.asarray(lengths)[0]

    def parts(x: Array) -> tuple[Plane, Array, Array]:
        own = x[7 : 7 + (n if told is None else 1)]
        return (
            Plane(size, tuple(x[:5] * shape)),
            x[5:7] * fixed,
            own if told is None else own * told,
        )

    def residual(x: Array) -> Array:
        plane, shift, length = parts(x)
        moved = seen.copy()
        moved[:, 0] += shift
        off = _calmed((_links(flattened(moved, plane)) - length) / noise)
        # neighbouring frames err alike: no more of them count than a few dozen
        return np.concatenate([trust * off[use], x[:5] / _PRIORS, x[5:7] / _FREE])

    first = start if told is None else np.array([np.mean(start / told)])
    scale = np.concatenate([_PRIORS, [1.0, 1.0], np.ones(len(first))])
    x0 = np.concatenate([np.zeros(7), first])
    fit = least_squares(residual, x0, x_scale=scale)
    plane, shift, length = parts(fit.x)
    moved = markers.copy()
    moved[:, 0] += shift
    off = np.where(both, _links(flattened(moved, plane)) - length, np.nan)
    return Calibration(plane, moved[0, 0] if fixed else None, length, off)


def _calmed(x: Array) -> Array:
    """Residuals whose squares grow like Huber's cost: wrong dots must not bend the view."""
    size = np.abs(x)
    far = np.sqrt(np.maximum(2 * _HUBER * size - _HUBER**2, 0.0))
    return np.asarray(np.sign(x) * np.where(size > _HUBER, far, size))


def contradiction(markers: Array, found: Array, lengths: Array) -> tuple[Array, Array] | None:
    """Ratios of the links, seen and told, where they contradict each other, else None.

    >>> chain = np.array([[[0.0, 0.0], [0.0, 10.0], [0.0, 30.0]]])
    >>> contradiction(chain, np.ones((1, 3), bool), np.array([0.1, 0.2])) is None
    True
    """
    both = found[:, 1:] & found[:, :-1]
    pairs = zip(_links(markers).T, both.T, strict=True)
    seen = np.array([np.median(link[use]) if use.any() else np.nan for link, use in pairs])
    ratio, told = seen / seen[0], np.asarray(lengths) / lengths[0]
    return (ratio, told) if (np.abs(ratio / told - 1) > _RATIO).any() else None


def _links(markers: Array) -> Array:
    return np.asarray(np.linalg.norm(np.diff(markers, axis=-2), axis=-1))
