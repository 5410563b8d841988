"""frictionid.track, joint angles of a video of coloured dots, and pictures of what was found."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from io import StringIO
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.errors import InputError, needs
from frictionid.files import write_bytes, write_text
from frictionid.outputs import check_outputs

from .angles import FOUND, LOST, PREDICTED, Angles, angles_csv, angles_of
from .follow import Markers, follow, gather, unwrapped_direction
from .marker_setup import Marker, MarkerSetup, SyncLed, load_marker_setup
from .source import Frame, Image, Source, open_source, video_file

with needs("camera"):
    import cv2


@dataclass(frozen=True, eq=False, repr=False)
class Tracked:
    """Joint angles of a video.

    Attributes
    ----------
    angles : Angles, arrays of all frames
    source : Source, the video
    """

    angles: Angles
    source: Source

    @property
    def document(self) -> dict[str, Any]:
        """Number of frames by state, median standard deviation [rad] of joints, and the camera."""
        angles = self.angles
        return {
            "frames": len(angles.state),
            "states": {s: angles.state.count(s) for s in (FOUND, PREDICTED, LOST)},
            "sigma": np.nanmedian(angles.sigma, axis=0),
            "plane": list(angles.calibration.shape),
        }

    def __repr__(self) -> str:
        angles, numbers = self.angles, self.document
        counts = numbers["states"].items()
        states = ", ".join(f"{count} {s}" for s, count in counts if count or s == FOUND)
        lines = [f"{numbers['frames']} frames: {states}"]
        for j, sigma in enumerate(numbers["sigma"], start=1):
            lines.append(f"q{j}: median standard deviation {np.degrees(sigma):.3f} deg")
        shape = angles.calibration.shape
        if any(shape):
            _, _, right, down, bulge = shape
            lines.append(
                f"camera: slant {right:+.3f}, {down:+.3f}, lens {bulge:+.3f} per half diagonal"
            )
        if angles.sync_led is not None:
            name, brightness = angles.sync_led
            lines.append(f"{name}: brightness {brightness.min():.3f} to {brightness.max():.3f}")
        return "\n".join(lines)

    @property
    def frame(self) -> pd.DataFrame:
        """A line for each picture: time [s], angles q and standard deviations sigma [rad], state.

        Angles are NaN unless found; predicted ones stand in columns of their own.
        """
        return pd.read_csv(StringIO(angles_csv(self.angles)))

    def save(self, path: str | Path) -> None:
        """Write the table of angles (CSV)."""
        write_text(Path(path), angles_csv(self.angles))

    def save_sheet(self, path: str | Path) -> None:
        """Write a contact sheet (PNG): some pictures with markers and angles drawn over them."""
        write_bytes(Path(path), cv2.imencode(".png", self.sheet())[1].tobytes())

    def save_overlay(self, path: str | Path) -> None:
        """Write the video with markers, angles and states drawn over it (MP4)."""
        source = self.source
        rate = source.rate if source.rate > 0 else 30.0
        with video_file(Path(path), "mp4v", rate, source.size) as writer:
            for k, frame in enumerate(source.frames()):
                writer.write(draw_frame(frame.image, self.angles, k))

    def sheet(self) -> Image:
        """Frames side by side: half of them evenly spaced, half in which a marker is missing."""
        angles = self.angles
        chosen, window = set(_chosen(angles)), _window(angles, self.source.size)
        frames = enumerate(self.source.frames())
        tiles = [draw_frame(frame.image, angles, k, window) for k, frame in frames if k in chosen]
        blank = np.full_like(tiles[0], 255)
        tiles += [blank] * (-len(tiles) % _ACROSS)
        rows = [np.hstack(tiles[i : i + _ACROSS]) for i in range(0, len(tiles), _ACROSS)]
        return np.asarray(np.vstack(rows), dtype=np.uint8)


_COLOURS = {FOUND: (90, 255, 90), PREDICTED: (60, 190, 255), LOST: (90, 90, 255)}
_SHEET, _ACROSS = 12, 4  # pictures of the contact sheet
_WIDTH = 480  # [px] of each


def draw_frame(
    image: Image, angles: Angles, k: int, window: tuple[int, int, int, int] | None = None
) -> Image:
    """The k-th frame, or a window (x0, y0, x1, y1) of it, with markers, state and angles."""
    out = image.copy()
    state = angles.state[k]
    places = angles.markers[k]
    for a, b in pairwise(places):
        if np.isfinite([a, b]).all():
            _line(out, a, b, (255, 255, 255))
    for place in places[np.isfinite(places).all(axis=-1)]:
        for arm in np.diag([10.0, 10.0]):
            _line(out, place - arm, place + arm, _COLOURS[FOUND])
    degrees = [f"{np.degrees(q):.1f} deg" if np.isfinite(q) else "?" for q in angles.q[k]]
    shown = [f"q{j} = {text}" for j, text in enumerate(degrees, start=1)]
    text = f"{angles.time[k]:.3f} s   {'   '.join(shown)}   {state}"
    if window is not None:
        x0, y0, x1, y1 = window
        out = cv2.resize(out[y0:y1, x0:x1], (_WIDTH, round(_WIDTH * (y1 - y0) / (x1 - x0))))
    size = max(out.shape[1] / 1100, 0.42)
    at = (int(16 * size), int(32 * size))
    out[: int(44 * size)] = out[: int(44 * size)] // 4
    cv2.putText(out, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, _COLOURS[state], 1, cv2.LINE_AA)
    return np.asarray(out, dtype=np.uint8)


def _window(angles: Angles, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """The part of the pictures with the markers, and a margin."""
    low, high = np.nanmin(angles.markers, axis=(0, 1)), np.nanmax(angles.markers, axis=(0, 1))
    margin = 20 + 0.1 * (high - low).max()
    (x0, y0), (x1, y1) = np.clip([low - margin, high + margin], 0, size).astype(int).tolist()
    return x0, y0, x1, y1


def _chosen(angles: Angles) -> list[int]:
    count = len(angles.state)
    missing = [k for k, s in enumerate(angles.state) if s != FOUND]
    spread = np.linspace(0, len(missing) - 1, _SHEET // 2 if missing else 0).astype(int)
    shown = {missing[i] for i in spread}
    even = np.linspace(0, count - 1, _SHEET - len(shown)).astype(int).tolist()
    return sorted({*shown, *even})


def _line(image: Image, a: np.ndarray, b: np.ndarray, colour: tuple[int, int, int]) -> None:
    ends = [tuple(int(v) for v in np.round(p * 16)) for p in (a, b)]
    cv2.line(image, ends[0], ends[1], colour, 1, cv2.LINE_AA, 4)


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
