"""Friction over a covariate such as a temperature: fits at several of its values as one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pandas as pd

from frictionid.api.models import friction_of
from frictionid.arrays import Array
from frictionid.data.calibration import Calibration, stack_calibrations
from frictionid.deploy.pooling.meta_regression import Regression, meta_regression
from frictionid.deploy.pooling.models import Key, bounds_of, check_alike, estimates
from frictionid.errors import InputError
from frictionid.friction import Friction


@dataclass(frozen=True, eq=False, repr=False)
class OverCovariate:
    """Parameters of friction as lines over a covariate.

    Attributes
    ----------
    covariate : its name
    lines : by block, parameter and joint (from 0; None for the machine as a whole)
    units : of the parameters
    left_out : sentences on parameters with fewer than three estimates, which stay at their medians
    """

    covariate: str
    lines: Mapping[Key, Regression]
    units: Mapping[Key, str]
    left_out: tuple[str, ...]
    median: Friction
    span: tuple[float, float]

    def __repr__(self) -> str:
        table = self.frame.to_string(index=False, na_rep="", float_format="{:.4g}".format)
        return "\n".join([table, *self.left_out])

    @property
    def frame(self) -> pd.DataFrame:
        """A line for each parameter.

        Columns: block, joint (from 1), parameter, unit; value, half_width: at the centre of the
        covariate, with half of its 95 % interval; slope, slope_half_width: per unit of the
        covariate; percent: the slope per unit, in percent of the value; p_value: of no slope; tau
        """
        rows = []
        for key, line in self.lines.items():
            half, of_slope = line.half_widths()
            rows.append(
                {
                    "block": key[0],
                    "joint": None if key[2] is None else key[2] + 1,
                    "parameter": key[1],
                    "unit": self.units[key],
                    "value": line.level,
                    "half_width": half,
                    "slope": line.slope,
                    "slope_half_width": of_slope,
                    "percent": 100.0 * line.slope / line.level if line.level else np.nan,
                    "p_value": line.p_value,
                    "tau": line.tau,
                }
            )
        return pd.DataFrame(rows).astype({"joint": "Int64"}) if rows else pd.DataFrame()

    def at(self, value: float) -> Friction:
        """The friction at a value of the covariate, within the bounds of its law.

        Raises
        ------
        InputError
            More than the span of the fits outside of it: the line is not known there.
        """
        low, high = self.span
        if not low - (high - low) <= value <= high + (high - low):
            raise InputError(
                f"{self.covariate} = {value:g} is far from the fits', {low:g} to {high:g}: record "
                "there, too"
            )
        theta, law = np.array(self.median.theta, dtype=float), self.median.law
        for (block, name, joint), line in self.lines.items():
            if block == "friction" and joint is not None and name in law.names:
                bounds = bounds_of(self.median, block, name)
                theta[joint, law.names.index(name)] = np.clip(line.at(value), *bounds)
        return replace(self.median, theta=theta)


def over_covariate(
    models: Mapping[str, Any] | Sequence[Any], covariate: str, values: Sequence[float] | None = None
) -> OverCovariate:
    """Regress the parameters of fits on a covariate, by a random-effects meta-regression.

    Each fit is of recordings at one value, such as a temperature that hardly changes within a
    recording. Every parameter becomes a line over it, with an interval of the slope.

    Parameters
    ----------
    models : list or mapping by name
        What `frictionid.fit` returns, or model files; three or more, of the same law.
    covariate : str
        Its name, such as "temperature".
    values : list of float, optional
        One for each model; without them, the means of the recordings' covariate of this name.

    Raises
    ------
    InputError
        Where models are not alike or too few, have no intervals, or the covariate does not vary.

    Examples
    --------
    >>> from frictionid.friction.laws import CoulombViscous
    >>> rigs = {
    ...     f"{T} deg": Friction(
    ...         CoulombViscous(), np.array([[0.2 - 0.002 * T, 0.02]]), {},
    ...         {"half_widths": [[0.001, 0.0005]]},
    ...     )
    ...     for T in (20, 30, 40, 50)
    ... }
    >>> over_covariate(rigs, "temperature", [20, 30, 40, 50]).at(25.0).theta.round(4)
    array([[0.15, 0.02]])
    """
    if not isinstance(models, Mapping):
        models = {f"model {k + 1}": model for k, model in enumerate(models)}
    names, given = list(models), list(models.values())
    if len(given) < 3:
        raise InputError(f"over_covariate: needs three models or more, not {len(given)}")
    frictions = [friction_of(model) for model in given]
    check_alike(frictions, names)
    x = _values(given, names, covariate, values)
    rows = [
        (float(at), e)
        for model, name, at in zip(frictions, names, x, strict=True)
        for e in estimates(model, name)
    ]
    lines: dict[Key, Regression] = {}
    units: dict[Key, str] = {}
    left_out = []
    for key in dict.fromkeys(e.key for _, e in rows):
        own = [(at, e) for at, e in rows if e.key == key]
        known = [(at, e) for at, e in own if not e.reason]
        if len(known) < 3 or len({at for at, _ in known}) < 2:
            title = own[0][1].name
            left_out.append(f"{title}: {len(known)} of {len(given)} fits tell it, no line")
            continue
        y, s = ([getattr(e, part) for _, e in known] for part in ("value", "error"))
        at = np.array([at for at, _ in known])
        lines[key], units[key] = meta_regression(np.array(y), np.array(s), at), known[0][1].unit
    theta = np.median([f.theta for f in frictions], axis=0)
    source = {f"over_{covariate}": {name: float(v) for name, v in zip(names, x, strict=True)}}
    median = replace(
        frictions[0], theta=theta, provenance=source, calibration=_mean_calibration(frictions)
    )
    span = (float(x.min()), float(x.max()))
    return OverCovariate(covariate, lines, units, tuple(left_out), median, span)


def _mean_calibration(frictions: Sequence[Friction]) -> Calibration | None:
    """Mean of what the fits found of machine and sensors; None where one has found nothing."""
    own = [f.calibration for f in frictions if f.calibration is not None]
    if len(own) < len(frictions):
        return None
    found = {f.name: getattr(stack_calibrations(own), f.name) for f in fields(Calibration)}
    means: dict[str, Any] = {k: None if v is None else v.mean(axis=0) for k, v in found.items()}
    return Calibration(**means)


def _values(
    given: Sequence[Any], names: Sequence[str], covariate: str, values: Sequence[float] | None
) -> Array:
    """The covariate of each model."""
    if values is None:
        values = [_mean(model, name, covariate) for model, name in zip(given, names, strict=True)]
    x = np.array(values, dtype=float)
    if x.shape != (len(given),) or not np.isfinite(x).all():
        raise InputError(f"over_covariate: give one finite number for each of {len(given)} models")
    if np.ptp(x) == 0:
        raise InputError(f"over_covariate: {covariate} is {x[0]:g} for all models: record others")
    return x


def _mean(model: Any, name: str, covariate: str) -> float:
    recordings = getattr(getattr(model, "data", None), "recordings", ())
    known = [r.covariates[covariate].value for r in recordings if covariate in r.covariates]
    if not known or len(known) < len(recordings):
        raise InputError(
            f"over_covariate: {name} knows no {covariate!r} of its recordings: give `values`"
        )
    return float(np.concatenate([v.ravel() for v in known]).mean())
