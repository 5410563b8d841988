"""Numbers as text, for tables and templates, and parameters that a fit estimated."""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.data.joint_scales import are_mixed
from frictionid.friction.laws.levels import stem
from frictionid.friction.provenance import Estimate, Estimates

NOTHING = "–"
INFINITE = "∞"
MINUS = "−"
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


def factor(value: float) -> str:
    """A factor.

    >>> factor(1.04), factor(2.345), factor(23.4), factor(0.5)
    ('1.04', '2.3', '23', '0.50')
    """
    return fixed(value, 2 if value < 1.1 else 1 if value < 10 else 0)


def signed(value: float) -> str:
    """A difference with one decimal and its sign.

    >>> signed(-0.123), signed(0.5), signed(-0.01)
    ('−0.1', '+0.5', '0.0')
    """
    text = fixed(abs(value), 1)
    if not any(digit in text for digit in "123456789"):
        return text
    return f"{'+' if value >= 0 else MINUS}{text}"


def with_error(mean: float, error: float) -> str:
    """A mean with its standard error, of which one digit is shown.

    >>> with_error(0.07, 0.00091), with_error(-0.012, 0.01), with_error(0.5, 0.0)
    ('0.0700 ± 0.0009', '−0.012 ± 0.010', '0.50 ± 0.00')
    """
    places = decimals([error, mean / 10], 1)
    return f"{fixed(mean, places).replace('-', MINUS)} ± {fixed(error, places)}"


def mean_sd(values: Array, places: int | None = None) -> str:
    """Mean ± standard deviation of the finite ones of values (F,).

    places : decimals; by default those that leave the deviation two digits

    >>> mean_sd(np.array([1.0, 1.2, np.nan])), mean_sd(np.array([2.0])), mean_sd(np.array([]))
    ('1.10 ± 0.14', '2.0', '–')
    """
    finite = values[np.isfinite(values)]
    if not len(finite):
        return NOTHING
    mean = float(finite.mean())
    if len(finite) == 1 or np.ptp(finite) < 1e-9:
        return short(mean) if abs(mean) > 1e-9 else "0"
    deviation = float(finite.std(ddof=1))
    places = decimals([deviation]) if places is None else places
    return f"{fixed(mean, places)} ± {fixed(deviation, places)}"


def either(units: Sequence[str]) -> str:
    """Unit of the joints' numbers, or those of joints of both kinds.

    >>> either(["rad", "rad"]), either(["m", "rad"])
    ('rad', 'm, rad')
    """
    return ", ".join(dict.fromkeys(units))


def norm_unit(position_units: Sequence[str]) -> str:
    """Unit of errors over all joints: where some turn and others slide, their joints' sizes.

    >>> norm_unit(["m", "m"]), norm_unit(["m", "rad"])
    ('m', 'sizes')
    """
    return "sizes" if are_mixed(position_units) else position_units[0]


def divergence_limit(angle_unit: str) -> str:
    """Error beyond which a prediction has diverged (`frictionid.data.joint_scales`).

    >>> divergence_limit("m"), divergence_limit("rad")
    ('a quarter of the travel', 'a quarter of the travel or 1 rad')
    """
    return "a quarter of the travel" + ("" if angle_unit == "m" else " or 1 rad")


def seconds(horizon: float) -> str:
    """A time span: "0.25 s"."""
    return f"{horizon:g} s"


# --- Estimates ------------------------------------------------------------------------------------


def change(e: Estimate) -> list[str]:
    """Difference from the nominal value, which is not zero, and its 95 % interval.

    In per cent; in the parameter's unit where the nominal value is below the standard error.
    """
    assert e.nominal
    scale, unit = (100 / e.nominal, "%") if e.error < abs(e.nominal) else (1.0, e.unit)
    middle, *ends = (scale * (v - e.nominal) for v in (e.value, *e.interval_95))
    texts = (rounded(v, abs(scale) * e.error) for v in (middle, *sorted(ends)))
    first, *others = (text if text.startswith(MINUS) else f"+{text}" for text in texts)
    return [f"{first} {unit}", *others]


def span(e: Estimate, scale: float) -> list[str]:
    """The value, times a scale, with its 95 % interval, as text."""
    return [rounded(scale * v, scale * e.error) for v in (e.value, *e.interval_95)]


COLUMNS = (
    "block joint parameter unit value error low_90 high_90 low_95 high_95 identified at_bound "
    "nominal"
).split()


def estimate_frame(read: Iterable[Estimate], joints: Sequence[str]) -> pd.DataFrame:
    """One line for each estimate; joint is "" for parameters of the machine as a whole.

    The ends of unknown intervals are infinite.
    """
    lines = [
        (
            e.block,
            "" if e.joint is None else joints[e.joint],
            e.parameter,
            e.unit,
            e.value,
            e.error,
            *e.interval_90,
            e.low,
            e.high,
            e.identified,
            e.at_bound,
            e.nominal,
        )
        for e in read
    ]
    return pd.DataFrame(lines, columns=COLUMNS).astype({"nominal": float})


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
    places = max(0, 1 - math.floor(math.log10(error)))
    # + 0.0 turns -0.0 into 0.0
    return f"{round(value, places) + 0.0:.{places}f}" if places < 9 else f"{value:.4g}"


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
        new = [e for e in friction if stem(e.parameter) not in names]
        shown = [e for e in new if e.identified and e.unit != "rad/s"]
        if shown and names < {stem(e.parameter) for e in friction}:
            values = (f"{e.name} {value_text(e)} {interval_text(e)}" for e in shown)
            parts.append(f"{name} shows {', '.join(values)}")
    return f"Identified, but no practical difference here: {'; '.join(parts)}." if parts else ""


def with_levels(refined: Estimates) -> list[Estimate]:
    """The parameters, and levels at rest where the data tell these but not what is Coulomb's.

    The level is coulomb + peak; of a part at a bound, which has no error, it has the other's.
    """
    read = refined.parameters
    places = {(e.joint, e.parameter): k for k, e in enumerate(read)}
    out = list(read)
    for k, coulomb in enumerate(read):
        peak = coulomb.parameter.replace("coulomb", "peak")
        i = places.get((coulomb.joint, peak), k)
        both = [j for j in (k, i) if np.isfinite(read[j].error)]
        if coulomb.identified or i == k or not both:
            continue
        C = refined.square(refined.covariance)[np.ix_(both, both)]
        value, error = coulomb.value + read[i].value, float(np.sqrt(C.sum()))
        half = float(stdtrit(refined.freedom, 0.975)) * error
        if half <= value:
            name, ends = f"{coulomb.parameter} + {read[i].name}", (value - half, value + half)
            numbers = coulomb.unit, coulomb.joint, value, error, ends, ends
            out.insert(out.index(read[i]) + 1, Estimate("friction", name, *numbers))
    return out
