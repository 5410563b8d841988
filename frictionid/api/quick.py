"""frictionid.quick: a first verdict in about a minute, which prints and draws itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import pandas as pd

from frictionid.api.models import DatasetLike, dataset_of
from frictionid.errors import InputError
from frictionid.quickstart import quick as first
from frictionid.quickstart.quick_picture import quick_figure
from frictionid.quickstart.quick_text import show_quick
from frictionid.report.console import printed, printed_html
from frictionid.report.figures.style import drawn


@dataclass(frozen=True, eq=False, repr=False)
class FirstVerdict(first.Quick):
    """A first verdict; see `frictionid.quickstart.quick.Quick` for its attributes."""

    def __repr__(self) -> str:
        return printed(partial(show_quick, self)).rstrip("\n")

    def _repr_html_(self) -> str:
        return printed_html(partial(show_quick, self))

    @property
    def frame(self) -> pd.DataFrame:
        """The laws on held-out motion: name, parameters, error [rad], standing."""
        rows = [
            (c.name, c.parameters, c.error, c.standing.standing if c.standing else "undecided")
            for c in self.candidates
        ]
        return pd.DataFrame(rows, columns=["name", "parameters", "error", "standing"])

    def plot(self) -> Any:
        """Friction by all laws and their errors, as a Matplotlib figure.

        Raises
        ------
        InputError
            Where the data are unusable.
        """
        if self.chosen is None:
            raise InputError("plot: the data are unusable, nothing was fitted")
        return drawn(partial(quick_figure, self))


def quick(data: DatasetLike, done: Callable[[str], None] | None = None) -> FirstVerdict:
    """Check a data set, compare three friction laws on held-out motion, and say which one holds.

    `done` is called with the name of each step that is finished.

    Raises
    ------
    InputError
        Where the recordings are too short to hold any motion out.
    """
    found = first.quick(dataset_of(data), done)
    return FirstVerdict(**{f.name: getattr(found, f.name) for f in fields(found)})
