"""The first invalid sample of a table: not a number, out of all range, or not later in time."""

import numpy as np
from numpy.typing import ArrayLike

LARGEST = 1e20  # of what is measured, in SI units: its squares still are numbers


def first_fault(
    time: ArrayLike, value: ArrayLike, names: tuple[str, ...]
) -> tuple[int, str] | None:
    """Index of the first invalid sample and the reason, or None.

    Parameters
    ----------
    time : array, shape (T,) [s]
    value : array, shape (T, n)
    names : tuple of n + 1 names, the time's first, for the reason

    Examples
    --------
    >>> first_fault([0.0, 1.0, 1.0], [[5.0], [6.0], [7.0]], ("t", "q"))
    (2, "time must increase: 't' is 1 after 1")
    """
    cells = np.column_stack([np.asarray(time, float), np.asarray(value, float)])
    with np.errstate(invalid="ignore"):
        broken = ~(np.abs(cells) < LARGEST)
    back = np.zeros(len(cells), dtype=bool)
    back[1:] = cells[1:, 0] <= cells[:-1, 0]
    faulty = broken.any(axis=1) | back
    if not faulty.any():
        return None
    at = int(np.argmax(faulty))
    if broken[at].any():
        column = int(np.argmax(broken[at]))
        given = "empty or nan" if np.isnan(cells[at, column]) else str(cells[at, column])
        if np.isfinite(cells[at, column]):
            return at, f"{names[column]!r} is {given}, which no sensor reports"
        return at, f"{names[column]!r} is {given}; every value must be a finite number"
    return (
        at,
        f"time must increase: {names[0]!r} is {cells[at, 0]:.9g} after {cells[at - 1, 0]:.9g}",
    )
