"""Confidence intervals of one-step fits, from the scatter between recordings."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.identifiers.grams import clusters
from frictionid.identifiers.linearised import Linearised
from frictionid.identifiers.residual import Problem
from frictionid.identifiers.row_weights import normalised


def half_widths(friction: Friction, problem: Problem, weights: Array, level: float = 0.95) -> Array:
    """Half the widths (n, P) of confidence intervals of the parameters of a fit, weights (K,).

    By the sandwich covariance H^-1 (sum_c s_c s_c') H^-1, with H = J'WJ and the score s_c = J'We of
    each cluster c of rows: a recording, or where these are few, a stretch of one; with a t
    distribution. NaN where the data do not determine a parameter, and for terms that a sparse law
    does not have. Errors that all recordings share, as those of smoothed states, are not in it.

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
    law, theta = Linearised(friction.law, problem), np.reshape(friction.theta, (1, -1))
    share = normalised(np.reshape(weights, (1, -1)), problem)[0]
    J = law.jacobian(theta)[0].reshape(*problem.r.shape, n * P)
    determined = J.reshape(-1, n * P).any(axis=0)
    if friction.law.is_sparse:
        determined &= theta[0] != 0
    J = J[..., determined]
    weighted = J * share[:, None, None]
    scores = np.einsum("kip,ki->kp", weighted, law.residual(theta)[0])
    bread = np.linalg.pinv(np.einsum("kip,kiq->pq", weighted, J), hermitian=True)
    label = clusters(problem)
    used = np.unique(label[share > 0])
    by_cluster = np.stack([scores[label == c].sum(0) for c in used])
    freedom = max(len(used) - 1, 1)
    covariance = bread @ (by_cluster.T @ by_cluster) @ bread * len(used) / freedom
    out = np.full(n * P, np.nan)
    out[determined] = stdtrit(freedom, 0.5 + level / 2) * np.sqrt(np.diag(covariance))
    return out.reshape(n, P)
