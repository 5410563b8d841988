"""Arguments that must be numbers: what is none ends in one sentence."""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Integral, Real
from typing import Any

from frictionid.errors import InputError


def number(name: str, value: Any) -> float:
    """A number.

    Raises
    ------
    InputError
        Where the value is none.

    >>> number("horizon", 1)
    1.0
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InputError(f"{name} = {value!r} must be a number")
    return float(value)


def optional_number(name: str, value: Any) -> float | None:
    """A number, or None."""
    return None if value is None else number(name, value)


def numbers(name: str, values: Any) -> list[float]:
    """Numbers of a list, or of one number.

    >>> numbers("windows", 0.1), numbers("windows", [0.1, 0.3])
    ([0.1], [0.1, 0.3])
    """
    listed = [values] if isinstance(values, str) or not isinstance(values, Iterable) else values
    return [number(name, value) for value in listed]


def count(name: str, value: Any) -> int:
    """A whole number that is not negative.

    >>> count("seed", 3)
    3
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 0:
        raise InputError(f"{name} = {value!r} must be a whole number, 0 or more")
    return int(value)
