"""Dots followed from frame to frame: predicted, assigned by geometry, never invented.

Each marker is looked for in a small window around where the chain's motion predicts it; one that is
not there, or not there in full, is missing in that frame. Only after some frames without it the
whole picture is searched.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from frictionid.acquire.camera.marks import Marker, Marks
from frictionid.acquire.camera.source import Frame, Image
from frictionid.acquire.camera.spots import Patch, Spot, axis_of, blobs, centroid, noise_of, patch
from frictionid.arrays import Array

_MARGIN, _FIRST = 9.0, 1.6  # [px], and px per sample of a link's length while speeds are unknown
_GROWS = 5.0  # [px] for each frame in which a dot was missing
_SEARCH = 4  # frames in a row without a dot, after which the whole picture is searched
_SHARE = 0.1  # by which a dot's area may differ from what it usually is
_FEW = 5  # dots that tell what is usual
_LENGTH, _PIXELS = 0.06, 3.0  # of a link's length and [px], by which tilt and lens may change it
_MANY = 8  # parts of a picture that are tried as a dot
_MEMORY = 0.12  # [s]: longer ago a motion predicts nothing


class Followed(NamedTuple):
    """Markers of each frame.

    time : (T,) [s]; at : (T, n + 1, 2) [px]; sigma : (T, n + 1) [px]; found : (T, n + 1)
    theta : (T, n), absolute directions of the links as predicted or found, without jumps [rad]
    """

    time: Array
    at: Array
    sigma: Array
    found: Array
    theta: Array


class Step(NamedTuple):
    """Markers of one frame, as in `Followed`, and the window (low, high) each was sought in."""

    time: float
    at: Array
    sigma: Array
    found: Array
    theta: Array
    windows: list[tuple[Array, Array] | None]


class Dot:
    """What is known of a marker's dot: colour, how large it looks, and the noise around it."""

    def __init__(self, marker: Marker, like: list[int]):
        assert marker.hue is not None
        self.axis = axis_of(marker.hue, marker.saturation, marker.value)
        self.radius, self.full = marker.radius, math.pi * marker.radius**2
        self.like = like  # markers whose dots have the same colour
        self.areas: deque[float] = deque(maxlen=31)
        self.noises: deque[float] = deque(maxlen=200)
        self.amplitude, self.missing = 1.0, 0
        self.noise, self.usual = 0.02, self.full  # as `centroid` wants it; usual area [px^2]

    def around(self, noise: float) -> None:
        """Learn from the noise around the dot."""
        if np.isfinite(noise):
            self.noises.append(noise)
            self.noise = _middle(self.noises)

    def whole(self, spot: Spot) -> bool:
        """Whether the dot is as large as it was before, so that nothing hides a part of it."""
        if len(self.areas) < _FEW:
            return 0.4 * self.full < spot.area < 2.5 * self.full
        return abs(spot.area / self.usual - 1) < _SHARE

    def seen(self, spot: Spot) -> None:
        """Learn from a whole dot."""
        self.areas.append(spot.area)
        self.usual = _middle(self.areas)
        self.amplitude, self.missing = spot.amplitude, 0


