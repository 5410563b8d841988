"""What shooting found, in words: parameters with intervals, and how the fit went."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

HEAD = ("parameter", "value", "95 % interval", "unit")


def parameter_rows(document: Mapping[str, Any]) -> Iterator[tuple[str, str, str, str]]:
    """Rows of name, value, 95 % interval and unit, as `document_of` has them.

    A parameter that is not identified shows no digits, only what is known of it: its interval.
    """
    for entry in document["parameters"]:
        low, high = (float(end) for end in entry["interval_95"])
        yield (
            str(entry["name"]),
            digits(entry["value"], entry["error"]) if entry["identified"] else _why(entry),
            interval(low, high, entry["error"]),
            str(entry["unit"]),
        )


def _why(entry: Mapping[str, Any]) -> str:
    return "not identified (at its bound)" if entry["at_bound"] else "not identified"


def digits(value: float, error: float) -> str:
    """A value with as many digits as its standard error allows.

    >>> digits(0.164472, 0.00018), digits(12.0, float("inf"))
    ('0.16447', '12')
    """
    if not math.isfinite(error) or error <= 0:
        return f"{value:.4g}"
    decimals = max(0, 1 - math.floor(math.log10(error)))
    return f"{value:.{decimals}f}" if decimals < 9 else f"{value:.4g}"


def interval(low: float, high: float, error: float) -> str:
    """An interval as text.

    >>> interval(0.1, float("inf"), 0.01)
    '0.100 ...'
    """
    if not math.isfinite(float(error)):
        return "unknown"
    ends = [digits(end, error) if math.isfinite(end) else "" for end in (low, high)]
    return f"{ends[0]} ... {ends[1]}".strip()


def remarks(document: Mapping[str, Any]) -> Iterator[str]:
    """Sentences on what is undetermined, windows that were left out or not explained."""
    for words in document["undetermined"]:
        yield f"{words[:1].upper()}{words[1:]}."
    if not document["settled"]:
        yield f"The fit had not settled after {document['iterations']} iterations."
    total = document["windows"]
    if document["left_out"]:
        yield (
            f"{len(document['left_out'])} of {total} windows were left out: a joint just misses or "
            "just reaches a stop there, and their prediction jumps with their start state."
        )
    if document["unexplained"]:
        yield (
            f"{len(document['unexplained'])} of {total} windows are not explained (residuals of 3 "
            f"times the angle noise and more): {_places(document['unexplained'])}."
        )


def _places(places: Sequence[Mapping[str, Any]], most: int = 4) -> str:
    told = [f"{p['recording']} at {p['begin']:.2f} s" for p in places[:most]]
    more = len(places) - most
    return ", ".join(told) + (f" and {more} more" if more > 0 else "")


def show_refined(document: Mapping[str, Any]) -> None:
    """Print the parameters with their intervals, and the remarks."""
    console = Console(soft_wrap=True)
    table = Table(*HEAD, box=None)
    for row in parameter_rows(document):
        table.add_row(*row)
    console.print(table)
    for sentence in remarks(document):
        console.print(sentence)
