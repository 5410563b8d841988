"""Active sets: which candidates of a sparse model have coefficients that are not zero.

Everything is computed from Gram matrices T with columns of length one and the target as the last
column (see `grams`), so that the cost of a search does not depend on the number of rows:

    cost(c) = c'H c - 2 c'g + T[-1, -1],   H = T[S, S],  g = T[S, -1]   for an active set S

Candidates of neighbouring velocities (signs, peaks) are nearly collinear; `Constraints.conflict`
says which exclude each other.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array

_RIDGE = 1e-11
_EXACT = 1e-12  # of the squares without friction, which is rounding
_LIMIT = 3000  # sets of a joint that are all tried
_LARGEST = 8  # candidates of a joint
_SWEEPS = 4
_GAIN = 1e-10  # of the squares without friction: a smaller gain is rounding


class Constraints(NamedTuple):
    """What active sets may contain: each column's joint (N,), and whether it may be used (N,).

    conflict : (N, N), pairs of columns that exclude each other; a column conflicts with itself
    positive : (N,), whether a column's coefficient must be positive
    """

    joint: Array
    conflict: Array
    positive: Array
    usable: Array


class ActiveSet(NamedTuple):
    """Columns of an active set, ascending, and the squares that its best fit leaves."""

    cost: float
    columns: tuple[int, ...]


def unit_columns(G: Array) -> tuple[Array, Array]:
    """Gram matrices (C, M, M) with columns of length one, and the lengths (M,) that they had.

    A column's length is that over all clusters; one of length zero stays.
    """
    length = np.sqrt(np.einsum("cii->i", G))
    scale = np.where(length > 0, length, 1.0)
    return G / scale / scale[:, None], length


def best_fits(T: Array, sets: Array) -> tuple[Array, Array]:
    """Squares (B,) and coefficients (B, s) of the best fit on each of the active sets (B, s).

    T (M, M), or a stack (B, M, M) with one for each set.
    """
    T = np.broadcast_to(T, (len(sets), *T.shape[-2:]))
    item = np.arange(len(sets))[:, None]
    H = T[item[..., None], sets[:, :, None], sets[:, None, :]]
    g = T[item, sets, -1]
    c = np.linalg.solve(H + _RIDGE * np.eye(sets.shape[-1]), g[..., None])[..., 0]
    explained = np.einsum("bi,bij,bj->b", c, H, c) - 2 * (c * g).sum(-1)
    return T[..., -1, -1] + explained, c


def admissible(coefficients: Array, T: Array, constraints: Constraints) -> tuple[int, ...]:
    """Active set proposed by coefficients (N,), without conflicts and wrong signs.

    Of conflicting columns the one with the largest coefficient stays. Columns whose coefficient in
    the best fit is negative, but must not be, are then removed one by one.
    """
    size = np.where(constraints.positive, coefficients, np.abs(coefficients)) * constraints.usable
    columns: list[int] = []
    for i in np.argsort(-size, kind="stable").tolist():
        if size[i] > 0 and not constraints.conflict[i, columns].any():
            columns.append(i)
    columns.sort()
    while columns:
        c = best_fits(T, np.array([columns]))[1][0]
        signed = np.where(constraints.positive[columns], c, 1.0)
        if signed.min() > 0:
            break
        columns.pop(int(np.argmin(signed)))
    return tuple(columns)


def best_proposals(
    T: Array, constraints: Constraints, proposals: Iterable[Sequence[int]]
) -> list[ActiveSet]:
    """The best admissible proposal of each size, ascending; the empty set is one of them."""
    fits = (_best(T, constraints, np.array([columns], dtype=int)) for columns in proposals)
    best = _by_size([ActiveSet(float(T[-1, -1]), ()), *fits])
    return [best[size] for size in sorted(best)]


@lru_cache(maxsize=16)
def compatible_sets(conflict: bytes, limit: int) -> tuple[Array, ...]:
    """All sets (B, s) of candidates without conflicts, for the sizes s = 0, 1, ...

    Up to the largest size with which there are no more than `limit` in all. conflict (P, P) of
    booleans as bytes.

    >>> conflict = np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]], dtype=bool)
    >>> [len(sets) for sets in compatible_sets(conflict.tobytes(), 100)]
    [1, 3, 2]
    """
    P = math.isqrt(len(conflict))
    excludes = np.frombuffer(conflict, dtype=bool).reshape(P, P)
    sizes = [np.zeros((1, 0), dtype=int)]
    while len(sizes[-1]) and sum(map(len, sizes)) <= limit:
        smaller, larger = sizes[-1], []
        last = smaller[:, -1] if smaller.shape[1] else np.full(len(smaller), -1)
        for i in range(P):
            sets = smaller[(last < i) & ~excludes[i][smaller].any(axis=1)]
            larger.append(np.concatenate([sets, np.full((len(sets), 1), i)], axis=1))
        sizes.append(np.concatenate(larger))
    return tuple(sizes[:-1])


def best_sets_of_joint(
    T: Array,
    constraints: Constraints,
    others: Sequence[int],
    joint: int,
    proposals: Iterable[Sequence[int]],
) -> list[ActiveSet]:
    """The best active sets of each size for one joint, beside the columns of the `others`.

    All sets of a joint are tried up to the size at which they become too many. Larger ones grow by
    one column at a time, after each of which columns are exchanged. Proposals are tried as well.
    """
    owned, kept = np.flatnonzero(constraints.joint == joint), np.array(sorted(others), dtype=int)
    every = compatible_sets(constraints.conflict[np.ix_(owned, owned)].tobytes(), _LIMIT)
    tried = [owned[sets][constraints.usable[owned[sets]].all(axis=1)] for sets in every]
    tried += [np.array([columns], dtype=int) for columns in proposals]
    best = _by_size(_best(T, constraints, _joined(kept, sets)) for sets in tried)
    size = len(kept) + len(every) - 1
    while size in best and size < len(kept) + _LARGEST:
        columns = np.array(best[size].columns, dtype=int)  # and one more of the joint
        larger = _best(T, constraints, _joined(columns, _additions(constraints, columns, joint)))
        if larger is None:
            break
        size += 1
        best |= _by_size([best.get(size), _exchanged(T, constraints, larger, joint)])
    return [best[size] for size in sorted(best)]


def _by_size(sets: Iterable[ActiveSet | None]) -> dict[int, ActiveSet]:
    """Of the active sets of each size the first one with the lowest cost."""
    best: dict[int, ActiveSet] = {}
    for fit in sets:
        if fit and (len(fit.columns) not in best or fit.cost < best[len(fit.columns)].cost):
            best[len(fit.columns)] = fit
    return best


def _joined(kept: Array, sets: Array) -> Array:
    """Active sets (B, s) of the kept columns and of sets (B, s - kept)."""
    return np.concatenate([np.tile(kept, (len(sets), 1)), sets], axis=1)


def _best(T: Array, constraints: Constraints, sets: Array) -> ActiveSet | None:
    """Of active sets (B, s) with admissible signs the one with the lowest cost, if there is one."""
    if not sets.size:
        return None
    cost, c = best_fits(T, sets)
    allowed = ((c > 0) | ~constraints.positive[sets]).all(-1)
    if not allowed.any():
        return None
    i = int(np.argmin(np.where(allowed, cost, np.inf)))
    return ActiveSet(float(cost[i]), tuple(sorted(map(int, sets[i]))))


def _additions(constraints: Constraints, columns: Array, joint: int) -> Array:
    """Columns (B, 1) of a joint that may be added to others."""
    free = constraints.usable & (constraints.joint == joint)
    return np.flatnonzero(free & ~constraints.conflict[:, columns].any(axis=1))[:, None]


def _exchanged(T: Array, constraints: Constraints, active: ActiveSet, joint: int) -> ActiveSet:
    """The active set after all exchanges of a joint's columns, one by one, that lower the cost."""
    while exchanges := list(_exchanges(constraints, active, joint)):
        better = _best(T, constraints, np.concatenate(exchanges))
        if better is None or better.cost > active.cost - _GAIN * T[-1, -1]:
            break
        active = better
    return active


