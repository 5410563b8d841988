"""What shooting found, in sentences: the machine and its sensors, and what is not known."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import stdtrit

from frictionid.report.numbers import listed
from frictionid.report.shooting_numbers import Estimate, correlation_of, digits

LOOPS = ("viscous", "lag")  # what a torque that acts late looks like
PLACES = 8  # told one by one; more stand in the table of windows
NAMES = 12


def findings(read: Sequence[Estimate]) -> Iterator[str]:
    """Sentences on delay, gain, bias, offsets, motor and inertia, where these were free."""
    known = [e for e in read if e.identified]
    for block, words in _WORDS.items():
        yield from (words(e) for e in known if e.block == block)
    yield from _inertia([e for e in read if e.block == "inertia"])


def _delay(e: Estimate) -> str:
    if e.low <= 0.0 <= e.high:
        return f"No delay of the torque shows: {_span(e, 1e3, ' ms')}."
    when = "later" if e.value > 0 else "earlier"
    return f"The torque acts {_span(e, 1e3 * np.sign(e.value), ' ms')} {when} than logged."


def _gain(e: Estimate) -> str:
    words = "has the right size"
    if not e.low <= 1.0 <= e.high:
        words = f"is too {'small' if e.value > 1.0 else 'large'}"
    return f"The {e.name} is {_span(e)}: the logged torque {words}."


def _bias(e: Estimate) -> str:
    if e.low <= 0.0 <= e.high:
        return _none(e)
    return f"The {e.name} is {_span(e, 1.0, f' {e.unit}')}: that acts beside the logged torque."


def _offset(e: Estimate) -> str:
    if e.low <= 0.0 <= e.high:
        return _none(e)
    where = "above" if e.value > 0 else "below"
    size = _span(e, 1.0, f" {e.unit}")
    return f"The {e.name} is {size}: the measured angle lies {where} the true one."


def _motor(e: Estimate) -> str:
    told = ""
    if e.told:
        middle, low, high = change(e)
        told = f", told is {e.told:g}: {middle} % ({low} to {high})"
    return f"The motor's {e.name} is {_span(e, 1.0, f' {e.unit}')}{told}."


def _none(e: Estimate) -> str:
    return f"No {e.name} shows: {_span(e, 1.0, f' {e.unit}')}."


_WORDS: Mapping[str, Callable[[Estimate], str]] = {
    "delay": _delay,
    "gain": _gain,
    "bias": _bias,
    "offset": _offset,
    "actuator": _motor,
}


def _span(e: Estimate, scale: float = 1.0, unit: str = "") -> str:
    """A value with its interval: 17.8 ms (17.6 to 17.9)."""
    ends = sorted((scale * e.low, scale * e.high))
    middle, low, high = (rounded(v, abs(scale) * e.error) for v in (scale * e.value, *ends))
    return f"{middle}{unit} ({low} to {high})"


def rounded(value: float, error: float) -> str:
    """A value for sentences: with one digit of its standard error.

    >>> rounded(17.7701, 0.12), rounded(-0.0312, 0.004)
    ('17.8', '−0.031')
    """
    return digits(value, 10 * error).replace("-", "−")


def _inertia(entries: Sequence[Estimate]) -> Iterator[str]:
    """Which base parameters are not what the data set's mechanism says."""
    told = [e for e in entries if e.identified and e.told]
    off = [e for e in told if e.outside]
    if not told:
        return
    parts = []
    for e in sorted(off, key=lambda e: -abs(_off(e))):
        middle, low, high = change(e)
        parts.append(f"{e.name} by {middle} % ({low} to {high})")
    if not off:
        each = {1: "the base parameter", 2: "both base parameters"}.get(
            len(told), f"all {len(told)} base parameters"
        )
        yield f"Of {each} the told value lies in the 95 % interval."
    elif len(off) == len(told):
        every = "All base parameters" if len(told) > 1 else "The base parameter"
        differ = "differ" if len(told) > 1 else "differs"
        yield f"{every} {differ} from what is told: {listed(parts)}."
    else:
        differ = "differs" if len(off) == 1 else "differ"
        yield (
            f"Of {len(told)} base parameters {len(off)} {differ} from what is told: "
            f"{listed(parts)}; of the others the told value lies in the 95 % interval."
        )


