"""Numbers as they stand in tables and sentences."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

NOTHING = "–"
INFINITE = "∞"
MOST_DECIMALS = 5


def decimals(values: Iterable[float], digits: int = 2) -> int:
    """Decimals that leave the smallest value of a column `digits` significant ones.

    >>> decimals([0.068, 0.7, float("inf"), 0.0])
    3
    """
    sizes = [abs(v) for v in values if np.isfinite(v) and v]
    if not sizes:
        return digits - 1
    return int(np.clip(digits - 1 - np.floor(np.log10(min(sizes))), 0, MOST_DECIMALS))


def fixed(value: float, places: int) -> str:
    """A number with so many decimals; infinite and missing ones by their signs.

    >>> fixed(0.0684, 3), fixed(float("inf"), 3), fixed(float("nan"), 3)
    ('0.068', '∞', '–')
    """
    if np.isnan(value):
        return NOTHING
    if np.isinf(value):
        return INFINITE if value > 0 else f"-{INFINITE}"
    return f"{value:.{places}f}"


def short(value: float, digits: int = 2) -> str:
    """A number with so many significant digits, for sentences.

    >>> short(0.06849), short(12.3), short(1234.0), short(-0.5)
    ('0.068', '12', '1234', '-0.50')
    """
    return fixed(value, decimals([value], digits))


def percent(share: float) -> str:
    """A share in per cent; a share above zero is never shown as zero.

    >>> percent(0.0), percent(0.002), percent(0.25), percent(1.0)
    ('0 %', '<1 %', '25 %', '100 %')
    """
    if not np.isfinite(share):
        return fixed(share, 0)
    if 0 < share < 0.01:
        return "<1 %"
    return ">99 %" if 0.99 < share < 1 else f"{100 * share:.0f} %"


def far(angle_unit: str) -> str:
    """How far off a prediction has diverged, in words (`evaluation.rows.far`).

    >>> far("rad"), far("m")
    ('1 rad', 'a quarter of the travel')
    """
    return "1 rad" if angle_unit == "rad" else "a quarter of the travel"


def seconds(horizon: float) -> str:
    """A time span in words of tables: "0.25 s"."""
    return f"{horizon:g} s"


def listed(names: Iterable[str]) -> str:
    """Names as a sentence lists them.

    >>> listed(["a"]), listed(["a", "b", "c"])
    ('a', 'a, b and c')
    """
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def coordinate(unit: str) -> str:
    """What a joint's coordinate is called, by its unit.

    >>> coordinate("rad"), coordinate("m")
    ('angle', 'position')
    """
    return "angle" if unit == "rad" else "position"
