"""Covariance of a fit by shooting, from what each recording alone would change in it."""

import numpy as np

from frictionid.arrays import Array

from ..covariance import grouped_covariance
from ..fit import Covariance
from ..parameters.parameter_block import values_of
from ..sandwich import FEW, Groups
from .gauss_newton import Solution
from .problem import ShootingProblem

_STRETCHES = 24


def groups_of(problem: ShootingProblem, solution: Solution) -> Groups:
    """The windows that count in a solution; of few recordings, stretches of time are clusters."""
    recording = problem.intervals.recording[solution.windows[:, 0]]
    cluster, count = recording, len(recording)
    if len(np.unique(recording)) < FEW:
        cluster = np.arange(count) * min(_STRETCHES, count) // count
    on, normal = solution.closed, solution.normal
    return Groups(
        normal.H[on], normal.g[on], solution.move, solution.free, recording[on], cluster[on]
    )


def covariance_of(
    problem: ShootingProblem, solution: Solution, model_error: Array | float = 0.0
) -> Covariance:
    """Covariance of a fit, from what each recording alone would change in it.

    The sandwich estimate with the leverage of each recording taken into account: parameters are
    solved for with every recording left out in turn, to first order [BellMcCaffrey2002]; so noise,
    the model's errors, and what differs between recordings all count. Fewer than four recordings
    are divided into 24 stretches of time; of three recordings the larger of both errors counts.

    model_error : covariance (D, D) of errors that all recordings share, see `omitted_blocks`
    """
    values = values_of(solution.estimate, problem.blocks)
    groups = groups_of(problem, solution)
    return grouped_covariance(
        problem.parameters, values, solution.estimate.friction, groups, model_error
    )
