"""Angles from a video: every frame followed, calibrated, with its accuracy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from typing import Literal

from frictionid.acquire.camera.angles import Angles, angles_of
from frictionid.acquire.camera.follow import Step, follow, gathered
from frictionid.acquire.camera.marks import Marks
from frictionid.acquire.camera.source import Frame, Source
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
    way = follow if method == "follow" else follow_as_the_study
    try:
        for step in way(marks, _frames(source)):
            steps.append(step)
            if tell is not None:
                tell(step)
    except KeyboardInterrupt:
        if source.kind != "live":  # that is how a live camera is stopped
            raise
    if not steps:
        raise InputError(f"{source.name} has no frames; name another video")
    return angles_of(gathered(steps), marks, source.size, source.name)


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
    for marker in marks.markers:
        if marker.at is not None:
            x, y = marker.at
            if not (0 <= x < width and 0 <= y < height):
                raise InputError(
                    f"{source.name}: the marker {marker.name!r} at ({x:g}, {y:g}) lies outside the "
                    f"picture of {width} x {height} pixels; correct at = ... in rig.toml"
                )
