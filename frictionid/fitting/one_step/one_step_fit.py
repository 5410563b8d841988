"""One-step fits: what an identifier makes of a problem, checked, with its errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.one_step.grams import clusters
from frictionid.fitting.one_step.linearised import Linearised
from frictionid.fitting.one_step.residual import Problem
from frictionid.fitting.one_step.row_weights import huber_factors, normalised
from frictionid.friction import Friction


def half_widths(
    friction: Friction,
    problem: Problem,
    weights: Array,
    level: float = 0.95,
    robust: float | None = None,
) -> Array:
    """Half the widths (n, P) of confidence intervals of the parameters of a fit, weights (K,).

    Of noise alone: errors that all recordings share, as the bias of smoothed states, are not in it,
    and where they are as large, such an interval holds the truth less often than its level says.
    See `standard_errors`.

    robust : clip of the fit's Huber weights [standard deviations], as `LeastSquares.robust`, or
        None for a fit without them

    By the sandwich covariance H^-1 (sum_c s_c s_c') H^-1, with H = J'WJ and the score s_c = J'We of
    each cluster c of rows: a recording, or where these are few, a stretch of one; with a t
    distribution. NaN where the data do not determine a parameter, and for terms that a sparse law
    does not have.

    >>> from frictionid.fitting.identifiers.least_squares import LeastSquares
    >>> from frictionid.fitting.identifiers.synthetic_problem import synthetic_problem
    >>> from frictionid.friction.laws import Stribeck
    >>> problem = synthetic_problem(1)
    >>> weights = np.ones((1, len(problem.r)))
    >>> fit = LeastSquares(Stribeck()).fit(problem, weights, 0)[0]
    >>> half_widths(fit, problem, weights[0]).round(4)  # truth: 0.10, 0.04, 1.5, 0.02
    array([[0.0024, 0.0027, 0.077 , 0.0005]])
    >>> fit.theta.round(4)
    array([[0.0989, 0.0415, 1.5209, 0.0202]])
    """
    error, freedom = _errors(friction, problem, weights, robust)
    return np.asarray(stdtrit(freedom, 0.5 + level / 2) * error)


def standard_errors(
    friction: Friction, problem: Problem, weights: Array, robust: float | None = None
) -> Array:
    """Standard errors (n, P) of the parameters of a fit, of noise alone, see `half_widths`."""
    return _errors(friction, problem, weights, robust)[0]


def _errors(
    friction: Friction, problem: Problem, weights: Array, robust: float | None
) -> tuple[Array, int]:
    """Standard errors (n, P), and their degrees of freedom."""
    covariance, freedom = covariance_of_fit(friction, problem, weights, robust)
    return np.sqrt(np.diag(covariance)).reshape(friction.theta.shape), freedom


def covariance_of_fit(
    friction: Friction, problem: Problem, weights: Array, robust: float | None = None
) -> tuple[Array, int]:
    """Covariance (n P, n P) of the parameters of a fit, of noise alone, and its degrees of freedom.

    See `half_widths`. NaN where the data do not determine a parameter; equal joints are correlated
    by one.
    """
    theta, own = np.reshape(friction.theta, (1, -1)), friction.constraints
    # as it was fitted, see `Linearised.within`
    law = Linearised(friction.law.sharpened() if problem.masked else friction.law, problem)
    share = normalised(np.reshape(weights, (1, -1)), problem)[0]
    residual = law.residual(theta)
    if robust is not None:
        share = share * huber_factors(residual, share[None], robust)[0]
    tie, D = None if own is None else own.tie, theta.size
    H, scores = np.zeros((D, D)), np.empty((len(problem.r), D))
    for rows, part in law.stretches():
        J = part.jacobian(theta)[0].reshape(*part.problem.r.shape, D)
        weighted = J * share[rows, None, None]
        scores[rows] = np.einsum("kip,ki->kp", weighted, residual[0, rows])
        H += weighted.reshape(-1, D).T @ J.reshape(-1, D)
    if tie is not None:
        H, scores = tie.T @ H @ tie, scores @ tie
    determined = np.diag(H) > 0
    if friction.law.is_sparse:
        determined &= theta[0] != 0
    scores = scores[:, determined]
    bread = np.linalg.pinv(H[np.ix_(determined, determined)], hermitian=True)
    label = clusters(problem)
    used = np.unique(label[share > 0])
    by_cluster = np.zeros((int(label.max()) + 1, scores.shape[1]))
    for p, column in enumerate(scores.T):
        by_cluster[:, p] = np.bincount(label, column)
    by_cluster = by_cluster[used]
    freedom = max(len(used) - 1, 1)
    covariance = bread @ (by_cluster.T @ by_cluster) @ bread * len(used) / freedom
    out = np.full(2 * [len(determined)], np.nan)
    out[np.ix_(determined, determined)] = covariance
    if tie is not None:
        each = tie.argmax(axis=1)
        out = out[np.ix_(each, each)]
    return out, freedom


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
