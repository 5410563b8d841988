"""Judging friction: folds, one-step and rollout scores, curves, statistics."""

from frictionid.evaluation.curves import (
    curve_error,
    curve_rows,
    curves,
    member_curves,
    velocity_grid,
)
from frictionid.evaluation.folds import Folds, Split, make_folds
from frictionid.evaluation.free_run import (
    course_folds,
    free_run,
    free_run_rows,
    make_course,
    powered,
)
from frictionid.evaluation.ground_truth import steady_state, true_friction, true_rig
from frictionid.evaluation.one_step import held_out_residual, one_step_rows
from frictionid.evaluation.protocol import Protocol
from frictionid.evaluation.rollout_starts import Starts, make_starts, start_folds
from frictionid.evaluation.rollouts import predict, rollout_rows
from frictionid.evaluation.score_rows import Row
from frictionid.evaluation.scoring import (
    Observed,
    Prepared,
    faced,
    judge,
    judge_folds,
    prepare,
    speeds,
    training_of,
    under,
    with_rig,
    without_physics,
)

__all__ = [
    "Folds",
    "Observed",
    "Prepared",
    "Protocol",
    "Row",
    "Split",
    "Starts",
    "course_folds",
    "curve_error",
    "curve_rows",
    "curves",
    "faced",
    "free_run",
    "free_run_rows",
    "held_out_residual",
    "judge",
    "judge_folds",
    "make_course",
    "make_folds",
    "make_starts",
    "member_curves",
    "one_step_rows",
    "powered",
    "predict",
    "prepare",
    "rollout_rows",
    "speeds",
    "start_folds",
    "steady_state",
    "training_of",
    "true_friction",
    "true_rig",
    "under",
    "with_rig",
    "without_physics",
    "velocity_grid",
]
