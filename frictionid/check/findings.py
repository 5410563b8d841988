"""What a check found: one sentence with figures, how bad it is, and what to do about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

# From good to bad; the position is the exit status of the command.
LEVELS = ("good", "doubtful", "unusable")


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


def percent(share: float) -> str:
    """A share in percent, with two digits.

    >>> percent(0.0678), percent(0.997), percent(1e-9)
    ('6.8 %', '100 %', '0 %')
    """
    value = 100 * share
    if value < 1e-4:
        return "0 %"
    return f"{value:.0f} %" if value >= 10 else f"{value:.2g} %"
