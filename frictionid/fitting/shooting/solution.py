"""Where a fit by shooting ended, and what its windows say of the parameters."""

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array

from ..covariance import grouped_covariance
from ..fit import Covariance
from ..parameters.parameter_block import Estimate, values_of
from ..sandwich import Groups, clusters_of
from .problem import ShootingProblem
from .windows import NormalEquations


class Solution(NamedTuple):
    """Where a fit to a problem ended.

    estimate; nodes (K, s); windows (W, N); residual (W, N + 1, n) [rad] after the last step, share
    (W, N + 1) and weight of each; sigma (n,) [rad]; normal equations of the windows before the last
    step, as much as each counts, and that step, move (D,); free (D,), parameters that are not at a
    bound; counts (W,), how much windows count; kinked (W,), true for those that were left out as
    their predictions jump; converged, and the number of iterations.
    """

    problem: ShootingProblem
    estimate: Estimate
    nodes: Array
    windows: Array
    residual: Array
    share: Array
    weight: Array
    sigma: Array
    normal: NormalEquations
    move: Array
    free: Array
    counts: Array
    kinked: Array
    converged: bool = False
    iterations: int = 0

    @property
    def values(self) -> Array:
        """Values (D,) of the free parameters."""
        return values_of(self.estimate, self.problem.blocks)

    @property
    def closed(self) -> Array:
        """True (W,) for windows that counted."""
        return self.counts > 0

    @property
    def curvature(self) -> Array:
        """Normal matrix (D, D) of the windows that counted, without priors."""
        return self.normal.H[self.closed].sum(axis=0)

    @property
    def groups(self) -> Groups:
        """The windows that count; of few recordings, stretches of time are clusters."""
        recording = self.problem.intervals.recording[self.windows[:, 0]]
        on, H, g = self.closed, self.normal.H, self.normal.g
        cluster = clusters_of(H[on], recording[on], np.arange(len(H))[on])
        return Groups(H[on], g[on], self.move, self.free, recording[on], cluster)

    def covariance(self, model_error: Array | float = 0.0) -> Covariance:
        """Covariance of the parameters, from what each recording alone would change in them.

        The sandwich estimate with the leverage of each recording taken into account: parameters are
        solved for with every recording left out in turn, to first order [BellMcCaffrey2002]; so
        noise, the model's errors, and what differs between recordings all count. Fewer than four
        recordings are divided into 24 stretches of time; of three recordings the larger of both
        errors counts.

        model_error : covariance (D, D) of errors that all recordings share, see `omitted_blocks`
        """
        parameters, friction = self.problem.parameters, self.estimate.friction
        return grouped_covariance(parameters, self.values, friction, self.groups, model_error)
