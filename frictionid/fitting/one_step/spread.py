"""How well rows tell parameters, by what they say from one stretch of the recordings to the next.

The curvature of a sum of squares counts rows as independent. Their errors are not: neighbouring
states are smoothed together, and what a model does not explain lasts. So a parameter's variance is
that by the scatter between clusters of rows, the sandwich, and what a test by the sum of squares
shows is divided by the ratio of both [Ribatet2012].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.fitting.gauss_newton import Conditions
from frictionid.fitting.one_step.grams import clusters
from frictionid.fitting.one_step.linearised import Linearised

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
    H, scores = np.zeros((N, N)), np.zeros((int(label.max()) + 1, N))
    freedom = max(int((weights > 0).sum()) * residual.shape[1] - N, 1)
    variance = np.einsum("k,ki->", weights, residual**2) / freedom
    for rows, part in law.stretches():
        J = part.jacobian(theta[None])[0].reshape(*part.problem.r.shape, -1)
        J = J if law.tie is None else J @ law.tie
        weighted = J * weights[rows, None, None]
        H += weighted.reshape(-1, N).T @ J.reshape(-1, N)
        each = np.einsum("kip,ki->kp", weighted, residual[rows])
        for p, column in enumerate(each.T):
            scores[:, p] += np.bincount(label[rows], column, minlength=len(scores))
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
