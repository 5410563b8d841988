"""MAT files up to version 7: their variables, and single columns of them by MATLAB's own names."""

from __future__ import annotations

import io
import re
import warnings
from typing import Any

import numpy as np

from frictionid.errors import InputError
from frictionid.signals import Array

_NAME = re.compile(r"([A-Za-z]\w*(?:\.[A-Za-z]\w*)*)(?:\(:,\s*([1-9]\d*)\))?")


def read_mat(content: bytes, file: str) -> dict[str, Any]:
    """Variables of a MAT file, structures as dicts.

    Raises
    ------
    InputError
        Where the content is no MAT file, or one of version 7.3, which is another format (HDF5).
    """
    from scipy.io import loadmat

    stream: Any = io.BytesIO(content)  # which scipy's stubs do not know to be allowed
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about variables that nobody may ask for
            found = loadmat(stream, simplify_cells=True)
    except NotImplementedError:
        raise InputError(
            f"{file} is a MAT file of version 7.3; save it again with save(..., '-v7')"
        ) from None
    except Exception as error:  # whatever damaged bytes lead scipy to: it has no error of its own
        raise InputError(
            f"{file} is no whole MAT file ({type(error).__name__}); copy or export it again"
        ) from None
    return {name: value for name, value in found.items() if not name.startswith("__")}


def mat_column(variables: dict[str, Any], name: str, file: str) -> Array:
    """Column of the variables, shape (R,): "q", "data(:,2)", "log.q" or "log.q(:,2)".

    Raises
    ------
    InputError
        Where there is no such variable or column, or it holds no real numbers.

    Examples
    --------
    >>> mat_column({"log": {"q": np.array([[1.0, 5.0], [2.0, 6.0]])}}, "log.q(:,2)", "a.mat")
    array([5., 6.])
    """
    match = _NAME.fullmatch(name.strip())
    if match is None:
        raise InputError(f"{file}: {name!r} names no column; write q, data(:,2) or log.q(:,2)")
    found: Any = variables
    for part in match[1].split("."):
        if not isinstance(found, dict) or part not in found:
            known = ", ".join(map(repr, found)) if isinstance(found, dict) else "no fields"
            raise InputError(f"{file} has no column {name!r}; it has {known or 'nothing'}")
        found = found[part]
    value = np.atleast_1d(np.asarray(found))
    if value.dtype.kind not in "fiub" or value.ndim > 2:
        raise InputError(f"{file}: column {name!r} holds no real numbers; convert it to double")
    if match[2] is not None:
        return _picked(value, int(match[2]), name, file)
    if value.ndim == 2:
        raise InputError(
            f"{file}: {name!r} has {value.shape[1]} columns; name one of them, as {match[1]}(:,1)"
        )
    return value.astype(float)


def _picked(value: Array, column: int, name: str, file: str) -> Array:
    table = value if value.ndim == 2 else value[:, None]
    if column > table.shape[1]:
        raise InputError(f"{file}: there is no {name!r}, it has {table.shape[1]} columns")
    return table[:, column - 1].astype(float)
