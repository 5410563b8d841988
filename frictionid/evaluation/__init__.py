"""Evaluation of friction models: folds, one-step and rollout scores, curves, statistics."""

from .curves import (
    curve_error,
    curve_scores,
    steady_state,
    true_calibration,
    true_friction,
    velocity_grid,
)
from .folds import Folds, Split, make_folds
from .free_run import (
    free_run,
    free_run_scores,
    make_trajectory,
    trajectory_folds,
    with_motor_torque,
)
from .initial_states import initial_state_folds, make_initial_states
from .predicted_motion import HorizonErrors, predict, rollout_scores
from .prepared import (
    CalibratedView,
    EstimatedStates,
    Prepared,
    Protocol,
    calibrated_views,
    prepare,
    prepared_for,
    protocol_for,
    screened,
    speeds,
    training_of,
    with_calibration,
    with_parameters,
    with_speeds,
    without_physics,
)
from .score_frame import SCORE_COLUMNS, score_frame, score_value
from .scoring import one_step_scores, score_folds, score_model
from .torque_left import nominal_torque_scores, torque_example, torque_frame, torque_left