def _exchanges(constraints: Constraints, active: ActiveSet, joint: int) -> Iterator[Array]:
    """Active sets (B, s) with another column of the joint in place of one of its columns."""
    columns = np.array(active.columns, dtype=int)
    for i in np.flatnonzero(constraints.joint[columns] == joint):
        kept = np.delete(columns, i)
        added = _additions(constraints, kept, joint)
        yield _joined(kept, added[added[:, 0] != columns[i]])


def search(
    G: Array,
    constraints: Constraints,
    proposals: Sequence[tuple[int, ...]],
    n_standard_errors: float,
) -> tuple[int, ...]:
    """Active set of all joints: that of one joint after the other is selected, until none changes.

    G (C, M, M) are the Gram matrices of the clusters. The search begins with the largest proposal:
    what a joint does not need shows best where the others have all that they may need.
    """
    T = G.sum(0)
    active = max((part.columns for part in best_proposals(T, constraints, proposals)), key=len)
    for _ in range(_SWEEPS):
        before = active
        for joint in np.unique(constraints.joint):
            others = [i for i in active if constraints.joint[i] != joint]
            parts = [[i for i in part if constraints.joint[i] == joint] for part in proposals]
            sets = best_sets_of_joint(T, constraints, others, int(joint), parts)
            active = selected(G, sets, n_standard_errors) if sets else active
        if active == before:
            break
    return active


def held_out_costs(G: Array, columns: Sequence[int]) -> Array:
    """Squares (C,) of each cluster under the fit of all the other clusters; G (C, M, M)."""
    if not columns:
        return G[:, -1, -1]
    S = np.array(columns)
    _, c = best_fits(G.sum(0) - G, np.repeat(S[None], len(G), axis=0))
    H, g = G[:, S[:, None], S], G[:, S, -1]
    return G[:, -1, -1] + np.einsum("ci,cij,cj->c", c, H, c) - 2 * np.einsum("ci,ci->c", c, g)


def selected(G: Array, sets: Sequence[ActiveSet], n_standard_errors: float) -> tuple[int, ...]:
    """The first of the active sets that predicts held-out clusters as well as the best one.

    Sets are given from small to large.
    """
    G = G[np.einsum("cii->c", G) > 0]
    floor = _EXACT * np.maximum(G[:, -1, -1], G[:, -1, -1].mean())
    costs = [np.maximum(held_out_costs(G, active.columns), floor) for active in sets]
    return sets[first_as_good(costs, n_standard_errors)].columns


def first_as_good(costs: Sequence[Array], n_standard_errors: float) -> int:
    """The first model whose squares (C,) of held-out clusters are as good as those of the best one.

    As good: the mean logarithm of their ratio exceeds zero by no more than so many standard errors
    over the clusters. Differences instead of ratios would leave the decision to the few clusters
    that move most.
    """
    best = int(np.argmin([cost.sum() for cost in costs]))
    for k, cost in enumerate(costs[:best]):
        excess = np.log(cost / costs[best])
        error = np.sqrt(excess.var(ddof=1) / len(excess)) if len(excess) > 1 else 0.0
        if excess.mean() <= n_standard_errors * error:
            return k
    return best
