"""Reader `phy180`: a string pendulum filmed by a phone; columns of time and angle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from frictionid.config import Strict, checked
from frictionid.data.readers.table import read_headerless, signal_of, table_name
from frictionid.data.recordings import Recording
from frictionid.files import read_bytes


def read(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Angle of a pendulum without motor; the third column, a residual, is not read."""
    checked(Strict, dict(settings), f"{path}: [reader]")
    table = read_headerless(read_bytes(path), str(path), ["1", "2"], comma=False)
    return Recording(
        table_name(path.name), signal_of(table, "1", ["2"]), signal_of(table, "1", [""])
    )
