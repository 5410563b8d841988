"""frictionid.track: joint angles from a video of coloured dots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from frictionid.config import nearest
from frictionid.errors import InputError, needs
from frictionid.files import write_bytes, write_text
from frictionid.outputs import check_outputs
from frictionid.rig.camera.angles import Angles, angles_csv
from frictionid.rig.camera.follow import FrameMarkers
from frictionid.rig.camera.marker_setup import MarkerSetup, load_marker_setup
from frictionid.rig.camera.source import Source, open_source
from frictionid.rig.camera.track import track as tracked

METHODS = ("follow", "study")


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

    def __repr__(self) -> str:
        angles = self.angles
        counts = {s: angles.state.count(s) for s in ("found", "predicted", "lost")}
        states = ", ".join(f"{c} {s}" for s, c in counts.items() if c or s == "found")
        lines = [f"{len(angles.state)} frames: {states}"]
        for j, sigma in enumerate(np.nanmedian(angles.sigma, axis=0), start=1):
            lines.append(f"q{j}: median standard deviation {np.degrees(sigma):.3f} deg")
        shape = angles.calibration.plane.shape
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
        with needs("camera"):
            import cv2

        from frictionid.rig.camera.overlay import contact_sheet

        picture = contact_sheet(self.source.frames(), self.angles, self.source.size)
        write_bytes(Path(path), cv2.imencode(".png", picture)[1].tobytes())

    def save_overlay(self, path: str | Path) -> None:
        """Write the video with markers and angles drawn over it (MP4)."""
        from frictionid.rig.camera.overlay import write_overlay

        write_overlay(self.source, self.angles, Path(path))


def track(
    video: str | Path | Source,
    rig: str | Path | MarkerSetup = "rig.toml",
    *,
    method: Literal["follow", "study"] = "follow",
    out: str | Path | None = None,
    replace: bool = False,
    done: Callable[[FrameMarkers], None] | None = None,
) -> Tracked:
    """Track coloured dots in a video: joint angles with their standard deviations.

    Parameters
    ----------
    video : path, folder of pictures, number of a camera, or an opened Source
    rig : path of settings with markers, links and camera, or a MarkerSetup
    method : "follow", or "study", thresholds in the whole picture
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
    if method not in METHODS:
        raise InputError(f"method = {method!r} is unknown; {nearest(method, METHODS)}")
    if out is not None:
        inputs = [Path(given) for given in (video, rig) if isinstance(given, str | Path)]
        check_outputs([Path(out)], inputs, replace=replace)
    markers = rig if isinstance(rig, MarkerSetup) else load_marker_setup(Path(rig))
    source = video if isinstance(video, Source) else open_source(str(video), markers.camera.rate)
    found = Tracked(tracked(source, markers, method, done), source)
    if out is not None:
        found.save(out)
    return found
