"""A proposal of rig.toml from the first seconds of a video: dots, colours, pivot, links.

What moves and is colourful is a dot; the one whose places lie on a circle hangs on the pivot, which
is the circle's middle; every other one keeps its distance to the dot before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import cv2
import numpy as np

from frictionid.acquire.camera.marks import APART, Camera, Links, Marker, Marks, hue_distance
from frictionid.acquire.camera.source import Frame, Image, Source
from frictionid.arrays import Array
from frictionid.errors import InputError

_SECONDS, _FRAMES = 5.0, 90  # of the video that are looked at, and how many frames of them
_CHROMA, _SATURATION = 45.0, 0.33  # from which on a pixel is colourful
_HUES = 25.0  # [deg] between colours of different dots
_SEEN = 0.55  # share of the frames in which a dot has to be seen
_STILL = 4.0  # [px] within which a dot that does not move stays
_TRIES = 400  # circles that are tried
_ROUND = 0.55  # share of its box that a dot fills at least


class Blob(NamedTuple):
    """A colourful part of a frame: index of the frame, place [px], area [px^2], colour."""

    frame: int
    x: float
    y: float
    area: float
    hue: float
    saturation: float
    value: float


class Circle(NamedTuple):
    """Middle (2,), radius [px], and the blob of each frame that lies on it (-1: none)."""

    middle: Array
    radius: float
    chosen: Array


def propose(source: Source) -> Marks:
    """Marks that the first seconds of a video suggest.

    Raises
    ------
    InputError
        Where no moving dot is found, or none moves on a circle.
    """
    pictures = _sampled(source)
    blobs = [b for k, image in enumerate(pictures) for b in _blobs(image, k)]
    groups = _colours(blobs, len(pictures))
    moving = [g for g in groups if _moves(g)]
    if not moving:
        raise InputError(
            f"{source.name}: nothing colourful moves in the first {_SECONDS:g} s; use dots of "
            "strong colours, light them better, or write rig.toml by hand"
        )
    first, group = _elbow(moving, len(pictures), source)
    chain, used = [_dots(group, first.chosen)], {id(b) for b in chain_blobs(group, first.chosen)}
    pixels = [first.radius]
    while (found := _next(chain[-1], moving, used)) is not None:
        dots, length, taken = found
        chain.append(dots)
        pixels.append(length)
        used |= {id(b) for b in taken}
    names = ["elbow", "tip"] if len(chain) == 2 else [f"joint{k + 2}" for k in range(len(chain))]
    if len(chain) == 1:
        names = ["tip"]
    markers = [_pivot(first.middle, groups)]
    markers += [_marker(name, dots) for name, dots in zip(names, chain, strict=True)]
    markers = _alike(markers)
    return Marks(markers=markers, links=Links(pixels=pixels), camera=Camera())


def _alike(markers: Sequence[Marker]) -> list[Marker]:
    """The markers, those of nearly the same hue with the same one."""
    out: list[Marker] = []
    for marker in markers:
        hues = [m.hue for m in out if m.hue is not None and marker.hue is not None]
        same = [h for h in hues if hue_distance(h, marker.hue or 0.0) < APART]
        out.append(marker.model_copy(update={"hue": same[0]}) if same else marker)
    return out


def _sampled(source: Source) -> list[Image]:
    count = int(_SECONDS * source.rate) if source.rate > 0 else _FRAMES
    step = max(count // _FRAMES, 1)
    frames: Iterator[Frame] = islice(source.frames(), 0, count, step)
    return [f.image for f in frames]


def _blobs(image: Image, frame: int) -> Iterator[Blob]:
    """Colourful, compact parts of a picture."""
    smooth = cv2.GaussianBlur(image, (5, 5), 1.5)
    b, g, r = cv2.split(smooth)
    top = cv2.max(cv2.max(b, g), r)
    chroma = cv2.subtract(top, cv2.min(cv2.min(b, g), r))
    mask = ((chroma > _CHROMA) & (chroma > cv2.multiply(top, _SATURATION))).astype(np.uint8)
    count, labels, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=4)
    limit = image.shape[0] * image.shape[1] / 200
    for k in range(1, count):
        x, y, w, h, area = stats[k]
        if not (20 <= area <= limit) or area < _ROUND * w * h or max(w, h) > 4 * min(w, h):
            continue
        part = smooth[y : y + h, x : x + w][labels[y : y + h, x : x + w] == k]
        strong = part[np.argsort(-(part.max(1).astype(int) - part.min(1)))[: max(area // 3, 4)]]
        bgr = strong.astype(np.float32).mean(axis=0) / 255
        hsv = cv2.cvtColor(bgr[None, None], cv2.COLOR_BGR2HSV)[0, 0].astype(float)
        cx, cy = centres[k]
        yield Blob(frame, float(cx), float(cy), float(area), *hsv.tolist())


def _colours(blobs: Sequence[Blob], frames: int) -> list[list[Blob]]:
    """Blobs of one colour each, of the colours that are seen in most frames."""
    left, groups = sorted(blobs, key=lambda b: b.hue), []
    while left:
        # the densest hue first
        hues = np.array([b.hue for b in left])
        near = np.abs((hues[:, None] - hues + 180) % 360 - 180) < _HUES
        middle = hues[np.argmax(near.sum(axis=1))]
        own = [b for b in left if hue_distance(b.hue, middle) < _HUES]
        left = [b for b in left if hue_distance(b.hue, middle) >= _HUES]
        if len({b.frame for b in own}) >= _SEEN * frames:
            groups.append(own)
    return groups


def _moves(group: Sequence[Blob]) -> bool:
    places = np.array([[b.x, b.y] for b in group])
    radius = np.sqrt(np.median([b.area for b in group]) / np.pi)
    return bool(np.ptp(places, axis=0).max() > 3 * radius)


def _elbow(moving: Sequence[list[Blob]], frames: int, source: Source) -> tuple[Circle, list[Blob]]:
    """The circle on which most places of one dot lie, the tightest first, and the dot's colour."""
    best: tuple[float, Circle, list[Blob]] | None = None
    for group in moving:
        circle, score = _circle(group, frames, source.size)
        if circle is not None and (best is None or score > best[0]):
            best = score, circle, group
    if best is None or best[0] < _SEEN:
        raise InputError(
            f"{source.name}: no dot moves on a circle in the first {_SECONDS:g} s; let the first "
            "link swing further there, or write rig.toml by hand"
        )
    return best[1], best[2]


