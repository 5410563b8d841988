"""Pooling of fitted models: one friction for several specimens, with the spread between them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from frictionid.api.models import count as whole
from frictionid.api.models import friction_of
from frictionid.comparison.equal_joints import groups_of
from frictionid.data.plants import Calibration, stack_calibrations
from frictionid.errors import InputError, printable
from frictionid.friction import Friction
from frictionid.friction.model_files import save_model
from frictionid.friction.provenance import Pooled as Specimens
from frictionid.friction.provenance import Provenance
from frictionid.report.numbers import digits, interval, short
from frictionid.report.tables import Table, table_of, terminal_text, text_columns

from .pooled_models import Key, check_alike, estimates, place_of, pooled, with_parameters
from .random_effects import Regression, meta_regression, pooled_draws

_LEAST = 1e-4  # p-values below it are not told apart


def pooled_table(several: Specimens) -> Table:
    """Table of the pooled parameters."""
    numbers = "mean", "95 % interval", "range of another specimen", "tau"
    heads = (*text_columns("parameter"), *numbers, *text_columns("unit"), "Q", "p", "models")
    rows = []
    for e in several.parameters:
        ranges = (interval(*ends, e.error) for ends in (e.interval_95, e.range_95))
        p = f"{e.p_value:.2g}" if e.p_value >= _LEAST else f"<{_LEAST:g}"
        words = (e.name, digits(e.value, e.error), *ranges, short(e.tau), e.unit)
        rows.append((*words, f"{e.Q:.3g}", p, str(len(e.models))))
    return table_of(heads, rows)


@dataclass(frozen=True, eq=False, repr=False)
class Pooled:
    """Friction of several specimens of one machine, and what another specimen may have.

    Attributes
    ----------
    friction : Friction, theta (n, P)
        The means; its provenance holds the spread. It is saved, exported and simulated as any
        other; an export with `randomise` draws further specimens.
    """

    friction: Friction

    def __repr__(self) -> str:
        return "\n".join(
            [terminal_text(pooled_table(self.several)), *map(printable, self.left_out)]
        )

    @property
    def frame(self) -> pd.DataFrame:
        """A line for each pooled parameter.

        Columns: block, joint (from 1, 0 for the machine as a whole), parameter, unit; value,
        low_95, high_95: the mean of all specimens with its interval; range_low, range_high: 95 %
        range of another specimen; tau, tau_low, tau_high: standard deviation between specimens; Q,
        p_value: heterogeneity; models: how many.
        """
        columns = (
            "block joint parameter unit value low_95 high_95 range_low range_high tau tau_low "
            "tau_high Q p_value models"
        )
        lines = [
            (
                e.block,
                0 if e.joint is None else e.joint + 1,
                e.parameter,
                e.unit,
                e.value,
                *e.interval_95,
                *e.range_95,
                e.tau,
                *e.tau_95,
                e.Q,
                e.p_value,
                len(e.models),
            )
            for e in self.several.parameters
        ]
        return pd.DataFrame(lines, columns=columns.split())

    @property
    def left_out(self) -> tuple[str, ...]:
        """Sentences on parameters that are not identified or lie at a bound."""
        return self.several.left_out

    def ranges(self) -> dict[str, Any]:
        """95 % ranges of another specimen by the parameters' names, for domain randomisation.

        Each has unit, mean, low and high.
        """
        return {
            e.name: {"unit": e.unit, "mean": e.value, "low": e.range_95[0], "high": e.range_95[1]}
            for e in self.several.parameters
        }

    def sample(self, count: int, seed: int = 0) -> Friction:
        """Further specimens: a friction with theta (count, n, P), within the 95 % ranges.

        Each parameter is drawn by itself; those that were not pooled stay at their medians.
        """
        draws = pooled_draws(self.several, whole("count", count), whole("seed", seed))
        theta = with_parameters(self.friction, self.several.parameters, draws)
        return replace(self.friction, theta=theta, constraints=None)

    def save(self, path: str | Path) -> None:
        """Write a model file (JSON)."""
        save_model(self.friction, Path(path))

    @property
    def several(self) -> Specimens:
        """What was pooled, parameter by parameter."""
        several = self.friction.provenance.pooled
        if several is None:
            raise InputError("the model is not pooled: frictionid pool makes one of several")
        return several


def pool(
    models: Sequence[Any] | Mapping[str, Any], *, equal: Sequence[Sequence[str | int]] = ()
) -> Pooled:
    """Pool fitted models of several specimens, of the same law, by a random-effects meta-analysis.

    Parameters
    ----------
    models : list or mapping by name
        What `frictionid.fit` returns, or model files: one of each specimen.
    equal : list of lists of str or int
        Groups of joints of the same kind, by names or by numbers from 1: each is a specimen.

    Raises
    ------
    InputError
        Where there are fewer than two models, they are not alike, have no intervals, or one is
        given twice.

    Examples
    --------
    >>> import numpy as np
    >>> from frictionid.friction.laws import CoulombViscous
    >>> rigs = {
    ...     f"rig {i}": Friction(
    ...         CoulombViscous(), np.array([[level, 0.02]]), {}, {"half_widths": [[0.01, 0.002]]}
    ...     )
    ...     for i, level in enumerate([0.10, 0.14, 0.12, 0.17])
    ... }
    >>> pool(rigs).frame[["parameter", "value", "range_low", "range_high"]].round(3)
      parameter  value  range_low  range_high
    0   coulomb  0.132      0.027       0.238
    1   viscous  0.020      0.018       0.022
    """
    if isinstance(models, str | Path) or not isinstance(models, Mapping | Sequence):
        raise InputError(f"pool: needs a list of models, not {models!r}")
    names, fits = _named(models)
    frictions = [friction_of(fit) for fit in fits]
    groups = groups_of(equal, frictions[0].joints) if equal and fits else ()
    return Pooled(pooled(frictions, names, groups))


def _named(models: Mapping[str, Any] | Sequence[Any]) -> tuple[list[str], list[Any]]:
    """Names of models, and the models: files have theirs, others that of their place."""
    if isinstance(models, Mapping):
        return [str(name) for name in models], list(models.values())
    names = [
        str(model) if isinstance(model, str | Path) else f"model {k + 1}"
        for k, model in enumerate(models)
    ]
    return names, list(models)


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
        for key, fitted in self.lines.items():
            half, of_slope = fitted.half_widths()
            rows.append(
                {
                    "block": key[0],
                    "joint": None if key[2] is None else key[2] + 1,
                    "parameter": key[1],
                    "unit": self.units[key],
                    "value": fitted.level,
                    "half_width": half,
                    "slope": fitted.slope,
                    "slope_half_width": of_slope,
                    "percent": 100.0 * fitted.slope / fitted.level if fitted.level else np.nan,
                    "p_value": fitted.p_value,
                    "tau": fitted.tau,
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
        for key, fitted in self.lines.items():
            if (place := place_of(self.median, *key)) is not None:
                theta[place] = np.clip(fitted.at(value), *law.bounds[place[1]])
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
    names, fits = _named(models)
    if len(fits) < 3:
        raise InputError(f"over_covariate: needs three models or more, not {len(fits)}")
    frictions = [friction_of(fit) for fit in fits]
    check_alike(frictions, names)
    if values is None:
        values = [_mean(fit, name, covariate) for fit, name in zip(fits, names, strict=True)]
    x = np.array(values, dtype=float)
    if x.shape != (len(fits),) or not np.isfinite(x).all():
        raise InputError(f"over_covariate: give one finite number for each of {len(fits)} models")
    if np.ptp(x) == 0:
        raise InputError(f"over_covariate: {covariate} is {x[0]:g} for all models: record others")
    value_of, lines, units, left_out = dict(zip(names, x.tolist(), strict=True)), {}, {}, []
    for key, rows in estimates(frictions, names).items():
        usable = [(value_of[row.model], row.estimate) for row in rows if not row.reason]
        at, first = [at for at, _ in usable], rows[0].estimate
        if len(usable) < 3 or len(set(at)) < 2:
            left_out.append(f"{first.name}: {len(usable)} of {len(fits)} fits tell it, no line")
            continue
        value, error = np.array([(e.value, e.error) for _, e in usable]).T
        lines[key], units[key] = meta_regression(value, error, np.array(at)), first.unit
    source = {f"over_{covariate}": value_of}
    median = replace(
        frictions[0],
        theta=np.median([f.theta for f in frictions], axis=0),
        provenance=Provenance().but(source),
        calibration=_mean_calibration(frictions),
    )
    span = (float(x.min()), float(x.max()))
    return OverCovariate(covariate, lines, units, tuple(left_out), median, span)


def _mean_calibration(frictions: Sequence[Friction]) -> Calibration | None:
    """Mean of what the fits say of machine and sensors; None where one of them says nothing."""
    calibrations = [f.calibration for f in frictions if f.calibration is not None]
    if len(calibrations) < len(frictions):
        return None
    stacked: dict[str, Any] = vars(stack_calibrations(calibrations))
    means: dict[str, Any] = {k: v if v is None else v.mean(axis=0) for k, v in stacked.items()}
    return Calibration(**means)


def _mean(model: Any, name: str, covariate: str) -> float:
    recordings = getattr(getattr(model, "data", None), "recordings", ())
    values = [r.covariates[covariate].value for r in recordings if covariate in r.covariates]
    if not values or len(values) < len(recordings):
        raise InputError(
            f"over_covariate: {name} knows no {covariate!r} of its recordings: give `values`"
        )
    return float(np.concatenate([v.ravel() for v in values]).mean())
