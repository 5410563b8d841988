"""Torques that act on the joints, and the friction that keeps some of them from moving.

M a = f - A' Tf,   f = h + B u,   -low <= Tf <= high at rest

Friction acts at parts that slide with velocities A w: the joints, and parts that turn with several
of them. A part that sticks holds its A w.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, columns, inverse, like, namespace, solve, times
from frictionid.dynamics.sliding_friction import Stiction, friction_torque
from frictionid.dynamics.state import Instant, driven
from frictionid.friction import Friction, at_rest
from frictionid.friction.coordinates import mobility, of_parts, onto_joints, turns_of

_SWEEPS = 50
_SETTLED = 1e-12  # [N m]
_ROUNDING, _SHARED = 1e-14, 1e-12  # of the mobility of parts that hold each other


class Balance(NamedTuple):
    """Inertia M (..., n, n), torques f = h + B u (..., n), `friction` of sliding parts (..., m).

    low, high : (..., m), break-away levels of negative and of positive friction, both positive
    turns : (c, n), of the coupled parts for one of each joint; None where all parts are joints
    """

    M: Array
    f: Array
    friction: Array
    low: Array
    high: Array
    turns: Array | None = None

    def left(self, Tf: Array) -> Array:
        """Torques f - A' Tf (..., n) [N m] that friction (..., m) leaves to the joints."""
        return self.f - onto_joints(Tf, self.turns)

    def below_break_away(self, Tf: Array) -> Array:
        """Where a friction torque (..., m) is within its break-away levels."""
        return (Tf > -self.low) & (Tf < self.high)


def balance(now: Instant, stiction: Stiction | None) -> Balance:
    """Torques at an instant."""
    plant, friction, state, u = now
    M, h = plant.dynamics(state.q, state.w)
    x = now.inputs
    one = 0.0 * x.w + 1.0
    law, theta, memory = friction.law, friction.theta, state.memory
    low, high = (law.limit(theta, x._replace(w=s * one), memory) for s in (-1.0, 1.0))
    Tf = friction_torque(friction, x, memory, stiction)
    turns = turns_of(plant.mechanism, state.w)
    return Balance(M, h + driven(plant, u), Tf, low + 0.0 * Tf, high + 0.0 * Tf, turns)


def has_break_away(friction: Friction) -> bool:
    """Whether friction has a break-away level; bristles hold a joint in other ways."""
    theta = friction.theta[..., None, :, :]
    x = at_rest(like(np.ones((1, friction.n)), theta))
    return bool((friction.law.limit(theta, x, friction.law.start(theta, x)) > 0).any())


def constrained(M: Array, f: Array, sticking: Array, turns: Array | None = None) -> Array:
    """Solution of M a = f - A' T with A_k a = 0 for the parts k that stick, T = 0 for the others.

    M (..., n, n), f (..., n), sticking (..., m); turns (c, n) of coupled parts, as in `Balance`
    """
    xp, n = namespace(M), M.shape[-1]
    held = xp.astype(sticking[..., :n], M.dtype)
    free = 1.0 - held
    both = free[..., :, None] * free[..., None, :]
    inner = M * both + _diagonal(held)
    if turns is None or not bool(sticking[..., n:].any()):
        return solve(inner, f * free)
    return times(less_held(inverse(inner) * both, turns, sticking[..., n:]), f)


def less_held(inner: Array, turns: Array, sticking: Array) -> Array:
    """Mobility (..., n, n) of free joints, less that of coupled parts that stick (..., c).

    inner - inner C' (C inner C')^-1 C inner,   C = turns (c, n)
    """
    xp = namespace(inner)
    right, left = inner @ turns.T, turns @ inner
    W = turns @ right
    own = xp.linalg.diagonal(W)
    on = xp.astype(sticking & (own > 0.0), inner.dtype)  # not where all joints of a part stick
    # a little more than W: parts that hold each other share the torque
    W = W * on[..., :, None] * on[..., None, :] + _diagonal(1.0 - on + _ROUNDING * own * on)
    return inner - right * on[..., None, :] @ xp.linalg.solve(W, left * on[..., :, None])


def _diagonal(x: Array) -> Array:
    n = x.shape[-1]
    return x[..., None] * like(_identity(n), x)


@cache
def _identity(n: int) -> Array:
    return np.eye(n)


def sticking_torque(now: Balance, candidates: Array) -> Array:
    """Friction (..., m) that keeps the candidates from accelerating, as far as its levels allow.

    For each candidate j, a_j = 0 or Tf_j at a level, where a = W (f - Tf) are accelerations of the
    parts and W = A M^-1 A'; f is zero at parts that are no joints. Projected Gauss-Seidel finds it:
    part after part,

        Tf_j <- clip(Tf_j + a_j / W_jj, -low_j, high_j)

    from the torques that hold all candidates; where the levels allow these, they are the answer
    [Stewart2000].
    """
    xp, W, n = namespace(now.M), mobility(now.M, now.turns), now.friction.shape[-1]
    low, high = now.low, now.high
    if now.turns is None:
        f = now.f
        everything = f - times(now.M, constrained(now.M, f - now.friction, candidates))
    else:
        f = of_parts(now.f, 0.0 * now.turns)
        everything = _holding(W, f, now.friction, candidates)
    clipped = xp.minimum(xp.maximum(everything, -low), high)
    first = xp.where(candidates, clipped, now.friction)
    Tf = [first[..., j] for j in range(n)]
    for _ in range(_SWEEPS):
        moved = False
        for j in range(n):
            a = sum(W[..., j, i] * (f[..., i] - Tf[i]) for i in range(n))
            wanted = xp.maximum(Tf[j] + a / W[..., j, j], -low[..., j])
            wanted = xp.minimum(wanted, high[..., j])
            new = xp.where(candidates[..., j], wanted, Tf[j])
            # NaN (a motion that has diverged) counts as settled, whatever the others do
            moved = moved or bool((xp.abs(new - Tf[j]) > _SETTLED).any())
            Tf[j] = new
        if not moved:
            break
    return columns(xp, *Tf)


def _holding(W: Array, f: Array, friction: Array, candidates: Array) -> Array:
    """Friction (..., m) that holds all candidates; those that hold each other share the load."""
    on = namespace(W).astype(candidates, W.dtype)
    sliding = friction * (1.0 - on)
    more = _SHARED * namespace(W).linalg.diagonal(W) * on
    both = W * on[..., :, None] * on[..., None, :] + _diagonal(1.0 - on + more)
    return sliding + solve(both, times(W, f - sliding) * on)
