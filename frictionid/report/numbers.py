"""Numbers as text, for tables and templates."""

from collections.abc import Iterable, Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.data.joint_scales import are_mixed

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


def signed(value: float, places: int) -> str:
    """A difference with so many decimals and its sign.

    >>> signed(-0.0123, 3), signed(0.5, 1), signed(-0.0001, 2)
    ('−0.012', '+0.5', '0.00')
    """
    text = f"{fixed(abs(value), places)}"
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
