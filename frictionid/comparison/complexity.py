"""The effective number of parameters of a fit by any recipe, as a score."""

from __future__ import annotations

import numpy as np

from frictionid.comparison.methods import Fit
from frictionid.evaluation.complexity import effective_parameters
from frictionid.evaluation.score_frame import Score
from frictionid.identifiers.one_step_fit import OneStepFit


def complexity_score(fit: Fit) -> Score | None:
    """Effective number of parameters of the friction of all data; None of recipes of one's own.

    Of a fit with a covariance, by shooting or inverse dynamics, how many parameters, those of the
    machine and its sensors too, the data determine: at no bound, with a finite error.
    """
    friction = fit.friction[-1]
    if fit.refined is not None and not friction.law.is_network:
        covariance = fit.refined.covariance
        count = float(np.sum(np.isfinite(covariance.error) & ~covariance.bound))
    elif isinstance(fit, OneStepFit):
        count = effective_parameters(friction, fit.problem, fit.weights)
    elif friction.law.is_network:
        count = float(np.size(friction.theta))
    else:
        return None
    return Score("all", "effective_parameters", "count", value=count)
