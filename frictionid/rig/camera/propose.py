"""A proposal of rig.toml from the first seconds of a video: dots, colours, pivot, links.

Colourful regions that move are dots. The dot whose places lie on a circle hangs on the pivot, the
centre of that circle; every other dot keeps its distance to the dot before it.
"""

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.errors import InputError, needs

from .marker_setup import MIN_HUE_DISTANCE, Links, Marker, MarkerSetup, hue_distance
from .source import Image, Source

with needs("camera"):
    import cv2


_SECONDS, _FRAMES = 5.0, 90  # of the video that are analysed, and how many frames of them
_CHROMA, _SATURATION = 45.0, 0.33  # from which on a pixel is colourful
_HUES = 25.0  # [deg] between colours of different dots
_SEEN = 0.55  # share of the frames in which a dot has to be seen
_STILL = 4.0  # [px] within which a dot that does not move stays
_TRIES = 400  # random circles
_COMPACT = 0.55  # least share of its bounding box that a dot fills


# of a colourful part of a frame: index of the frame, place [px], area [px^2], colour
_COLUMNS = ("frame", "x", "y", "area", "hue", "saturation", "value")


def propose(source: Source) -> MarkerSetup:
    """Marker setup by the first seconds of a video.

    Raises
    ------
    InputError
        Where no moving dot is found, or none moves on a circle.
    """
    count = int(_SECONDS * source.rate) if source.rate > 0 else _FRAMES
    frames = islice(source.frames(), 0, count, max(count // _FRAMES, 1))
    pictures = [frame.image for frame in frames]
    rows = [row for k, image in enumerate(pictures) for row in _colour_regions(image, k)]
    groups = _colours(pd.DataFrame(rows, columns=list(_COLUMNS)), len(pictures))
    moving = [g for g in groups if _moves(g)]
    if not moving:
        raise InputError(
            f"{source.name}: nothing colourful moves in the first {_SECONDS:g} s; use dots of "
            "strong colours, light them better, or write rig.toml by hand"
        )
    circles = [_circle(group, len(pictures), np.array(source.size)) for group in moving]
    centre, radius, dots, score = max(circles, key=lambda circle: circle[-1])
    if score < _SEEN:
        raise InputError(
            f"{source.name}: no dot moves on a circle in the first {_SECONDS:g} s; let the first "
            "link swing further there, or write rig.toml by hand"
        )
    chain, pixels, used = [dots], [radius], dots.index
    while (child := _next(chain[-1], moving, used)) is not None:
        regions, length = child
        chain.append(regions.drop_duplicates("frame", keep="last"))
        pixels.append(length)
        used = used.append(regions.index)
    usual = {1: ["tip"], 2: ["elbow", "tip"]}
    names = usual.get(len(chain), [f"joint{k + 2}" for k in range(len(chain))])
    markers = [_pivot(centre, groups)]
    markers += [_marker(name, dots) for name, dots in zip(names, chain, strict=True)]
    markers = _merged_hues(markers)
    return MarkerSetup(markers=markers, links=Links(pixels=pixels))


def _merged_hues(markers: Sequence[Marker]) -> list[Marker]:
    """The markers; nearly equal hues become one, as dots of one colour have."""
    out: list[Marker] = []
    for marker in markers:
        hues = [m.hue for m in out if m.hue is not None and marker.hue is not None]
        same = [h for h in hues if hue_distance(h, marker.hue or 0.0) < MIN_HUE_DISTANCE]
        out.append(marker.model_copy(update={"hue": same[0]}) if same else marker)
    return out


def _colour_regions(image: Image, frame: int) -> Iterator[tuple[float, ...]]:
    """Colourful, compact parts of a picture."""
    smooth = cv2.GaussianBlur(image, (5, 5), 1.5)
    blue, green, red = cv2.split(smooth)  # twenty times as fast as along the last axis
    top = cv2.max(cv2.max(blue, green), red)
    chroma = top - cv2.min(cv2.min(blue, green), red)
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
        yield frame, *centres[k], float(area), *hsv


def _colours(left: pd.DataFrame, frames: int) -> list[pd.DataFrame]:
    """Regions grouped by colour, for the colours that are seen in most frames."""
    left, groups = left.sort_values("hue", kind="stable"), []
    while len(left):
        hues = left["hue"].to_numpy()
        near = hue_distance(hues[:, None], hues) < _HUES
        alike = near[near.sum(axis=1).argmax()]  # the densest hue first
        if left["frame"][alike].nunique() >= _SEEN * frames:
            groups.append(left[alike])
        left = left[~alike]
    return groups


def _places(group: pd.DataFrame) -> Array:
    return group[["x", "y"]].to_numpy()


def _moves(group: pd.DataFrame) -> bool:
    radius = np.sqrt(np.median(group["area"]) / np.pi)
    return bool(np.ptp(_places(group), axis=0).max() > 3 * radius)


def _circle(
    group: pd.DataFrame, frames: int, size: Array
) -> tuple[Array, float, pd.DataFrame, float]:
    """Centre and radius [px] of the best circle through random triples (RANSAC), and its dots.

    And its score: share of the frames, less the mean distance; zero where there is none.
    """
    rng = np.random.default_rng(0)
    places, frame = _places(group), group["frame"].to_numpy()
    best, score = np.zeros(len(places), dtype=bool), 0.0
    for _ in range(_TRIES if len(places) > 2 else 0):
        centre, radius = _fitted(places[rng.choice(len(places), 3, replace=False)])
        if not (15 < radius < size[1] and (centre > 0).all() and (centre < size).all()):
            continue
        off, width = _off(places, centre, radius), 1.5 + 0.02 * radius
        on = off < width
        if not on.any() or _arc(places[on], centre) < 0.5:
            continue
        now = len(np.unique(frame[on])) / frames - 0.2 * float(np.mean(off[on])) / width
        if now > score:
            best, score = on, now
    if not best.any():
        return np.zeros(2), 0.0, group[best], score
    centre, radius = _fitted(places[best])
    off = _off(places, centre, radius)
    dots = group.iloc[np.argsort(off, kind="stable")[: (off < 3.0 + 0.03 * radius).sum()]]
    return centre, radius, dots.drop_duplicates("frame"), score


def _off(places: Array, centre: Array, radius: float) -> Array:
    """Distances of places from a circle."""
    return np.abs(np.hypot(*(places - centre).T) - radius)


def _fitted(places: Array) -> tuple[Array, float]:
    """Centre and radius of the circle nearest to places, by linear least squares."""
    a = np.column_stack([2 * places, np.ones(len(places))])
    x = np.linalg.lstsq(a, (places**2).sum(axis=1), rcond=None)[0]
    return x[:2], float(np.sqrt(max(x[2] + x[:2] @ x[:2], 0.0)))


def _arc(places: Array, centre: Array) -> float:
    """Angle [rad] of the arc that places cover, seen from the centre."""
    angle = np.sort(np.arctan2(*(places - centre).T))
    gaps = np.diff(np.append(angle, angle[0] + 2 * np.pi))
    return float(2 * np.pi - gaps.max())


def _next(
    parent: pd.DataFrame, moving: Sequence[pd.DataFrame], used: pd.Index
) -> tuple[pd.DataFrame, float] | None:
    """Regions of the dot that keeps its distance to the one before, and that distance."""
    best, most = None, _SEEN
    for group in moving:
        free = group[~group.index.isin(used) & group["frame"].isin(parent["frame"])]
        if not len(free):
            continue
        before = _places(parent.set_index("frame").loc[free["frame"]])
        gap = np.hypot(*(_places(free) - before).T)
        near = np.abs(gap[:, None] - gap) < 2.0 + 0.03 * gap
        length = float(np.median(gap[near[near.sum(axis=1).argmax()]]))
        fits = free[np.abs(gap - length) < 3.0 + 0.04 * length]
        share = fits["frame"].nunique() / len(parent)
        if share > most and length > 10:
            best, most = (fits, length), share
    return best


def _marker(name: str, dots: pd.DataFrame) -> Marker:
    # blur by motion enlarges a dot: those that look smaller are nearer the truth
    radius = float(np.sqrt(np.quantile(dots["area"], 0.3) / np.pi))
    turned = np.exp(1j * np.radians(dots["hue"].to_numpy())).mean()
    hue = float(np.degrees(np.angle(turned)) % 360)
    saturation, value = np.clip(
        np.median(dots[["saturation", "value"]], axis=0), 0.16, 1.0
    ).tolist()
    return Marker(name=name, hue=hue, saturation=saturation, value=value, radius=radius)


def _pivot(centre: Array, groups: Sequence[pd.DataFrame]) -> Marker:
    """The pivot: a dot that stays there, else the centre of the circle."""
    for group in groups:
        near = group[np.hypot(*(_places(group) - centre).T) < 2 * _STILL]
        near = near.drop_duplicates("frame", keep="last")
        if len(near) > 0.5 * group["frame"].nunique() and not _moves(near):
            return _marker("pivot", near).model_copy(update={"moves": False})
    return Marker(name="pivot", at=centre.tolist())
