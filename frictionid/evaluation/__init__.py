"""Evaluation of friction models: folds, one-step and rollout scores, curves, statistics."""

from frictionid.evaluation.curves import (
    curve_error,
    curve_scores,
    curves,
    known_speeds,
    member_curves,
    velocity_grid,
    with_speeds,
)
from frictionid.evaluation.folds import Folds, Split, make_folds
from frictionid.evaluation.free_run import (
    free_run,
    free_run_scores,
    make_trajectory,
    trajectory_folds,
    with_motor_torque,
)
from frictionid.evaluation.ground_truth import steady_state, true_calibration, true_friction
from frictionid.evaluation.initial_states import (
    InitialStates,
    initial_state_folds,
    make_initial_states,
)
from frictionid.evaluation.one_step import held_out_residual, one_step_scores
from frictionid.evaluation.prepared import (
    CalibratedView,
    EstimatedStates,
    Prepared,
    calibrated_views,
    prepare,
    prepared_for,
    screened,
    speeds,
    training_of,
    with_calibration,
    with_parameters,
    without_physics,
)
from frictionid.evaluation.protocol import Protocol
from frictionid.evaluation.rollouts import predict, rollout_scores
from frictionid.evaluation.score_frame import SCORE_COLUMNS, score_frame, score_value
from frictionid.evaluation.scoring import Evaluation, beside_friction, score_folds, score_model

__all__ = [
    "SCORE_COLUMNS",
    "CalibratedView",
    "EstimatedStates",
    "Evaluation",
    "Folds",
    "InitialStates",
    "Prepared",
    "Protocol",
    "Split",
    "beside_friction",
    "calibrated_views",
    "curve_error",
    "curve_scores",
    "curves",
    "free_run",
    "free_run_scores",
    "held_out_residual",
    "initial_state_folds",
    "known_speeds",
    "make_folds",
    "make_initial_states",
    "make_trajectory",
    "member_curves",
    "one_step_scores",
    "predict",
    "prepare",
    "prepared_for",
    "rollout_scores",
    "score_folds",
    "score_frame",
    "score_model",
    "score_value",
    "screened",
    "speeds",
    "steady_state",
    "training_of",
    "trajectory_folds",
    "true_calibration",
    "true_friction",
    "velocity_grid",
    "with_calibration",
    "with_motor_torque",
    "with_parameters",
    "with_speeds",
    "without_physics",
]
