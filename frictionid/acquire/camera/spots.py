"""Sub-pixel places of coloured dots: soft centroids of how much of a dot's colour a pixel has.

The share is a linear function of blue, green and red that is 1 in the dot's colour and 0 in every
grey, however bright: light, shadows and the links' metal do not matter, and what exposure and lens
blur keeps its centroid.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from frictionid.acquire.camera.source import Image
from frictionid.arrays import Array

_LEVEL = 0.4  # share of the colour from which on a pixel may belong to a dot
_EDGE = 2.5  # [px] around the dot that still count
_INNER = 0.5  # share of the radius within which a dot's colour is read
_BLOCK = 4  # [px] of blocks whose means tell the noise that a centroid feels
_TINT = 0.08  # share of the dot's own colour that backgrounds may have
_FLOOR = 0.015  # [px]: what compression and the grid of pixels leave


class Spot(NamedTuple):
    """A dot.

    at : (2,) [px]; sigma : its standard deviation [px]; amplitude : share of the colour in its
    middle; area : [px^2] that it would have in this colour throughout, whatever the light
    """

    at: Array
    sigma: float
    amplitude: float
    area: float


class Patch(NamedTuple):
    """Share of a colour (height, width) in a part of a picture whose first pixel is `corner`."""

    share: Array
    corner: tuple[int, int]


def axis_of(hue: float, saturation: float, value: float) -> Array:
    """Weights (1, 3) of blue, green and red that give the share of a colour.

    >>> (axis_of(0.0, 1.0, 1.0) @ [[0.0, 9.0], [0.0, 9.0], [255.0, 9.0]]).round(6)
    array([[1., 0.]])
    """
    pixel = np.array([[[hue, saturation, value]]], dtype=np.float32)
    bgr = 255.0 * cv2.cvtColor(pixel, cv2.COLOR_HSV2BGR)[0, 0].astype(float)
    colourful = bgr - bgr.mean()
    return np.asarray((colourful / (colourful @ colourful))[None], dtype=np.float32)


def patch(image: Image, axis: Array, low: Array, high: Array) -> Patch | None:
    """Share of a colour between two corners (x, y), None where that lies outside the picture."""
    height, width = image.shape[:2]
    x0, y0 = max(int(low[0]), 0), max(int(low[1]), 0)
    x1, y1 = min(int(high[0]) + 1, width), min(int(high[1]) + 1, height)
    if x1 - x0 < 3 or y1 - y0 < 3:
        return None
    part = image[y0:y1, x0:x1].astype(np.float32)
    return Patch(cv2.transform(part, axis), (x0, y0))


def blobs(found: Patch, amplitude: float, radius: float) -> Array:
    """Centres (B, 2) [px] and areas, shape (B, 3), of connected parts in the colour, largest first.

    Parts of less than a third of the dot's area are left out.
    """
    mask = (found.share > _LEVEL * amplitude).astype(np.uint8)
    count, _, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=4)
    if count < 2:
        return np.zeros((0, 3))
    area = stats[1:, cv2.CC_STAT_AREA].astype(float)
    order = np.argsort(-area)
    order = order[area[order] >= np.pi * radius**2 / 3]
    table = np.column_stack([centres[1:] + found.corner, area])
    return np.asarray(table[order])


def centroid(
    found: Patch, near: Array, streak: Array, radius: float, amplitude: float, noise: float
) -> Spot | None:
    """The dot near a place, None where there is none.

    Parameters
    ----------
    found : Patch
    near : array, shape (2,) [px]
    streak : array, shape (2,) [px], by which the dot moves during the exposure
    radius : float [px]
    amplitude : float, share of the colour that the dot itself has
    noise : float, variance of the share times the area [px^2] over which it is alike
    """
    share, limit = found.share, 0.15 * amplitude * math.pi * radius**2
    (x0, y0), (dx, dy) = found.corner, (float(v) / 2 for v in streak)
    x, y = float(near[0]) - x0, float(near[1]) - y0
    reach = radius + _EDGE
    mask = np.zeros(share.shape, dtype=np.uint8)
    for _ in range(4):
        mask[:] = 0
        _stadium(mask, (x, y), (dx, dy), reach + 2.5, 2)
        _stadium(mask, (x, y), (dx, dy), reach, 1)
        back, grain = _background(share[mask == 2])
        # what is a little coloured is background of another tint, not dot
        level, inside = back + _TINT * amplitude, mask == 1
        above = np.maximum(share, level)
        above -= level
        above *= inside
        m = cv2.moments(above)
        mass = m["m00"]
        if mass < limit:
            return None
        new = m["m10"] / mass, m["m01"] / mass
        moved = max(abs(new[0] - x), abs(new[1] - y))
        x, y = new
        if moved < 0.25:
            break
    length, left = 2 * math.hypot(dx, dy), _passed(_TINT * amplitude / max(grain, 1e-9))
    full = _spread(radius, length)
    spread = full + left * (_spread(reach, length) - full)
    sigma = math.hypot(math.sqrt(noise * spread) / mass, _FLOOR)
    area = float(np.maximum(share[inside] - back, -0.3 * amplitude).sum())
    mask[:] = 0
    _stadium(mask, (x, y), (0.0, 0.0), radius, 1)
    own = share[mask == 1]
    _stadium(mask, (x, y), (0.0, 0.0), _INNER * radius, 2)
    inner = cv2.mean(share, (mask == 2).view(np.uint8))[0] - back
    # most of the dot, where something small is drawn on its middle
    own.partition(len(own) // 2)
    most = float(own[len(own) // 2]) - back
    inner = max(inner / _filled(length / radius), most)
    if inner < 0.3 * amplitude:
        return None
    return Spot(np.array([x + x0, y + y0]), sigma, inner, area / inner)


def _background(ring: Array) -> tuple[float, float]:
    """Share of the colour around a dot, and its deviation from pixel to pixel; reorders them."""
    if len(ring) < 9:
        return 0.0, 0.0
    low, middle = len(ring) // 6, len(ring) // 2
    ring.partition((low, middle))
    return float(ring[middle]), float(ring[middle] - ring[low])


def _passed(level: float) -> float:
    """Share of a pixel's noise variance above a level (in standard deviations) that is taken off.

    >>> round(_passed(0.0), 3), round(_passed(3.0), 3)
    (0.341, 0.0)
    """
    if level > 8:
        return 0.0
    tail = 0.5 * math.erfc(level / math.sqrt(2))
    bell = math.exp(-(level**2) / 2) / math.sqrt(2 * math.pi)
    mean = bell - level * tail
    return (1 + level**2) * tail - level * bell - mean**2


def _spread(radius: float, length: float) -> float:
    """Mean of x^2 and y^2, integrated over a disc drawn out to a streak [px^4]."""
    disc = math.pi * radius**2 * (radius**2 / 2 + length**2 / 4)
    return float((disc + 2 * radius * length * (length**2 / 12 + radius**2 / 3)) / 2)


def _filled(streak: float) -> float:
    """Share of the exposure for which the inner part of a dot is covered; streak in radii.

    >>> [round(_filled(v), 3) for v in (0.5, 2.0, 4.0)]
    [1.0, 0.875, 0.5]
    """
    near, far, half = 1.0 - _INNER, 1.0 + _INNER, streak / 2
    if half <= near:
        return 1.0
    end = min(half, far)  # covered wholly to `near`, less and less to `far`, averaged to `half`
    partly = (far * (end - near) - (end**2 - near**2) / 2) / (far - near)
    return (near + partly) / half


def _stadium(
    mask: Image, at: tuple[float, float], half: tuple[float, float], reach: float, value: int
) -> None:
    (x, y), (dx, dy) = at, half
    begin = round(16 * (x - dx)), round(16 * (y - dy))
    end = round(16 * (x + dx)), round(16 * (y + dy))
    cv2.line(mask, begin, end, value, max(round(2 * reach), 1), cv2.LINE_8, 4)


def noise_of(found: Patch, at: Array, reach: float) -> float:
    """Noise as `centroid` wants it, of what lies around a dot; nan where too little does."""
    share = found.share
    rows, columns = share.shape[0] // _BLOCK, share.shape[1] // _BLOCK
    if rows < 2 or columns < 2:
        return float("nan")
    part = share[: rows * _BLOCK, : columns * _BLOCK]
    means = cv2.resize(part, (columns, rows), interpolation=cv2.INTER_AREA)
    y, x = (np.mgrid[:rows, :columns] + 0.5) * _BLOCK - 0.5
    x, y = x + found.corner[0] - at[0], y + found.corner[1] - at[1]
    away = means[np.hypot(x, y) > reach + 2 * _BLOCK]
    if len(away) < 12:
        return float("nan")
    middle = np.median(away)
    return float((1.4826 * np.median(np.abs(away - middle))) ** 2 * _BLOCK**2)
