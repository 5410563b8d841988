"""Signals from columns of a table: on their clock, in SI units, faults named by row of the file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.data.readers.table import Table
from frictionid.data.signal_checks import first_fault
from frictionid.data.signals import Array, Signal
from frictionid.errors import InputError


def signal_of(
    table: Table,
    clock: str,
    names: Sequence[str],
    *,
    second: float = 1.0,
    unit: float | Array = 1.0,
    hold: str | None = None,
    sparse: bool = False,
    sigma: Array | None = None,
) -> Signal:
    """Named columns of a table as one signal; "" stands for a column of zeros.

    Parameters
    ----------
    table : Table
    clock : str
        The time column.
    names : sequence of n str
    second : float
        SI value of one unit of the clock.
    unit : float, or array, shape (n,)
        SI value of one unit of the columns, negative where their sign is the other way round.
    hold : "linear", "previous", or None where nothing is stated
    sparse : bool
        Whether only the rows with a time on this clock belong to the signal.
    sigma : array, shape (n,), or None, in the unit of the columns

    Raises
    ------
    InputError
        At the first row whose time does not increase or where a cell is empty or not finite.
    """
    time, rows = table.columns[clock], table.rows
    value = np.column_stack([table.columns[n] if n else np.zeros(len(time)) for n in names])
    if sparse:
        has_time = ~np.isnan(time)
        time, value, rows = time[has_time], value[has_time], rows[has_time]
    if not len(time):
        raise InputError(f"{table.file}: the column {clock!r} is empty; name the column of a clock")
    fault = first_fault(time, value, (clock, *names))
    if fault:
        raise InputError(f"{table.file}, row {rows[fault[0]]}: {fault[1]}; repair or delete it")
    # A number too large for its unit becomes infinite, which the recording refuses.
    with np.errstate(over="ignore"):
        deviation = None if sigma is None else sigma * np.abs(unit)
        return Signal(time * second, value * unit, hold, deviation)
