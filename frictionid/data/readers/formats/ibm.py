"""Reader `ibm`: markers of the filmed double pendulum of [Asseman2018]."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from frictionid.data.readers.formats import markers
from frictionid.data.recordings import Recording

# Red pivot, green elbow, blue tip; y before x, in fifths of a camera pixel; 400 frames a second.
LAYOUT = {"x": ["2", "4", "6"], "y": ["1", "3", "5"], "header": False, "rate": 400.0}


def read(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Angles of both joints; the settings are those of `markers`, most of them preset."""
    return markers.read(path, {**LAYOUT, **settings})
