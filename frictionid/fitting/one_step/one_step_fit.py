"""One-step fits: what an identifier makes of a problem, checked, with its errors.

The curvature of a sum of squares counts rows as independent. Their errors are not: neighbouring
states are smoothed together, and what a model does not explain lasts. So a parameter's variance is
that by the scatter between clusters of rows, the sandwich, and what a test by the sum of squares
shows is divided by the ratio of both [Ribatet2012].
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction, present

from ..fit import Covariance, Fit
from ..gauss_newton import Conditions
from ..identifier import Identifier
from ..parameter_block import Parameter
from .linearised import Linearised, clusters
from .residual import Problem, normalised


def covariance_of_fit(friction: Friction, problem: Problem, weights: Array) -> tuple[Array, int]:
    """Covariance (n P, n P) of the parameters of a fit, of noise alone, and its degrees of freedom.

    By the sandwich H^-1 (sum_c s_c s_c') H^-1, with H = J'WJ, and the score s_c = J'We of
    each cluster c of rows: a recording, or where these are few, a stretch of one. What all
    recordings share, as the bias of smoothed states, is not in it. NaN where the data do not
    determine a parameter, and for terms that a sparse law does not have; equal joints are
    correlated by one.

    >>> from frictionid.fitting.identifiers import LeastSquares
    >>> from frictionid.fitting.identifiers.check_identifier import synthetic_problem
    >>> from frictionid.friction.laws import Stribeck
    >>> problem = synthetic_problem(1)
    >>> weights = np.ones((1, len(problem.r)))
    >>> fit = LeastSquares(Stribeck()).fit(problem, weights, 0)[0]
    >>> covariance, freedom = covariance_of_fit(fit, problem, weights[0])
    >>> np.sqrt(covariance.diagonal()).round(4), freedom
    (array([0.0012, 0.0013, 0.0369, 0.0002]), 20)
    >>> fit.theta.round(4)  # truth: 0.10, 0.04, 1.5, 0.02
    array([[0.0989, 0.0415, 1.5209, 0.0202]])
    """
    law, limits = problem.fitted_form(friction.law), friction.constraints
    linear = Linearised(law, problem, tie=None if limits is None else limits.tie)
    theta = linear.once(np.asarray(friction.theta)[None])
    share, label = normalised(np.reshape(weights, (1, -1)), problem)[0], clusters(problem)
    H, scores = _summed(linear, label, theta[0], linear.residual(theta)[0], share)
    determined = np.diag(H) > 0
    determined &= linear.once(
        np.broadcast_to(present(law, friction.theta), friction.theta.shape)[None]
    )[0]
    keep, used = np.flatnonzero(determined), np.unique(label[share > 0])
    bread = np.linalg.pinv(H[np.ix_(keep, keep)], hermitian=True)
    moves, freedom = scores[np.ix_(used, keep)] @ bread, max(len(used) - 1, 1)
    out = np.full(H.shape, np.nan)
    out[np.ix_(keep, keep)] = moves.T @ moves * len(used) / freedom
    if linear.tie is not None:
        each = linear.tie.argmax(axis=1)
        out = out[np.ix_(each, each)]
    return out, freedom


def _summed(
    law: Linearised, label: Array, theta: Array, residual: Array, weights: Array
) -> tuple[Array, Array]:
    """J'WJ (N, N) at theta (N,), and the score J'We (C, N) of each cluster, labels (K,)."""
    N = len(theta)
    H, scores = np.zeros((N, N)), np.zeros((int(label.max()) + 1, N))
    for rows, part in law.stretches():
        J = part.jacobian(theta[None])[0].reshape(*part.problem.r.shape, -1)
        J = J if law.tie is None else J @ law.tie
        weighted = J * weights[rows, None, None]
        H += weighted.reshape(-1, N).T @ J.reshape(-1, N)
        each = np.einsum("kip,ki->kp", weighted, residual[rows])
        for p, column in enumerate(each.T):
            scores[:, p] += np.bincount(label[rows], column, minlength=len(scores))
    return H, scores


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


KNOWN = 0.5  # of its size, a standard error: a parameter that is known no better is not identified
_BLIND = 1e-13  # of the largest eigenvalue
CLEAR = 9.0  # deviance, adjusted: a fit that is worse by more is shown to be worse


class Spread(NamedTuple):
    """What rows tell of parameters.

    error : (F, N), standard errors by clusters of rows, infinite without a trace
    excess : (F, N), their variance over that by the curvature, at least 1
    variance : (F,) of the weighted residuals
    """

    error: Array
    excess: Array
    variance: Array

    def worst(self, theta: Array, neutral: Array, size: Array, among: Array) -> Array:
        """The parameter (F, N) of each fit that is known least, if one `among` some is not known.

        Its error exceeds half of its size, and its interval holds the neutral value.
        """
        off = np.abs(theta - neutral)
        unknown = among & (off > 0) & (self.error > np.maximum(KNOWN * size, off / 2.0))
        measure = np.where(unknown, self.error / np.where(np.isfinite(size), size, 1.0), -1.0)
        out = np.zeros_like(unknown)
        out[np.arange(len(out)), np.argmax(measure, axis=1)] = True
        return out & unknown

    def shown(
        self, law: Linearised, theta: Array, without: Array, under: Conditions, chosen: Array
    ) -> Array:
        """Whether (F,) fits without some chosen parameters (F, N) are clearly worse than with."""
        before, after = (law.cost(law.residual(x), under.weights) for x in (theta, without))
        most = np.where(chosen, self.excess, 1.0).max(axis=1)
        return after - before > CLEAR * most * self.variance


def spread_of(law: Linearised, theta: Array, residual: Array, under: Conditions) -> Spread:
    """What the rows tell of the parameters (F, N) at a minimum, with the residuals (F, K, n) there.

    Bounds count for nothing here: where two parameters do the same, one of them often ends at zero,
    and the other one is not known any better for that.
    """
    label = clusters(law.problem)
    free = under.low < under.high
    each = zip(theta, residual, under.weights, free, strict=True)
    return Spread(
        *(np.stack(x) for x in zip(*(_of_fold(law, label, *f) for f in each), strict=True))
    )


def _of_fold(
    law: Linearised, label: Array, theta: Array, residual: Array, weights: Array, free: Array
) -> tuple[Array, Array, Array]:
    """Errors (N,), ratios (N,) and variance of one fold."""
    N, used = len(theta), np.unique(label[weights > 0])
    freedom = max(int((weights > 0).sum()) * residual.shape[1] - N, 1)
    variance = np.einsum("k,ki->", weights, residual**2) / freedom
    H, scores = _summed(law, label, theta, residual, weights)
    trace = np.diag(H) > _BLIND * np.diag(H).max(initial=0.0)
    shown = free & trace
    error, excess = np.where(free | ~trace, np.inf, 0.0), np.ones(N)
    keep, count = np.flatnonzero(shown), max(len(used) - 1, 1)
    inverse = _inverse(H[np.ix_(keep, keep)])
    moves = scores[np.ix_(used, keep)] @ inverse
    by_rows = variance * np.diag(inverse)
    by_cluster = np.maximum((moves**2).sum(axis=0) * len(used) / count, by_rows)
    error[keep], excess[keep] = np.sqrt(by_cluster), by_cluster / np.maximum(by_rows, 1e-300)
    return error, excess, variance


def _inverse(H: Array) -> Array:
    size = np.sqrt(np.diag(H))
    value, vector = np.linalg.eigh(H / np.outer(size, size))
    # a combination without a trace is known no better than rounding
    value = np.maximum(value, _BLIND * value.max(initial=0.0))
    return (vector / value) @ vector.T / np.outer(size, size)
