"""Torque left by models: a table of joints, and a sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from frictionid.evaluation.score_frame import SCORE_COLUMNS
from frictionid.evaluation.torque_left import torque_frame

from .numbers import NOTHING, fixed, short
from .sections import Model, SummaryData
from .tables import Column, Part, Table, by_columns

_WORDS = (
    "what a model leaves of the measured torque, over windows of 0.05 s in which the joint slides: "
    "per cent of its rms, and rms"
)


def torque_table(
    frames: Mapping[str, pd.DataFrame], joints: Sequence[str], title: str = ""
) -> Table | None:
    """Torque left in each joint by models, beside the measured one; None where none was measured.

    frames : by the models' names, see `frictionid.evaluation.torque_left.torque_frame`
    """
    frames = {name: frame for name, frame in frames.items() if len(frame)}
    if not frames:
        return None
    first = next(iter(frames.values()))
    named = {str(j + 1): name for j, name in enumerate(joints)}
    names = [named.get(j, j if j == "all" else f"joint {j}") for j in first["joint"]]
    measured = [
        f"{short(rms, 3)} {unit}" if rms > 0 else NOTHING
        for rms, unit in zip(first["measured_rms"], first["unit"], strict=True)
    ]
    parts: list[Part] = [(Column("joint", words=True), names), (Column("measured"), measured)]
    nominal = zip(first["nominal"], first["nominal_rms"], strict=True)
    parts.append((Column("no friction, nominal"), [_share(*pair) for pair in nominal]))
    for name, frame in frames.items():
        cells = [_share(*pair) for pair in zip(frame["left"], frame["left_rms"], strict=True)]
        parts.append((Column(name), cells))
    label = f"torque-{title}" if title else "torque"
    return by_columns(f"{title}: {_WORDS}." if title else f"Torque left: {_WORDS}.", label, parts)


def torque_sentence(frames: Mapping[str, pd.DataFrame]) -> str:
    """The shares together in one line; empty where no torque was measured."""
    shares = {name: frame["left"].iloc[-1] for name, frame in frames.items() if len(frame)}
    shares = {name: share for name, share in shares.items() if share >= 0}
    if not shares:
        return ""
    nominal = next(frame["nominal"].iloc[-1] for frame in frames.values() if len(frame))
    each = ", ".join(f"{name} {_percent(share)}" for name, share in shares.items())
    return f"torque left, of the measured rms: {each}; no friction, nominal {_percent(nominal)}"


def torque_frames(data: SummaryData) -> dict[str, pd.DataFrame]:
    """Torque left by the models of a comparison, by their names."""
    return {model.name: _frame(data, model) for model in data.models}


def torque_numbers(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """All of it in one frame, with the models' names as `model`."""
    each = [frame.assign(model=name) for name, frame in frames.items() if len(frame)]
    return pd.concat(each, ignore_index=True) if each else pd.DataFrame()


def score_torque_frames(scores: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Torque left by given models, of their scores in the columns of scores.csv."""
    return {
        str(name): torque_frame(rows[list(SCORE_COLUMNS)].itertuples(index=False))
        for name, rows in scores.groupby("identifier", sort=False)
    }


def _frame(data: SummaryData, model: Model) -> pd.DataFrame:
    """Torque left by a model of a comparison."""
    rows: list[tuple[Any, ...]] = []
    units = data.description.torque_units
    for column in data.level.columns[data.level.columns.str.startswith("torque_")]:
        head, _, joint = column.partition("_joint")
        score, _, statistic = head.rpartition("_")
        value = data.value(model, column)
        unit = units[int(joint) - 1] if joint else ""
        if np.isfinite(value):
            rows.append(("all", score, statistic, None, joint or "all", value, unit))
    return torque_frame(rows)


def _share(share: float, rms: float) -> str:
    size = f"({short(rms, 3)})" if rms >= 0 else ""
    return " ".join(filter(None, (_percent(share), size))) or NOTHING


def _percent(share: float) -> str:
    return f"{fixed(100 * share, 1)} %" if share >= 0 else ""
