"""Which columns of a table are time, angles and torques, with what speaks for it."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.data.readers.column_toml import CURRENTS, UNITS, counts_of
from frictionid.data.readers.table import Table
from frictionid.data.signals import TORQUE_HOLD
from frictionid.errors import InputError

from .tables import (
    COUNTS,
    RUNS,
    by_trust,
    is_measured,
    is_sensed,
    nameless,
    quantity_of,
    unit_of,
    words,
)

LEFT_OVER = "a guess, as no other column is left; "
_RUN, _SHORTEST = 20, 5  # rows of a run at least, on average and each
_RATES = (4.0, 20e3)  # [Hz] at which machines are recorded
_TURNS = 2.0 * 2 * np.pi  # [rad]: joints rarely turn further, unless these are degrees
LENGTHS = ("m", "mm")
_AMPERES = 60.0  # more are mA
_TORQUE = {"rad": "N m", "m": "N"}
_SLOPE = 0.9  # correlation with the slope of an angle, of a velocity
_HELD = 0.3  # share of repeated values in a column that a command holds


class Guess(NamedTuple):
    """Columns of a quantity, one per joint, their unit (or units), and what speaks for both."""

    columns: tuple[str, ...]
    unit: str | tuple[str, ...]
    evidence: str


class ColumnGuesses(NamedTuple):
    """Guesses of all that a dataset.toml says of the columns.

    signs : 1 or -1 per joint, by quantity; hold : what the torque does between two samples
    unused : names of the columns with numbers that are left over
    missing : rows without all angles ; header : whether the tables have one
    split : column that tells runs apart, with what speaks for it; None where there is one run
    """

    time: Guess
    angle: Guess
    torque: Guess
    hold: str
    unused: tuple[str, ...]
    missing: int = 0
    header: bool = True
    split: Guess | None = None
    signs: Mapping[str, tuple[int, ...]] = {}

    @property
    def is_current(self) -> bool:
        """Whether the columns of torque hold currents."""
        return self.torque.unit in CURRENTS

    def with_angle_unit(self, unit: str, evidence: str) -> "ColumnGuesses":
        """The guesses with another unit of the angles, or of those that are of its kind."""
        units: str | tuple[str, ...] = unit
        if not isinstance(self.angle.unit, str):
            length = unit in LENGTHS
            units = tuple(unit if (u in LENGTHS) == length else u for u in self.angle.unit)
        return self._replace(angle=self.angle._replace(unit=units, evidence=evidence))


def guess_columns(
    table: Table,
    driven: Sequence[bool],
    kinds: Sequence[str],
    named: Mapping[str, Sequence[str]] = {},
    *,
    kt: bool = False,
) -> ColumnGuesses:
    """Columns and units of a table's time, angles and torques.

    Parameters
    ----------
    table : Table of all columns with numbers
    driven : whether each joint has a motor
    kinds : unit of each joint's angle, "rad" or "m"
    named : columns of "time", "angle" or "torque" that are known
    kt : whether torque constants are known, so that columns whose names say nothing hold currents

    Raises
    ------
    InputError
        Where no column fits a quantity, with the columns there are and the option that names it.

    Examples
    --------
    >>> t = np.arange(50) / 50
    >>> table = Table("a.csv", np.arange(50), {"t": t, "q": np.sin(9 * t), "i_A": np.cos(t)})
    >>> guesses = guess_columns(table, [True], ["rad"])
    >>> guesses.angle.columns, guesses.angle.unit, guesses.torque.unit, guesses.time.evidence
    (('q',), 'rad', 'A', 'increases in every row, at 50 Hz')
    """
    check_named(table, named)
    time = _time(table, named.get("time"))
    angle = _angle(table, kinds, time, named.get("angle"))
    split = _split(table, time.columns[0])
    taken = (*time.columns, *angle.columns, *(split.columns if split else ()))
    free = [name for name in table.columns if name not in taken]
    torque = _torque(table, driven, kinds, free, named.get("torque"), kt=kt)
    pushes = [name for name in torque.columns if name]
    hold = "linear" if pushes and all(_varies(table, name) for name in pushes) else TORQUE_HOLD
    unused = tuple(name for name in free if name not in pushes)
    missing = len(table.rows) - len(table.complete(angle.columns).rows)
    header = bool(table.rows[0] > 1) or not all(map(str.isdecimal, table.columns))
    return ColumnGuesses(time, angle, torque, hold, unused, missing, header, split)


def check_named(table: Table, named: Mapping[str, Sequence[str]]) -> None:
    """Refuse names of columns that a table does not have, by quantity."""
    for quantity, names in named.items():
        for name in filter(None, names):
            if name not in table.columns:
                raise InputError(
                    f"--{quantity}: {table.file} has no column of numbers {name!r}; "
                    f"{table.faults.get(name) or nearest(name, table.columns)}"
                )


def _unknown(table: Table, quantity: str, fault: str) -> InputError:
    for name, text in table.faults.items():
        if quantity_of(name) == quantity:
            return InputError(text)
    columns = ", ".join(
        f"{name!r} ({np.nanmin(c):.4g} to {np.nanmax(c):.4g})" for name, c in table.columns.items()
    )
    way = ", or say --time '100 Hz' where rows are that far apart" if quantity == "time" else ""
    return InputError(f"{table.file}: {fault}; name it with --{quantity}{way}; there are {columns}")


# --- Time -----------------------------------------------------------------------------------------


def _time(table: Table, named: Sequence[str] | None) -> Guess:
    rising = [name for name, column in table.columns.items() if _runs(column)]
    increasing = [name for name in rising if (np.diff(table.columns[name]) > 0).all()]
    clocks = [name for name in table.columns if quantity_of(name) == "time"]
    called, again = ([n for n in clocks if n in names] for names in (increasing, rising))
    candidates = list(named or called or again)
    for name in candidates[:1] or clocks[:1]:
        _check_order(table, name)
    candidates = candidates or increasing
    if not candidates:
        raise _unknown(table, "time", "no column increases from row to row, as time does")
    name = candidates[0]
    runs = _runs(table.columns[name])
    if not runs:
        raise InputError(f"--time: {name!r} does not increase from row to row, as time does")
    steps = np.diff(table.columns[name])
    step = float(np.median(steps[steps > 0]))
    usual = (u for u, s in UNITS["time"].items() if _RATES[0] <= 1 / (step * s) <= _RATES[1])
    unit = unit_of(name, "time") or next(usual, "s")  # in which the step is a usual one
    rate = 1.0 / (step * UNITS["time"][unit])
    where = "every row" if runs == 1 else "every row of each run"
    return Guess((name,), unit, f"increases in {where}, at {rate:.4g} Hz")


def _check_order(table: Table, name: str) -> None:
    column = table.columns[name]
    back, again = _restarts(column)
    if len(back) and not _runs(column):
        k = int(back[~again][0] if not again.all() else back[0])
        before, after = column[k : k + 2]
        raise InputError(
            f"{table.file}, row {table.rows[k + 1]}: {name!r} goes back from {before:g} to "
            f"{after:g}: put the rows into the order of time, or name another column with --time"
        )


def _runs(column: Array) -> int:
    """Number of runs in which a column rises, but for repeated rows; 0 where it does not."""
    back, again = _restarts(column)
    runs = 1 + len(back)
    increases = np.diff(column).any() and np.isfinite(column).all() and again.all()
    return runs if increases and (runs == 1 or len(column) >= _RUN * runs) else 0


def _restarts(column: Array) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Rows (K,) behind which a column falls, and whether a run of some rows starts anew there.

    It does where it falls to near the start of the run before.
    """
    back = np.flatnonzero(np.diff(column) < 0)
    starts = np.concatenate([[0], back + 1])
    first, rows = column[starts], np.diff(starts)
    near = 2 * (first[1:] - first[:-1]) <= column[back] - first[:-1]
    return back, near & (rows >= _SHORTEST)


