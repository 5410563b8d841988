"""Tables of a data set on two clocks: rows of the camera's clock, then those of the drive's."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .signals import Array

CAMERA, DRIVE = "time_camera", "time_drive"


def joint_columns(driven: Sequence[bool]) -> dict[str, Any]:
    """The [columns] table for angles q1, ... and torques u1, ... of the driven joints.

    >>> joint_columns([False, True])["torque"]
    ['', 'u2']
    """
    joints = range(1, len(driven) + 1)
    return {
        "time": {"angle": CAMERA, "torque": DRIVE},
        "angle": [f"q{j}" for j in joints],
        "torque": [f"u{j}" if motor else "" for j, motor in zip(joints, driven, strict=True)],
    }


def two_clock_csv(camera: Mapping[str, list[str]], drive: Mapping[str, list[str]]) -> str:
    """CSV text of the columns of both clocks; cells on the other clock are empty.

    >>> two_clock_csv({"a": ["1"]}, {"b": ["2"]}).split()
    ['a,b', '1,', ',2']
    """
    seen, logged = (len(next(iter(columns.values()))) for columns in (camera, drive))
    columns = {name: cells + [""] * logged for name, cells in camera.items()}
    columns |= {name: [""] * seen + cells for name, cells in drive.items()}
    return csv_text(columns)


def csv_text(columns: Mapping[str, list[str]]) -> str:
    """CSV text of columns of equal length."""
    rows = [",".join(columns), *(",".join(cells) for cells in zip(*columns.values(), strict=True))]
    return "\n".join(rows) + "\n"


def decimal_cells(values: Array, decimals: int) -> list[str]:
    """Numbers with so many decimals at most.

    >>> decimal_cells(np.array([0.5, -1e-9]), 3)
    ['0.5', '0']
    """
    # + 0.0 turns -0.0 into 0.0
    return [f"{v:.{decimals}f}".rstrip("0").rstrip(".") for v in np.round(values, decimals) + 0.0]
