"""Torques that act on the joints, and the friction that keeps some of them from moving.

M a = f - Tf,   f = h + B u,   -low <= Tf <= high at rest
"""

from __future__ import annotations

from typing import NamedTuple

from frictionid.arrays import Array, inverse, namespace, solve, times
from frictionid.dynamics.sliding_friction import Stiction, friction_torque
from frictionid.dynamics.state import Instant, driven
from frictionid.friction import Friction, at_rest

_SWEEPS = 50
_SETTLED = 1e-12  # [N m]


class Balance(NamedTuple):
    """Inertia M (..., n, n), torques f = h + B u and `friction` of sliding joints (..., n) [N m].

    low, high : break-away levels of negative and of positive friction, both positive
    """

    M: Array
    f: Array
    friction: Array
    low: Array
    high: Array

    def below_break_away(self, Tf: Array) -> Array:
        """Where a friction torque (..., n) is within its break-away levels."""
        return (Tf > -self.low) & (Tf < self.high)


def balance(now: Instant, stiction: Stiction | None) -> Balance:
    """Torques at an instant."""
    plant, friction, state, u = now
    M, h = plant.dynamics(state.q, state.w)
    x, one = now.inputs, 0.0 * state.w + 1.0
    law, theta, memory = friction.law, friction.theta, state.memory
    low, high = (law.limit(theta, x._replace(w=s * one), memory) for s in (-1.0, 1.0))
    Tf = friction_torque(friction, x, memory, stiction)
    return Balance(M, h + driven(plant, u), Tf, low + 0.0 * Tf, high + 0.0 * Tf)


def has_break_away(friction: Friction) -> bool:
    """Whether friction has a break-away level; bristles hold a joint in other ways."""
    theta = friction.theta[..., None, :, :]
    x = at_rest(namespace(theta).ones((1, friction.n), dtype=theta.dtype))
    return bool((friction.law.limit(theta, x, friction.law.start(theta, x)) > 0).any())


def constrained(M: Array, f: Array, sticking: Array) -> Array:
    """Solution of M a = f for the free joints, with a = 0 for the sticking ones."""
    xp = namespace(M)
    free = 1.0 - xp.astype(sticking, M.dtype)
    both = free[..., :, None] * free[..., None, :]
    return solve(M * both + _diagonal(1.0 - free), f * free)


def _diagonal(x: Array) -> Array:
    xp = namespace(x)
    return x[..., None] * xp.eye(x.shape[-1], dtype=x.dtype)


def sticking_torque(now: Balance, candidates: Array) -> Array:
    """Friction (..., n) that keeps the candidates from accelerating, as far as its levels allow.

    For each candidate j, a_j = 0 or Tf_j at a level, where a = A (f - Tf) and A = M^-1. Projected
    Gauss-Seidel finds it: joint after joint,

        Tf_j <- clip(Tf_j + a_j / A_jj, -low_j, high_j)

    from the torques that hold all candidates; where the levels allow these, they are the answer
    [Stewart2000].
    """
    xp, A, n = namespace(now.M), inverse(now.M), now.M.shape[-1]
    f, low, high = now.f, now.low, now.high
    everything = f - times(now.M, constrained(now.M, f - now.friction, candidates))
    clipped = xp.minimum(xp.maximum(everything, -low), high)
    first = xp.where(candidates, clipped, now.friction)
    Tf = [first[..., j] for j in range(n)]
    for _ in range(_SWEEPS):
        moved = False
        for j in range(n):
            a = sum(A[..., j, i] * (f[..., i] - Tf[i]) for i in range(n))
            wanted = xp.maximum(Tf[j] + a / A[..., j, j], -low[..., j])
            wanted = xp.minimum(wanted, high[..., j])
            new = xp.where(candidates[..., j], wanted, Tf[j])
            # NaN (a motion that has diverged) counts as settled, whatever the others do
            moved = moved or bool((xp.abs(new - Tf[j]) > _SETTLED).any())
            Tf[j] = new
        if not moved:
            break
    return xp.stack(Tf, axis=-1)
