"""Markers, angles and states drawn over the frames: a video and a contact sheet."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from frictionid.data.video_file import VideoFormat, video_file
from frictionid.errors import needs
from frictionid.rig.camera.angles import FOUND, LOST, Angles
from frictionid.rig.camera.source import Frame, Image, Source

with needs("camera"):
    import cv2


_COLOURS = {FOUND: (90, 255, 90), "predicted": (60, 190, 255), LOST: (90, 90, 255)}
_SHEET, _ACROSS = 12, 4  # pictures of the contact sheet
_WIDTH = 480  # [px] of each


def draw_frame(
    image: Image, angles: Angles, k: int, window: tuple[int, int, int, int] | None = None
) -> Image:
    """The k-th frame, or a window (x0, y0, x1, y1) of it, with markers, state and angles."""
    out = image.copy()
    state = angles.state[k]
    places = angles.markers[k]
    for a, b in zip(places[:-1], places[1:], strict=True):
        if np.isfinite([a, b]).all():
            _line(out, a, b)
    for place in places[np.isfinite(places).all(axis=-1)]:
        _cross(out, place, _COLOURS[FOUND])
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


def write_overlay(source: Source, angles: Angles, path: Path) -> None:
    """Write the video with markers, angles and states drawn over it.

    Raises
    ------
    InputError
        Where it cannot be written.
    """
    rate = source.rate if source.rate > 0 else 30.0
    form = VideoFormat("mp4v", rate, source.size)
    with video_file(path, form) as writer:
        for k, frame in enumerate(source.frames()):
            writer.write(draw_frame(frame.image, angles, k))


def contact_sheet(frames: Iterable[Frame], angles: Angles, size: tuple[int, int]) -> Image:
    """Frames side by side: half of them evenly spaced, half in which a marker is missing."""
    chosen, window = set(_chosen(angles)), _window(angles, size)
    tiles = [
        draw_frame(frame.image, angles, k, window) for k, frame in enumerate(frames) if k in chosen
    ]
    blank = np.full_like(tiles[0], 255)
    tiles += [blank] * (-len(tiles) % _ACROSS)
    rows = [np.hstack(tiles[i : i + _ACROSS]) for i in range(0, len(tiles), _ACROSS)]
    return np.asarray(np.vstack(rows), dtype=np.uint8)


def _window(angles: Angles, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """The part of the pictures with the markers, and a margin."""
    low, high = np.nanmin(angles.markers, axis=(0, 1)), np.nanmax(angles.markers, axis=(0, 1))
    margin = 20 + 0.1 * (high - low).max()
    (x0, y0), (x1, y1) = np.clip([low - margin, high + margin], 0, size).astype(int).tolist()
    return x0, y0, x1, y1


def _chosen(angles: Angles) -> list[int]:
    count = len(angles.state)
    missing = [k for k, s in enumerate(angles.state) if s != FOUND]
    some = np.linspace(0, len(missing) - 1, _SHEET // 2 if missing else 0).astype(int)
    shown = {missing[i] for i in some}
    even = np.linspace(0, count - 1, _SHEET - len(shown)).astype(int).tolist()
    return sorted({*shown, *even})


def _line(
    image: Image, a: np.ndarray, b: np.ndarray, colour: tuple[int, int, int] = (255, 255, 255)
) -> None:
    ends = [tuple(int(v) for v in np.round(p * 16)) for p in (a, b)]
    cv2.line(image, ends[0], ends[1], colour, 1, cv2.LINE_AA, 4)


def _cross(image: Image, place: np.ndarray, colour: tuple[int, int, int]) -> None:
    for arm in (np.array([10.0, 0.0]), np.array([0.0, 10.0])):
        _line(image, place - arm, place + arm, colour)
