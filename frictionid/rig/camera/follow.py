"""Dots followed from frame to frame: predicted, found near the prediction, never invented.

Each dot is looked for in a small window around the place that the motion of the chain predicts. A
dot that is not there, or not there as a whole, is missing in that frame. After some frames without
it the whole picture is searched, and dots are assigned by the lengths of the links.
"""

import math
from collections import deque
from collections.abc import Iterator
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array

from .blobs import Blob, Dot, Patch, centroid, colour_patch, colour_regions, noise_of
from .marker_setup import MarkerSetup
from .source import Frame, Image

_MARGIN = 9.0  # [px] around a predicted dot
_MARGIN_PER_MISS = 5.0  # [px] more for each frame in which the dot was missing
_SEARCH_AFTER = 4  # frames without a dot, after which the whole picture is searched
_LENGTH, _PIXELS = 0.06, 3.0  # share of a link's length and [px] by which tilt and lens change it
_MAX_REGIONS = 8  # regions of a picture that are tried as one dot
_MEMORY = 0.12  # [s] for which a motion predicts the next frames


class Markers(NamedTuple):
    """Markers of a frame, or with T leading those of all frames.

    Attributes
    ----------
    time : of the frame, or array, shape (T,) [s]
    at : array, shape (n + 1, 2) [px]
    sigma : array, shape (n + 1) [px]
    seen : array of bool, shape (n + 1), whether each is found in the frame
    theta : array, shape (n,) [rad], absolute directions of the links as predicted or found,
        unwrapped
    """

    time: Any
    at: Array
    sigma: Array
    seen: Array
    theta: Array


class Prediction(NamedTuple):
    """Where the markers of the next frame should be.

    Attributes
    ----------
    at : array, shape (n + 1, 2) [px]
    streak : array, shape (n + 1, 2) [px], by which they move during the exposure
    margin : error of the prediction [px], None where there is none to start from
    """

    at: Array
    streak: Array
    margin: float | None


Search = tuple[Array, list[Blob | None]]  # places as found or predicted, blobs found