class Follower:
    """Follows the markers of a rig through the frames of a video.

    Parameters
    ----------
    marks : Marks

    Examples
    --------
    >>> from frictionid.acquire.camera.marks import Marker
    >>> pivot = Marker(name="pivot", at=[20.0, 20.0])
    >>> tip = Marker(name="tip", hue=0.0, saturation=1.0, value=1.0, radius=3.0)
    >>> picture = np.zeros((60, 60, 3), np.uint8)
    >>> picture[38:43, 18:23, 2] = 255
    >>> step = Follower(Marks(markers=[pivot, tip])).step(Frame(0.0, picture))
    >>> step.at[1].round(3).tolist()
    [20.0, 40.0]
    """

    def __init__(self, marks: Marks):
        self.marks, markers = marks, marks.markers
        self.n, self.exposure = marks.n, marks.camera.exposure
        hues = [m.hue for m in markers]
        self.dots = [
            None
            if m.hue is None
            else Dot(m, [j for j, h in enumerate(hues) if j != i and h == m.hue])
            for i, m in enumerate(markers)
        ]
        pixels = marks.links.pixels
        self.lengths = None if pixels is None else np.array(pixels)
        self.past: deque[tuple[float, Array]] = deque(maxlen=3)  # time, theta
        self.pivot = np.array(markers[0].at) if markers[0].at is not None else None
        self.theta = np.zeros(self.n)
        self.frames = 0

    def step(self, frame: Frame) -> Step:
        """Markers of the next frame."""
        self.frames += 1
        at, streak, margin = self._predicted(frame.time)
        spots: list[Spot | None] = [None] * (self.n + 1)
        windows: list[tuple[Array, Array] | None] = [None] * (self.n + 1)
        if margin is not None:
            for i, dot in enumerate(self.dots):
                if dot is None:
                    continue
                reach = np.abs(streak[i]) / 2 + (dot.radius + margin + _GROWS * dot.missing)
                windows[i] = at[i] - reach, at[i] + reach
                spot = spots[i] = self._sought(frame.image, i, at, streak, windows[i])
                if spot is not None:
                    # what hangs on this marker is where it is, not where it was predicted
                    at[i:] += spot.at - at[i]
        lost = [i for i, d in enumerate(self.dots) if d is not None and spots[i] is None]
        if lost and (margin is None or any(self._missing(i) >= _SEARCH for i in lost)):
            self._search(frame.image, at, streak, spots, margin is None)
        return self._taken(frame.time, at, spots, windows)

    def _missing(self, i: int) -> int:
        dot = self.dots[i]
        return 0 if dot is None else dot.missing

    def _predicted(self, time: float) -> tuple[Array, Array, float | None]:
        """Pixels (n + 1, 2), their move during the exposure, and how far off that may be [px]."""
        still = np.zeros((self.n + 1, 2))
        if self.pivot is None:
            return still.copy(), still, None
        recent = [entry for entry in self.past if time - entry[0] <= _MEMORY + 1.5 * self._pace()]
        if not recent or self.lengths is None:
            return still + self.pivot, still, None
        theta, rate = _extrapolated([t for t, _ in recent], [angles for _, angles in recent], time)
        self.theta = theta
        # places as complex numbers x + iy, from the pivot on
        turned = self.lengths * np.exp(-1j * theta)
        links, speeds = np.zeros((2, self.n + 1), dtype=complex)
        np.cumsum(1j * turned, out=links[1:])
        np.cumsum(rate * turned, out=speeds[1:])
        at = links.view(float).reshape(-1, 2) + self.pivot
        streak = (self.exposure * speeds).view(float).reshape(-1, 2)
        margin, most = _MARGIN, 0.5 * float(self.lengths.sum())
        if len(recent) < 3:
            return at, streak, max(margin, most)
        return at, streak, min(margin + 0.25 * max(map(abs, speeds)) * (time - recent[-1][0]), most)

    def _pace(self) -> float:
        if len(self.past) < 2:
            return 0.05
        return self.past[-1][0] - self.past[-2][0]

    def _sought(
        self, image: Image, i: int, at: Array, streak: Array, window: tuple[Array, Array] | None
    ) -> Spot | None:
        dot = self.dots[i]
        assert dot is not None and window is not None
        found = patch(image, dot.axis, *window)
        if found is None or self._covered(i, at[i], at, streak):
            return None
        spot = self._spot(found, i, at[i], streak[i])  # most predictions are that good
        if spot is None:
            parts = blobs(found, dot.amplitude, dot.radius)
            if not len(parts):
                return None
            nearest = parts[np.argmin(np.hypot(*(parts[:, :2] - at[i]).T))]
            spot = self._spot(found, i, nearest[:2], streak[i])
        if spot is None or self._covered(i, spot.at, at, streak):
            return None
        if i and not self._fits(i, spot.at, at):
            return None
        if self.frames % 8 == 0 or len(dot.noises) < 20:
            dot.around(noise_of(found, spot.at, dot.radius + math.hypot(*streak[i]) / 2))
        return spot

    def _spot(self, found: Patch, i: int, near: Array, streak: Array) -> Spot | None:
        """The dot there, if it is whole."""
        dot = self.dots[i]
        assert dot is not None
        spot = centroid(found, near, streak, dot.radius, dot.amplitude, dot.noise)
        if spot is None or not dot.whole(spot):
            return None
        return spot

    def _covered(self, i: int, place: Array, at: Array, streak: Array) -> bool:
        """Whether a dot of the same colour is so near that the two cannot be told apart."""
        dot = self.dots[i]
        assert dot is not None
        for j in dot.like:
            other = self.dots[j]
            reach = dot.radius + (other.radius if other else 0.0) + 4.0
            reach += (math.hypot(*streak[i]) + math.hypot(*streak[j])) / 2
            if math.dist(place, at[j]) < reach:
                return True
        return False

    def _fits(self, i: int, place: Array, at: Array) -> bool:
        """Whether the link before a marker is as long as it has to be."""
        assert self.lengths is not None
        length = math.dist(place, at[i - 1])
        slack = _PIXELS + (_MARGIN if self._missing(i - 1) else 0.0)
        return abs(length - self.lengths[i - 1]) < _LENGTH * self.lengths[i - 1] + slack

    def _search(
        self, image: Image, at: Array, streak: Array, spots: list[Spot | None], first: bool
    ) -> None:
        """Look for all dots in the whole picture, and take them where the links fit."""
        whole = np.zeros(2), np.array(image.shape[1::-1], float)
        candidates: list[list[Spot]] = []
        for i, dot in enumerate(self.dots):
            if dot is None:
                candidates.append([Spot(np.array(self.marks.markers[i].at), 0.0, 0.0, 0.0)])
                continue
            found = patch(image, dot.axis, *whole)
            assert found is not None
            parts = blobs(found, dot.amplitude, dot.radius)[:_MANY]
            still = np.zeros(2) if first else streak[i]
            seen = [
                centroid(_cut(found, p, dot), p, still, dot.radius, dot.amplitude, dot.noise)
                for p in parts[:, :2]
            ]
            candidates.append([s for s in seen if s is not None])
        best = self._combined(candidates)
        if best is None:
            return
        for i, spot in enumerate(best):
            if self.dots[i] is not None:
                spots[i], at[i] = spot, spot.at
        if self.lengths is None:
            places = np.stack([s.at for s in best])
            self.lengths = np.linalg.norm(np.diff(places, axis=0), axis=-1)

    def _combined(self, candidates: list[list[Spot]]) -> list[Spot] | None:
        """One spot for each marker whose distances are those of the links, None where none are."""
        best, least = None, np.inf
        for chosen in product(*candidates):
            places = np.stack([s.at for s in chosen])
            gaps = np.linalg.norm(places[:, None] - places[None], axis=-1)
            if (gaps + 1e9 * np.eye(len(gaps)) < 2.0).any():
                continue  # one dot cannot be two markers
            length = np.linalg.norm(np.diff(places, axis=0), axis=-1)
            cost = self._misfit(length)
            # of two that fit alike the larger dots are taken
            pairs = zip(chosen, self.dots, strict=True)
            cost -= 0.05 * sum(min(s.area / d.full, 1.0) for s, d in pairs if d)
            if cost < least:
                best, least = list(chosen), cost
        return best

    def _misfit(self, length: Array) -> float:
        told = self.marks.links
        if self.lengths is not None:
            off = np.abs(length - self.lengths) / (_LENGTH * self.lengths + _PIXELS)
            return float((off**2).sum()) if (off < 1).all() else np.inf
        if told.lengths is not None and self.n > 1:
            ratio = length / np.array(told.lengths)
            return float((((ratio / ratio.mean()) - 1) ** 2).sum() / _LENGTH**2)
        return 0.0

    def _taken(
        self,
        time: float,
        at: Array,
        spots: list[Spot | None],
        windows: list[tuple[Array, Array] | None],
    ) -> Step:
        """The step, remembered for the predictions of the next ones."""
        found, sigma = np.zeros(self.n + 1, dtype=bool), np.full(self.n + 1, np.nan)
        for i, (dot, spot) in enumerate(zip(self.dots, spots, strict=True)):
            if dot is None:
                found[i], sigma[i] = True, 0.0
            elif spot is None:
                dot.missing += 1
            else:
                found[i], sigma[i], at[i] = True, spot.sigma, spot.at
                dot.seen(spot)
        if found[0]:
            self.pivot = at[0].copy()
        both = found[1:] & found[:-1]
        link = at[1:] - at[:-1]
        now = np.arctan2(link[:, 0], link[:, 1])
        now = self.theta + (now - self.theta + np.pi) % (2 * np.pi) - np.pi
        theta = np.where(both, now, self.theta)
        if both.all():
            self.past.append((time, theta))
            assert self.lengths is not None
            self.lengths = 0.9 * self.lengths + 0.1 * np.hypot(link[:, 0], link[:, 1])
        elif not self.past or time - self.past[-1][0] > _MEMORY:
            self.past.clear()
        self.theta = theta
        return Step(time, at.copy(), sigma, found, theta.copy(), windows)


