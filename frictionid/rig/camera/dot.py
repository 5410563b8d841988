"""One coloured dot: its colour, and its size and noise as learnt from the frames before."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from frictionid.arrays import Array
from frictionid.rig.camera.blobs import Blob, DotModel, Patch, axis_of, centroid
from frictionid.rig.camera.marker_setup import Marker

_AREA_TOLERANCE = 0.1  # by which a dot's area may differ from its median
_FEW = 5  # dots that make a median


class Dot:
    """A marker's dot: its colour, and its size and noise learnt from the frames before."""

    def __init__(self, marker: Marker, alike: list[int]):
        assert marker.hue is not None
        self.axis = axis_of(marker.hue, marker.saturation, marker.value)
        self.alike = alike  # markers whose dots have the same colour
        self.model = DotModel(marker.radius)
        self.full_area = math.pi * marker.radius**2
        self.missing = 0
        self._areas: deque[float] = deque(maxlen=31)
        self._noises: deque[float] = deque(maxlen=200)

    @property
    def radius(self) -> float:
        """Radius [px] of the dot."""
        return self.model.radius

    def whole_blob(self, patch: Patch, near: Array, streak: Array) -> Blob | None:
        """The dot near a place, if it is whole."""
        blob = centroid(patch, near, streak, self.model)
        return blob if blob is not None and self._is_whole(blob) else None

    def _is_whole(self, blob: Blob) -> bool:
        """Whether the area is the usual one, so that nothing hides a part of the dot."""
        if len(self._areas) < _FEW:
            return 0.4 * self.full_area < blob.area < 2.5 * self.full_area
        return abs(blob.area / _median(self._areas) - 1) < _AREA_TOLERANCE

    def learn(self, blob: Blob) -> None:
        """Take over area and amplitude of a whole dot."""
        self._areas.append(blob.area)
        self.model = DotModel(self.radius, blob.amplitude, self.model.noise)
        self.missing = 0

    @property
    def knows_noise(self) -> bool:
        """Whether the noise has been measured in enough frames."""
        return len(self._noises) >= 20

    def learn_noise(self, noise: float) -> None:
        """Take over the noise around the dot, if it was measured."""
        if np.isfinite(noise):
            self._noises.append(noise)
            self.model = DotModel(self.radius, self.model.amplitude, _median(self._noises))


def _median(values: deque[float]) -> float:
    """Upper median, as quickly as a few dozen numbers allow."""
    return sorted(values)[len(values) // 2]
