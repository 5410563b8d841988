"""Start of a least-squares fit: the law's harmonics by evidence, and the values to begin at.

The harmonics of cogging and ripple are chosen joint by joint and fold by fold. The torque of each
row, see `regressor.torques`, is regressed on what there may be anyway (friction of any shape over
the speed, an offset, gravity and inertia that are off) and on cos(k gear q) and sin(k gear q) of
the candidates k; of ripple times the direction. Candidates come in one by one, that first which
explains most, and change places with others. How many there are held-out motion says: with each
cluster of rows left out, they are sought again, and the smallest number is taken that predicts
these clusters as well as the best one, but for scatter between the clusters.

The values to begin at are for each joint the best of those that its law suggests.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
from scipy.special import stdtrit

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Groups, Law, along
from frictionid.friction.laws import NoFriction, Ripple, Sum
from frictionid.friction.laws.combined import CombinedLaw
from frictionid.friction.laws.position_torques import AUTO, Periodic

from ..gauss_newton import bounded
from ..one_step.balances import SHAPES
from ..one_step.linearised import Linearised, clusters, grams
from ..one_step.residual import Problem
from .active_sets import best_fits, first_as_good, held_out_costs, unit_columns
from .regressor import torques

# --- Harmonics ------------------------------------------------------------------------------------

_MOST, _GROUPS = 6, 20  # harmonics of a joint, and clusters
_SIGNIFICANCE = 0.01  # of all joints together
_BLIND, _GAIN = 1e-9, 1e-6


def by_evidence(
    law: Law, problem: Problem, weights: Array, equal: Groups = ()
) -> tuple[Law, Array | None]:
    """The law with the harmonics that any joint of any fold shows, and which are absent, (F, n, P).

    As it is, and None, where none are to be chosen. Equal joints have what one of them shows.
    """
    part = auto_part(law)
    if part is None:
        return law, None
    has = harmonics(part, problem, weights)
    for group in equal:
        joints = np.array(group) - 1
        has[:, joints] = has[:, joints].any(axis=1, keepdims=True)
    shown = np.flatnonzero(has.any(axis=(0, 1)))
    form = with_harmonics(law, tuple(part.orders[i] for i in shown))
    absent = np.zeros((*has.shape[:2], len(form.names)), dtype=bool)
    for i in shown:
        for name in (f"cos_{part.orders[i]}", f"sin_{part.orders[i]}"):
            absent[..., form.names.index(name)] = ~has[..., i]
    return form, absent


def auto_part(law: Law) -> Periodic | None:
    """The law, or the part of it, whose harmonics are to be chosen."""
    if isinstance(law, Periodic):
        return law if law.harmonics == AUTO else None
    for part in law.parts if isinstance(law, CombinedLaw) else ():
        if (inner := auto_part(part)) is not None:
            return inner
    return None


def with_harmonics(law: Law, chosen: tuple[int, ...]) -> Law:
    """The law with harmonics in place of "auto"; without its periodic part where there are none.

    >>> auto = {"kind": "cogging", "harmonics": "auto"}
    >>> with_harmonics(Sum(("coulomb_viscous", auto)), (6, 12)).names
    ('coulomb', 'viscous', 'cos_6', 'sin_6', 'cos_12', 'sin_12')
    >>> with_harmonics(Ripple(harmonics="auto"), ())
    CoulombViscous(width=0.02, shape='tanh', symmetric=True)
    """
    if isinstance(law, Periodic) and law.harmonics == AUTO:
        none = law.inner if isinstance(law, Ripple) else NoFriction()
        return replace(law, harmonics=chosen) if chosen else none
    if not isinstance(law, CombinedLaw):
        return law
    changed: dict[str, Any] = {}
    for name in law.made_of:
        part = getattr(law, name)
        several = isinstance(part, tuple)
        each = tuple(with_harmonics(x, chosen) for x in (part if several else (part,)))
        if isinstance(law, Sum):
            each = tuple(x for x in each if not isinstance(x, NoFriction))
        if isinstance(law, Sum) and len(each) == 1:
            return each[0]
        changed[name] = each if several else each[0]
    return replace(law, **changed)


def harmonics(law: Periodic, problem: Problem, weights: Array) -> Array:
    """Whether the rows show each of the law's candidates k, (F, n, k), under weights (F, K)."""
    _, torque, weight = torques(problem)
    label = clusters(problem)
    label = label * _GROUPS // max(int(label.max()) + 1, _GROUPS)
    count, level = len(law.orders), _SIGNIFICANCE / torque.shape[1]
    out = np.zeros((len(weights), torque.shape[1], count), dtype=bool)
    for j in range(torque.shape[1]):
        if not weight[:, j].any():
            continue
        A = np.concatenate([_columns(law, problem, j), torque[:, [j]]], axis=1)
        A = A * np.sqrt(weight[:, [j]] / weight[:, j].max())
        base = A.shape[1] - 1 - 2 * count
        for f, G in enumerate(grams(A[:, None], weights, label)):
            out[f, j, list(_chosen(G, base, count, level))] = True
    return out