def _circle(
    group: Sequence[Blob], frames: int, size: tuple[int, int]
) -> tuple[Circle | None, float]:
    """Best circle by random triples, and its score: share of frames on it, less its misfit."""
    rng = np.random.default_rng(0)
    places = np.array([[b.x, b.y] for b in group])
    frame = np.array([b.frame for b in group])
    best, score = None, 0.0
    for _ in range(_TRIES):
        three = places[rng.choice(len(places), 3, replace=False)] if len(places) > 3 else places
        middle, radius = _through(three)
        if not np.isfinite(radius) or not 15 < radius < size[1]:
            continue
        if not ((middle > 0) & (middle < np.array(size))).all():
            continue
        off = np.abs(np.hypot(*(places - middle).T) - radius)
        on = off < 1.5 + 0.02 * radius
        if not on.any() or _turn(places[on], middle) < 0.5:
            continue
        share = len(set(frame[on].tolist())) / frames
        now = share - 0.2 * float(np.mean(off[on])) / (1.5 + 0.02 * radius)
        if now > score:
            best, score = (middle, radius, on), now
    if best is None:
        return None, 0.0
    middle, radius = _fitted(places[best[2]])
    off = np.abs(np.hypot(*(places - middle).T) - radius)
    chosen = np.full(frames, -1)
    for k in np.argsort(-off):  # the nearest of a frame is written last
        if off[k] < 3.0 + 0.03 * radius:
            chosen[frame[k]] = k
    return Circle(middle, radius, chosen), score


