"""Geometry of pictures: joint angles from the pixels of markers.

Pixels count to the right and downwards. Angles are those of the mechanisms: 0 hangs down,
counter-clockwise in the picture is positive; the first is absolute, each other one relative to the
link before.
"""

from typing import NamedTuple

import numpy as np

from .signals import Array


def link_angles(markers: Array) -> Array:
    """Joint angles of a chain of links by their ends, shape (T, n) [rad], unwrapped.

    theta_i = atan2(x_i+1 - x_i, y_i+1 - y_i),  q_1 = theta_1,  q_i = theta_i - theta_i-1

    Each starts within (-pi, pi] and changes by less than half a turn between frames.

    Parameters
    ----------
    markers : array, shape (T, n + 1, 2), any unit of length
        Pivot, the joints behind it and the tip; x to the right, y downwards.

    Examples
    --------
    A link to the right of the pivot, the next one straight up from its end:

    >>> np.degrees(link_angles(np.array([[[0.0, 0.0], [5.0, 0.0], [5.0, -3.0]]])))
    array([[90., 90.]])
    """
    link = np.diff(np.asarray(markers, float), axis=1)
    absolute = np.arctan2(link[..., 0], link[..., 1])
    relative = np.diff(absolute, axis=1, prepend=0.0)
    within_a_turn = np.pi - np.mod(np.pi - relative, 2 * np.pi)  # in (-pi, pi]
    return np.unwrap(within_a_turn, axis=0)


def link_lengths(markers: Array) -> Array:
    """Distances of neighbouring markers (T, n + 1, 2), shape (T, n), in the markers' unit.

    >>> link_lengths(np.array([[[0.0, 0.0], [3.0, 4.0]]]))
    array([[5.]])
    """
    return np.linalg.norm(np.diff(np.asarray(markers, float), axis=1), axis=-1)


def hold_pivot(markers: Array) -> Array:
    """The markers (T, n + 1, 2) with the pivot at its median over time, for a fixed one.

    >>> seen = np.array([[[0.0, 1.0], [2.0, 9.0]], [[4.0, 1.0], [3.0, 9.0]]])
    >>> hold_pivot(seen)[:, 0]
    array([[2., 1.],
           [2., 1.]])
    """
    markers = np.array(markers, float)
    markers[:, 0] = np.median(markers[:, 0], axis=0)
    return markers


def mirror(markers: Array) -> Array:
    """The markers as seen from the other side, left and right exchanged.

    >>> mirror(np.array([[[2.0, 3.0]]]))
    array([[[-2.,  3.]]])
    """
    return np.asarray(markers, float) * np.array([-1.0, 1.0])


class Plane(NamedTuple):
    """Map from a picture to the plane of motion, for `flattened`.

    size : width and height of the picture [px]
    shape : stretch along x against y and along the diagonal, slant to the right and downwards
        (perspective), bulge (lens distortion); relative to the half diagonal, about the middle
    """

    size: tuple[int, int]
    shape: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)


def flattened(points: Array, plane: Plane) -> Array:
    """Points (..., 2) [px] as a camera without tilt and lens distortion would see them [px].

    With p from the picture's middle in half diagonals, p <- p (1 + bulge |p|^2), then
    p <- p / (1 + slant p), then p <- p + [[a, b], [b, -a]] p.

    >>> flattened(np.array([[10.0, 20.0]]), Plane((640, 480)))
    array([[10., 20.]])
    """
    stretch, diagonal, right, down, bulge = plane.shape
    middle = (np.array(plane.size, float) - 1) / 2
    half = np.linalg.norm(middle)
    p = (np.asarray(points, float) - middle) / half
    p = p * (1.0 + bulge * (p**2).sum(-1, keepdims=True))
    p = p / (1.0 + p @ np.array([right, down]))[..., None]
    p = p + p @ np.array([[stretch, diagonal], [diagonal, -stretch]])
    return middle + half * p
