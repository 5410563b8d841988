"""A proposal of rig.toml from the first seconds of a video: dots, colours, pivot, links.

Colourful regions that move are dots. The dot whose places lie on a circle hangs on the pivot, the
centre of that circle; every other dot keeps its distance to the dot before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError, needs
from frictionid.rig.camera.marker_setup import (
    MIN_HUE_DISTANCE,
    Camera,
    Links,
    Marker,
    MarkerSetup,
    hue_distance,
)
from frictionid.rig.camera.source import Frame, Image, Source

with needs("camera"):
    import cv2


_SECONDS, _FRAMES = 5.0, 90  # of the video that are analysed, and how many frames of them
_CHROMA, _SATURATION = 45.0, 0.33  # from which on a pixel is colourful
_HUES = 25.0  # [deg] between colours of different dots
_SEEN = 0.55  # share of the frames in which a dot has to be seen
_STILL = 4.0  # [px] within which a dot that does not move stays
_TRIES = 400  # random circles
_COMPACT = 0.55  # least share of its bounding box that a dot fills


class ColourRegion(NamedTuple):
    """A colourful part of a frame: index of the frame, place [px], area [px^2], colour."""

    frame: int
    x: float
    y: float
    area: float
    hue: float
    saturation: float
    value: float


class Circle(NamedTuple):
    """Centre (2,), radius [px], and the region of each frame that lies on it (-1: none)."""

    centre: Array
    radius: float
    chosen: Array


def propose(source: Source) -> MarkerSetup:
    """Marker setup by the first seconds of a video.

    Raises
    ------
    InputError
        Where no moving dot is found, or none moves on a circle.
    """
    pictures = _first_frames(source)
    regions = [b for k, image in enumerate(pictures) for b in _colour_regions(image, k)]
    groups = _colours(regions, len(pictures))
    moving = [g for g in groups if _moves(g)]
    if not moving:
        raise InputError(
            f"{source.name}: nothing colourful moves in the first {_SECONDS:g} s; use dots of "
            "strong colours, light them better, or write rig.toml by hand"
        )
    first, group = _elbow(moving, len(pictures), source)
    circled = [group[k] for k in first.chosen if k >= 0]
    chain, used = [{b.frame: b for b in circled}], {id(b) for b in circled}
    pixels = [first.radius]
    while (child := _next(chain[-1], moving, used)) is not None:
        dots, length, taken = child
        chain.append(dots)
        pixels.append(length)
        used |= {id(b) for b in taken}
    names = ["elbow", "tip"] if len(chain) == 2 else [f"joint{k + 2}" for k in range(len(chain))]
    if len(chain) == 1:
        names = ["tip"]
    markers = [_pivot(first.centre, groups)]
    markers += [_marker(name, dots) for name, dots in zip(names, chain, strict=True)]
    markers = _merged_hues(markers)
    return MarkerSetup(markers=markers, links=Links(pixels=pixels), camera=Camera())


def _merged_hues(markers: Sequence[Marker]) -> list[Marker]:
    """The markers; nearly equal hues become one, as dots of one colour have."""
    out: list[Marker] = []
    for marker in markers:
        hues = [m.hue for m in out if m.hue is not None and marker.hue is not None]
        same = [h for h in hues if hue_distance(h, marker.hue or 0.0) < MIN_HUE_DISTANCE]
        out.append(marker.model_copy(update={"hue": same[0]}) if same else marker)
    return out


def _first_frames(source: Source) -> list[Image]:
    """Pictures spread over the first seconds."""
    count = int(_SECONDS * source.rate) if source.rate > 0 else _FRAMES
    step = max(count // _FRAMES, 1)
    frames: Iterator[Frame] = islice(source.frames(), 0, count, step)
    return [f.image for f in frames]


def _colour_regions(image: Image, frame: int) -> Iterator[ColourRegion]:
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
        if not (20 <= area <= limit) or area < _COMPACT * w * h or max(w, h) > 4 * min(w, h):
            continue
        part = smooth[y : y + h, x : x + w][labels[y : y + h, x : x + w] == k]
        strong = part[np.argsort(-(part.max(1).astype(int) - part.min(1)))[: max(area // 3, 4)]]
        bgr = strong.astype(np.float32).mean(axis=0) / 255
        hsv = cv2.cvtColor(bgr[None, None], cv2.COLOR_BGR2HSV)[0, 0].astype(float)
        cx, cy = centres[k]
        yield ColourRegion(frame, float(cx), float(cy), float(area), *hsv.tolist())


def _colours(regions: Sequence[ColourRegion], frames: int) -> list[list[ColourRegion]]:
    """Regions grouped by colour, for the colours that are seen in most frames."""
    left, groups = sorted(regions, key=lambda b: b.hue), []
    while left:
        # the densest hue first
        hues = np.array([b.hue for b in left])
        near = np.abs((hues[:, None] - hues + 180) % 360 - 180) < _HUES
        densest = hues[np.argmax(near.sum(axis=1))]
        colour = [b for b in left if hue_distance(b.hue, densest) < _HUES]
        left = [b for b in left if hue_distance(b.hue, densest) >= _HUES]
        if len({b.frame for b in colour}) >= _SEEN * frames:
            groups.append(colour)
    return groups


def _moves(group: Sequence[ColourRegion]) -> bool:
    places = np.array([[b.x, b.y] for b in group])
    radius = np.sqrt(np.median([b.area for b in group]) / np.pi)
    return bool(np.ptp(places, axis=0).max() > 3 * radius)


def _elbow(
    moving: Sequence[list[ColourRegion]], frames: int, source: Source
) -> tuple[Circle, list[ColourRegion]]:
    """The circle on which most places of one dot lie, and the regions of that dot's colour."""
    best: tuple[float, Circle, list[ColourRegion]] | None = None
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
    group: Sequence[ColourRegion], frames: int, size: tuple[int, int]
) -> tuple[Circle | None, float]:
    """Best circle through random triples (RANSAC), and its score: share of frames less misfit."""
    rng = np.random.default_rng(0)
    places = np.array([[b.x, b.y] for b in group])
    frame = np.array([b.frame for b in group])
    best, score = None, 0.0
    for _ in range(_TRIES):
        three = places[rng.choice(len(places), 3, replace=False)] if len(places) > 3 else places
        centre, radius = _through(three)
        if not np.isfinite(radius) or not 15 < radius < size[1]:
            continue
        if not ((centre > 0) & (centre < np.array(size))).all():
            continue
        off = np.abs(np.hypot(*(places - centre).T) - radius)
        on = off < 1.5 + 0.02 * radius
        if not on.any() or _arc(places[on], centre) < 0.5:
            continue
        share = len(set(frame[on].tolist())) / frames
        now = share - 0.2 * float(np.mean(off[on])) / (1.5 + 0.02 * radius)
        if now > score:
            best, score = (centre, radius, on), now
    if best is None:
        return None, 0.0
    centre, radius = _fitted(places[best[2]])
    off = np.abs(np.hypot(*(places - centre).T) - radius)
    chosen = np.full(frames, -1)
    for k in np.argsort(-off):  # the nearest of a frame is written last
        if off[k] < 3.0 + 0.03 * radius:
            chosen[frame[k]] = k
    return Circle(centre, radius, chosen), score