def _through(three: Array) -> tuple[Array, float]:
    """Middle and radius of the circle through three points (3, 2)."""
    a = 2 * (three[1:] - three[0])
    if abs(np.linalg.det(a)) < 1e-6:
        return np.zeros(2), np.inf
    middle = np.linalg.solve(a, (three[1:] ** 2).sum(1) - (three[0] ** 2).sum())
    return middle, float(np.hypot(*(three[0] - middle)))


def _fitted(places: Array) -> tuple[Array, float]:
    """Middle and radius of the circle nearest to places, by linear least squares."""
    a = np.column_stack([2 * places, np.ones(len(places))])
    x = np.linalg.lstsq(a, (places**2).sum(axis=1), rcond=None)[0]
    return x[:2], float(np.sqrt(x[2] + x[:2] @ x[:2]))


def _turn(places: Array, middle: Array) -> float:
    """Angle [rad] that places cover as seen from a circle's middle."""
    angle = np.sort(np.arctan2(*(places - middle).T))
    gaps = np.diff(np.append(angle, angle[0] + 2 * np.pi))
    return float(2 * np.pi - gaps.max())


def chain_blobs(group: Sequence[Blob], chosen: Array) -> list[Blob]:
    """The blobs of a group that were chosen."""
    return [group[k] for k in chosen if k >= 0]


def _dots(group: Sequence[Blob], chosen: Array) -> dict[int, Blob]:
    return {b.frame: b for b in chain_blobs(group, chosen)}


def _next(
    parent: dict[int, Blob], moving: Sequence[list[Blob]], used: set[int]
) -> tuple[dict[int, Blob], float, list[Blob]] | None:
    """The dot that keeps its distance to the one before, the distance, and its blobs."""
    best, most = None, _SEEN
    for group in moving:
        free = [b for b in group if id(b) not in used and b.frame in parent]
        if not free:
            continue
        gap = np.array([np.hypot(b.x - parent[b.frame].x, b.y - parent[b.frame].y) for b in free])
        near = np.abs(gap[:, None] - gap) < 2.0 + 0.03 * gap
        length = float(np.median(gap[near[np.argmax(near.sum(axis=1))]]))
        fits = [b for b, g in zip(free, gap, strict=True) if abs(g - length) < 3.0 + 0.04 * length]
        share = len({b.frame for b in fits}) / max(len(parent), 1)
        if share > most and length > 10:
            best, most = ({b.frame: b for b in fits}, length, fits), share
    return best


def _marker(name: str, dots: dict[int, Blob]) -> Marker:
    blobs = list(dots.values())
    # blur by motion enlarges a dot: those that look smaller are nearer the truth
    radius = float(np.sqrt(np.quantile([b.area for b in blobs], 0.3) / np.pi))
    x, y = (np.mean(f(np.radians([b.hue for b in blobs]))) for f in (np.cos, np.sin))
    hue = float(np.degrees(np.arctan2(y, x)) % 360)
    saturation, value = (
        float(np.clip(np.median([getattr(b, what) for b in blobs]), 0.16, 1.0))
        for what in ("saturation", "value")
    )
    return Marker(name=name, hue=hue, saturation=saturation, value=value, radius=radius)


def _pivot(middle: Array, groups: Sequence[list[Blob]]) -> Marker:
    """The pivot: a dot that stays there, else the middle of the circle."""
    for group in groups:
        near = {
            b.frame: b for b in group if np.hypot(b.x - middle[0], b.y - middle[1]) < 2 * _STILL
        }
        if len(near) > 0.5 * len({b.frame for b in group}) and not _moves(list(near.values())):
            return _marker("pivot", near).model_copy(update={"moves": False})
    return Marker(name="pivot", at=[float(v) for v in middle])
