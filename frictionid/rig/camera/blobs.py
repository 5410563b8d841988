"""Sub-pixel centroids of coloured dots, from the share of a dot's colour in each pixel.

The share is a linear function of blue, green and red that is 1 in the dot's colour and 0 in every
grey, however bright: light, shadows and metal do not change it. Being linear, it keeps the centroid
under the blur of exposure and lens.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from frictionid.arrays import MAD, Array
from frictionid.errors import needs

from .marker_setup import Marker
from .source import Image

with needs("camera"):
    import cv2


_LEVEL = 0.4  # share of the colour from which on a pixel may belong to a dot
_EDGE = 2.5  # [px] around the dot that belong to its window
_RING = 2.5  # [px] around the window whose median is the background
_INNER = 0.5  # share of the radius within which a dot's colour is read
_BLOCK = 4  # [px], edge of the blocks whose means show the noise that a centroid has
_TINT = 0.08  # share of the dot's own colour that backgrounds may have
_FLOOR = 0.015  # [px]: what compression and the grid of pixels leave
_ROUNDS, _STILL = 4, 0.25  # iterations of the centroid at most, and the move [px] that ends them
_FAINT, _PALE = 0.15, 0.3  # least mass and least share of the colour, relative to a whole dot


class Blob(NamedTuple):
    """A dot as it was found in a frame.

    Attributes
    ----------
    at : array, shape (2,) [px]
    sigma : standard deviation of its place [px]
    amplitude : share of the colour in its middle
    area : [px^2] that it would have if it had this colour throughout, whatever the light
    """

    at: Array
    sigma: float
    amplitude: float
    area: float


class Patch(NamedTuple):
    """Share of a colour (height, width) in the part of a picture that begins at `corner`."""

    share: Array
    corner: tuple[int, int]


_AREA_TOLERANCE = 0.1  # by which a dot's area may differ from its median
_FEW = 5  # dots that make a median


class Dot:
    """A marker's dot: its colour, and its size and noise learnt from the frames before.

    Attributes
    ----------
    axis : weights of its colour, see `axis_of`
    alike : markers whose dots have the same colour
    radius : [px]
    amplitude : share of the colour that the dot itself has
    noise : variance of the share times the area [px^2] over which it is correlated
    missing : frames without it since it was last seen
    """

    def __init__(self, marker: Marker, alike: list[int]):
        assert marker.hue is not None
        self.axis = axis_of(marker.hue, marker.saturation, marker.value)
        self.alike = alike
        self.radius, self.amplitude, self.noise = marker.radius, 1.0, 0.02
        self.full_area = math.pi * marker.radius**2
        self.missing = 0
        self._areas: deque[float] = deque(maxlen=31)
        self._noises: deque[float] = deque(maxlen=200)

    def whole_blob(self, patch: Patch, near: Array, streak: Array) -> Blob | None:
        """The dot near a place, if it is whole."""
        blob = centroid(patch, near, streak, self)
        if blob is None:
            return None
        # where the area is the usual one nothing hides a part of the dot
        if len(self._areas) < _FEW:
            whole = 0.4 * self.full_area < blob.area < 2.5 * self.full_area
        else:
            whole = abs(blob.area / _median(self._areas) - 1) < _AREA_TOLERANCE
        return blob if whole else None

    def learn(self, blob: Blob) -> None:
        """Take over area and amplitude of a whole dot."""
        self._areas.append(blob.area)
        self.amplitude = blob.amplitude
        self.missing = 0

    @property
    def knows_noise(self) -> bool:
        """Whether the noise has been measured in enough frames."""
        return len(self._noises) >= 20

    def learn_noise(self, noise: float) -> None:
        """Take over the noise around the dot, if it was measured."""
        if np.isfinite(noise):
            self._noises.append(noise)
            self.noise = _median(self._noises)


def _median(values: deque[float]) -> float:
    """Upper median, as quickly as a few dozen numbers allow."""
    return sorted(values)[len(values) // 2]


def axis_of(hue: float, saturation: float, value: float) -> Array:
    """Weights (1, 3) of blue, green and red whose sum is the share of a colour.

    >>> (axis_of(0.0, 1.0, 1.0) @ [[0.0, 9.0], [0.0, 9.0], [255.0, 9.0]]).round(6)
    array([[1., 0.]])
    """
    pixel = np.array([[[hue, saturation, value]]], dtype=np.float32)
    bgr = 255.0 * cv2.cvtColor(pixel, cv2.COLOR_HSV2BGR)[0, 0].astype(float)
    colourful = bgr - bgr.mean()
    return np.asarray((colourful / (colourful @ colourful))[None], dtype=np.float32)


def colour_patch(image: Image, axis: Array, low: Array, high: Array) -> Patch | None:
    """Share of a colour between two corners (x, y), None where that lies outside the picture."""
    height, width = image.shape[:2]
    x0, y0 = max(int(low[0]), 0), max(int(low[1]), 0)
    x1, y1 = min(int(high[0]) + 1, width), min(int(high[1]) + 1, height)
    if x1 - x0 < 3 or y1 - y0 < 3:
        return None
    part = image[y0:y1, x0:x1].astype(np.float32)
    return Patch(cv2.transform(part, axis), (x0, y0))


def colour_regions(patch: Patch, dot: Dot) -> Array:
    """Centres [px] and areas [px^2] of connected regions in the dot's colour, largest first.

    Shape (B, 3): x, y, area. Regions of less than a third of the dot's area are left out.
    """
    mask = (patch.share > _LEVEL * dot.amplitude).astype(np.uint8)
    count, _, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=4)
    if count < 2:
        return np.zeros((0, 3))
    area = stats[1:, cv2.CC_STAT_AREA].astype(float)
    order = np.argsort(-area)
    order = order[area[order] >= np.pi * dot.radius**2 / 3]
    table = np.column_stack([centres[1:] + patch.corner, area])
    return table[order]


class _Window(NamedTuple):
    """The converged window around a dot, in pixels of the patch.

    at : (x, y), the centroid; inside : mask of the window; mass : share summed over it, less
    background and tint; background : share around the window; grain : its deviation from pixel to
    pixel
    """

    at: tuple[float, float]
    inside: Image
    mass: float
    background: float
    grain: float


def centroid(patch: Patch, near: Array, streak: Array, dot: Dot) -> Blob | None:
    """The dot near a place, None where there is none.

    With the share s of a pixel, the background b around the dot and a tint t that backgrounds may
    have, the place is the mean over the window, a stadium as long as the dot's streak,

        at = sum max(s - b - t, 0) (x, y) / mass,    mass = sum max(s - b - t, 0)

    iterated until the window stays. Its variance is noise * spread / mass^2, where the spread is
    the mean of x^2 and y^2 integrated over the part of the window that noise reaches.

    Parameters
    ----------
    patch : Patch
    near : array, shape (2,) [px]
    streak : array, shape (2,) [px], by which the dot moves during the exposure
    dot : Dot
    """
    half = float(streak[0]) / 2, float(streak[1]) / 2
    window = _converged(patch, near, half, dot)
    if window is None:
        return None
    length = 2 * math.hypot(*half)
    amplitude = _amplitude(patch.share, window, dot.radius, length)
    if amplitude < _PALE * dot.amplitude:
        return None
    above = patch.share[window.inside] - window.background
    area = float(np.maximum(above, -_PALE * dot.amplitude).sum())
    at = np.array([window.at[0] + patch.corner[0], window.at[1] + patch.corner[1]])
    return Blob(at, _deviation(window, dot, length), amplitude, area / amplitude)


def _converged(patch: Patch, near: Array, half: tuple[float, float], dot: Dot) -> _Window | None:
    """The window after at most four moves to its own centroid, None where too little is in it."""
    share, reach = patch.share, dot.radius + _EDGE
    least = _FAINT * dot.amplitude * math.pi * dot.radius**2
    at = float(near[0]) - patch.corner[0], float(near[1]) - patch.corner[1]
    for _ in range(_ROUNDS):
        mask = np.zeros(share.shape, dtype=np.uint8)
        _stadium(mask, at, half, reach + _RING, 2)
        _stadium(mask, at, half, reach, 1)
        background, grain = _background(share[mask == 2])
        # what is a little coloured is background of another tint, not dot
        level, inside = background + _TINT * dot.amplitude, mask == 1
        above = np.maximum(share, level)
        above -= level
        above *= inside
        moments = cv2.moments(above)
        mass = moments["m00"]
        if mass < least:
            return None
        before, at = at, (moments["m10"] / mass, moments["m01"] / mass)
        if max(abs(at[0] - before[0]), abs(at[1] - before[1])) < _STILL:
            break
    return _Window(at, inside, mass, background, grain)


def _deviation(window: _Window, dot: Dot, length: float) -> float:
    """Standard deviation of the centroid [px]: noise within the dot, and what passes around it."""
    passed = _passed_noise(_TINT * dot.amplitude / max(window.grain, 1e-9))
    within = _spread(dot.radius, length)
    spread = within + passed * (_spread(dot.radius + _EDGE, length) - within)
    return math.hypot(math.sqrt(dot.noise * spread) / window.mass, _FLOOR)


def _amplitude(share: Array, window: _Window, radius: float, length: float) -> float:
    """Share of the colour in the dot's middle: mean of the inner part, or median of the disc.

    The mean is divided by the share of the exposure in which the inner part is covered; the median
    counts where something small is drawn on the middle.
    """
    mask = np.zeros(share.shape, dtype=np.uint8)
    _stadium(mask, window.at, (0.0, 0.0), radius, 1)
    disc = share[mask == 1]
    _stadium(mask, window.at, (0.0, 0.0), _INNER * radius, 2)
    inner = cv2.mean(share, (mask == 2).view(np.uint8))[0] - window.background
    disc.partition(len(disc) // 2)
    median = float(disc[len(disc) // 2]) - window.background
    return max(inner / _covered_share(length / radius), median)


def _background(ring: Array) -> tuple[float, float]:
    """Median of the share around a dot, and its deviation from pixel to pixel; reorders them."""
    if len(ring) < 9:
        return 0.0, 0.0
    low, middle = len(ring) // 6, len(ring) // 2
    ring.partition((low, middle))
    return float(ring[middle]), float(ring[middle] - ring[low])


def _passed_noise(level: float) -> float:
    """Share of a pixel's noise variance that exceeds a level (in standard deviations).

    The variance of max(x - level, 0) for standard normal x.

    >>> round(_passed_noise(0.0), 3), round(_passed_noise(3.0), 3)
    (0.341, 0.0)
    """
    if level > 8:
        return 0.0
    tail = 0.5 * math.erfc(level / math.sqrt(2))
    density = math.exp(-(level**2) / 2) / math.sqrt(2 * math.pi)
    mean = density - level * tail
    return (1 + level**2) * tail - level * density - mean**2


def _spread(radius: float, length: float) -> float:
    """Mean of x^2 and y^2, integrated over a disc drawn out to a streak [px^4]."""
    disc = math.pi * radius**2 * (radius**2 / 2 + length**2 / 4)
    return float((disc + 2 * radius * length * (length**2 / 12 + radius**2 / 3)) / 2)


def _covered_share(streak: float) -> float:
    """Share of the exposure in which the dot covers its inner part; streak in radii.

    It is covered wholly until the dot is `near` away, less and less until it is `far` away.

    >>> [round(_covered_share(v), 3) for v in (0.5, 2.0, 4.0)]
    [1.0, 0.875, 0.5]
    """
    near, far, half = 1.0 - _INNER, 1.0 + _INNER, streak / 2
    if half <= near:
        return 1.0
    end = min(half, far)
    partly = (far * (end - near) - (end**2 - near**2) / 2) / (far - near)
    return (near + partly) / half


def _stadium(
    mask: Image, at: tuple[float, float], half: tuple[float, float], reach: float, value: int
) -> None:
    """Write a value into all pixels nearer than `reach` to the line from at - half to at + half."""
    (x, y), (dx, dy) = at, half
    begin = round(16 * (x - dx)), round(16 * (y - dy))
    end = round(16 * (x + dx)), round(16 * (y + dy))
    cv2.line(mask, begin, end, value, max(round(2 * reach), 1), cv2.LINE_8, 4)


def noise_of(patch: Patch, at: Array, reach: float) -> float:
    """Noise, see `Dot`, of what lies around a dot; nan where too little does."""
    share = patch.share
    rows, columns = share.shape[0] // _BLOCK, share.shape[1] // _BLOCK
    if rows < 2 or columns < 2:
        return float("nan")
    part = share[: rows * _BLOCK, : columns * _BLOCK]
    means = cv2.resize(part, (columns, rows), interpolation=cv2.INTER_AREA)
    y, x = (np.mgrid[:rows, :columns] + 0.5) * _BLOCK - 0.5
    x, y = x + patch.corner[0] - at[0], y + patch.corner[1] - at[1]
    away = means[np.hypot(x, y) > reach + 2 * _BLOCK]
    if len(away) < 12:
        return float("nan")
    middle = np.median(away)
    return float((MAD * np.median(np.abs(away - middle))) ** 2 * _BLOCK**2)
