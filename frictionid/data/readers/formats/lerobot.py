"""Reader `lerobot`: Parquet files of LeRobot data sets, versions 2 and 3 [LeRobot].

`meta/info.json` names the elements of each feature, a column of vectors. An element is a column
`feature[name]`, or by its number `feature[0]`. Each episode of a file is a recording.
"""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from frictionid.config import Strict, checked, nearest
from frictionid.errors import InputError
from frictionid.files import read_bytes

from ..column_toml import ColumnNames
from ..table import Table, read_table

_EPISODE = "episode_index"
_ELEMENT = re.compile(r"(.+)\[(.+)\]")

Limits = Annotated[list[float], Field(min_length=2, max_length=2)]


class LerobotSettings(Strict):
    """Settings of the reader `lerobot`.

    range : of elements that are normalised: angles at -100 and at 100, in the unit of the angles
    episodes : numbers of those that are read, by default all
    """

    range: dict[str, Limits] = {}
    episodes: list[int] | None = None


def tables(
    content: bytes, file: str, settings: Mapping[str, Any], columns: ColumnNames
) -> dict[str, Table]:
    """Table of each episode in a file, by what the name of its recording has behind the file's."""
    chosen = checked(LerobotSettings, settings, f"{file}: [reader]")
    if not file.lower().endswith(".parquet"):
        raise InputError(f"{file} is no .parquet file; name data/*/*.parquet in the patterns")
    names = columns.names()
    places = _places(names, file)
    table = read_table(content, file, [*dict.fromkeys([*places.values(), _EPISODE])])
    picked = {name: table.columns[place] for name, place in places.items()}
    angles = {*columns.angle, *columns.covariates.values()}
    elements = [_element(name) for name in angles]
    for name, (low, high) in chosen.range.items():
        if name not in elements:
            raise InputError(
                f"{file}: [reader] range: no angle {name!r}; {nearest(name, elements)}"
            )
        if low == high:
            raise InputError(f"{file}: [reader] range: {name!r} goes from {low:g} to {high:g}")
    for name in angles:
        low, high = chosen.range.get(_element(name), (-100.0, 100.0))
        picked[name] = low + (picked[name] + 100.0) * ((high - low) / 200.0)
    episode, whole = table.columns[_EPISODE], Table(file, table.rows, picked)
    if not np.isfinite(episode).all():
        raise InputError(f"{file}: {_EPISODE} has empty cells; convert the data set again")
    numbers = np.unique(episode)
    return {
        "" if len(numbers) == 1 else f"/episode_{number:.0f}": whole.taken(episode == number)
        for number in numbers
        if chosen.episodes is None or number in chosen.episodes
    }


def unstated(columns: ColumnNames) -> Iterator[tuple[str, str, str]]:
    """The unit of the angles, which no file says."""
    yield (
        "angle",
        ", ".join(columns.angle[:3]),
        'LeRobot records "deg", "rad", or -100 to 100 of a calibrated range, whose limits then '
        "stand in range in [reader]",
    )


def _element(name: str) -> str:
    """Name of an element within its feature, or the name itself."""
    match = _ELEMENT.fullmatch(name)
    return match[2] if match else name


def _places(names: list[str], file: str) -> dict[str, str]:
    """Columns of the Parquet file, as `feature[number]`, by the names they are asked by."""
    out, features = {}, None
    for name in names:
        match = _ELEMENT.fullmatch(name)
        if match is None or match[2].isdecimal():
            out[name] = name
            continue
        features = _features(file) if features is None else features
        if match[1] not in features:
            raise InputError(f"{file} has no feature {match[1]!r}; {nearest(match[1], features)}")
        elements = features[match[1]]
        if match[2] not in elements:
            raise InputError(
                f"{file}: {match[1]} has no {match[2]!r}; {nearest(match[2], elements)}"
            )
        out[name] = f"{match[1]}[{elements.index(match[2])}]"
    return out


def _features(file: str) -> dict[str, list[str]]:
    """Names of the elements of each feature, by the info.json of the data set."""
    info = next((p / "meta/info.json" for p in Path(file).parents if (p / "meta").is_dir()), None)
    if info is None:
        raise InputError(f"{file}: no folder above has meta/info.json; copy it, or use feature[0]")
    try:
        features = json.loads(read_bytes(info).decode("utf-8"))["features"]
        return {str(name): _names(feature) for name, feature in features.items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(f"{info} does not describe features; copy it again") from None


def _names(feature: Mapping[str, Any]) -> list[str]:
    """Names of a feature's elements, none where they are fewer than its elements."""
    names = _listed(feature.get("names"))
    return names if [len(names)] == feature.get("shape") else []


def _listed(names: object) -> list[str]:
    """Names as version 3 has them, a list, or as version 2 may, lists by kind ("motors")."""
    if isinstance(names, dict):
        return [name for part in names.values() for name in _listed(part)]
    return [str(name) for name in names] if isinstance(names, list) else []
