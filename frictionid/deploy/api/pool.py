"""Pooling of fitted models: one friction for several specimens, with the spread between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from frictionid.api.models import count as whole
from frictionid.api.models import friction_of
from frictionid.comparison.equal_joints import groups_of
from frictionid.comparison.registry import LAWS
from frictionid.deploy.pooling.models import joint_names, pooled
from frictionid.deploy.pooling.random_effects import sampled
from frictionid.errors import InputError, printable
from frictionid.friction import Friction
from frictionid.friction.model_files import save_model
from frictionid.report.console import console, printed
from frictionid.report.estimates import digits, interval, pooled_document
from frictionid.report.numbers import short
from frictionid.report.tables import Column, Table, for_terminal, line, text_columns

COLUMNS = (
    *("block", "joint", "parameter", "unit", "value", "low_95", "high_95"),
    *("range_low", "range_high", "tau", "tau_low", "tau_high", "Q", "p_value", "models"),
)
_LEAST = 1e-4  # p-values below it are not told apart


def pooled_frame(document: Mapping[str, Any]) -> pd.DataFrame:
    """A line for each pooled parameter; joint is its number from 1, 0 for the machine as a whole.

    Columns: block, joint, parameter, unit; value, low_95, high_95: the mean of all specimens with
    its interval; range_low, range_high: 95 % range of another specimen; tau, tau_low, tau_high:
    standard deviation between specimens; Q, p_value: heterogeneity; models: how many.
    """
    lines = [
        (
            *(e["block"], 0 if e["joint"] is None else int(e["joint"]) + 1),
            str(e["name"]) if e["joint"] is None else str(e["name"]).rpartition(" of ")[0],
            *(e["unit"], float(e["value"]), *e["interval_95"], *e["range_95"]),
            *(float(e["tau"]), *e["tau_95"], float(e["Q"]), float(e["p_value"])),
            len(e["models"]),
        )
        for e in document["parameters"]
    ]
    return pd.DataFrame(lines, columns=list(COLUMNS))


def pooled_table(document: Mapping[str, Any]) -> Table:
    """The same for people."""
    columns = (
        *text_columns("parameter"),
        *(Column("mean"), Column("95 % interval"), Column("range of another specimen")),
        *(Column("tau"), *text_columns("unit"), Column("Q"), Column("p"), Column("models")),
    )
    lines = []
    for e in document["parameters"]:
        value, error = float(e["value"]), float(e["error"])
        inner, outer = (
            interval(float(low), float(high), error)
            for low, high in (e["interval_95"], e["range_95"])
        )
        words = str(e["name"]), digits(value, error), inner, outer, short(float(e["tau"]))
        spread = f"{e['Q']:.3g}", _p_value(float(e["p_value"])), str(len(e["models"]))
        lines.append(line((*words, str(e["unit"]), *spread)))
    return Table("", "pooled", columns, tuple(lines))


def _p_value(p: float) -> str:
    return f"{p:.2g}" if p >= _LEAST else f"<{_LEAST:g}"


def show_pooled(document: Mapping[str, Any]) -> None:
    """Print what was pooled, and what was left out."""
    out = console()
    for text in for_terminal(pooled_table(document)):
        out.print(text, soft_wrap=True)
    for sentence in document["left_out"]:
        out.print(printable(str(sentence)), markup=False, soft_wrap=True)


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
        return printed(partial(show_pooled, self._document)).rstrip()

    @property
    def frame(self) -> pd.DataFrame:
        """A line for each pooled parameter.

        Columns: block, joint, parameter, unit; value, low_95, high_95: the mean of all specimens
        with its interval; range_low, range_high: 95 % range of another specimen; tau, tau_low,
        tau_high: standard deviation between specimens; Q, p_value: heterogeneity; models: how
        many.
        """
        return pooled_frame(self._document)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Sentences on parameters that are not identified or lie at a bound."""
        return tuple(self._document["left_out"])

    def ranges(self) -> dict[str, Any]:
        """95 % ranges of another specimen by the parameters' names, for domain randomisation.

        Each has unit, mean, low and high.
        """
        return {
            str(e["name"]): {
                "unit": e["unit"],
                "mean": e["value"],
                "low": e["range_95"][0],
                "high": e["range_95"][1],
            }
            for e in self._document["parameters"]
        }

    def sample(self, count: int, seed: int = 0) -> Friction:
        """Further specimens: a friction with theta (count, n, P), within the 95 % ranges.

        Each parameter is drawn by itself; those that were not pooled stay at their medians.
        """
        return sampled(self.friction, whole("count", count), whole("seed", seed))

    def save(self, path: str | Path) -> None:
        """Write a model file (JSON).

        Raises
        ------
        InputError
            Where the place cannot be written.
        """
        save_model(self.friction, Path(path), LAWS)

    @property
    def _document(self) -> Mapping[str, Any]:
        document = pooled_document(self.friction)
        if not document:
            raise InputError("the model is not pooled: frictionid pool makes one of several")
        return document


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
    if isinstance(models, Mapping):
        names, given = [str(name) for name in models], list(models.values())
    elif isinstance(models, str | Path) or not isinstance(models, Sequence):
        raise InputError(f"pool: needs a list of models, not {models!r}")
    else:
        names, given = _names(models), list(models)
    frictions = [friction_of(model) for model in given]
    groups = groups_of(equal, joint_names(frictions[0], names[0])) if equal and given else ()
    return Pooled(pooled(frictions, names, groups))


def _names(models: Sequence[Any]) -> list[str]:
    """Names of files as they were given, and of others by their place."""
    return [
        str(model) if isinstance(model, str | Path) else f"model {k + 1}"
        for k, model in enumerate(models)
    ]
