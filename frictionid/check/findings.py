"""What a check found: one sentence with figures, how bad it is, and what to do about it.

A finding is a row of `findings.toml` (level, sentence, remedy) with the figures of a check.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from string import Formatter
from typing import Any

import numpy as np

# From good to bad; the position is the exit status of the command.
LEVELS = ("good", "doubtful", "unusable")
_SCALES = {"ms": 1e3, "%": 100.0, "deg": 180 / np.pi, "minus": -1.0}


@dataclass(frozen=True)
class Finding:
    """Something that is wrong, or worth knowing.

    Attributes
    ----------
    kind : str
        One word for programs, such as "flipped_torque".
    level : str
        "good" (only worth knowing), "doubtful" or "unusable" (as the data stand).
    text : str
        What was found, with figures.
    remedy : str
        What to do, or "".
    joint : int or None
        Number of the joint, the first is 1.
    numbers : mapping of str to float
        The figures, SI.
    """

    kind: str
    level: str
    text: str
    remedy: str = ""
    joint: int | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)


def finding(
    code: str,
    numbers: Mapping[str, float],
    words: Mapping[str, Any] | None = None,
    joint: int | None = None,
    *,
    level: str = "",
    kind: str = "",
) -> Finding:
    """The finding of a row of the table.

    numbers : figures that programs see as well; words : what else stands in the sentence
    level, kind : in place of those of the row

    >>> finding("wrapped_angle", {"jumps": 3.0}, joint=2).text
    'angle 2 jumps by a whole turn 3 times: it is wrapped at half a turn'
    """
    row, values = table()[code], {**numbers, **(words or {}), "joint": joint}
    text, remedy = sentence(code, values), sentence(code, values, "remedy")
    kind = kind or row.get("kind", code)
    return Finding(kind, level or row["level"], text, remedy, joint, numbers)


def sentence(code: str, values: Mapping[str, Any], key: str = "text") -> str:
    """Text or remedy of a row of the table with values in it."""
    return _Words().vformat(table()[code].get(key, ""), (), values)


@cache
def table() -> dict[str, dict[str, str]]:
    """Level, text and remedy of each code."""
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


class _Words(Formatter):
    """Templates with the formats of the table: percent, left, and figures in other units."""

    def format_field(self, value: Any, format_spec: str) -> str:
        if format_spec == "percent":
            return percent(value)
        if format_spec == "left":
            return percent_unexplained(value)
        unit, _, digits = format_spec.rpartition(" ")
        return format(_SCALES[unit] * value if unit else value, digits)


def percent(share: float) -> str:
    """A share in percent, with two digits.

    >>> percent(0.0678), percent(0.997), percent(1e-9)
    ('6.8 %', '100 %', '0 %')
    """
    value = 100 * share
    if value < 1e-4:
        return "0 %"
    return f"{value:.0f} %" if value >= 10 else f"{value:.2g} %"


def percent_unexplained(score: float) -> str:
    """Share of the torque that a score, see `log_unexplained`, leaves unexplained.

    >>> percent_unexplained(2 * np.log(0.068))
    '6.8 %'
    """
    return percent(float(np.exp(score / 2)))
