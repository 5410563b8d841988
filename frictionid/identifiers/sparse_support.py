"""Which candidates belong to friction: supports that fit well, and the one that predicts best.

All of it happens on Gram matrices with columns of length one (see `grams`), so that the number of
rows costs nothing. Candidates with a velocity of their own (signs, peaks) look alike where these
velocities are neighbours; which exclude each other is given.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array

_RIDGE = 1e-11
_EXACT = 1e-12  # of the squares without friction, which is rounding
_LIMIT = 3000  # sets of candidates of a joint
_MOST = 8  # candidates of a joint
_SWEEPS = 4
_GAIN = 1e-10  # of the squares, below which an exchange is rounding


class Rules(NamedTuple):
    """What supports may be: each column's joint (N,), whether it is positive (N,), usable (N,).

    conflict : (N, N), pairs of columns that exclude each other, each itself among them
    """

    joint: Array
    conflict: Array
    positive: Array
    usable: Array


class Found(NamedTuple):
    """A support, sorted, and its squares."""

    cost: float
    support: tuple[int, ...]


def least(T: Array, supports: Array) -> tuple[Array, Array]:
    """Squares (B,) and coefficients (B, s) of the best fit on each support (B, s).

    T (..., M, M) has the target as last column; a stack of B is one for each support.
    """
    s = supports.shape[-1]
    pick = np.arange(len(T))[:, None] if T.ndim == 3 else None
    rows, columns = supports[:, :, None], supports[:, None, :]
    H = T[rows, columns] if pick is None else T[pick[:, :, None], rows, columns]
    g = T[supports, -1] if pick is None else T[pick, supports, -1]
    c = np.linalg.solve(H + _RIDGE * np.eye(s), g[..., None])[..., 0]
    fitted = np.einsum("bi,bij,bj->b", c, H, c) - 2 * (c * g).sum(-1)
    return T[..., -1, -1] + fitted, c


def lawful(coefficients: Array, T: Array, rules: Rules) -> tuple[int, ...]:
    """Support (s,) of coefficients (N,): the largest first, none that would drive."""
    size = np.where(rules.positive, coefficients, np.abs(coefficients)) * rules.usable
    order = [int(i) for i in np.argsort(-size, kind="stable") if size[i] > 0]
    support: list[int] = []
    for i in order:
        if not rules.conflict[i, support].any():
            support.append(i)
    support.sort()
    while support:
        c = least(T, np.array([support]))[1][0]
        wrong = np.where(rules.positive[support], c, 1.0)
        if wrong.min() > 0:
            break
        support.pop(int(np.argmin(wrong)))
    return tuple(support)


def plain(T: Array, rules: Rules, proposals: Iterable[Sequence[int]]) -> list[Found]:
    """The best proposal of each size, from small to large; the empty one is always there."""
    best = {0: Found(float(T[-1, -1]), ())}
    for support in proposals:
        found = _first(T, rules, np.array([support])) if support else None
        if found and (len(support) not in best or found.cost < best[len(support)].cost):
            best[len(support)] = found
    return [best[size] for size in sorted(best)]


@lru_cache(maxsize=16)
def subsets(conflict: bytes, limit: int) -> tuple[Array, ...]:
    """All sets of candidates (B, s) without a conflict, for s = 0, 1, ...

    Up to the largest size with which they are no more than `limit` in all; conflict (P, P) of
    booleans as bytes.

    >>> conflict = np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]], dtype=bool)
    >>> [len(sets) for sets in subsets(conflict.tobytes(), 100)]
    [1, 3, 2]
    """
    P = math.isqrt(len(conflict))
    excludes = np.frombuffer(conflict, dtype=bool).reshape(P, P)
    sizes, total = [np.zeros((1, 0), dtype=int)], 1
    while len(sizes[-1]):
        grown = []
        for i in range(P):
            own = sizes[-1]
            after = (own[:, -1] < i) if own.shape[1] else np.ones(len(own), dtype=bool)
            fine = own[after & ~excludes[i][own].any(axis=1)]
            grown.append(np.concatenate([fine, np.full((len(fine), 1), i)], axis=1))
        sizes.append(np.concatenate(grown))
        total += len(sizes[-1])
        if total > limit:
            break
    return tuple(sizes[:-1])


def path(
    T: Array, rules: Rules, fixed: Sequence[int], joint: int, proposals: Iterable[Sequence[int]]
) -> list[Found]:
    """The best supports of each size for one joint, beside the `fixed` columns of the others.

    Of all sets where these are not too many; larger ones grow by one candidate at a time, which
    then give way to others, one by one, as long as that lowers the squares. Proposals are tried as
    they are.
    """
    own, rest = np.flatnonzero(rules.joint == joint), np.array(sorted(fixed), dtype=int)
    best: dict[int, Found] = {}

    def keep(found: Found | None) -> Found | None:
        size = -1 if found is None else len(found.support)
        if found is not None and (size not in best or found.cost < best[size].cost):
            best[size] = found
        return found

    sizes = subsets(rules.conflict[np.ix_(own, own)].tobytes(), _LIMIT)
    for sets in sizes:
        keep(_first(T, rules, _beside(rest, own[sets][rules.usable[own[sets]].all(axis=1)])))
    for part in proposals:
        keep(_first(T, rules, _beside(rest, np.array([part], dtype=int))))
    size = len(rest) + len(sizes) - 1
    while size in best and size < len(rest) + _MOST:
        found = _grown(T, rules, best[size], joint)
        if keep(_exchanged(T, rules, found, joint)) is None:
            break
        size += 1
    return [best[size] for size in sorted(best)]


def _beside(rest: Array, sets: Array) -> Array:
    """Supports (B, s) of the fixed columns and sets (B, s - fixed)."""
    return np.concatenate([np.tile(rest, (len(sets), 1)), sets], axis=1)


def _first(T: Array, rules: Rules, supports: Array) -> Found | None:
    """The lawful one of supports (B, s) with the lowest squares."""
    if not supports.size:
        return None
    cost, c = least(T, supports)
    allowed = ((c > 0) | ~rules.positive[supports]).all(-1)
    if not allowed.any():
        return None
    i = int(np.argmin(np.where(allowed, cost, np.inf)))
    return Found(float(cost[i]), tuple(sorted(map(int, supports[i]))))


def _grown(T: Array, rules: Rules, found: Found, joint: int) -> Found | None:
    """The best support with one column of a joint more."""
    S = np.array(found.support, dtype=int)
    free = rules.usable & (rules.joint == joint) & ~rules.conflict[:, S].any(axis=1)
    return _first(T, rules, _beside(S, np.flatnonzero(free)[:, None]))


def _exchanged(T: Array, rules: Rules, found: Found | None, joint: int) -> Found | None:
    """The support after all exchanges in a joint that lower the squares, the best one first."""
    while found is not None:
        S, tries = np.array(found.support, dtype=int), []
        for i in np.flatnonzero(rules.joint[S] == joint):
            rest = np.delete(S, i)
            free = rules.usable & (rules.joint == joint) & (np.arange(len(rules.joint)) != S[i])
            free &= ~rules.conflict[:, rest].any(axis=1)
            tries.append(_beside(rest, np.flatnonzero(free)[:, None]))
        better = _first(T, rules, np.concatenate(tries)) if tries else None
        if better is None or better.cost > found.cost - _GAIN * T[-1, -1]:
            break
        found = better
    return found


def searched(
    G: Array, rules: Rules, proposals: Sequence[tuple[int, ...]], sure: float
) -> tuple[int, ...]:
    """The support of all joints: joint by joint the one that `chosen` picks, until none changes.

    It begins with the largest proposal: what a joint does not need is seen best where the others
    have all they may need.
    """
    T = G.sum(0)
    now = max((one.support for one in plain(T, rules, proposals)), key=len)
    for _ in range(_SWEEPS):
        before = now
        for joint in np.unique(rules.joint):
            fixed = [i for i in now if rules.joint[i] != joint]
            parts = [[i for i in one if rules.joint[i] == joint] for one in proposals]
            found = path(T, rules, fixed, int(joint), parts)
            now = chosen(G, found, sure) if found else now
        if now == before:
            break
    return now


def left_out(G: Array, support: Sequence[int]) -> Array:
    """Squares (C,) of each cluster by the fit of all the others; G (C, M, M)."""
    if not support:
        return np.asarray(G[:, -1, -1])
    S = np.array(support)
    _, c = least(G.sum(0) - G, np.repeat(S[None], len(G), axis=0))
    H, g = G[:, S[:, None], S], G[:, S, -1]
    return np.asarray(
        G[:, -1, -1] + np.einsum("ci,cij,cj->c", c, H, c) - 2 * np.einsum("ci,ci->c", c, g)
    )


def chosen(G: Array, found: Sequence[Found], sure: float) -> tuple[int, ...]:
    """The smallest support that predicts left-out clusters as well as the best one does.

    As well: the mean ratio of their squares, by its logarithm, is one within `sure` of its standard
    errors over the clusters. Differences would leave the word to the few that move most.
    """
    G = G[np.einsum("cii->c", G) > 0]
    floor = _EXACT * np.maximum(G[:, -1, -1], G[:, -1, -1].mean())
    losses = [np.maximum(left_out(G, one.support), floor) for one in found]
    best = int(np.argmin([loss.sum() for loss in losses]))
    for one, loss in zip(found, losses, strict=True):
        worse = np.log(loss / losses[best])
        error = np.sqrt(worse.var(ddof=1) / len(worse)) if len(worse) > 1 else 0.0
        if worse.mean() <= sure * error or one is found[best]:
            return one.support
    return found[best].support