def _split(table: Table, clock: str) -> Guess | None:
    """Column that tells runs apart: one called so, or the time where it starts again."""
    again = np.diff(table.columns[clock]) < 0
    for name, column in table.columns.items():
        changes = np.abs(np.diff(column)) > 0
        if RUNS & set(words(name)) and 0 < changes.sum() < len(column) / _RUN:
            if not (again & ~changes).any():
                return Guess((name,), "", f"tells {1 + changes.sum()} runs apart")
    if not again.any() or not _runs(table.columns[clock]):
        return None
    return Guess((clock,), "", f"the time starts again: {1 + again.sum()} runs")


# --- Angles ---------------------------------------------------------------------------------------


def _angle(table: Table, kinds: Sequence[str], time: Guess, named: Sequence[str] | None) -> Guess:
    n = len(kinds)
    free = [name for name in table.columns if name not in time.columns]
    called = [name for name in free if quantity_of(name) == "angle" and is_measured(name)]
    trusted = next((names for names in by_trust(called) if len(names) >= n), called)
    columns, evidence = list(named or trusted), "as named"
    if len(columns) < n and not named:
        clock = table.columns[time.columns[0]] * UNITS["time"][str(time.unit)]
        slopes = _with_slopes(table, free, clock)
        turning = [name for name in nameless(free) if unit_of(name, "angle")]
        if len(slopes) >= n:
            columns, evidence = slopes, "another column follows its slope"
        elif len(turning) == n:
            columns, evidence = turning, "by its unit"
    if named and len(columns) != n:
        raise InputError(f"--angle names {len(columns)} columns; the mechanism's joints are {n}")
    if len(columns) < n:
        raise _unknown(table, "angle", f"{len(columns)} columns look like angles, for {n} joints")
    chosen = tuple(columns[:n])
    unit, reason = _by_kind(kinds, chosen, lambda names, kind: _angle_unit(table, names, kind))
    return Guess(chosen, unit, f"{evidence}; {reason}")