def _columns(law: Periodic, problem: Problem, j: int) -> Array:
    """Columns (K, B + 2 k) of what there may be anyway, and of the candidates' waves."""
    x = problem.nodes.inputs
    q, w = x.q[:, j], x.w[:, j]
    sign, fast = np.sign(w), max(float(np.quantile(np.abs(w), 0.95)), 1e-12)
    slow = [sign * np.exp(-np.abs(w) / (share * fast)) for share in SHAPES]
    base = [np.ones_like(w), sign, w, w * np.abs(w), *slow, np.cos(q), np.sin(q)]
    by = sign if isinstance(law, Ripple) else np.ones_like(w)
    # of less than a turn of its wave a harmonic may be any function of the angle
    turns = np.repeat(law.orders, 2) * law.gear * np.ptp(q) / (2 * np.pi)
    waves = [by * (turn >= 1) * wave for turn, wave in zip(turns, law.waves(q), strict=True)]
    each = np.stack([*base, *waves], axis=1)
    at = problem.stencil
    change = (w[at[:, -1]] - w[at[:, 0]]) / problem.dt
    return np.concatenate([change[:, None], problem.mean(each)], axis=1)


def _chosen(G: Array, base: int, count: int, level: float) -> tuple[int, ...]:
    """Candidates by Gram matrices (C, M, M) of the clusters, at a level of significance."""
    G = unit_columns(G[np.einsum("cii->c", G) > 0])[0]
    if len(G) < 2:
        return ()
    costs = np.stack([_held_out(G, c, base, count) for c in range(len(G))], axis=1)
    size = first_as_good(list(costs), float(stdtrit(len(G) - 1, 1.0 - level)))
    return list(_sets(G.sum(axis=0), base, count, size))[-1]


def _held_out(G: Array, c: int, base: int, count: int) -> Array:
    """Squares (_MOST + 1,) that cluster c has under the fits of the others, by their number."""
    T = G.sum(axis=0) - G[c]
    each, costs = np.stack([T, G[c]]), []
    for chosen in _sets(T, base, count, _MOST):
        columns = [*range(base), *(base + 2 * k + i for k in chosen for i in (0, 1))]
        costs.append(held_out_costs(each, columns)[1])
    return np.maximum(costs, 1e-12 * max(G[c, -1, -1], 1e-300))


def _sets(T: Array, base: int, count: int, most: int) -> Iterator[tuple[int, ...]]:
    """Candidates that explain most: none, one, and so on. One comes in, others change place."""
    inner = np.linalg.pinv(T[:base, :base], rcond=_BLIND, hermitian=True)
    left = T[base:, base:] - T[base:, :base] @ inner @ T[:base, base:]
    chosen: list[int] = []
    yield ()
    for _ in range(min(most, count)):
        cost, k = _best(left, chosen, count)
        chosen.append(k)
        while True:
            others = [[x for x in chosen if x != k] for k in chosen]
            trials = [(*_best(left, rest, count), rest) for rest in others]
            better, k, rest = min(trials)
            if better >= cost - _GAIN * abs(left[-1, -1]):  # of rounding it may be negative
                break
            cost, chosen = better, [*rest, k]
        yield tuple(sorted(chosen))


def _best(left: Array, chosen: Sequence[int], count: int) -> tuple[float, int]:
    """Squares that are left with the best candidate beside those chosen, and the candidate."""
    free = [k for k in range(count) if k not in chosen]
    sets = np.array([[2 * x + i for x in (*chosen, k) for i in (0, 1)] for k in free])
    cost = best_fits(left, sets)[0]
    place = int(np.argmin(cost))
    return float(cost[place]), free[place]


# --- Initial values -------------------------------------------------------------------------------

_RIDGE = 1e-12
_SWEEPS = 2


def best_initial_guess(fit: Linearised, weights: Array) -> tuple[Array, Array]:
    """Initial values (F, N) with the lowest cost one linear step away, and the values there (F, N).

    Each fold first takes the best values that are the same for all joints, then changes those of
    one joint after the other.
    """
    values = _values(fit)
    grams = _grams_of_values(fit, values, weights)
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


def _grams_of_values(fit: Linearised, values: Array, weights: Array) -> Array:
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
        b, G, r = _torque_columns(part, values), part.problem.G, part.problem.r
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


def _torque_columns(fit: Linearised, values: Array) -> Array:
    """Columns b (n, K, S (P + 1)) of the mean torques in the rows by values (S, n, P)."""
    S, n, P = values.shape
    slopes = fit.slopes(values.reshape(S, n * P))
    torque = fit.problem.mean(along(fit.friction(values), fit.problem.nodes))
    both = np.concatenate([slopes, -torque[..., None]], axis=-1)  # (S, K, n, P + 1)
    return np.moveaxis(both, 0, 2).transpose(1, 0, 2, 3).reshape(n, -1, S * (P + 1))


def _best_of_fold(values: Array, gram: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Initial values (N,) of one fold, of values (S, n, P), and the values (N,) after its step.

    gram : (M, M), see `_grams_of_values`; low, high : bounds (N,)
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
