"""Dots by thresholds, median blur and centroid of the whole picture [DeMeester2020].

For comparison only: nothing is predicted, checked or calibrated.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.rig.camera.follow import FrameMarkers
from frictionid.rig.camera.marker_setup import Marker, MarkerSetup
from frictionid.rig.camera.source import Frame, Image

_HUE = 15.0  # [deg] of hue that belong to a dot
_LEVEL = 0.4  # least saturation and value, relative to the dot's
_BLUR = 5  # [px]


def follow_by_thresholds(setup: MarkerSetup, frames: Iterator[Frame]) -> Iterator[FrameMarkers]:
    """Markers of each frame by thresholds on hue, saturation and value.

    Raises
    ------
    InputError
        For two dots of one colour, which this method cannot tell apart.
    """
    hues = [m.hue for m in setup.markers if m.hue is not None]
    if len(set(hues)) < len(hues):
        raise InputError("--method study cannot tell dots of one colour apart; give each its own")
    theta = np.zeros(setup.n)
    for frame in frames:
        places = [_place(frame.image, m) for m in setup.markers]
        found = np.array([p is not None for p in places])
        at = np.array([np.full(2, np.nan) if p is None else p for p in places])
        link = np.diff(at, axis=0)
        now = np.arctan2(link[:, 0], link[:, 1])
        now = theta + (now - theta + np.pi) % (2 * np.pi) - np.pi
        theta = np.where(np.isfinite(now), now, theta)
        sigma = np.where(found, 0.5, np.nan)  # unknown: half a pixel
        yield FrameMarkers(frame.time, at, sigma, found, theta.copy(), [None] * len(at))


def _place(image: Image, marker: Marker) -> Array | None:
    if marker.hue is None:
        return np.array(marker.at)
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    hue, level = marker.hue / 2, 255 * _LEVEL
    mask = np.zeros(image.shape[:2], dtype=np.uint8)
    for turn in (-180, 0, 180):  # red lies on both sides of 0
        low = np.array([hue + turn - _HUE / 2, level * marker.saturation, level * marker.value])
        high = np.array([hue + turn + _HUE / 2, 255, 255])
        if high[0] >= 0 and low[0] <= 180:
            mask |= np.asarray(cv2.inRange(hsv, np.maximum(low, 0), high), dtype=np.uint8)
    m = cv2.moments(cv2.medianBlur(mask, _BLUR), binaryImage=True)
    return np.array([m["m10"], m["m01"]]) / m["m00"] if m["m00"] else None
