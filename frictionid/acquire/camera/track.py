"""Angles from a video: every frame followed, calibrated, with its accuracy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from typing import Literal

import cv2
import numpy as np

from frictionid.acquire.camera.angles import Angles, angles_of
from frictionid.acquire.camera.follow import Step, follow, gathered
from frictionid.acquire.camera.marks import Lamp, Marks
from frictionid.acquire.camera.source import Frame, Image, Source
from frictionid.acquire.camera.study import follow_as_the_study
from frictionid.errors import InputError

Method = Literal["follow", "study"]

_TOGETHER = 8  # frames handed over at a time: to wake a thread takes as long as to find a dot


def track(
    source: Source,
    marks: Marks,
    method: Method = "follow",
    tell: Callable[[Step], None] | None = None,
) -> Angles:
    """Joint angles of each frame of a video, with standard deviations and what was not found.

    Parameters
    ----------
    source : Source
    marks : Marks
    method : "follow" or "study"
        The study's thresholds and centroids of the whole picture, without calibration, for
        comparison.
    tell : callable
        Called with each frame's step, to show progress. An interrupt ends a live camera; what was
        seen until then counts.

    Raises
    ------
    InputError
        Where the video is damaged, dots are not in it, or places lie outside the picture.
    """
    _check_places(source, marks)
    plain = {"camera": marks.camera.model_copy(update={"calibrate": False})}
    marks = marks if method == "follow" else marks.model_copy(update=plain)
    steps: list[Step] = []
    bright: list[float] = []
    frames = _frames(source)
    if marks.lamp is not None:
        frames = _watched(frames, marks.lamp, source.size, bright)
    way = follow if method == "follow" else follow_as_the_study
    try:
        for step in way(marks, frames):
            steps.append(step)
            if tell is not None:
                tell(step)
    except KeyboardInterrupt:
        if source.kind != "live":  # that is how a live camera is stopped
            raise
    if not steps:
        raise InputError(f"{source.name} has no frames; name another video")
    angles = angles_of(gathered(steps), marks, source.size, source.name)
    if marks.lamp is None:
        return angles
    # an interrupt may come between a lamp and its dots
    return angles._replace(lamp=(marks.lamp.name, np.array(bright[: len(steps)])))


def _watched(
    frames: Iterator[Frame], lamp: Lamp, size: tuple[int, int], bright: list[float]
) -> Iterator[Frame]:
    """The frames, while the brightness of the lamp in each is noted, 1 where all is white."""
    (x0, y0), (x1, y1), disc = _disc(lamp, size)
    for frame in frames:
        part: Image = frame.image[y0:y1, x0:x1]
        bright.append(sum(cv2.mean(part, disc)[:3]) / (3 * 255))
        yield frame


def _disc(lamp: Lamp, size: tuple[int, int]) -> tuple[list[int], list[int], Image]:
    """Corners of the part of the pictures that holds a lamp, and which of its pixels do."""
    at, r = np.array(lamp.at), max(lamp.radius, 1.5)  # some pixel, however small it is
    low = np.clip(np.floor(at - r).astype(int), 0, size)
    high = np.clip(np.ceil(at + r).astype(int) + 1, 0, size)
    (x0, y0), (x1, y1) = low.tolist(), high.tolist()
    y, x = np.mgrid[y0:y1, x0:x1]
    disc = np.hypot(x - at[0], y - at[1]) <= r
    return [x0, y0], [x1, y1], disc.astype(np.uint8)


def _frames(source: Source) -> Iterator[Frame]:
    """The frames, whose times must increase."""
    last = float("-inf")
    live = source.kind == "live"
    coming = source.frames() if live else _ahead(source.frames(buffers=2 * _TOGETHER + 1))
    for k, frame in enumerate(coming):
        if frame.time <= last:
            raise InputError(
                f"{source.name}, frame {k + 1}: its time stamp {frame.time:g} s does not come "
                f"after {last:g} s; convert the video to an .mp4 with time stamps"
            )
        last = frame.time
        yield frame


def _ahead(frames: Iterator[Frame]) -> Iterator[Frame]:
    """The frames, the next few decoded while some are looked at."""
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(_some, frames)
        while some := coming.result():
            coming = pool.submit(_some, frames)
            yield from some


def _some(frames: Iterator[Frame]) -> list[Frame]:
    return list(islice(frames, _TOGETHER))


def _check_places(source: Source, marks: Marks) -> None:
    width, height = source.size
    places = [(f"the marker {m.name!r}", m.at) for m in marks.markers if m.at is not None]
    if marks.lamp is not None:
        places.append(("the lamp", marks.lamp.at))
    for what, (x, y) in places:
        if not (0 <= x < width and 0 <= y < height):
            raise InputError(
                f"{source.name}: {what} at ({x:g}, {y:g}) lies outside the picture of "
                f"{width} x {height} pixels; correct at = ... in rig.toml"
            )
