"""Harmonics of cogging and ripple by evidence, joint by joint and fold by fold.

The torque of each row, see `regressor.torques`, is regressed on what there may be anyway (friction
of any shape over the speed, an offset, gravity and inertia that are off) and on cos(k gear q) and
sin(k gear q) of the candidates k; of ripple times the direction. Candidates come in one by one,
that first which explains most, and change places with others. How many there are held-out motion
says: with each cluster of rows left out, they are sought again, and the smallest number is taken
that predicts these clusters as well as the best one, but for scatter between the clusters.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import stdtrit

from frictionid.arrays import Array
from frictionid.friction import Groups, Law
from frictionid.friction.laws import NoFriction, Ripple, Sum
from frictionid.friction.laws.combined import CombinedLaw
from frictionid.friction.laws.position_torques import AUTO, Periodic

from ..one_step.balances import SHAPES
from ..one_step.linearised import clusters, grams
from ..one_step.residual import Problem
from .active_sets import best_fits, first_as_good, held_out_costs, unit_columns
from .regressor import torques

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
