"""Tilt and lens distortion of a camera, estimated from links whose lengths are constant."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from frictionid.arrays import Array
from frictionid.data.marker_geometry import Plane, flattened, link_lengths

_MAX_FRAMES = 600
# Prior standard deviations of stretch, slant and bulge, see Plane, and of a given pivot [px].
_PLANE_SIGMA = np.array([0.01, 0.01, 0.05, 0.05, 0.05])
_PIVOT_SIGMA = 3.0
_FLOOR = 0.05  # [px], added to the noise
# Neighbouring frames err alike: no more than so many residuals count as independent.
_INDEPENDENT = 200
_HUBER = 2.0  # standard deviations from which on the cost grows linearly
_RATIO = 0.1  # by which the links' lengths may contradict the picture


class ViewCalibration(NamedTuple):
    """View of a camera onto the plane of motion.

    Attributes
    ----------
    plane : map from the picture to the plane of motion
    pivot : array, shape (2,) [px], corrected; None where the pivot is a dot
    lengths : array, shape (n,) [px], of the links in the plane
    residual : array, shape (T, n) [px], measured minus estimated length, nan where an end is hidden
    """

    plane: Plane
    pivot: Array | None
    lengths: Array
    residual: Array


def calibrate_view(
    markers: Array,
    sigma: Array,
    found: Array,
    size: tuple[int, int],
    *,
    fixed: bool,
    view: bool = True,
    lengths: Array | None = None,
) -> ViewCalibration:
    """View in which links keep their lengths: robust least squares with priors on the plane.

    The unknowns are x = (shape of the plane (5), shift of the pivot (2), lengths of the links).

    Parameters
    ----------
    markers : array, shape (T, n + 1, 2) [px]
    sigma : array, shape (T, n + 1) [px]
    found : array of bool, shape (T, n + 1)
    size : width and height of the picture [px]
    fixed : bool
        Whether the first marker is one given place, which is then corrected.
    view : bool
        False corrects the pivot only, not tilt and lens.
    lengths : array, shape (n,), optional
        Of the links, in any unit: only their ratio counts.
    """
    n = markers.shape[1] - 1
    both = found[:, 1:] & found[:, :-1]
    rows = np.flatnonzero(both.any(axis=1))
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), _MAX_FRAMES)).astype(int)]
    use = both[rows]
    noise = np.hypot(link_noise(sigma[rows]), _FLOOR)
    weight = np.sqrt(min(1.0, _INDEPENDENT / max(int(use.sum()), 1)))
    # a single link draws a circle, which looks like one under many perspectives and lenses
    free = np.array([1.0, 1.0, n > 1, n > 1, n > 1]) * view
    ratio = np.eye(n) if lengths is None else np.asarray(lengths)[:, None] / lengths[0]
    model = _Model(size, free, fixed, ratio)

    def residual(x: Array) -> Array:
        off = _huber(model.residual(x, markers[rows]) / noise)
        return np.concatenate([weight * off[use], x[:5] / _PLANE_SIGMA, x[5:7] / _PIVOT_SIGMA])

    seen = link_lengths(markers[rows])
    start = np.array([np.median(link[u]) for link, u in zip(seen.T, use.T, strict=True)])
    first = start if lengths is None else np.array([np.mean(start / ratio[:, 0])])
    scale = np.concatenate([_PLANE_SIGMA, [1.0, 1.0], np.ones(len(first))])
    x = least_squares(residual, np.concatenate([np.zeros(7), first]), x_scale=scale).x
    pivot = markers[0, 0] + model.shift(x) if fixed else None
    off = np.where(both, model.residual(x, markers), np.nan)
    return ViewCalibration(model.plane(x), pivot, model.lengths(x), off)


class _Model(NamedTuple):
    """What the unknowns x stand for.

    free : array, shape (5,), zero for shapes of the plane that stay zero; fixed : whether the pivot
    is given; ratio : array, shape (n, m), from the last m unknowns to the lengths of the links
    """

    size: tuple[int, int]
    free: Array
    fixed: bool
    ratio: Array

    def plane(self, x: Array) -> Plane:
        return Plane(self.size, tuple(x[:5] * self.free))

    def shift(self, x: Array) -> Array:
        return x[5:7] * self.fixed

    def lengths(self, x: Array) -> Array:
        return (self.ratio * x[7:]).sum(axis=1)

    def residual(self, x: Array, markers: Array) -> Array:
        """Measured minus estimated lengths (T, n) [px] of the links in the plane."""
        moved = markers.copy()
        moved[:, 0] += self.shift(x)
        return link_lengths(flattened(moved, self.plane(x))) - self.lengths(x)


def link_noise(sigma: Array) -> Array:
    """Standard deviations (T, n) of links between markers with deviations (T, n + 1); nan is 0."""
    known = np.nan_to_num(sigma)
    return np.asarray(np.sqrt(known[:, 1:] ** 2 + known[:, :-1] ** 2))


def _huber(x: Array) -> Array:
    """Residuals whose squares are Huber's cost, so that wrong dots do not bend the view."""
    size = np.abs(x)
    far = np.sqrt(np.maximum(2 * _HUBER * size - _HUBER**2, 0.0))
    return np.asarray(np.sign(x) * np.where(size > _HUBER, far, size))


def length_contradiction(
    markers: Array, found: Array, lengths: Array
) -> tuple[Array, Array] | None:
    """Ratios of the links' lengths as measured and as given where they contradict, else None.

    >>> chain = np.array([[[0.0, 0.0], [0.0, 10.0], [0.0, 30.0]]])
    >>> length_contradiction(chain, np.ones((1, 3), bool), np.array([0.1, 0.2])) is None
    True
    """
    both = found[:, 1:] & found[:, :-1]
    pairs = zip(link_lengths(markers).T, both.T, strict=True)
    seen = np.array([np.median(link[use]) if use.any() else np.nan for link, use in pairs])
    measured, given = seen / seen[0], np.asarray(lengths) / lengths[0]
    return (measured, given) if (np.abs(measured / given - 1) > _RATIO).any() else None
