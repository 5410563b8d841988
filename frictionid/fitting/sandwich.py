"""Sandwich covariance: what each group of rows alone would change in the free parameters."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array, rows_by, stretches

from .gauss_newton import scaled_inverse
from .parameter_block import Parameter, limits_of

FEW = 4  # recordings: of fewer, stretches of time are the clusters
STRETCHES = 24  # of recordings, together or of three of them
_NEARLY_ALL = 0.99  # of what is known of a parameter: none is left to scatter between recordings
_SOME = 3  # recordings whose own scatter counts as well, where it is larger
_AT_ONCE = 4_000_000  # pairs of recordings: there may be thousands
SINGULAR = 1e-9  # of the largest singular value of the scaled normal equations


class Groups(NamedTuple):
    """What W groups of rows, windows or stretches of recordings, each say of the D parameters.

    H (W, D, D), g (W, D) : normal equations of each where the last step of the fit began, without
    priors; move (D,) : that step; free (D,) : parameters that are not at a bound
    recording, cluster (W,) : whose scatter counts, of each group
    """

    H: Array
    g: Array
    move: Array
    free: Array
    recording: Array
    cluster: Array

    @property
    def score(self) -> Array:
        """Descent (W, D) that each group would go on with after the step."""
        return self.g - self.H @ self.move


def sandwich(H: Array, groups: Groups) -> Array:
    """Covariance of the free parameters by clusters; of three recordings the larger.

    H (D, D) : normal matrix of all groups, with priors

    Of G clusters, some tell much more of a parameter than others: `scatter` then expects too large
    a variance, which is divided by its excess, with fewer degrees of freedom than G - 1, so that
    it is enlarged until its 95 % interval by the t distribution with G - 1 is that with its own.
    """
    left = _left_out(H, groups, groups.cluster)
    inner, count = scatter(H, groups, groups.cluster, left), len(left)
    if count > 1:
        excess, freedom = expected(H, groups, left)
        wider = stdtrit(freedom, 0.975) / stdtrit(count - 1, 0.975) / np.sqrt(excess)
        inner = inner * np.outer(wider, wider)
    if _SOME <= len(np.unique(groups.recording)) < FEW:
        # what a single recording shows cannot scatter between them
        between = np.zeros(len(H))
        several = groups._replace(free=groups.free & ~in_one(groups.H, groups.recording))
        between[several.free] = np.diag(scatter(H, several, groups.recording))
        wider = between[groups.free] / np.maximum(np.diag(inner), 1e-300)
        wider = np.sqrt(np.maximum(1.0, wider))
        inner = inner * np.outer(wider, wider)
    return inner


def clusters_of(H: Array, recording: Array, time: Array) -> Array:
    """Clusters (W,) of groups: recordings, or stretches of these.

    Stretches where recordings are few, or one of them shows nearly all of some parameter, as where
    each recording moves another joint.

    H (W, D, D) : normal equations of each group; time (W,) : in whose order they follow each other
    """
    count = len(np.unique(recording))
    if count >= FEW and not in_one(H, recording).any():
        return recording
    return stretches(recording, time, -(-STRETCHES // min(count, FEW - 1)))


def in_one(H: Array, label: Array) -> Array:
    """Parameters (D,) of which groups H (W, D, D) with one of the labels (W,) show nearly all."""
    each = np.stack([np.einsum("wdd->d", H[rows]) for rows in rows_by(label)])
    return each.max(axis=0) > _NEARLY_ALL * each.sum(axis=0)


def excess_of(groups: Groups, parameters: Sequence[Parameter]) -> Array:
    """How many times larger the variance (D,) between clusters is than that by the curvature.

    The curvature counts samples as independent. A prior weighs what it says where its weight is
    multiplied by this ratio: beside the variance between clusters it then stands as it should
    [Ribatet2012]. One where it is smaller, and for parameters without a prior or at a bound.
    """
    plain = [p._replace(excess=1.0) for p in parameters]
    H = groups.H.sum(axis=0) + np.diag(limits_of(plain).precision)
    informed = np.array([np.isfinite(p.tolerance) for p in parameters], dtype=bool)
    informed &= groups.free & ~shown_once(H, groups)
    out, keep = np.ones(len(H)), np.flatnonzero(groups.free)
    if not informed.any() or len(np.unique(groups.cluster)) < 2:
        return out
    between = np.zeros(len(H))
    between[keep] = np.diag(sandwich(H, groups))
    curved = np.zeros(len(H))
    curved[keep] = np.diag(scaled_inverse(H[np.ix_(keep, keep)], SINGULAR))
    out[informed] = np.maximum(between[informed] / np.maximum(curved[informed], 1e-300), 1.0)
    return out


def worth(H: Array, groups: Groups) -> float:
    """How many independent parameters the free ones are worth: tr(H^-1 K), K of clusters' scores.

    Their number where samples scatter independently, and as many times more as neighbouring samples
    err alike: the penalty of a composite likelihood [VarinVidoni2005]. With the sandwich
    V = H^-1 K H^-1 it is tr(V H).
    """
    free = groups.free & ~shown_once(H, groups)
    if not free.any() or len(np.unique(groups.cluster)) < 2:
        return float(free.sum())
    inner = H[np.ix_(free, free)]
    return float(np.sum(sandwich(H, groups._replace(free=free)) * inner))


def _left_out(H: Array, groups: Groups, label: Array) -> Array:
    """(H - H_g)^-1 (G, N, N) of the N free parameters without the groups of each label (W,)."""
    keep = np.ix_(np.flatnonzero(groups.free), np.flatnonzero(groups.free))
    rests = [(H - groups.H[rows].sum(axis=0))[keep] for rows in rows_by(label)]
    return scaled_inverse(np.stack(rests), SINGULAR)


def scatter(H: Array, groups: Groups, label: Array, left: Array | None = None) -> Array:
    """Covariance of the free parameters from what the groups of each label (W,) would change in it.

    C = (G - 1)/G sum_g (m_g - m)(m_g - m)',  m_g = -(H - H_g)^-1 s_g,  s = g - H move per group

    left : the inverses, where they are known
    """
    left, score = _left_out(H, groups, label) if left is None else left, groups.score
    pairs = zip(left, rows_by(label), strict=True)
    moves = np.stack([-(each @ score[rows].sum(axis=0)[groups.free]) for each, rows in pairs])
    off = moves - moves.mean(axis=0)
    return (len(left) - 1) / len(left) * off.T @ off


def shown_once(H: Array, groups: Groups) -> Array:
    """Parameters (D,) of which nothing is left to know without the groups of some cluster.

    What scatters between the clusters says nothing of these, and they would spoil the others.
    """
    most = SINGULAR * np.diag(H)
    left = [np.diag(H - groups.H[rows].sum(axis=0)) for rows in rows_by(groups.cluster)]
    shape = (len(left), len(H))  # nothing may be free
    return np.min(np.reshape(left, shape), axis=0, initial=np.inf) <= most


def expected(H: Array, groups: Groups, left: Array | None = None) -> tuple[Array, Array]:
    """Excess of each free parameter's variance by clusters, and its degrees of freedom.

    Where only noise scatters, the scores have the covariance of residuals, and the moves m_g that
    `scatter` squares have the one below. Its trace says how much larger than H^-1 their variance is
    on average; Satterthwaite's freedom is that of their sum of squares [BellMcCaffrey2002].

        cov(s_g, s_h) = H_g delta_gh - H_g H^-1 H_h,   C = cov(m_g, m_h),   (tr C)^2 / tr(C C)

    left : (H - H_g)^-1, where they are known
    """
    left = _left_out(H, groups, groups.cluster) if left is None else left
    keep = np.ix_(np.flatnonzero(groups.free), np.flatnonzero(groups.free))
    parts = np.stack([groups.H[rows].sum(axis=0)[keep] for rows in rows_by(groups.cluster)])
    moved, inverse, count = left @ parts, scaled_inverse(H[keep], SINGULAR), len(parts)
    trace, square = np.zeros(len(inverse)), np.zeros(len(inverse))
    for k in range(len(inverse)):
        A, diagonal = moved[:, k], (moved[:, k] * left[:, k]).sum(axis=1)
        mean = (diagonal - A @ (inverse @ A.sum(axis=0))) / count
        trace[k] = (diagonal - (A @ inverse * A).sum(axis=1) - mean).sum()
        for rows in np.array_split(np.arange(count), -(-count * count // _AT_ONCE)):
            C = -A[rows] @ inverse @ A.T
            C[np.arange(len(rows)), rows] += diagonal[rows]
            C += mean.mean() - mean - mean[rows, None]
            square[k] += ((C / (trace[k] if trace[k] > 0 else 1.0)) ** 2).sum()
    excess = (count - 1) / count * trace / np.maximum(np.diag(inverse), 1e-300)
    # of very few the approximation errs on the large side
    freedom = np.clip(1.0 / np.maximum(square, 1e-300), (count - 1) / 3, count - 1)
    return np.maximum(excess, 1.0), freedom


def solve_scaled(H: Array, g: Array) -> Array:
    """H^-1 g of a normal matrix H (D, D), least squares where it is singular; g (D, ...)."""
    return scaled_inverse(H, SINGULAR) @ g


def step_of(H: Array, g: Array, free: Array) -> Array:
    """The Gauss-Newton step (D,) H^-1 g of the free parameters (D,), zero for others."""
    keep, step = np.flatnonzero(free), np.zeros(len(free))
    step[keep] = solve_scaled(H[np.ix_(keep, keep)], g[keep])
    return step
