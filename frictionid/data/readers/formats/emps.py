"""Reader `emps`: the positioning system of [Janot2019], one prismatic joint."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.config import Strict, checked
from frictionid.data.readers.mat import mat_column, read_mat
from frictionid.data.readers.table import read_table, signal_of, table_name
from frictionid.data.recordings import Recording
from frictionid.errors import InputError
from frictionid.files import read_bytes


def read(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Position [m] and force [N] of the carriage; force = gtau vir, held by the controller.

    The reference position qg is the covariate `reference` [m], the controller's output vir the
    covariate `voltage` [V].

    Raises
    ------
    InputError
        For any setting (there are none), and for files without t, qm, qg, vir and gtau.
    """
    checked(Strict, dict(settings), f"{path}: [reader]")
    content, file = read_bytes(path), str(path)
    if not file.lower().endswith(".mat"):
        raise InputError(f"{file}: recordings of emps are MAT files; narrow the patterns")
    table = read_table(content, file, ["t", "qm", "qg", "vir"])
    gain = mat_column(read_mat(content, file), "gtau", file)
    if gain.shape != (1,) or not np.isfinite(gain[0]) or gain[0] == 0:
        raise InputError(f"{file}: gtau must be one number other than zero [N/V]")
    return Recording(
        table_name(path.name),
        signal_of(table, "t", ["qm"]),
        signal_of(table, "t", ["vir"], unit=float(gain[0]), hold="previous"),
        covariates={
            "reference": signal_of(table, "t", ["qg"]),
            "voltage": signal_of(table, "t", ["vir"], hold="previous"),
        },
    )
