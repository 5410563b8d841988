"""The summary tables: every model's scores on one data set."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from frictionid.evaluation.score_frame import SCORE_COLUMNS, over_folds
from frictionid.evaluation.torque_left import torque_frame

from .numbers import NOTHING, decimals, divergence_limit, fixed, percent, seconds, short
from .sections import EULER, INTEGRAL, RIVALS, Model, SummaryData, rollout
from .tables import Cell, Column, Part, Table, by_columns, line, table_of

ONE_STEP = {EULER: "euler mean", INTEGRAL: "integral rms"}
DETAILS = FULL, MEDIANS, LAST, BRIEF = "full", "medians", "last", "brief"  # ever narrower
TRUE_START = "rollout_true_start"


class Summary(NamedTuple):
    """Numbers of a summary table, one line for each model; see `summary_numbers`."""

    frame: pd.DataFrame
    dataset: str
    horizons: tuple[float, ...]
    joints: tuple[str, ...]  # with known true curves, else none
    unit: str


def summary_of(data: SummaryData, failed: Mapping[Model, Sequence[str]] | None = None) -> Summary:
    """Numbers of all models on one data set.

    failed : names of the physical checks that models fail, see `Verdict.failed`
    """
    columns = {"identifier": "label", "recipe": "recipe", "role": "role"}
    names = {key: [getattr(m, name) for m in data.models] for key, name in columns.items()}
    tasks, joints = [m.task for m in data.models], data.description.true_joints
    frame = pd.DataFrame(names, index=tasks).join(
        summary_numbers(data.level, data.folds, data.horizons, joints)
    )
    if failed:
        frame["implausible"] = ["; ".join(failed.get(model, ())) for model in data.models]
    unit = data.description.angle_unit
    return Summary(frame.reset_index(drop=True), data.dataset, data.horizons, joints, unit)


def summary_numbers(
    level: pd.DataFrame, folds: pd.DataFrame, horizons: Sequence[float], joints: Sequence[str]
) -> pd.DataFrame:
    """Numbers of each line: mean and deviation over folds one step ahead, all else pooled.

    The curve error is that of the friction fitted to all data; beside it stand mean and deviation
    over the folds. Where nothing was fitted to the data deviations are NaN.
    """
    curves = [f"curve_error_joint{joint}" for joint in joints]
    names = [rollout(h, s) for h in horizons for s in ("median", "q90", "diverged")]
    names += [rollout(h, s, TRUE_START) for h in horizons for s in ("median", "q90")]
    level = level.reindex(columns=[*ONE_STEP, *names, "free_run_mean", *curves, "n_parameters"])
    mean, sd = (over_folds(folds, statistic) for statistic in ("mean", "std"))
    mean = mean.reindex(level.index, columns=curves).fillna(level[curves]).add_suffix("_folds")
    return level.join([mean, sd.reindex(columns=[*ONE_STEP, *curves]).add_suffix("_sd")])


def summary_table(
    summary: Summary, caption: str, *, detail: str = FULL, recipes: bool = True, sd: bool = True
) -> Table:
    """The summary table.

    detail : how much is shown: all, the rollouts' medians, those of the last horizons, hardly more
    recipes : whether they have a column, else they head blocks of lines
    sd : whether the deviation over folds stands beside the one-step scores
    """
    frame = summary.frame
    parts: list[Part] = [(Column("identifier", words=True), frame["identifier"])]
    if recipes and (frame["recipe"] != "").any():
        parts.append((Column("recipe", words=True), frame["recipe"].replace("", NOTHING)))
    for name in list(ONE_STEP)[: 1 if detail == BRIEF else 2]:
        parts.append(_one_step(summary, name, sd, detail == BRIEF))
    shown = summary.horizons[-2:] if detail in (LAST, BRIEF) else summary.horizons
    parts += [_rollout(summary, h, full=detail == FULL or h == shown[-1]) for h in shown]
    parts += [_rollout(summary, h, TRUE_START) for h in _true_starts(summary)]
    if frame["free_run_mean"].notna().any():
        column, places = Column("mean", "free run", summary.unit), decimals(frame["free_run_mean"])
        parts.append(_with_best(summary, column, "free_run_mean", places))
    parts += _curves(summary)
    if detail != BRIEF:
        parts.append((Column("parameters"), [fixed(v, 0) for v in frame["n_parameters"]]))
    if "implausible" in frame:
        parts.append((Column("implausible", words=True), frame["implausible"].replace("", NOTHING)))
    columns, cells = zip(*parts, strict=True)
    several = len(set(frame["recipe"]) - {""}) > 1
    blocks = zip(zip(*cells, strict=True), frame["role"], frame["recipe"], strict=True)
    lines = [
        line(row, f"{role} {recipe}", f"{recipe} recipe" if several and recipe else "")
        for row, role, recipe in blocks
    ]
    return table_of(columns, lines, caption, f"summary-{summary.dataset}")


def caption_of(data: SummaryData, summary: Summary) -> str:
    """Caption of a summary table."""
    parts = [f"{data.dataset}: fitted on {data.fitted_on}, never seen"]
    if data.held_out:
        parts = [f"{data.dataset}: held-out scores", "one step: mean ± sd over the folds"]
    shares = [rollout(h, "diverged") for h in summary.horizons]
    limit = divergence_limit(summary.unit)
    if (summary.frame[shares] > 0).any(axis=None):
        parts.append(f"rollouts: median (90 % quantile, share further off than {limit})")
    elif shares:
        parts.append(f"rollouts: median (90 % quantile), none further off than {limit}")
    if _true_starts(summary):
        parts.append("from true states: against the true angles, with the memory of the motion")
    if summary.frame["free_run_mean"].notna().any():
        parts.append("free run: mean error over whole recordings, simulated from their start")
    if "implausible" in summary.frame:
        parts.append("implausible: physical checks that a model fails")
    return f"{'; '.join(parts)}. Best model in bold."


def _one_step(summary: Summary, name: str, deviations: bool, brief: bool) -> Part:
    values, sd = summary.frame[name], summary.frame[f"{name}_sd"]
    places = decimals(values, 3)
    details = [
        f" ± {fixed(d, places)}" if deviations and np.isfinite(v) and np.isfinite(d) else ""
        for v, d in zip(values, sd, strict=True)
    ]
    heading = ONE_STEP[name].partition(" ")[0] if brief else ONE_STEP[name]
    column = Column(heading, "one step", f"{summary.unit}/s")
    return _with_best(summary, column, name, places, details)


def _rollout(
    summary: Summary, horizon: float, score: str = "rollout_angle", *, full: bool = True
) -> Part:
    names = [rollout(horizon, s, score) for s in ("median", "q90")]
    median, q90 = (summary.frame[name] for name in names)
    true_start = score == TRUE_START
    diverged = 0.0 * median if true_start else summary.frame[rollout(horizon, "diverged")]
    shares = (diverged > 0).any()
    details = [
        f" ({short(q)}{f', {percent(d)}' if shares else ''})" if full and not np.isnan(m) else ""
        for m, q, d in zip(median, q90, diverged, strict=True)
    ]
    group = "from true states" if true_start else "rollout"
    column = Column(seconds(horizon), group, summary.unit, ", median (90 %)")
    return _with_best(summary, column, names[0], decimals(median), details)


def _true_starts(summary: Summary) -> list[float]:
    """Horizons of the predictions from true states that are shown: the last, where it has any."""
    last = summary.horizons[-1:]
    return [h for h in last if summary.frame[rollout(h, "median", TRUE_START)].notna().any()]


def _curves(summary: Summary) -> list[Part]:
    names = {f"joint {joint}": f"curve_error_joint{joint}" for joint in summary.joints}
    shares = 100 * summary.frame[list(names.values())]
    # the truth's own error is its smoothing only
    places = min(decimals(shares.where(shares > 0.01).to_numpy().ravel()), 1)
    return [
        _with_best(summary, Column(joint, "curve error", "%"), name, places, scale=100)
        for joint, name in names.items()
    ]


def _with_best(
    summary: Summary,
    column: Column,
    name: str,
    places: int,
    details: Sequence[str] = (),
    scale: float = 1,
) -> Part:
    """Scores with so many decimals and their details; the best and all that look like it bold."""
    scores = summary.frame[name]
    texts = [fixed(scale * value, places) for value in scores]
    finite = scores[summary.frame["role"].isin(RIVALS) & np.isfinite(scores)]
    best = texts[int(finite.idxmin())] if len(finite) > 1 else None
    return column, [
        Cell(text + detail, i in finite.index and text == best)
        for i, (text, detail) in enumerate(zip(texts, details or len(texts) * [""], strict=True))
    ]


# --- Torque left ----------------------------------------------------------------------------------


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
    caption = f"{title or 'Torque left'}: {_WORDS}{_noise(first)}."
    return by_columns(caption, label, parts)


def torque_sentence(frames: Mapping[str, pd.DataFrame]) -> str:
    """The shares together in one line; empty where no torque was measured."""
    shares = {name: frame["left"].iloc[-1] for name, frame in frames.items() if len(frame)}
    shares = {name: share for name, share in shares.items() if share >= 0}
    if not shares:
        return ""
    first = next(frame for frame in frames.values() if len(frame))
    nominal = _percent(first["nominal"].iloc[-1])
    each = ", ".join(f"{name} {_percent(share)}" for name, share in shares.items())
    return (
        f"torque left, of the measured rms: {each}; no friction, nominal {nominal}{_noise(first)}"
    )


def _noise(frame: pd.DataFrame) -> str:
    """What noise leaves of the torque, where that is known."""
    share = frame["noise"].iloc[-1]
    return f"; noise of the angles alone leaves up to {_percent(share)}" if share > 0 else ""


def torque_frames(data: SummaryData) -> dict[str, pd.DataFrame]:
    """Torque left by the models of a comparison, by their names."""
    names = {model.task: model.name for model in data.models}
    frames = score_torque_frames(data.scores.assign(identifier=data.scores["task"].map(names)))
    return {model.name: frames[model.name] for model in data.models}


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


def _share(share: float, rms: float) -> str:
    size = f"({short(rms, 3)})" if rms >= 0 else ""
    return " ".join(filter(None, (_percent(share), size))) or NOTHING


def _percent(share: float) -> str:
    return f"{fixed(100 * share, 1)} %" if share >= 0 else ""
