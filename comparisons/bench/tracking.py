"""The camera's part beside OpenCV's decoder alone, on a simulated film of fast motion."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from camera import PLAIN, decoded, errors, fast, marker_setup_of
from case import Case, Part, Side

from frictionid.rig.camera.film import write_film
from frictionid.rig.camera.track import track

SECONDS = 5


def tracking() -> Part:
    """Angles of all frames; opening the film and decoding it are part of both."""
    cv2.setNumThreads(1)
    folder = Path(tempfile.mkdtemp(prefix="frictionid-bench-"))
    motion = fast(SECONDS)
    path = write_film(replace(PLAIN, codec="mpeg4"), motion, folder / "film")
    setup, count = marker_setup_of(PLAIN), len(motion.angle.time)

    def ours() -> float:
        e = errors(track(path, setup).angles, motion)
        return float(np.sqrt((e**2).mean()))

    def theirs() -> float:
        assert decoded(path) == count
        return float("nan")

    own = Side("frictionid, found and measured", ours)
    peer = Side("OpenCV's decoder alone", theirs)
    name = f"tracking, {count} frames of 1280 x 720"
    # a thread of ours decodes while another one tracks
    return Part((Case(name, own, peer, "angles [deg]", bar=0.8, clock="wall"),), 6)
