"""Where a fit starts: for each joint one of the starts that its law suggests."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import along
from frictionid.identifiers.box_qp import bounded
from frictionid.identifiers.linearised import Rows

_RIDGE = 1e-12
_SWEEPS = 2


def best_initial_guess(rows: Rows, weights: Array) -> tuple[Array, Array]:
    """The starts (F, N) with the lowest cost one linear step away, and the parameters there (F, N).

    The law is linearised once at each of its starts. Which joint takes which start is then a choice
    among columns of one Gram matrix per fold.

    Raises
    ------
    InputError
        Where a joint slides in fewer rows of a fold than it has parameters.
    """
    n, P = rows.joints, len(rows.law.names)
    S = len(rows.law.initial)
    starts = np.repeat(np.reshape(rows.law.initial, (S, 1, P)), n, axis=1)
    slopes = rows.slopes(starts.reshape(S, n * P))  # (S, K, n, n, P)
    rows.check(slopes, rows.problem.r)
    check_rows(rows, weights, np.abs(slopes).max(axis=(0, 2, 4), initial=0.0) > 0)
    columns = np.concatenate([slopes, _without_slopes(rows, starts)[..., None]], axis=-1)
    columns = np.moveaxis(columns, 0, 2).reshape(rows.problem.r.size, -1)
    columns = np.column_stack([columns, rows.problem.r.ravel()])
    used = np.flatnonzero(columns.any(axis=0))
    table = columns[:, used]
    begin, end = np.empty((2, len(weights), n * P))
    for f, weight in enumerate(np.repeat(weights, n, axis=1)):
        gram = np.zeros((columns.shape[1],) * 2)
        gram[np.ix_(used, used)] = (table.T * weight) @ table
        choice, end[f] = _chosen(gram, starts, rows.bounds)
        begin[f] = starts[choice, np.arange(n)].ravel()
    return begin, end


def _without_slopes(rows: Rows, starts: Array) -> Array:
    """-G_j Tf_j at the starts, shape (S, K, n, n): what r becomes the residual by."""
    friction = rows.friction(starts)
    torque = rows.problem.mean(along(friction, rows.problem.nodes))
    return -rows.problem.G * torque[:, :, None, :]


def _chosen(gram: Array, starts: Array, bounds: tuple[Array, Array]) -> tuple[Array, Array]:
    """Choice (n,) and parameters (N,) for one fold: all joints alike, then one after the other."""
    S, n, _ = starts.shape
    choice, theta = _best(gram, starts, bounds, np.repeat(np.arange(S)[:, None], n, axis=1))
    for j in list(range(n)) * (_SWEEPS if n > 1 else 0):
        choices = np.repeat(choice[None], S, axis=0)
        choices[:, j] = np.arange(S)
        choice, theta = _best(gram, starts, bounds, choices)
    return choice, theta


def _best(
    gram: Array, starts: Array, bounds: tuple[Array, Array], choices: Array
) -> tuple[Array, Array]:
    """The best of some choices (C, n) of starts, and the parameters (N,) after its step."""
    joints = np.arange(choices.shape[1])
    index = np.arange(len(gram) - 1).reshape(*starts.shape[:2], -1)[choices, joints]
    slopes = index[..., :-1].reshape(len(choices), -1)
    rest = np.insert(index[..., -1], 0, len(gram) - 1, axis=1)  # they add up to the residual
    H = gram[slopes[:, :, None], slopes[:, None, :]]
    g = gram[slopes[:, :, None], rest[:, None, :]].sum(-1)
    cost = gram[rest[:, :, None], rest[:, None, :]].sum((-1, -2))
    start = starts[choices, joints].reshape(slopes.shape)
    eased = H * (1 + _RIDGE * np.eye(H.shape[-1]))
    move = bounded(eased, g, bounds[0] - start, bounds[1] - start)
    cost = cost - 2 * (g * move).sum(-1) + np.einsum("ci,cij,cj->c", move, H, move)
    best = int(np.argmin(cost))
    return choices[best], np.clip(start + move, *bounds)[best]


def check_rows(rows: Rows, weights: Array, slides: Array) -> None:
    """Refuse folds in which a joint slides in too few rows; slides (K, n) says where it does.

    Raises
    ------
    InputError
        Naming the fold and the joint.
    """
    counts = (weights > 0).astype(float) @ slides
    P = len(rows.law.names)
    if (counts < P).any():
        f, j = np.argwhere(counts < P)[0]
        raise InputError(
            f"joint {j + 1} slides in {counts[f, j]:.0f} rows of fold {f}, too few for the {P} "
            f"parameters of {rows.law}: give recordings in which it moves, or use fewer folds"
        )
