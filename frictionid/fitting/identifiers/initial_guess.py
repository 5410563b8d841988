"""Initial guesses of fits: for each joint the best of the initial values that its law suggests."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import along

from ..gauss_newton import bounded
from ..one_step.linearised import Linearised

_RIDGE = 1e-12
_SWEEPS = 2


def best_initial_guess(fit: Linearised, weights: Array) -> tuple[Array, Array]:
    """Initial values (F, N) with the lowest cost one linear step away, and the values there (F, N).

    Each fold first takes the best values that are the same for all joints, then changes those of
    one joint after the other.
    """
    values = _values(fit)
    grams = _grams(fit, values, weights)
    pairs = [_best_of_fold(values, *fold) for fold in zip(grams, *fit.bounds, strict=True)]
    initial, stepped = (np.reshape(each, (len(weights), -1)) for each in zip(*pairs, strict=True))
    return np.clip(initial, *fit.bounds), stepped


def _values(fit: Linearised) -> Array:
    """Initial values (S, n, P) that the law suggests, within the bounds of any fold."""
    P = len(fit.law.names)
    starts = np.array(fit.law.initial, dtype=float)
    if P:  # values far outside the bounds are all the same one
        low, high = (x.reshape(-1, P) for x in fit.bounds)
        starts = np.unique(np.clip(starts, low.min(axis=0), high.max(axis=0)), axis=0)
    return np.repeat(starts[:, None], fit.joints, axis=1)


def _grams(fit: Linearised, values: Array, weights: Array) -> Array:
    """Gram matrix (F, M, M) of each fold; M = S n (P + 1) + 1.

    Near the values theta_j of some choice for each joint j, with steps d_j from there,

        e = r - sum_j G_j Tf_j(theta_j) - sum_j J_j d_j

    so that the rows matter by the products of the columns [J_j, -G_j Tf_j] of all values and
    joints, and r as the last one. The columns of joint j are G_kj b_kj with b = [dTf_j/dtheta,
    -Tf_j] of all values, so that the rows matter by

        sum_k w_k (G_kj' G_ki) b_kj b_ki'    and    sum_k w_k (G_kj' r_k) b_kj
    """
    S, n, P = values.shape
    B, F = S * (P + 1), len(weights)
    blocks, right = np.zeros((F, n, B, n, B)), np.zeros((F, n, B))
    size = np.zeros(F)
    for rows, part in fit.stretches(S):
        b, G, r = _torques(part, values), part.problem.G, part.problem.r
        part.check_finite(b, G, r)
        pairs = np.einsum("kij,kil->jlk", G, G)
        onto = np.einsum("kij,ki->jk", G, r)
        size += weights[:, rows] @ (r**2).sum(axis=1)
        for at, weight, share in sums_of_rows(weights[:, rows]):
            for j in range(n):
                right[:, j] += share[:, None] * ((weight * onto[j, at]) @ b[j, at])
                for i in range(j + 1):
                    product = (b[j, at].T * (weight * pairs[j, i, at])) @ b[i, at]
                    blocks[:, j, :, i] += share[:, None, None] * product
    for j, i in combinations(range(n), 2):
        blocks[:, j, :, i] = np.swapaxes(blocks[:, i, :, j], 1, 2)
    grams = np.zeros((F, n * B + 1, n * B + 1))
    grams[:, :-1, :-1], ends = blocks.reshape(F, n * B, n * B), right.reshape(F, n * B)
    grams[:, -1, :-1], grams[:, :-1, -1], grams[:, -1, -1] = ends, ends, size
    return grams


def sums_of_rows(weights: Array) -> Iterator[tuple[Array, Array, Array]]:
    """Sums over rows of which those under weights (F, K) are made: rows, weights, shares (F,).

    Folds of whole recordings share most of their rows, and the sums over these.
    """
    F, K = weights.shape
    key = np.cos(np.arange(1.0, F + 1)) @ weights  # the same for rows that have the same weights
    _, first, cell = np.unique(key, return_index=True, return_inverse=True)
    if len(first) > F + 1 or not np.array_equal(weights[:, first[cell]], weights):
        yield from ((np.arange(K), *pair) for pair in zip(weights, np.eye(F), strict=True))
        return
    for c, k in enumerate(first):
        rows = np.flatnonzero(cell == c)
        yield rows, np.ones(len(rows)), weights[:, k]


def _torques(fit: Linearised, values: Array) -> Array:
    """Columns b (n, K, S (P + 1)) of the mean torques in the rows by values (S, n, P)."""
    S, n, P = values.shape
    slopes = fit.slopes(values.reshape(S, n * P))
    torque = fit.problem.mean(along(fit.friction(values), fit.problem.nodes))
    both = np.concatenate([slopes, -torque[..., None]], axis=-1)  # (S, K, n, P + 1)
    return np.moveaxis(both, 0, 2).transpose(1, 0, 2, 3).reshape(n, -1, S * (P + 1))


def _best_of_fold(values: Array, gram: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Initial values (N,) of one fold, of values (S, n, P), and the values (N,) after its step.

    gram : (M, M), see `_grams`; low, high : bounds (N,)
    """
    S, n, _ = values.shape
    alike = np.repeat(np.arange(S)[:, None], n, axis=1)
    choice, stepped = _best_choice(values, gram, low, high, alike)
    for j in list(range(n)) * (_SWEEPS if n > 1 else 0):
        choices = np.repeat(choice[None], S, axis=0)
        choices[:, j] = np.arange(S)
        choice, stepped = _best_choice(values, gram, low, high, choices)
    return values[choice, np.arange(n)].ravel(), stepped


def _best_choice(
    values: Array, gram: Array, low: Array, high: Array, choices: Array
) -> tuple[Array, Array]:
    """The choice (n,) of initial values with the lowest cost after one step, and the values there.

    The cost after a step d within the bounds, from the values of one of the choices (C, n), is

        |e0|^2 - 2 g'd + d'H d,   H = J'J,  g = J'e0
    """
    C, n = choices.shape
    S, _, P = values.shape
    columns = np.arange(S * n * (P + 1)).reshape(n, S, P + 1)[np.arange(n), choices]
    J = columns[..., :-1].reshape(C, n * P)
    e0 = np.insert(columns[..., -1], 0, len(gram) - 1, axis=1)  # these columns add up to e0
    H = gram[J[:, :, None], J[:, None, :]]
    g = gram[J[:, :, None], e0[:, None, :]].sum(-1)
    cost = gram[e0[:, :, None], e0[:, None, :]].sum((-1, -2))
    start = values[choices, np.arange(n)].reshape(C, n * P)
    damped = H * (1 + _RIDGE * np.eye(n * P))
    d = bounded(damped, g, low - start, high - start)
    cost = cost - 2 * (g * d).sum(-1) + np.einsum("ci,cij,cj->c", d, H, d)
    best = int(np.argmin(cost))
    return choices[best], np.clip(start[best] + d[best], low, high)


def hardly_sliding(fit: Linearised, weights: Array) -> Array:
    """Which joints (F, n) slide in fewer rows of a fold, weights (F, K), than they have parameters.

    Raises
    ------
    InputError
        Naming a joint that slides in no row, with a weight or without.
    """
    problem = fit.problem
    slides = np.zeros(problem.r.shape)
    if problem.nodes.inputs.w.any():  # else there is no speed that bounds the law's velocities
        first = _values(fit)[:1].reshape(1, -1)
        for rows, part in fit.stretches():
            slopes = part._replace(tie=None).slopes(first)[0]
            slides[rows] = (part.problem.G != 0).any(axis=1) & slopes.any(axis=-1)
    if fit.constraints is not None:  # equal joints determine their parameters together
        owner = fit.constraints.owner
        slides = slides @ (owner[:, None] == owner)
    needed = fit.law.has_parameters(fit.joints).sum(axis=1)
    never = (needed > 0) & ~slides.any(axis=0)
    if never.any():
        raise InputError(
            f"joint {never.argmax() + 1} slides in no row: give recordings in which it moves, or "
            "lock it"
        )
    return (weights > 0).astype(float) @ slides < needed
