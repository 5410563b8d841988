"""Parameters that a fit estimated, beside their nominal and true values, and as text."""

import math
from collections.abc import Iterable, Mapping, Sequence

import pandas as pd

from frictionid.friction.laws.levels import stem
from frictionid.friction.provenance import Estimate, Estimates

from .numbers import MINUS, NOTHING
from .sections import DataDescription


def change(e: Estimate) -> list[str]:
    """Difference from the nominal value, which is not zero, and its 95 % interval [%]."""
    assert e.nominal
    middle, *ends = (100 * (v / e.nominal - 1.0) for v in (e.value, *e.interval_95))
    error = 100 * e.error / abs(e.nominal)
    texts = (rounded(v, error) for v in (middle, *sorted(ends)))
    return [text if text.startswith(MINUS) else f"+{text}" for text in texts]


def span(e: Estimate, scale: float) -> list[str]:
    """The value, times a scale, with its 95 % interval, as text."""
    return [rounded(scale * v, scale * e.error) for v in (e.value, *e.interval_95)]


def true_value(e: Estimate, data: DataDescription | None) -> float | None:
    """Value by the simulation, None where it is not known; a sensor's is that of all joints."""
    value = None if data is None else data.true_parameters.get(e.block)
    if isinstance(value, Mapping):
        value = value.get(e.parameter)
        value = value[e.joint] if isinstance(value, list) and e.joint is not None else value
    return None if value is None else float(value)


COLUMNS = (
    *("block", "joint", "parameter", "unit", "value", "error", "low_90", "high_90"),
    *("low_95", "high_95", "identified", "at_bound", "nominal"),
)


def estimate_frame(read: Iterable[Estimate], joints: Sequence[str]) -> pd.DataFrame:
    """One line for each estimate; joint is "" for parameters of the machine as a whole.

    The ends of unknown intervals are infinite.
    """
    lines = [
        (
            *(e.block, "" if e.joint is None else joints[e.joint], e.parameter, e.unit),
            *(e.value, e.error, *e.interval_90, e.low, e.high),
            *(e.identified, e.at_bound, e.nominal),
        )
        for e in read
    ]
    return pd.DataFrame(lines, columns=list(COLUMNS)).astype({"nominal": float})


def names_of(read: Iterable[Estimate]) -> tuple[str, ...]:
    """Full names of parameters."""
    return tuple(estimate.name for estimate in read)


def mark_of(estimate: Estimate) -> str:
    """Mark of a value in a table: "bound", "unknown" where the data do not determine it, or ""."""
    return "bound" if estimate.at_bound else "" if estimate.identified else "unknown"


def value_text(estimate: Estimate) -> str:
    """The value as tables show it: without digits where the data do not determine it."""
    if estimate.at_bound:
        return f"at its bound, {estimate.value:.3g}"
    if estimate.held:
        return f"held at {estimate.value:.3g}"
    if not estimate.identified:
        return "not identified"
    return digits(estimate.value, estimate.error)


def interval_text(estimate: Estimate) -> str:
    """The 95 % interval as tables show it: none of a value that is held, where it is assumed."""
    error = math.inf if estimate.held else estimate.error
    return interval(estimate.low, estimate.high, error)


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


def added(chosen: Estimates, others: Mapping[str, Estimates]) -> str:
    """What fits of richer laws show beyond the chosen one's parameters, a sentence; "" of nothing.

    Of laws that have all of its parameters, those that the data tell from zero, with intervals;
    velocities, which say nothing of how much there is, are left out. A parameter of each direction
    counts as that of both.
    """
    names = {stem(e.parameter) for e in chosen.parameters if e.block == "friction"}
    parts = []
    for name, other in others.items():
        friction = [e for e in other.parameters if e.block == "friction"]
        shown = [e for e in friction if e.identified and e.unit != "rad/s"]
        shown = [e for e in shown if stem(e.parameter) not in names]
        if shown and names < {stem(e.parameter) for e in friction}:
            values = (f"{e.name} {value_text(e)} {interval_text(e)}" for e in shown)
            parts.append(f"{name} shows {', '.join(values)}")
    return f"Identified, but no practical difference here: {'; '.join(parts)}." if parts else ""