def follow(marks: Marks, frames: Iterator[Frame]) -> Iterator[Step]:
    """Markers of each frame, one after the other."""
    follower = Follower(marks)
    for frame in frames:
        yield follower.step(frame)


def gathered(steps: list[Step]) -> Followed:
    """The steps as arrays."""
    columns = [np.stack([getattr(s, name) for s in steps]) for name in Followed._fields]
    return Followed(*columns)


def _extrapolated(times: list[float], angles: list[Array], time: float) -> tuple[Array, Array]:
    """Angles (n,) and rates at a time, by the polynomial through up to three samples."""
    if len(times) == 1:
        return angles[0].copy(), np.zeros_like(angles[0])
    d = time - times[-1]
    speed = (angles[-1] - angles[-2]) / (times[-1] - times[-2])  # divided differences
    if len(times) == 2:
        return angles[-1] + d * speed, speed
    before = (angles[-2] - angles[-3]) / (times[-2] - times[-3])
    bend = (speed - before) / (times[-1] - times[-3])
    step = time - times[-2]
    return angles[-1] + d * (speed + step * bend), speed + (d + step) * bend


def _middle(values: deque[float]) -> float:
    """Median, as quickly as a few dozen numbers allow."""
    return sorted(values)[len(values) // 2]


def _cut(found: Patch, at: Array, dot: Dot) -> Patch:
    """The part of a patch around a place."""
    reach = int(3 * dot.radius + 30)
    x, y = (at - found.corner).astype(int)
    x0, y0 = max(x - reach, 0), max(y - reach, 0)
    part = found.share[y0 : y + reach + 1, x0 : x + reach + 1]
    return Patch(part, (found.corner[0] + x0, found.corner[1] + y0))