def _off(e: Estimate) -> float:
    assert e.told
    return e.value / e.told - 1.0


def change(e: Estimate) -> tuple[str, str, str]:
    """Difference from what is told, with the ends of its interval, in per cent."""
    assert e.told
    error = 100 * e.error / abs(e.told)
    low, high = sorted(100 * (end / e.told - 1.0) for end in (e.low, e.high))
    return signed(100 * _off(e), error), signed(low, error), signed(high, error)


def signed(value: float, error: float) -> str:
    """A number for sentences with its sign.

    >>> signed(16.449, 0.021), signed(-3.0, 1.2)
    ('+16.45', '−3')
    """
    return f"{'+' if value >= 0 else ''}{rounded(value, error)}"


def coverage(read: Sequence[Estimate]) -> str:
    """How many true values the intervals hold, where there are any to be known."""
    inside = [e.covered for e in read if e.covered is not None]
    if not inside:
        return ""
    missed = [e.name for e in read if e.covered is False]
    beside = f", not those of {_short_list(missed)}" if missed else ""
    return (
        f"The 95 % intervals hold {sum(inside)} of the {len(inside)} true values that are known of "
        f"identified parameters{beside}."
    )


def doubts(document: Mapping[str, Any], read: Sequence[Estimate]) -> Iterator[str]:
    """Sentences on what is not identified, and on windows left out or not explained."""
    yield from document.get("doubts", ())
    names = [f"{e.name} (at its bound)" if e.at_bound else e.name for e in read if not e.identified]
    if names:
        yield f"Not identified, at a bound or less sure than its own size: {_short_list(names)}."
    for words in document["undetermined"]:
        yield f"{words[:1].upper()}{words[1:]}."
    yield from late(document, read)
    priors = [e.name for e in read if e.prior]
    if priors:
        yield f"With a prior that was given: {_short_list(priors)}."
    if not document["settled"]:
        yield f"The fit had not settled after {document['iterations']} iterations."
    yield from windows(document)


def _short_list(names: Sequence[str]) -> str:
    more = len(names) - NAMES
    return listed([*names[:NAMES], f"{more} more"] if more > 0 else names)


def late(document: Mapping[str, Any], read: Sequence[Estimate]) -> Iterator[str]:
    """Where a delay that is not known well enough, or was not free, would look like friction.

    A delay within its own interval moves a parameter by up to |r| t s, r their correlation and s
    the parameter's standard error: is that its whole value, the delay explains it as well.
    """
    loops = [e for e in read if e.block == "friction" and e.short.partition("_")[0] in LOOPS]
    delays = [i for i, e in enumerate(read) if e.block == "delay"]
    if not loops:
        return
    if not delays:
        if document.get("driven", False):
            yield (
                "The delay was not free: a torque that acts later than logged looks like viscous "
                f"friction, and its share is in {_short_list([e.name for e in loops])}."
            )
        return
    share = np.abs(correlation_of(document)[delays[0]])
    reach = float(stdtrit(document["freedom"], 0.975))
    names = [
        e.name
        for e, r in zip(read, share, strict=True)
        if e in loops and np.isfinite(e.error) and r * reach * e.error >= abs(e.value)
    ]
    if names:
        yield (
            f"The delay explains {_short_list(names)} as well: within its interval lies one with "
            "which nothing would be left."
        )


def windows(document: Mapping[str, Any]) -> Iterator[str]:
    """Windows left out or not explained, by recording and time."""
    out, odd = document["left_out"], document["unexplained"]
    if out:
        yield (
            f"{_count(out, document)} left out, as a joint just misses or just reaches a stop and "
            f"the prediction jumps with the start state: {_places(out)}."
        )
    if odd:
        yield (
            f"{_count(odd, document)} not explained, with residuals of three times the angle noise "
            f"and more: {_places(odd)}."
        )


def _count(places: Sequence[Any], document: Mapping[str, Any]) -> str:
    were = "was" if len(places) == 1 else "were"
    return f"{len(places)} of {document['windows']} windows {were}"


def _places(places: Sequence[Mapping[str, Any]]) -> str:
    told = [f"{p['recording']} {p['begin']:.2f} to {p['end']:.2f} s" for p in places[:PLACES]]
    more = len(places) - PLACES
    return ", ".join(told) + (f" and {more} more" if more > 0 else "")
