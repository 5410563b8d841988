"""Parameters estimated by shooting, read from a result document, and their numbers as text."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.report.numbers import MINUS, NOTHING
from frictionid.report.sections import DataDescription


class Estimate(NamedTuple):
    """A parameter that was free in shooting, with its 90 and 95 % intervals.

    name : with the joint's, as the document has it; parameter: without
    joint : index of the joint that it belongs to, None for the machine as a whole
    error : standard error, infinite where the data say nothing
    nominal, true : value by the data set's description, and by the simulation; None if unknown
    """

    block: str
    name: str
    parameter: str
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
    nominal: float | None
    true: float | None

    def holds(self, value: float) -> bool:
        """Whether the 95 % interval holds a value."""
        return self.low <= value <= self.high

    def change(self) -> tuple[str, str, str]:
        """Difference from the nominal value, which is not zero, and its 95 % interval [%]."""
        assert self.nominal
        error = 100 * self.error / abs(self.nominal)
        low, high = sorted(100 * (v / self.nominal - 1.0) for v in (self.low, self.high))
        middle = 100 * (self.value / self.nominal - 1.0)
        texts = [rounded(v, error) for v in (middle, low, high)]
        middle_, low_, high_ = (t if t.startswith(MINUS) else f"+{t}" for t in texts)
        return middle_, low_, high_

    def span(self, scale: float = 1.0) -> tuple[str, str, str]:
        """Value, times a scale, with its 95 % interval, as text."""
        values = (scale * v for v in (self.value, self.low, self.high))
        middle, low, high = (rounded(v, scale * self.error) for v in values)
        return middle, low, high


def estimates(document: Mapping[str, Any], data: DataDescription | None = None) -> list[Estimate]:
    """Estimates of a result document of shooting, in its order.

    data : description of the data set: names of joints, true values
    """
    return [_estimate(entry, data) for entry in document["parameters"]]


def _estimate(entry: Mapping[str, Any], data: DataDescription | None) -> Estimate:
    block, name, joint = str(entry["block"]), str(entry["name"]), entry["joint"]
    parameter = name
    if joint is not None:
        parameter = name.rpartition(" of ")[0]
        if data is not None:
            parameter = name.removesuffix(f" of {data.joints[joint]}")
    nominal = entry.get("nominal")
    inner, outer = (tuple(map(float, entry[f"interval_{level}"])) for level in (90, 95))
    return Estimate(
        block=block,
        name=name,
        parameter=parameter or name,
        joint=joint,
        unit=str(entry["unit"]),
        value=float(entry["value"]),
        error=float(entry["error"]),
        inner=(inner[0], inner[1]),
        low=outer[0],
        high=outer[1],
        at_bound=bool(entry["at_bound"]),
        identified=bool(entry["identified"]),
        prior=entry.get("prior") is not None,
        nominal=None if nominal is None else float(nominal),
        true=None if data is None else _true(data.true_parameters.get(block), parameter, joint),
    )


def _true(known: Any, name: str, joint: int | None) -> float | None:
    """True value of a parameter among those of its block; a sensor's is the same for all joints."""
    value = known
    if isinstance(value, Mapping):
        value = value.get(name)
        value = value[joint] if isinstance(value, list) and joint is not None else value
    return None if value is None else float(value)


def names_of(read: Iterable[Estimate]) -> tuple[str, ...]:
    """Full names of parameters."""
    return tuple(estimate.name for estimate in read)


def correlation_of(document: Mapping[str, Any]) -> Array:
    """Correlation (D, D); NaN for parameters without an error."""
    return np.array(document["correlation"], dtype=float).reshape(2 * [len(document["parameters"])])


def mark_of(estimate: Estimate) -> str:
    """Mark of a value in a table: "bound", "unknown" where the data do not determine it, or ""."""
    return "bound" if estimate.at_bound else "" if estimate.identified else "unknown"


def value_text(estimate: Estimate) -> str:
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


def rounded(value: float, error: float) -> str:
    """A value with one digit of its standard error.

    >>> rounded(17.7701, 0.12), rounded(-0.0312, 0.004)
    ('17.8', '−0.031')
    """
    return digits(value, 10 * error).replace("-", MINUS)


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


_SINGLE = ("value", "error", "tau", "Q", "p_value")
_PAIRS = ("interval_90", "interval_95", "range_95", "tau_95")
_LARGEST = 1e100  # beyond it squares overflow


def pooled_document(friction: Friction) -> Mapping[str, Any]:
    """What pooling wrote into a friction's provenance; empty for others.

    Raises
    ------
    InputError
        Where it cannot be read.
    """
    document = friction.provenance.get("pooled") or {}
    if not document:
        return {}
    try:
        entries = [_checked(e, friction.n) for e in document["parameters"]]
        left_out = [str(sentence) for sentence in document["left_out"]]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"the pooled parameters of the model cannot be read: {error}") from None
    return {**document, "parameters": entries, "left_out": left_out}


def _checked(e: Mapping[str, Any], joints: int) -> dict[str, Any]:
    """A pooled parameter whose numbers are numbers."""
    name, joint = str(e["name"]), e["joint"]
    if joint is not None and not 0 <= int(joint) < joints:
        raise ValueError(f"{name} is at no joint of the model")
    pairs = {key: _numbers(e[key], name) for key in _PAIRS}
    single = {key: _numbers([e[key]], name)[0] for key in _SINGLE}
    values, errors = (_numbers(e[key], name) for key in ("values", "errors"))
    models = [str(model) for model in e["models"]]
    alike = len(values) == len(errors) == len(models) > 1 and min(errors) > 0
    if not alike or any(len(p) != 2 or p[0] > p[1] for p in pairs.values()):
        raise ValueError(f"{name} has other numbers than were written")
    words = {key: str(e[key]) for key in ("block", "unit")}
    place = None if joint is None else int(joint)
    more = {"values": values, "errors": errors, "models": models, "joint": place, "name": name}
    return {**words, **pairs, **single, **more, "identified": True, "at_bound": False}


def _numbers(given: Any, name: str) -> list[float]:
    numbers = [float(value) for value in given]
    if not all(abs(value) < _LARGEST for value in numbers):
        raise ValueError(f"{name} is not finite")
    return numbers
