"""Sandwich covariance: what each group of windows alone would change in the free parameters."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.fitting.shooting.gauss_newton import Solution
from frictionid.fitting.shooting.problem import ShootingProblem

_FEW = 4  # recordings: of fewer, stretches of time are the clusters
_SOME = 3  # recordings whose own scatter counts as well, where it is larger
_STRETCHES = 24
SINGULAR = 1e-9  # of the largest singular value of the scaled normal equations


def clusters_of(problem: ShootingProblem, solution: Solution) -> tuple[Array, Array]:
    """Recording (W,) and cluster (W,) of each window."""
    owner = problem.intervals.recording[solution.windows[:, 0]]
    if len(np.unique(owner)) >= _FEW:
        return owner, owner
    return owner, np.arange(len(owner)) * min(_STRETCHES, len(owner)) // len(owner)


def sandwich(H: Array, solution: Solution, owner: Array, clusters: Array) -> Array:
    """Covariance of the free parameters by clusters (W,); of three recordings (W,) the larger.

    Of G clusters, some tell much more of a parameter than others: `scatter` then expects too large
    a variance, which is divided by its excess, with fewer degrees of freedom than G - 1, so that
    it is enlarged until its 95 % interval by the t distribution with G - 1 is that with its own.
    """
    inner = scatter(H, solution, clusters)
    count = len(np.unique(clusters))
    if count > 1:
        excess, freedom = expected(H, solution, clusters)
        own = stdtrit(freedom, 0.975) / stdtrit(count - 1, 0.975) / np.sqrt(excess)
        inner = inner * np.outer(own, own)
    if _SOME <= len(np.unique(owner)) < _FEW:
        between = np.diag(scatter(H, solution, owner))
        wider = np.sqrt(np.maximum(1.0, between / np.maximum(np.diag(inner), 1e-300)))
        inner = inner * np.outer(wider, wider)
    return inner


def scatter(H: Array, solution: Solution, groups: Array) -> Array:
    """Covariance of the free parameters from what each group of windows would change in them.

    C = (G - 1)/G sum_g (m_g - m)(m_g - m)',  m_g = -(H - H_g)^-1 s_g,  s = g - H move per window
    """
    keep, use = np.flatnonzero(solution.free), solution.closed
    parts = solution.normal.H[use]
    score = solution.normal.g[use] - parts @ solution.move
    names = np.unique(groups)
    moves = np.zeros((len(names), len(keep)))
    for c, name in enumerate(names):
        own = groups == name
        rest = (H - parts[own].sum(axis=0))[np.ix_(keep, keep)]
        moves[c] = -solve_scaled(rest, score[own].sum(axis=0)[keep])
    off = moves - moves.mean(axis=0)
    return np.asarray((len(names) - 1) / len(names) * off.T @ off)


def shown_once(H: Array, solution: Solution, groups: Array) -> Array:
    """Parameters (D,) of which nothing is left to know without one of the groups of windows.

    What scatters between the groups says nothing of these, and they would spoil the others.
    """
    parts, most = solution.normal.H[solution.closed], SINGULAR * np.diag(H)
    left = [np.diag(H - parts[groups == name].sum(axis=0)) for name in np.unique(groups)]
    return np.asarray(np.min(left, axis=0) <= most)


def expected(H: Array, solution: Solution, groups: Array) -> tuple[Array, Array]:
    """Excess of each free parameter's variance by groups (W,), and its degrees of freedom.

    Where only noise scatters, the scores have the covariance of residuals, and the moves m_g that
    `scatter` squares have the one below. Its trace says how much larger than H^-1 their variance is
    on average; Satterthwaite's freedom is that of their sum of squares [BellMcCaffrey2002].

        cov(s_g, s_h) = H_g delta_gh - H_g H^-1 H_h,   C = cov(m_g, m_h),   (tr C)^2 / tr(C C)
    """
    keep = np.ix_(np.flatnonzero(solution.free), np.flatnonzero(solution.free))
    parts = solution.normal.H[solution.closed]
    own = np.stack([parts[groups == g].sum(axis=0)[keep] for g in np.unique(groups)])
    left = np.stack([_inverse(H[keep] - part) for part in own])
    moved, inverse, count = left @ own, _inverse(H[keep]), len(own)
    trace, square = np.zeros(len(inverse)), np.zeros(len(inverse))
    for k in range(len(inverse)):  # one (G, G) at a time: there may be thousands of recordings
        C = -moved[:, k] @ inverse @ moved[:, k].T
        C[np.diag_indices(count)] += (moved[:, k] * left[:, k]).sum(axis=1)
        C -= C.mean(axis=0)
        C -= C.mean(axis=1, keepdims=True)
        trace[k] = np.trace(C)
        square[k] = ((C / (trace[k] if trace[k] > 0 else 1.0)) ** 2).sum()
    excess = (count - 1) / count * trace / np.maximum(np.diag(inverse), 1e-300)
    # of very few the approximation errs on the large side
    freedom = np.clip(1.0 / np.maximum(square, 1e-300), (count - 1) / 3, count - 1)
    return np.maximum(excess, 1.0), freedom


def solve_scaled(H: Array, g: Array) -> Array:
    """H^-1 g of a normal matrix H (D, D), least squares where it is singular; g (D, ...)."""
    return np.asarray(_inverse(H) @ g)


def _inverse(H: Array) -> Array:
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    inverse = np.linalg.pinv(H / np.outer(scale, scale), rcond=SINGULAR, hermitian=True)
    return np.asarray(inverse / np.outer(scale, scale))
