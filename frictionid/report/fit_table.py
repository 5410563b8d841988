"""Parameters of one fit: estimates with intervals, as a frame and as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.report.estimates import Estimate, digits, estimates, interval
from frictionid.report.numbers import NOTHING
from frictionid.report.pooled_document import pooled_document
from frictionid.report.tables import Column, Table, line, text_columns

COLUMNS = (
    *("block", "joint", "parameter", "value", "low_95", "high_95"),
    *("unit", "identified", "at_bound", "nominal"),
)
NORMAL = 1.96  # half-widths of 95 % over standard errors


def fit_estimates(
    friction: Friction, joints: Sequence[str], half_widths: Array | None
) -> list[Estimate]:
    """Estimates of a fitted friction (n, P): those of shooting, else of its parameters.

    half_widths : (n, P), half the 95 % intervals, NaN where there is none; None where none is known

    A network's weights and terms that a sparse law does not have are left out.
    """
    document: Any = friction.provenance.get("refined") or pooled_document(friction)
    if document:
        return estimates(document)
    if friction.law.is_network:
        return []
    theta = np.asarray(friction.theta, dtype=float)
    own = friction.law.has_parameters(len(theta))
    half = np.full(theta.shape, np.nan) if half_widths is None else half_widths
    return [
        _estimate(friction, (j, i), float(half[j, i]), joints, known=half_widths is not None)
        for j, i in np.ndindex(*theta.shape)
        if own[j, i] and not (friction.law.is_sparse and theta[j, i] == 0)
    ]


def _estimate(
    friction: Friction, place: tuple[int, int], half: float, joints: Sequence[str], *, known: bool
) -> Estimate:
    """Known : whether intervals are known at all; else nothing is said to be unidentified."""
    j, i = place
    name, value = friction.law.names[i], float(friction.theta[j, i])
    finite = bool(np.isfinite(half))
    error = half / NORMAL if finite else float("inf")
    inner = 1.645 * error
    return Estimate(
        block="friction",
        name=f"{name} of {joints[j]}",
        parameter=name,
        joint=j,
        unit=friction.units_at(j)[i],
        value=value,
        error=error,
        inner=(value - inner, value + inner),
        low=value - half if finite else -np.inf,
        high=value + half if finite else np.inf,
        at_bound=False,
        identified=not known or (finite and half <= abs(value)),
        prior=False,
        nominal=None,
        true=None,
    )


def interval_note(source: Mapping[str, Any]) -> str:
    """What the intervals of a one-step fit hold, by its provenance."""
    if "smoothing_bias" in source:
        return "intervals hold the noise, and the bias of smoothed states"
    return (
        "intervals hold the noise alone: they leave out the bias of smoothed states and are too "
        "narrow; fit with bias=True, or by shooting"
    )


def estimate_table(
    read: Sequence[Estimate], *, known: bool = True, noise_alone: bool = False
) -> Table:
    """Table of estimates: value, 95 % interval, unit, and whether the data determine it.

    noise_alone : whether intervals hold the noise, but not the bias of smoothed states
    known : whether intervals are known; without them nothing is said of that
    """
    columns = [
        *text_columns("parameter"),
        Column("value"),
        Column("interval of the noise alone" if noise_alone else "95 % interval"),
        *text_columns("unit", "identified"),
    ]
    lines = []
    for e in read:
        value = digits(e.value, e.error if e.identified else float("inf"))
        said = NOTHING if not known else "yes" if e.identified else "NO, at its bound"
        said = "NO" if known and not e.identified and not e.at_bound else said
        lines.append(line((e.name, value, interval(e.low, e.high, e.error), e.unit, said)))
    return Table("", "parameters", tuple(columns), tuple(lines))


def estimate_frame(
    read: Sequence[Estimate], joints: Sequence[str], *, known: bool = True
) -> pd.DataFrame:
    """One line for each estimate; joint is "" for parameters of the machine as a whole.

    Columns: block, joint, parameter, value, low_95, high_95, unit, identified, at_bound, nominal.
    The ends of unknown intervals are infinite.

    known : whether intervals are known; without them `identified` is None
    """
    lines = [
        (
            e.block,
            "" if e.joint is None else joints[e.joint],
            e.parameter,
            *(e.value, e.low, e.high, e.unit, e.identified if known else None, e.at_bound),
            np.nan if e.nominal is None else e.nominal,
        )
        for e in read
    ]
    return pd.DataFrame(lines, columns=list(COLUMNS)).astype({"nominal": float})
