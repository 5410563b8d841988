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
    free_run,
    free_run_rows,
    make_trajectory,
    powered,
    trajectory_folds,
)
from frictionid.evaluation.ground_truth import steady_state, true_calibration, true_friction
from frictionid.evaluation.one_step import held_out_residual, one_step_rows
from frictionid.evaluation.protocol import Protocol
from frictionid.evaluation.rollout_starts import (
    InitialStates,
    initial_state_folds,
    make_initial_states,
)
from frictionid.evaluation.rollouts import predict, rollout_rows
from frictionid.evaluation.score_rows import Row
from frictionid.evaluation.scoring import (
    Observed,
    Prepared,
    judge,
    judge_folds,
    prepare,
    prepared_for,
    speeds,
    training_of,
    under,
    with_calibration,
    without_physics,
)

__all__ = [
    "Folds",
    "Observed",
    "Prepared",
    "Protocol",
    "Row",
    "Split",
    "InitialStates",
    "trajectory_folds",
    "curve_error",
    "curve_rows",
    "curves",
    "prepared_for",
    "free_run",
    "free_run_rows",
    "held_out_residual",
    "judge",
    "judge_folds",
    "make_trajectory",
    "make_folds",
    "make_initial_states",
    "member_curves",
    "one_step_rows",
    "powered",
    "predict",
    "prepare",
    "rollout_rows",
    "speeds",
    "initial_state_folds",
    "steady_state",
    "training_of",
    "true_friction",
    "true_calibration",
    "under",
    "with_calibration",
    "without_physics",
    "velocity_grid",
]
