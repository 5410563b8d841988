"""One-step scores: the velocity error one sample ahead, on held-out rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.data.joint_scales import norm_of
from frictionid.evaluation.score_frame import Score, summarise
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction import Friction, Law, along, along_own


def held_out_residual(friction: Friction, problem: Problem, use: Array, fold: Array) -> Array:
    """Residuals (k, n) [rad/s] of some rows, each by the friction that has not seen it.

    friction : batch of F frictions; use : (K,) true for the k rows; fold : (k,) friction of each.
    """
    rows = np.flatnonzero(use)
    whole = problem.of_rows(rows)
    owner = np.zeros(len(whole.nodes.first) - 1, dtype=int)
    owner[whole.recording] = fold
    undivided = (owner[whole.recording] == fold).all()
    if undivided and friction.law.has_memory and type(friction.law).relaxation is Law.relaxation:
        return whole.residual(along_own(friction[owner], whole.nodes))
    out = np.empty((len(rows), problem.r.shape[-1]))
    for f in np.unique(fold):
        own = problem.of_rows(rows[fold == f])
        out[fold == f] = own.residual(along(friction[int(f)], own.nodes))
    return out


def one_step_scores(
    residual: Array,
    fold: Array,
    score: str,
    velocity_units: Sequence[str] = (),
    sizes: Array | None = None,
) -> Iterator[Score]:
    """Scores of the 2-norm over the joints of residuals (K, n): each fold's, and all pooled.

    velocity_units : of each joint, all "rad/s" where there are none
    sizes : (n,) of the joints, see `joint_scales`
    """
    n = residual.shape[-1]
    units = tuple(velocity_units) or ("rad/s",) * n
    norm, unit = norm_of(residual, units, np.ones(n) if sizes is None else sizes)
    of = Score("all", score, unit=unit)
    for f in np.unique(fold):
        yield from summarise(norm[fold == f], of._replace(fold=str(f)))
    yield from summarise(norm, of)
    for j, own in enumerate(units):
        yield from summarise(np.abs(residual[:, j]), of._replace(joint=str(j + 1), unit=own))
