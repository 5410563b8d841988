"""frictionid.laws and frictionid.identifiers: what can be named, as frames."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from frictionid.comparison import kind_descriptions
from frictionid.comparison.kind_descriptions import KindDescription, described


def laws(name: str = "") -> pd.DataFrame:
    """The friction laws of model files, with equations, parameters and units; or all of one.

    Raises
    ------
    InputError
        For an unknown name.

    Examples
    --------
    >>> laws("coulomb_viscous").loc["viscous", "unit"]
    'N m s/rad'
    """
    return _frame(kind_descriptions.laws(), name)


def identifiers(name: str = "") -> pd.DataFrame:
    """What `fit` and `compare` can name, with parameters and settings; or all of one.

    Raises
    ------
    InputError
        For an unknown name.
    """
    return _frame(kind_descriptions.identifiers(), name)


def _frame(kinds: Sequence[KindDescription], name: str) -> pd.DataFrame:
    if name:
        kind = described(kinds, name)
        entries = [*(("parameter", e) for e in kind.parameters)]
        entries += [*(("setting", e) for e in kind.settings)]
        rows = [(e.name, part, e.unit, e.default, e.meaning) for part, e in entries]
        columns = ["name", "part", "unit", "default", "meaning"]
        return pd.DataFrame(rows, columns=columns).set_index("name")
    lines = [
        (
            kind.name,
            kind.summary,
            ", ".join(f"{p.name} [{p.unit}]" for p in kind.parameters),
            ", ".join(s.name for s in kind.settings),
        )
        for kind in kinds
    ]
    columns = ["name", "summary", "parameters", "settings"]
    return pd.DataFrame(lines, columns=columns).set_index("name")
