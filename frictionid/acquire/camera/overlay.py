"""What was found and what was not, drawn over the frames: a video and a contact sheet."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from frictionid.acquire.camera.angles import FOUND, LOST, Angles
from frictionid.acquire.camera.source import Frame, Image, Source
from frictionid.errors import InputError

_COLOURS = {FOUND: (90, 255, 90), "predicted": (60, 190, 255), LOST: (90, 90, 255)}
_SHEET, _ACROSS = 12, 4  # pictures of the contact sheet
_WIDTH = 480  # [px] of each


def drawn(
    image: Image, angles: Angles, k: int, window: tuple[int, int, int, int] | None = None
) -> Image:
    """The k-th frame, or a window (x0, y0, x1, y1) of it, with markers, state and angles."""
    out = image.copy()
    state = angles.state[k]
    places = angles.markers[k]
    seen = np.isfinite(places).all(axis=-1)
    for a, b in zip(range(len(places) - 1), range(1, len(places)), strict=True):
        if seen[a] and seen[b]:
            _line(out, places[a], places[b])
    for place in places[seen]:
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
    """The video with all that was found drawn over it.

    Raises
    ------
    InputError
        Where it cannot be written.
    """
    rate = source.rate if source.rate > 0 else 30.0
    code = cv2.VideoWriter.fourcc(*"mp4v")
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, rate, source.size)
    if not writer.isOpened():
        raise InputError(f"{path} cannot be written as a video; name an .mp4 in another folder")
    for k, frame in enumerate(source.frames()):
        writer.write(drawn(frame.image, angles, k))
    writer.release()


def contact_sheet(frames: Iterable[Frame], angles: Angles, size: tuple[int, int]) -> Image:
    """Frames side by side: half of them evenly spaced, half where something was not found."""
    chosen, tiles, window = set(_chosen(angles)), [], _window(angles, size)
    for k, frame in enumerate(frames):
        if k in chosen:
            tiles.append(drawn(frame.image, angles, k, window))
    blank = np.full_like(tiles[0], 255)
    tiles += [blank] * (-len(tiles) % _ACROSS)
    rows = [np.hstack(tiles[i : i + _ACROSS]) for i in range(0, len(tiles), _ACROSS)]
    return np.asarray(np.vstack(rows), dtype=np.uint8)


def _window(angles: Angles, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """The part of the pictures in which markers are, with some room."""
    low, high = np.nanmin(angles.markers, axis=(0, 1)), np.nanmax(angles.markers, axis=(0, 1))
    room = 20 + 0.1 * (high - low).max()
    (x0, y0), (x1, y1) = np.clip([low - room, high + room], 0, size).astype(int).tolist()
    return x0, y0, x1, y1


def _chosen(angles: Angles) -> list[int]:
    count = len(angles.state)
    missing = [k for k, s in enumerate(angles.state) if s != FOUND]
    some = (
        [missing[i] for i in np.linspace(0, len(missing) - 1, _SHEET // 2).astype(int)]
        if (missing)
        else []
    )
    even = np.linspace(0, count - 1, _SHEET - len(set(some))).astype(int).tolist()
    return sorted({*some, *even})


def _line(image: Image, a: np.ndarray, b: np.ndarray) -> None:
    ends = [tuple(int(v) for v in np.round(p * 16)) for p in (a, b)]
    cv2.line(image, ends[0], ends[1], (255, 255, 255), 1, cv2.LINE_AA, 4)


def _cross(image: Image, place: np.ndarray, colour: tuple[int, int, int]) -> None:
    for way in ((10.0, 0.0), (0.0, 10.0)):
        ends = [tuple(int(v) for v in np.round((place + s * np.array(way)) * 16)) for s in (-1, 1)]
        cv2.line(image, ends[0], ends[1], colour, 1, cv2.LINE_AA, 4)
