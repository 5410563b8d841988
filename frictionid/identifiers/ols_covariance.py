"""How sure one-step fits are: intervals from the scatter between recordings."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.identifiers.grams import clusters
from frictionid.identifiers.linearised import Rows
from frictionid.identifiers.residual import Problem
from frictionid.identifiers.row_weights import relative


def half_widths(friction: Friction, problem: Problem, weights: Array, level: float = 0.95) -> Array:
    """Half the width (n, P) of an interval of each parameter of a fit under weights (K,).

    From what each recording (or stretch, where these are few) alone would change, with a t
    distribution. NaN where the data say nothing, and for terms that a sparse law does not have. It
    is the scatter of the fit alone: errors that all recordings share, as of smoothed states, stay.

    >>> from frictionid.identifiers.least_squares import LeastSquares
    >>> from frictionid.identifiers.synthetic_problem import synthetic_problem
    >>> from frictionid.friction.laws import Stribeck
    >>> problem = synthetic_problem(1)
    >>> weights = np.ones((1, len(problem.r)))
    >>> fit = LeastSquares(Stribeck()).fit(problem, weights, 0)[0]
    >>> half_widths(fit, problem, weights[0]).round(4)  # truth: 0.10, 0.04, 1.5, 0.02
    array([[0.0024, 0.0027, 0.077 , 0.0005]])
    >>> fit.theta.round(4)
    array([[0.0989, 0.0415, 1.5209, 0.0202]])
    """
    n, P = friction.theta.shape
    rows, theta = Rows(friction.law, problem), np.reshape(friction.theta, (1, -1))
    share = relative(np.reshape(weights, (1, -1)), problem)[0]
    J = rows.slopes(theta)[0].reshape(*problem.r.shape, n * P)
    known = J.reshape(-1, n * P).any(axis=0)
    if getattr(friction.law, "sparse", False):
        known &= theta[0] != 0
    out = np.full(n * P, np.nan)
    own = J[..., known] * share[:, None, None]
    scores = np.einsum("kip,ki->kp", own, rows.residual(theta)[0])
    H = np.einsum("kip,kiq->pq", own, J[..., known])
    label = clusters(problem)
    seen = np.unique(label[share > 0])
    parts = np.stack([scores[label == c].sum(0) for c in seen])
    inverse = np.linalg.pinv(H, hermitian=True)
    freedom = max(len(seen) - 1, 1)
    covariance = inverse @ (parts.T @ parts) @ inverse * len(seen) / freedom
    out[known] = stdtrit(freedom, 0.5 + level / 2) * np.sqrt(np.diag(covariance))
    return out.reshape(n, P)