class Follower:
    """Follows the markers of a rig through the frames of a video.

    Parameters
    ----------
    setup : MarkerSetup

    Examples
    --------
    >>> from frictionid.rig.camera.marker_setup import Marker
    >>> pivot = Marker(name="pivot", at=[20.0, 20.0])
    >>> tip = Marker(name="tip", hue=0.0, saturation=1.0, value=1.0, radius=3.0)
    >>> picture = np.zeros((60, 60, 3), np.uint8)
    >>> picture[38:43, 18:23, 2] = 255
    >>> step = Follower(MarkerSetup(markers=[pivot, tip])).step(Frame(0.0, picture))
    >>> step.at[1].round(3).tolist()
    [20.0, 40.0]
    """

    def __init__(self, setup: MarkerSetup):
        self.setup, markers = setup, setup.markers
        self.n, self.exposure = setup.n, setup.camera.exposure
        hues = [m.hue for m in markers]
        self.dots = {
            i: Dot(m, [j for j, h in enumerate(hues) if j != i and h == m.hue])
            for i, m in enumerate(markers)
            if m.hue is not None
        }
        pixels = setup.links.pixels
        self.lengths = None if pixels is None else np.array(pixels)
        self.past: deque[tuple[float, Array]] = deque(maxlen=3)  # time and theta of whole frames
        self.pivot = np.array(markers[0].at) if markers[0].at is not None else None
        self.theta = np.zeros(self.n)
        self.frames = 0

    def step(self, frame: Frame) -> Markers:
        """Markers of the next frame."""
        self.frames += 1
        predicted = self._predict(frame.time)
        search = self._search_windows(frame.image, predicted)
        lost = [dot.missing for i, dot in self.dots.items() if search[1][i] is None]
        # no window will show them: at the start, or after some frames
        if lost and (predicted.margin is None or max(lost) >= _SEARCH_AFTER):
            search = self._search_all(frame.image, predicted, search)
        return self._remember(frame.time, search)

    def _predict(self, time: float) -> Prediction:
        """The chain at the angles that the last three frames extrapolate to."""
        still = np.zeros((self.n + 1, 2))
        if self.pivot is None:
            return Prediction(still.copy(), still, None)
        interval = self.past[-1][0] - self.past[-2][0] if len(self.past) > 1 else 0.05
        memory = _MEMORY + 1.5 * interval
        recent = [entry for entry in self.past if time - entry[0] <= memory]
        if not recent or self.lengths is None:
            return Prediction(still + self.pivot, still, None)
        self.theta, rate = _extrapolated(recent, time)
        # places as complex numbers x + iy, from the pivot on
        turned = self.lengths * np.exp(-1j * self.theta)
        links, speeds = np.zeros((2, self.n + 1), dtype=complex)
        np.cumsum(1j * turned, out=links[1:])
        np.cumsum(rate * turned, out=speeds[1:])
        at = links.view(float).reshape(-1, 2) + self.pivot
        streak = (self.exposure * speeds).view(float).reshape(-1, 2)
        most = 0.5 * float(self.lengths.sum())
        if len(recent) < 3:  # the speed is not known
            return Prediction(at, streak, max(_MARGIN, most))
        move = max(map(abs, speeds)) * (time - recent[-1][0])
        return Prediction(at, streak, min(_MARGIN + 0.25 * move, most))

    def _search_windows(self, image: Image, predicted: Prediction) -> Search:
        """Dots near their predicted places; what hangs on a found marker moves with it."""
        at = predicted.at.copy()
        blobs: list[Blob | None] = [None] * (self.n + 1)
        if predicted.margin is None:
            return at, blobs
        for i, dot in self.dots.items():
            reach = dot.radius + predicted.margin + _MARGIN_PER_MISS * dot.missing
            half = np.abs(predicted.streak[i]) / 2 + reach
            patch = colour_patch(image, dot.axis, at[i] - half, at[i] + half)
            blob = None if patch is None else self._in_patch(patch, i, at, predicted.streak)
            blobs[i] = blob
            if blob is not None:
                at[i:] += blob.at - at[i]
        return at, blobs

    def _in_patch(self, patch: Patch, i: int, at: Array, streak: Array) -> Blob | None:
        """The whole dot of marker i in a patch, None where it is hidden or may be another one."""
        dot = self.dots[i]
        if self._is_ambiguous(i, at[i], at, streak):
            return None
        blob = dot.whole_blob(patch, at[i], streak[i])
        if blob is None:  # the prediction was not good enough to start from
            regions = colour_regions(patch, dot)
            if not len(regions):
                return None
            nearest = regions[np.argmin(np.hypot(*(regions[:, :2] - at[i]).T))]
            blob = dot.whole_blob(patch, nearest[:2], streak[i])
        if blob is None or self._is_ambiguous(i, blob.at, at, streak):
            return None
        if i and not self._fits_link(i, blob.at, at):
            return None
        if self.frames % 8 == 0 or not dot.knows_noise:
            reach = dot.radius + math.hypot(*streak[i]) / 2
            dot.learn_noise(noise_of(patch, blob.at, reach))
        return blob

    def _is_ambiguous(self, i: int, place: Array, at: Array, streak: Array) -> bool:
        """Whether a dot of the same colour is so near that the two cannot be told apart."""
        dot = self.dots[i]
        for j in dot.alike:
            reach = dot.radius + self.dots[j].radius + 4.0
            reach += (math.hypot(*streak[i]) + math.hypot(*streak[j])) / 2
            if math.dist(place, at[j]) < reach:
                return True
        return False

    def _fits_link(self, i: int, place: Array, at: Array) -> bool:
        """Whether the link before marker i keeps its length."""
        assert self.lengths is not None
        length = math.dist(place, at[i - 1])
        before = self.dots.get(i - 1)
        slack = _PIXELS + (_MARGIN if before and before.missing else 0.0)
        return abs(length - self.lengths[i - 1]) < _LENGTH * self.lengths[i - 1] + slack

    def _search_all(self, image: Image, predicted: Prediction, search: Search) -> Search:
        """All dots in the whole picture, assigned so that the links keep their lengths."""
        streak = np.zeros_like(predicted.streak) if predicted.margin is None else predicted.streak
        candidates = [self._candidates(image, i, streak[i]) for i in range(self.n + 1)]
        best = self._best_chain(candidates)
        if best is None:
            return search
        at, blobs = search[0].copy(), list(search[1])
        for i in self.dots:
            blobs[i], at[i] = best[i], best[i].at
        if self.lengths is None:
            self.lengths = _lengths(best)
        return at, blobs

    def _candidates(self, image: Image, i: int, streak: Array) -> list[Blob]:
        """Blobs in the whole picture that may be marker i."""
        dot = self.dots.get(i)
        if dot is None:
            return [Blob(np.array(self.setup.markers[i].at), 0.0, 0.0, 0.0)]
        patch = colour_patch(image, dot.axis, np.zeros(2), np.array(image.shape[1::-1], float))
        assert patch is not None
        regions = colour_regions(patch, dot)[:_MAX_REGIONS]
        blobs = [centroid(_cut(patch, place, dot), place, streak, dot) for place in regions[:, :2]]
        return [blob for blob in blobs if blob is not None]

    def _best_chain(self, candidates: list[list[Blob]]) -> list[Blob] | None:
        """One blob for each marker whose distances fit the links, None where none do.

        Of two that fit alike the larger dots are taken.
        """
        best, least = None, np.inf
        for chain in product(*candidates):
            places = np.stack([blob.at for blob in chain])
            gaps = np.linalg.norm(places[:, None] - places[None], axis=-1)
            if (gaps + 1e9 * np.eye(len(gaps)) < 2.0).any():
                continue  # one dot cannot be two markers
            shares = (chain[i].area / dot.full_area for i, dot in self.dots.items())
            size = sum(min(share, 1.0) for share in shares)
            cost = self._length_error(_lengths(chain)) - 0.05 * size
            if cost < least:
                best, least = list(chain), cost
        return best

    def _length_error(self, length: Array) -> float:
        """Squared error of link lengths [px], relative to their tolerance; inf where one is off."""
        if self.lengths is not None:
            off = np.abs(length - self.lengths) / (_LENGTH * self.lengths + _PIXELS)
            return float((off**2).sum()) if (off < 1).all() else np.inf
        stated = self.setup.links.lengths
        if stated is not None and self.n > 1:
            ratio = length / np.array(stated)
            return float((((ratio / ratio.mean()) - 1) ** 2).sum() / _LENGTH**2)
        return 0.0

    def _remember(self, time: float, search: Search) -> Markers:
        """The markers of the frame; those that were found improve the next predictions."""
        at, blobs = search[0].copy(), search[1]
        seen, sigma = np.zeros(self.n + 1, dtype=bool), np.full(self.n + 1, np.nan)
        for i, blob in enumerate(blobs):
            dot = self.dots.get(i)
            if dot is None:
                seen[i], sigma[i] = True, 0.0
            elif blob is None:
                dot.missing += 1
            else:
                seen[i], sigma[i], at[i] = True, blob.sigma, blob.at
                dot.learn(blob)
        if seen[0]:
            self.pivot = at[0].copy()
        both = seen[1:] & seen[:-1]
        link = at[1:] - at[:-1]
        direction = unwrapped_direction(link, self.theta)
        self.theta = np.where(both, direction, self.theta)
        if both.all():
            self.past.append((time, self.theta))
            assert self.lengths is not None
            self.lengths = 0.9 * self.lengths + 0.1 * np.hypot(link[:, 0], link[:, 1])
        elif not self.past or time - self.past[-1][0] > _MEMORY:
            self.past.clear()
        return Markers(time, at, sigma, seen, self.theta.copy())


