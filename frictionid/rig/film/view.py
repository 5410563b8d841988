"""Pixels at which a tilted camera with a lens sees points of the plane of motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from frictionid.config import Positive, check_settings
from frictionid.data.signals import Array
from frictionid.errors import InputError

Pixels = Annotated[int, Field(ge=1, le=8192)]  # a picture of 8192 x 8192 takes 0.2 GB
_FAR = 10.0  # sizes of the picture


@dataclass(frozen=True)
class View:
    """A pinhole camera with radial distortion that looks at a plane.

    Attributes
    ----------
    size : pixels to the right and downwards
    pivot : pixel at which an untilted camera without distortion sees the fixed joint
    scale : pixels per metre at the pivot's distance
    distance : of the camera from the plane [m]
    tilt : rotation vector [deg] of the plane about the picture's horizontal and vertical axis
    distortion : share by which points at the corners of the picture move outwards
    """

    size: tuple[Pixels, Pixels] = (1280, 720)
    pivot: tuple[float, float] = (640.0, 360.0)
    scale: Positive = 900.0
    distance: Positive = 2.0
    tilt: tuple[float, float] = (0.0, 0.0)
    distortion: float = 0.0

    def __post_init__(self) -> None:
        check_settings(self)
        for at, size in zip(self.pivot, self.size, strict=True):
            if abs(at) > _FAR * size:
                raise InputError(
                    f"pivot = {list(self.pivot)} is far outside of a picture of {list(self.size)} "
                    "pixels: it is the pixel of the fixed joint"
                )

    def pixels(self, points: Array) -> Array:
        """Pixels (..., 2), x to the right and y downwards, of points (..., 2) [m] from the pivot.

        The points count to the right and downwards, too.

        >>> View().pixels(np.array([[0.1, 0.0]]))
        array([[730., 360.]])
        """
        size, pivot = np.array(self.size, float), np.array(self.pivot)
        middle = (size - 1) / 2
        flat = np.asarray(points, float) + (pivot - middle) / self.scale
        X = flat @ _turned(*np.radians(self.tilt)).T  # (..., 3)
        seen = X[..., :2] / (1.0 + X[..., 2:] / self.distance) * self.scale
        corner = np.linalg.norm(middle)
        out = 1.0 + self.distortion * (seen**2).sum(-1, keepdims=True) / corner**2
        return np.asarray(middle + seen * out)


def _turned(about_x: float, about_y: float) -> Array:
    """The first two columns (3, 2) of the rotation by a vector in the picture's plane."""
    return np.asarray(Rotation.from_rotvec([about_x, about_y, 0.0]).as_matrix()[:, :2])


def chain(angles: Array, lengths: Array) -> Array:
    """Pivot, joints and tip (T, n + 1, 2) [m] from the pivot, for joint angles (T, n) [rad].

    Angles are relative to the link before and 0 where the chain hangs; x to the right, y downwards.

    >>> chain(np.array([[np.pi / 2, 0.0]]), np.array([1.0, 2.0])).round(9)[0, -1]
    array([3., 0.])
    """
    absolute = np.cumsum(angles, axis=-1)
    links = np.stack([np.sin(absolute), np.cos(absolute)], axis=-1) * np.asarray(lengths)[:, None]
    ends = np.cumsum(links, axis=-2)
    return np.concatenate([np.zeros_like(ends[..., :1, :]), ends], axis=-2)
