"""One-step fits: what an identifier makes of a problem, checked, with its errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.one_step.covariance import half_widths, standard_errors
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction import Friction


class ErrorBars(NamedTuple):
    """What stands behind each parameter (n, P) of a fit, and what it is."""

    size: Array
    meaning: str


@dataclass(frozen=True, eq=False)
class OneStepFit:
    """Friction (F, n, P) of F folds, the last one all data, fitted to a problem.

    weights : (K,), those of all data
    """

    friction: Friction
    problem: Problem
    weights: Array
    refined: ClassVar[None] = None

    def half_widths(self) -> Array:
        """Half the width (n, P) of 95 % intervals of the noise alone, without bias of smoothing."""
        return half_widths(self.friction[-1], self.problem, self.weights)

    def error_bars(self) -> ErrorBars:
        """Standard errors of the friction of all data, without what smoothing gets wrong."""
        size = standard_errors(self.friction[-1], self.problem, self.weights)
        return ErrorBars(
            size, "standard errors of the noise alone, bias of the smoothing not included"
        )


def checked_fit(identifier: Identifier, problem: Problem, weights: Array, seed: int) -> Friction:
    """Friction (F, n, P) that an identifier fits under weights (F, K).

    Raises
    ------
    InputError
        Where it is not finite, or not one for each row of the weights and each joint.
    """
    friction = identifier.fit(problem, weights, seed)
    shape = np.shape(friction.theta)
    wanted = (len(weights), problem.r.shape[-1], len(friction.law.names))
    if shape != wanted:
        raise InputError(f"{identifier!r} gives theta of shape {shape}, it must be {wanted}")
    if not np.isfinite(friction.theta).all():
        raise InputError(f"{identifier!r}: the fit failed: its numbers are not finite")
    return friction
