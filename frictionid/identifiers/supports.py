"""Which candidates belong to friction: supports that fit well, and the one that predicts best.

All of it happens on Gram matrices with columns of length one (see `grams`), so that the number of
rows costs nothing. Candidates with a velocity of their own (signs, peaks) look alike where these
velocities are neighbours; of such a family one member at the most is chosen.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array

_RIDGE = 1e-11
_GAIN = 1e-10  # of the squares, below which an exchange is rounding


class Rules(NamedTuple):
    """What supports may be: of each column (N,) its family, whether it is positive, or usable."""

    family: Array
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
    """Support (s,) of coefficients (N,): of each family the largest, none that would drive."""
    size = np.where(rules.positive, coefficients, np.abs(coefficients)) * rules.usable
    order = [int(i) for i in np.argsort(-size, kind="stable") if size[i] > 0]
    kept: dict[int, int] = {}
    for i in order:
        kept.setdefault(int(rules.family[i]), i)
    support = sorted(kept.values())
    while support:
        c = least(T, np.array([support]))[1][0]
        wrong = np.where(rules.positive[support], c, 1.0)
        if wrong.min() > 0:
            break
        support.pop(int(np.argmin(wrong)))
    return tuple(support)


def path(
    T: Array, rules: Rules, proposals: Iterable[Sequence[int]], most: int, exchange: bool = True
) -> list[Found]:
    """The best support found of each size, from small to large, at most `most` columns each.

    It begins at the proposals. With `exchange`, one column at a time gives way to another as long
    as that lowers the squares, and supports of every size are tried, from the next smaller one.
    """
    best: dict[int, Found] = {0: Found(float(T[-1, -1]), ())}

    def keep(found: Found | None) -> bool:
        if found is None or len(found.support) > most:
            return False
        size = len(found.support)
        better = size not in best or found.cost < best[size].cost
        if better:
            best[size] = found
        return better

    for support in dict.fromkeys(map(tuple, proposals)):
        begin = _first(T, rules, np.array([support])) if support else None
        keep(_exchanged(T, rules, begin) if exchange else begin)
    for size in range(most if exchange else 0):
        if size not in best:
            break
        grown = _grown(T, rules, best[size])
        if grown is None:
            break
        keep(_exchanged(T, rules, grown))
    return [best[size] for size in sorted(best)]


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


def _grown(T: Array, rules: Rules, found: Found) -> Found | None:
    """The best support with one column more."""
    S = np.array(found.support, dtype=int)
    more = np.flatnonzero(rules.usable & ~np.isin(rules.family, rules.family[S]))
    return _first(T, rules, np.concatenate([np.tile(S, (len(more), 1)), more[:, None]], axis=1))


def _exchanged(T: Array, rules: Rules, found: Found | None) -> Found | None:
    """The support after all exchanges that lower the squares, the best one first."""
    while found is not None:
        S = np.array(found.support, dtype=int)
        tries = []
        for i in range(len(S)):
            rest = np.delete(S, i)
            taken = np.isin(rules.family, rules.family[rest])
            new = np.flatnonzero(rules.usable & ~taken & (np.arange(len(taken)) != S[i]))
            tries.append(np.concatenate([np.tile(rest, (len(new), 1)), new[:, None]], axis=1))
        better = _first(T, rules, np.concatenate(tries))
        if better is None or better.cost > found.cost - _GAIN * T[-1, -1]:
            break
        found = better
    return found


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

    As well: the difference of their squares, summed over the clusters, is less than `sure` of its
    standard errors.
    """
    G = G[np.einsum("cii->c", G) > 0]
    losses = [left_out(G, one.support) for one in found]
    best = int(np.argmin([loss.sum() for loss in losses]))
    for one, loss in zip(found, losses, strict=True):
        worse = loss - losses[best]
        error = np.sqrt(len(worse) * worse.var(ddof=1)) if len(worse) > 1 else 0.0
        if worse.sum() <= sure * error or one is found[best]:
            return one.support
    return found[best].support
