"""The score frame: one table of scores from the evaluation to the report, and its statistics.

Columns of a score frame (`SCORE_COLUMNS`), one line for each score of one friction model:

fold       "0", "1", ... for the scores of one fold, "all" for those pooled over the folds
score      what is measured: "one_step_integral", "rollout_angle", "curve_error", ...
statistic  how the errors are summarised: "mean", "rms", "median", "q90", "diverged", ...
horizon_s  [s] ahead, NaN for scores without a horizon
joint      "1", "2", ..., or "all" for the norm over the joints
value      the score, infinite or NaN where a prediction is not finite
unit       of the value

Where some joints turn and others slide, errors in the norm over the joints count in units of their
joint's size (`frictionid.data.joint_scales`): the norm has the unit "1", or "1/s" of velocities.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.data.joint_scales import norm_of
from frictionid.errors import InputError


class Score(NamedTuple):
    """One line of a score frame; without statistic and value, what a summary of errors fills in."""

    fold: str
    score: str
    statistic: str = ""
    horizon_s: float | None = None
    joint: str = "all"
    value: float = float("nan")
    unit: str = "1"


SCORE_COLUMNS = Score._fields


def score_frame(scores: Iterable[Sequence[Any]]) -> pd.DataFrame:
    """Score frame of scores, or of the lines of a result file.

    >>> score_frame([["0", "rollout_angle", "q90", 0.5, "all", "inf", "rad"]]).value.tolist()
    [inf]
    >>> score_frame([["0", "curve_error", "rms", None, "1", None, "1"]]).value.tolist()
    [nan]
    """
    frame = pd.DataFrame(list(scores), columns=list(SCORE_COLUMNS))
    return frame.astype({"horizon_s": float, "value": float})


def with_scores(frame: pd.DataFrame, scores: Iterable[Score]) -> pd.DataFrame:
    """A score frame with further scores below its own."""
    return score_frame([*frame.itertuples(index=False), *scores])


def score_value(
    frame: pd.DataFrame,
    score: str,
    statistic: str,
    horizon: float | None = None,
    joint: str = "all",
    fold: str = "all",
) -> float:
    """One value of a score frame.

    Examples
    --------
    >>> frame = score_frame([["all", "rollout_angle", "median", 0.5, "all", 0.02, "rad"]])
    >>> score_value(frame, "rollout_angle", "median", 0.5)
    0.02
    """
    at = frame.horizon_s.isna() if horizon is None else frame.horizon_s == horizon
    names = {"fold": fold, "score": score, "statistic": statistic, "joint": joint}
    for column, name in names.items():
        at &= frame[column] == name
    if not at.any():
        raise InputError(f"no score {score!r}, {statistic!r} at {horizon} s for joint {joint}")
    return float(frame.value[at].iloc[0])


def parts_of(
    error: Array, fold: Array, score: Score, units: Sequence[str], sizes: Array
) -> Iterator[tuple[Array, Score]]:
    """Sizes of errors (..., K, n) that are summarised together, each with what it is a score of.

    Those of each fold (K,), all of them, and those of each joint; over the joints their norm, see
    `norm_of`, which `units` and `sizes` (n,) are for.
    """
    norm, unit = norm_of(error, units, sizes)
    score = score._replace(unit=unit)
    for f in np.unique(fold):
        yield norm[..., fold == f], score._replace(fold=str(f))
    yield norm, score
    for j, joint_unit in enumerate(units):
        yield np.abs(error[..., j]), score._replace(joint=str(j + 1), unit=joint_unit)


def summarise_rollouts(errors: Array, score: Score, limit: float) -> Iterator[Score]:
    """Median, 90 % quantile and diverged share of rollout errors (N,), in the unit of the score.

    Diverged predictions stay in the quantiles, at infinity when they are not finite; errors beyond
    the `limit` count as diverged.

    >>> of = Score("0", "rollout_angle", horizon_s=1.0, unit="rad")
    >>> [s.value for s in summarise_rollouts(np.array([0.1, 0.2, np.nan]), of, 1.0)]
    [0.2, inf, 0.3333333333333333]
    """
    errors = np.where(np.isfinite(errors), errors, np.inf)
    for name, level in (("median", 0.5), ("q90", 0.9)):
        yield score._replace(statistic=name, value=_quantile(errors, level))
    yield score._replace(statistic="diverged", value=float(np.mean(errors > limit)), unit="1")


def _quantile(values: Array, level: float) -> float:
    """Quantile between the two nearest of the values, some of them infinite (NumPy's turns NaN)."""
    ordered = np.sort(values)
    at = round(level * (len(ordered) - 1), 9)
    low, part = int(at), at - int(at)
    if part == 0.0:
        return float(ordered[low])
    return float((1.0 - part) * ordered[low] + part * ordered[low + 1])


def score_tables(scores: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Scores of each (task, fold), and of each task: means over folds one step ahead, else pooled.

    Columns are named by score, statistic, horizon and joint; `scores` has the column `task`, too.
    """
    scores = scores.assign(column=_columns(scores))
    pooled = scores["fold"] == "all"
    level = scores[pooled].pivot(index="task", columns="column", values="value")
    folds = scores[~pooled].astype({"fold": int})
    folds = folds.pivot(index=["task", "fold"], columns="column", values="value")
    means = over_folds(folds, "mean")
    steps = means.filter(like="one_step")
    return folds, steps.combine_first(level)  # a single fold leaves what is pooled


def over_folds(folds: pd.DataFrame, statistic: str) -> pd.DataFrame:
    """The "mean" or "std" over the folds of each task's scores; NaN with a single fold."""

    def reduced(values: pd.Series) -> float:
        scores = values.to_numpy()
        if len(scores) < 2 or (statistic == "std" and not np.isfinite(scores).all()):
            return float("nan")
        return float(scores.mean() if statistic == "mean" else scores.std(ddof=1))

    return folds.groupby("task").agg(reduced)


def _columns(scores: pd.DataFrame) -> pd.Series:
    """Name of the column of each score: score, statistic, horizon and joint."""
    names: pd.Series[str] = scores["score"] + "_" + scores["statistic"]
    names = names.replace({"curve_error_rms": "curve_error", "n_parameters_count": "n_parameters"})
    horizon = scores["horizon_s"].map(lambda h: "" if np.isnan(h) else f"_{h:g}s")
    joint = scores["joint"].astype(str)
    return names + horizon + joint.where(joint == "all", "_joint" + joint).replace("all", "")