def unwrapped_direction(link: Array, near: Array) -> Array:
    """Directions [rad] of links (..., 2) [px], 0 downwards, within half a turn of those `near`."""
    direction = np.arctan2(link[..., 0], link[..., 1])
    return near + (direction - near + np.pi) % (2 * np.pi) - np.pi


def follow(setup: MarkerSetup, frames: Iterator[Frame]) -> Iterator[Markers]:
    """Markers of each frame, one after the other."""
    return map(Follower(setup).step, frames)


def gather(steps: list[Markers]) -> Markers:
    """Markers of single frames as arrays over all frames."""
    return Markers._make(map(np.stack, zip(*steps, strict=True)))


def _extrapolated(past: list[tuple[float, Array]], time: float) -> tuple[Array, Array]:
    """Angles (n,) and rates at a time, by the polynomial through up to three samples.

    Newton's divided differences.
    """
    (t2, q2), *before = past[::-1]
    if not before:
        return q2.copy(), np.zeros_like(q2)
    d, (t1, q1) = time - t2, before[0]
    speed = (q2 - q1) / (t2 - t1)
    if len(before) == 1:
        return q2 + d * speed, speed
    t0, q0 = before[1]
    curvature = (speed - (q1 - q0) / (t1 - t0)) / (t2 - t0)
    step = time - t1
    return q2 + d * (speed + step * curvature), speed + (d + step) * curvature


def _lengths(chain: list[Blob] | tuple[Blob, ...]) -> Array:
    """Distances (n,) [px] of neighbouring blobs."""
    return np.linalg.norm(np.diff(np.stack([blob.at for blob in chain]), axis=0), axis=-1)


def _cut(patch: Patch, at: Array, dot: Dot) -> Patch:
    """The part of a patch around a place."""
    reach = int(3 * dot.radius + 30)
    x, y = (at - patch.corner).astype(int)
    x0, y0 = max(x - reach, 0), max(y - reach, 0)
    part = patch.share[y0 : y + reach + 1, x0 : x + reach + 1]
    return Patch(part, (patch.corner[0] + x0, patch.corner[1] + y0))