def _by_kind(
    kinds: Sequence[str], names: Sequence[str], guess: Callable[[Sequence[str], str], Sequence[str]]
) -> tuple[str | tuple[str, ...], str]:
    """Unit of the columns of each kind of joint, and what speaks for it; one where all are alike.

    names : of the columns, "" where a joint has none ; guess : unit and reason for columns of a
    kind
    """
    of_kind: dict[str, list[str]] = {}
    for name, kind in zip(names, kinds, strict=True):
        if name:
            of_kind.setdefault(kind, []).append(name)
    guesses = {kind: guess(columns, kind) for kind, columns in of_kind.items()}
    units = {kind: unit for kind, (unit, _) in guesses.items()}
    reasons = "; ".join(dict.fromkeys(reason for _, reason in guesses.values()))
    if len(set(units.values())) == 1:
        return next(iter(units.values())), reasons
    return tuple(units.get(kind, _TORQUE[kind]) for kind in kinds), reasons


def _with_slopes(table: Table, free: Sequence[str], clock: Array) -> list[str]:
    """Columns whose slope another column follows."""
    if not free:
        return []
    columns = pd.DataFrame({name: table.columns[name] for name in free})
    both = {"column": columns, "slope": columns.apply(np.gradient, args=(clock,))}
    alike = pd.concat(both, axis=1).corr(min_periods=3).loc["column", "slope"] > _SLOPE
    return [name for name in free if alike[name].drop(name).any()]


def _angle_unit(table: Table, names: Sequence[str], kind: str) -> tuple[str, str]:
    """Unit of the angles, by their names or their range."""
    low = min(float(np.nanmin(table.columns[name])) for name in names)
    high = max(float(np.nanmax(table.columns[name])) for name in names)
    span = f"{low:.4g} to {high:.4g}"
    unit = unit_of(names[0], "angle")
    if unit and (unit in LENGTHS) == (kind == "m"):
        return unit, f"the name says {unit}; {span}"
    if kind == "m":
        return ("mm", f"{span}: in m a long way") if high - low > 20 else ("m", span)
    named = not COUNTS.isdisjoint(words(names[0]))
    if counts_of(np.stack([table.columns[name] for name in names]), named=named):
        return "counts", f"{span}, whole numbers: counts, a guess, see [motor]"
    if high - low > _TURNS:
        return "deg", f"{span}: in rad that were {(high - low) / (2 * np.pi):.1f} turns"
    return "rad", f"{span}: within two turns"


# --- Torques --------------------------------------------------------------------------------------


def _torque(
    table: Table,
    driven: Sequence[bool],
    kinds: Sequence[str],
    free: Sequence[str],
    named: Sequence[str] | None,
    *,
    kt: bool,
) -> Guess:
    motors = sum(driven)
    if not motors:
        units = tuple(_TORQUE[kind] for kind in kinds)
        return Guess(("",) * len(driven), units[0] if len(set(units)) == 1 else units, "no motor")
    quantity, columns = _torque_columns(free, motors, named)
    rest = nameless(free)
    rest, why = [n for n in rest if unit_of(n, "torque")] or rest, ""
    if not columns and not named and len(rest) == motors:
        columns, why = rest, LEFT_OVER
    if named and len(named) == len(driven):
        columns = [name for name, motor in zip(named, driven, strict=True) if motor]
    if len(columns) < motors:
        fault = f"{len(columns)} columns look like torques or currents, for {motors} motors"
        raise _unknown(table, "torque", fault)
    silent = not any(quantity_of(name) or unit_of(name, "torque") for name in columns)
    quantity = "current" if kt and silent else quantity
    each = iter(columns)
    chosen = tuple(next(each) if motor else "" for motor in driven)
    unit, reason = _by_kind(
        kinds, chosen, lambda names, kind: _torque_unit(table, names, quantity, kind)
    )
    return Guess(chosen, unit, why + reason)


def _torque_columns(
    free: Sequence[str], motors: int, named: Sequence[str] | None
) -> tuple[str, list[str]]:
    """Quantity and columns that drive the motors: a sensor's before others, commands last."""
    if named:
        columns = [name for name in named if name]
        return ("current" if "current" in map(quantity_of, columns) else "torque"), columns
    for measured, quantity in product((True, False), ("torque", "current")):
        columns = [n for n in free if quantity_of(n) == quantity and is_measured(n) == measured]
        for trusted in by_trust(columns):
            if len(trusted) >= motors:
                return quantity, trusted
    return "torque", []


def _torque_unit(table: Table, names: Sequence[str], quantity: str, kind: str) -> tuple[str, str]:
    top = max(float(np.nanmax(np.abs(table.columns[name]))) for name in names)
    unit = unit_of(names[0], "torque")
    command = "" if all(map(is_measured, names)) else "a command, no measurement; "
    reason = f"the name says {unit}"
    if not unit and quantity == "current":
        unit = "mA" if top > _AMPERES else "A"
        reason = "named like a current" if quantity_of(names[0]) else "a current, as it has a kt"
    elif not unit:
        unit = _TORQUE[kind]
        reason = f"no unit in the name, taken as {unit}"
    return unit, f"{command}{reason}; up to {top:.4g}"


def _varies(table: Table, name: str) -> bool:
    """Whether a sensor's samples change too often for a torque that is held."""
    column = table.columns[name]
    repeats = np.ptp(column) > 0 and (np.diff(column) == 0).mean() > _HELD
    return is_sensed(name) and not repeats
