"""How derivatives of a motion change where a joint crosses w = 0."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.tangent.tangent import Tangent, inverse_of_free, rows_of_parts
from frictionid.dynamics.zero_crossing import Crossing
from frictionid.friction.coordinates import of_parts

_GRAZE = 0.1  # of a slow speed


def cross_tangent(
    tangent: Tangent, start: list[Array], w0: Array, crossing: Crossing, h: Array, slow: Array
) -> None:
    """Change the derivatives of the rows that cross w = 0 in a substep, in place.

    A joint that stops keeps the derivative of its angle and hands its momentum on. Of a joint that
    passes, friction switches its side earlier or later: dw changes by kick dt, where t = h w1/(w1 -
    w0) is the time since the crossing.

    start : derivatives of w before the substep; w0 : (k, n) velocities before it; h : (k,) length
    slow : (m,) speeds of parts near rest
    """
    n, rows, turns = len(tangent.q), crossing.rows, crossing.turns
    w0, w1 = of_parts(w0, turns), of_parts(crossing.w, turns)
    angle, end = [q[:, rows] for q in tangent.q], [w[:, rows] for w in tangent.w]
    for j in range(n):
        angle[j] -= np.where(crossing.stops[:, j], h / 2, 0.0) * end[j]
    if crossing.passes.any():
        later = np.zeros_like(end[0])
        before, after = rows_of_parts(start, turns), rows_of_parts(end, turns)
        for j in range(w1.shape[-1]):
            # minus the derivative of the time since the crossing; bounded where w = 0 is just met
            gap = np.maximum((w0[:, j] - w1[:, j]) ** 2, (_GRAZE * slow[j]) ** 2)
            part = np.where(crossing.passes[:, j], h / gap, 0.0)
            later += part * (w0[:, j] * after[j] - w1[:, j] * before[j])
        for i in range(n):
            end[i] = end[i] - crossing.jump[:, i] * later
    if crossing.stops.any():
        free = inverse_of_free(crossing.M, crossing.sticking, turns)
        kept = (free[..., None] * crossing.M[:, None]).sum(-2)
        some = np.asarray(crossing.stops.any(-1))
        kept = np.where(some[:, None, None], kept, np.eye(n))
        end = [np.asarray(sum(kept[:, i, j] * end[j] for j in range(n))) for i in range(n)]
    for i in range(n):
        tangent.q[i][:, rows], tangent.w[i][:, rows] = angle[i], end[i]
