"""Judging friction: folds, one-step and rollout scores, curves, statistics."""

from frictionid.evaluation.curves import curve_error, curve_rows, curves, velocity_grid
from frictionid.evaluation.folds import Folds, Split, make_folds
from frictionid.evaluation.judge import (
    Prepared,
    Protocol,
    examples,
    judge,
    judge_folds,
    prepare,
)
from frictionid.evaluation.one_step import held_out_residual, one_step_rows
from frictionid.evaluation.rollouts import (
    Starts,
    make_starts,
    predict,
    rollout_rows,
    start_folds,
)
from frictionid.evaluation.rows import Row
from frictionid.evaluation.truth import steady_state, true_friction

__all__ = [
    "Folds",
    "Prepared",
    "Protocol",
    "Row",
    "Split",
    "Starts",
    "curve_error",
    "curve_rows",
    "curves",
    "examples",
    "held_out_residual",
    "judge",
    "judge_folds",
    "make_folds",
    "make_starts",
    "one_step_rows",
    "predict",
    "prepare",
    "rollout_rows",
    "start_folds",
    "steady_state",
    "true_friction",
    "velocity_grid",
]
