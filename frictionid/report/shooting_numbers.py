"""What shooting found, read from a task's or a model's document, and its numbers as text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.report.numbers import NOTHING


class Estimate(NamedTuple):
    """A parameter that shooting freed, with its 90 and 95 % intervals.

    name : with the joint's, as the document has it; short: without
    joint : index of the joint that it belongs to, None for the machine as a whole
    error : standard error, infinite where the data say nothing
    told, true : what the data set says of it, and what a simulation knows; None for nothing
    """

    block: str
    name: str
    short: str
    joint: int | None
    unit: str
    value: float
    error: float
    inner: tuple[float, float]
    low: float
    high: float
    at_bound: bool
    identified: bool
    prior: bool
    told: float | None
    true: float | None

    @property
    def outside(self) -> bool:
        """Whether what is told lies outside the 95 % interval; not where it is not identified."""
        known = self.identified and self.told is not None
        return known and not self.low <= float(self.told or 0.0) <= self.high

    @property
    def covered(self) -> bool | None:
        """Whether the true value lies inside; None where either is unknown."""
        if not self.identified or self.true is None:
            return None
        return self.low <= self.true <= self.high


def estimates(
    document: Mapping[str, Any], about: Mapping[str, Any] | None = None
) -> list[Estimate]:
    """Estimates of a document of `document_of`, in its order.

    `about` is the data set's entry of datasets.json: names of joints, true values.
    """
    joints = (about or {}).get("joints")
    return [_estimate(entry, joints, about or {}) for entry in document["parameters"]]


def _estimate(
    entry: Mapping[str, Any], joints: Sequence[str] | None, about: Mapping[str, Any]
) -> Estimate:
    name, joint = str(entry["name"]), entry["joint"]
    short = name
    if joint is not None:
        short = name.removesuffix(f" of {joints[joint]}") if joints else name.rpartition(" of ")[0]
    told = entry.get("told")
    return Estimate(
        block=str(entry["block"]),
        name=name,
        short=short or name,
        joint=joint,
        unit=str(entry["unit"]),
        value=float(entry["value"]),
        error=float(entry["error"]),
        inner=(float(entry["interval_90"][0]), float(entry["interval_90"][1])),
        low=float(entry["interval_95"][0]),
        high=float(entry["interval_95"][1]),
        at_bound=bool(entry["at_bound"]),
        identified=bool(entry["identified"]),
        prior=entry.get("prior") is not None,
        told=None if told is None else float(told),
        true=_true(str(entry["block"]), short, joint, about.get("true_parameters") or {}),
    )


def _true(block: str, name: str, joint: int | None, known: Mapping[str, Any]) -> float | None:
    """True value of a parameter; those of sensors are the same for all joints."""
    value = known.get(block)
    if isinstance(value, Mapping):
        value = value.get(name)
        value = value[joint] if isinstance(value, list) and joint is not None else value
    return None if value is None else float(value)


def correlation_of(document: Mapping[str, Any]) -> Array:
    """Correlation (D, D); NaN for parameters without an error."""
    return np.array(document["correlation"], dtype=float).reshape(2 * [len(document["parameters"])])


def value_words(estimate: Estimate) -> str:
    """The value as tables show it: without digits where the data do not determine it."""
    if estimate.at_bound:
        return f"at its bound, {estimate.value:.3g}"
    if not estimate.identified:
        return "not identified"
    return digits(estimate.value, estimate.error)


def digits(value: float, error: float) -> str:
    """A value with as many digits as its standard error allows.

    >>> digits(0.164472, 0.00018), digits(12.0, float("inf"))
    ('0.16447', '12')
    """
    if not math.isfinite(error) or error <= 0:
        return f"{value:.4g}"
    decimals = max(0, 1 - math.floor(math.log10(error)))
    # + 0.0 turns -0.0 into 0.0
    return f"{round(value, decimals) + 0.0:.{decimals}f}" if decimals < 9 else f"{value:.4g}"


def interval(low: float, high: float, error: float) -> str:
    """An interval as text.

    >>> interval(0.1, 0.25, 0.01), interval(0, float("inf"), 0.01), interval(0, 1, float("inf"))
    ('[0.100, 0.250]', '[0, ∞)', '–')
    """
    if not math.isfinite(error):
        return NOTHING
    ends = ["0" if end == 0 else digits(end, error) for end in (low, high)]
    left = f"[{ends[0]}" if math.isfinite(low) else "(-∞"
    right = f"{ends[1]}]" if math.isfinite(high) else "∞)"
    return f"{left}, {right}"