def _through(three: Array) -> tuple[Array, float]:
    """Centre and radius of the circle through three points (3, 2)."""
    a = 2 * (three[1:] - three[0])
    if abs(np.linalg.det(a)) < 1e-6:
        return np.zeros(2), np.inf
    centre = np.linalg.solve(a, (three[1:] ** 2).sum(1) - (three[0] ** 2).sum())
    return centre, float(np.hypot(*(three[0] - centre)))


def _fitted(places: Array) -> tuple[Array, float]:
    """Centre and radius of the circle nearest to places, by linear least squares."""
    a = np.column_stack([2 * places, np.ones(len(places))])
    x = np.linalg.lstsq(a, (places**2).sum(axis=1), rcond=None)[0]
    return x[:2], float(np.sqrt(x[2] + x[:2] @ x[:2]))


def _arc(places: Array, centre: Array) -> float:
    """Angle [rad] of the arc that places cover, seen from the centre."""
    angle = np.sort(np.arctan2(*(places - centre).T))
    gaps = np.diff(np.append(angle, angle[0] + 2 * np.pi))
    return float(2 * np.pi - gaps.max())


def _next(
    parent: dict[int, ColourRegion], moving: Sequence[list[ColourRegion]], used: set[int]
) -> tuple[dict[int, ColourRegion], float, list[ColourRegion]] | None:
    """The dot that keeps its distance to the one before, the distance, and its regions."""
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


def _marker(name: str, dots: dict[int, ColourRegion]) -> Marker:
    regions = list(dots.values())
    # blur by motion enlarges a dot: those that look smaller are nearer the truth
    radius = float(np.sqrt(np.quantile([b.area for b in regions], 0.3) / np.pi))
    x, y = (np.mean(f(np.radians([b.hue for b in regions]))) for f in (np.cos, np.sin))
    hue = float(np.degrees(np.arctan2(y, x)) % 360)
    saturation, value = (
        float(np.clip(np.median([getattr(b, what) for b in regions]), 0.16, 1.0))
        for what in ("saturation", "value")
    )
    return Marker(name=name, hue=hue, saturation=saturation, value=value, radius=radius)


def _pivot(centre: Array, groups: Sequence[list[ColourRegion]]) -> Marker:
    """The pivot: a dot that stays there, else the centre of the circle."""
    for group in groups:
        near = {
            b.frame: b for b in group if np.hypot(b.x - centre[0], b.y - centre[1]) < 2 * _STILL
        }
        if len(near) > 0.5 * len({b.frame for b in group}) and not _moves(list(near.values())):
            return _marker("pivot", near).model_copy(update={"moves": False})
    return Marker(name="pivot", at=[float(v) for v in centre])
