"""Reader `phy180`: a string pendulum filmed by a phone; columns of time and angle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.config import Strict, checked
from frictionid.data.readers.headerless import read_headerless
from frictionid.data.readers.table import table_name
from frictionid.data.readers.table_signals import signal_of
from frictionid.data.recordings import Recording
from frictionid.files import read_bytes


def read_phy180(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Angle of a pendulum without motor; the third column, a residual, is not read.

    Raises
    ------
    InputError
        For any setting (there are none), and for damaged tables.
    """
    checked(Strict, dict(settings), f"{path}: [reader]")
    table = read_headerless(read_bytes(path), str(path), ["1", "2"], comma=False)
    angle = signal_of(table, "1", ["2"])
    return Recording(table_name(path.name), angle, angle._replace(value=np.zeros_like(angle.value)))
