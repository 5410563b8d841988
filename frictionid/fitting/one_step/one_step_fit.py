"""One-step fits: what an identifier makes of a problem, checked, with its errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.fitting.fit import Covariance, Fit
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.one_step.grams import clusters
from frictionid.fitting.one_step.linearised import Linearised
from frictionid.fitting.one_step.residual import Problem, huber_factors, normalised
from frictionid.fitting.parameters.parameter_block import Parameter
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
    covariance, freedom = covariance_of_fit(friction, problem, weights, robust)
    half = stdtrit(freedom, 0.5 + level / 2) * np.sqrt(np.diag(covariance))
    return half.reshape(friction.theta.shape)


def covariance_of_fit(
    friction: Friction, problem: Problem, weights: Array, robust: float | None = None
) -> tuple[Array, int]:
    """Covariance (n P, n P) of the parameters of a fit, of noise alone, and its degrees of freedom.

    See `half_widths`. NaN where the data do not determine a parameter; equal joints are correlated
    by one.
    """
    theta, limits = np.reshape(friction.theta, (1, -1)), friction.constraints
    # as it was fitted, see `Linearised.within`
    law = Linearised(friction.law.sharpened() if problem.masked else friction.law, problem)
    share = normalised(np.reshape(weights, (1, -1)), problem)[0]
    residual = law.residual(theta)
    if robust is not None:
        share = share * huber_factors(residual, share[None], robust)[0]
    tie, D = None if limits is None else limits.tie, theta.size
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


def one_step_fit(
    friction: Friction, problem: Problem, weights: Array, *, intervals: bool = True
) -> Fit:
    """A fit of friction (F, n, P), of all data with weights (K,) last, with its covariance.

    intervals : whether they are wanted; equations of sparse laws need them always
    """
    last, law = friction[-1], friction.law
    fit = Fit(last, folds=friction, problem=problem, weights=weights)
    named = law.names and not (law.is_network or law.cannot_be_saved)
    if not (law.is_sparse or (intervals and named)):
        return fit
    matrix, freedom = covariance_of_fit(last, problem, weights)
    parameters = tuple(
        Parameter("friction", f"{name} of joint {j + 1}", last.units_at(j)[i], 0.0, place=(j, i))
        for j in range(last.n)
        for i, name in enumerate(law.names)
    )
    nowhere = np.zeros(len(parameters), dtype=bool)
    covariance = Covariance(
        *(parameters, np.ravel(last.theta), matrix, freedom), bound=nowhere, meaningless=nowhere
    )
    return replace(fit, covariance=covariance)


def checked_fit(identifier: Identifier, problem: Problem, weights: Array, seed: int) -> Friction:
    """Friction (F, n, P) that an identifier fits under weights (F, K), see `checked`."""
    return checked(identifier.fit(problem, weights, seed), identifier, problem, weights)


def checked(
    friction: Friction, identifier: Identifier, problem: Problem, weights: Array
) -> Friction:
    """The friction that an identifier gives.

    Raises
    ------
    InputError
        Where it is not finite, or not one for each row of the weights and each joint.
    """
    shape = np.shape(friction.theta)
    wanted = (len(weights), problem.r.shape[-1], len(friction.law.names))
    if shape != wanted:
        raise InputError(f"{identifier!r} gives theta of shape {shape}, it must be {wanted}")
    if not np.isfinite(friction.theta).all():
        raise InputError(f"{identifier!r}: the fit failed: its numbers are not finite")
    return friction
