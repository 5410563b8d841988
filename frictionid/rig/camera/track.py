"""frictionid.track, joint angles from a video: decode ahead, follow, measure an LED, calibrate."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.errors import InputError, needs
from frictionid.outputs import check_outputs

from .angles import Angles, angles_of
from .follow import Markers, follow, gather, unwrapped_direction
from .marker_setup import Marker, MarkerSetup, SyncLed, load_marker_setup
from .source import Frame, Image, Source, open_source
from .tracked import Tracked

with needs("camera"):
    import cv2


_HUE = 15.0  # [deg] of hue that belong to a dot
_LEVEL = 0.4  # least saturation and value, relative to the dot's
_BLUR = 5  # [px]


def follow_by_thresholds(setup: MarkerSetup, frames: Iterator[Frame]) -> Iterator[Markers]:
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
        seen = np.array([p is not None for p in places])
        at = np.array([np.full(2, np.nan) if p is None else p for p in places])
        link = np.diff(at, axis=0)
        direction = unwrapped_direction(link, theta)
        theta = np.where(np.isfinite(direction), direction, theta)
        sigma = np.where(seen, 0.5, np.nan)  # unknown: half a pixel
        yield Markers(frame.time, at, sigma, seen, theta.copy())


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


Method = Literal["follow", "study"]

_BATCH = 8  # frames decoded at a time: to wake a thread takes as long as to find a dot


def track(
    video: str | Path | Source,
    rig: str | Path | MarkerSetup = "rig.toml",
    *,
    method: Method = "follow",
    out: str | Path | None = None,
    replace: bool = False,
    done: Callable[[Markers], None] = lambda _: None,
) -> Tracked:
    """Track coloured dots in a video: joint angles with their standard deviations.

    Parameters
    ----------
    video : path, folder of pictures, number of a camera, or an opened Source
        An interrupt ends a live camera; the frames until then are used.
    rig : path of settings with markers, links and camera, or a MarkerSetup
    method : "follow", or "study", thresholds in the whole picture, without calibration
    out : path, optional
        Table of angles to write.
    replace : bool
        Whether it may replace a file.
    done : function, optional
        Called with what was found in each picture.

    Raises
    ------
    InputError
        Where there is no video, or dots are hardly ever found.

    Examples
    --------
    Angles of a film, as a data set without torque::

        film = frictionid.track("swing.mp4", "rig.toml").frame.dropna(subset=["q1"])
        data = frictionid.Dataset.from_frames(film, frictionid.mechanisms.pendulum(
            mass=0.4, length=0.25), time="time", angle="q1")
    """
    if method not in get_args(Method):
        raise InputError(f"method = {method!r} is unknown; {nearest(method, get_args(Method))}")
    if out is not None:
        inputs = [Path(path) for path in (video, rig) if isinstance(path, str | Path)]
        check_outputs([Path(out)], inputs, replace=replace)
    setup = rig if isinstance(rig, MarkerSetup) else load_marker_setup(Path(rig))
    source = video if isinstance(video, Source) else open_source(str(video), setup.camera.rate)
    tracked = Tracked(_angles(source, setup, method, done), source)
    if out is not None:
        tracked.save(out)
    return tracked


def _angles(
    source: Source, setup: MarkerSetup, method: Method, done: Callable[[Markers], None]
) -> Angles:
    """Angles of all frames, with the brightness of a sync LED."""
    _check_places(source, setup)
    brightness: list[float] = []
    frames = _frames(source)
    if setup.sync_led is not None:
        frames = _measured(frames, setup.sync_led, source.size, brightness)
    if method == "study":
        uncalibrated = setup.camera.model_copy(update={"calibrate": False})
        setup = setup.model_copy(update={"camera": uncalibrated})
        markers = follow_by_thresholds(setup, frames)
    else:
        markers = follow(setup, frames)
    steps: list[Markers] = []
    try:
        for step in markers:
            steps.append(step)
            done(step)
    except KeyboardInterrupt:  # it ends a live camera
        if source.kind != "live":
            raise
    if not steps:
        raise InputError(f"{source.name} has no frames; name another video")
    angles = angles_of(gather(steps), setup, source.size, source.name)
    if setup.sync_led is None:
        return angles
    # an interrupt may come after the LED of a frame was measured and before its markers were
    return angles._replace(sync_led=(setup.sync_led.name, np.array(brightness[: len(steps)])))


def _measured(
    frames: Iterator[Frame], led: SyncLed, size: tuple[int, int], brightness: list[float]
) -> Iterator[Frame]:
    """The frames; the brightness of the LED in each, from 0 to 1, is appended to a list."""
    at, r = np.array(led.at), max(led.radius, 1.5)  # at least one pixel
    x0, y0 = np.clip(np.floor(at - r).astype(int), 0, size).tolist()
    x1, y1 = np.clip(np.ceil(at + r).astype(int) + 1, 0, size).tolist()
    y, x = np.mgrid[y0:y1, x0:x1]
    disc = (np.hypot(x - at[0], y - at[1]) <= r).astype(np.uint8)
    for frame in frames:
        part = frame.image[y0:y1, x0:x1]
        brightness.append(sum(cv2.mean(part, disc)[:3]) / (3 * 255))
        yield frame


def _frames(source: Source) -> Iterator[Frame]:
    """The frames of a source; InputError where their times do not increase."""
    last = float("-inf")
    live = source.kind == "live"
    frames = source.frames() if live else _decoded_ahead(source.frames(buffers=2 * _BATCH + 1))
    for k, frame in enumerate(frames):
        if frame.time <= last:
            raise InputError(
                f"{source.name}, frame {k + 1}: its time stamp {frame.time:g} s does not come "
                f"after {last:g} s; convert the video to an .mp4 with time stamps"
            )
        last = frame.time
        yield frame


def _decoded_ahead(frames: Iterator[Frame]) -> Iterator[Frame]:
    """The frames; the next batch is decoded while one is used."""

    def decoded() -> list[Frame]:
        return list(islice(frames, _BATCH))

    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(decoded)
        while batch := coming.result():
            coming = pool.submit(decoded)
            yield from batch


def _check_places(source: Source, setup: MarkerSetup) -> None:
    width, height = source.size
    places = [(f"the marker {m.name!r}", m.at) for m in setup.markers if m.at is not None]
    if setup.sync_led is not None:
        places.append(("the sync LED", setup.sync_led.at))
    for what, (x, y) in places:
        if not (0 <= x < width and 0 <= y < height):
            raise InputError(
                f"{source.name}: {what} at ({x:g}, {y:g}) lies outside the picture of "
                f"{width} x {height} pixels; correct at = ... in rig.toml"
            )
