"""The effective number of parameters of a fit by any recipe, as a score."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.evaluation.complexity import effective_parameters
from frictionid.evaluation.score_frame import Score
from frictionid.fitting.method import Fit
from frictionid.fitting.one_step.one_step_fit import OneStepFit
from frictionid.fitting.parameters.parameter_block import Parameter
from frictionid.friction import Constraints


def complexity_score(fit: Fit) -> Score | None:
    """Effective number of parameters of the friction of all data; None of recipes of one's own.

    Of a fit with a covariance, by shooting or inverse dynamics, how many parameters, those of the
    machine and its sensors too, the data determine: at no bound, with a finite error.
    """
    friction = fit.friction[-1]
    if fit.refined is not None and not friction.law.is_network:
        covariance, own = fit.refined.covariance, fit.refined.fitted.constraints
        known = np.isfinite(covariance.error) & ~covariance.bound
        count = float(sum(known[k] for k in _once(covariance.parameters, own)))
    elif isinstance(fit, OneStepFit):
        count = effective_parameters(friction, fit.problem, fit.weights)
    elif friction.law.is_network:
        count = float(np.size(friction.theta))
    else:
        return None
    return Score("all", "effective_parameters", "count", value=count)


def _once(parameters: Sequence[Parameter], constraints: Constraints | None) -> list[int]:
    """Places of the parameters, those of equal joints once."""
    if constraints is None or not constraints.equal:
        return list(range(len(parameters)))
    owner = constraints.owner
    return [
        k
        for k, p in enumerate(parameters)
        if p.block != "friction" or owner[p.place[0]] == p.place[0]
    ]
