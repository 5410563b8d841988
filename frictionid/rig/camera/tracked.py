"""Joint angles of a video of coloured dots, and pictures of what was found."""

from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from frictionid.errors import needs
from frictionid.files import write_bytes, write_text

from .angles import FOUND, LOST, PREDICTED, Angles, angles_csv
from .source import Image, Source, video_file

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
        """Write the video with markers, angles and states drawn over it (MP4).

        Raises
        ------
        InputError
            Where it cannot be written.
        """
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
    for a, b in zip(places[:-1], places[1:], strict=True):
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
