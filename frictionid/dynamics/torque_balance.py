"""Torques that act on the joints, and the friction that keeps some of them from moving.

M a = f - A' Tf,   f = h + B u,   -low <= Tf <= high at rest

Friction acts at parts that slide with velocities A w: the joints, and parts that turn with several
of them. A part that sticks holds its A w. A law smoothed at w = 0 stands for a step there: of a
joint that slides in one direction it is evaluated on that side of its smoothing, at the joint's
speed or the least one at which the smoothing does not show.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, columns, inverse, like, namespace, solve, times
from frictionid.friction import Friction, Inputs, Law, Memory, at_rest
from frictionid.friction.coordinates import mobility, of_parts, onto_joints
from frictionid.friction.law import NUMERICAL_WIDTH, SHARP_WIDTH

from .state import Instant

SWEEPS = 50
SETTLED = 1e-12  # [N m]
_ROUNDING, _SHARED = 1e-14, 1e-12  # of the mobility of parts that hold each other
_WIDTHS = 5.0  # of a law's smoothing: beyond them it does not show


class Stiction(NamedTuple):
    """What friction does in a substep beyond the smooth law.

    direction : (..., n), sign of the velocity with which a joint slides; None where the law has no
        break-away level, and is left as it is
    sticking : (..., n), joints that are held at rest
    braking : (..., n) [N m], minimum braking torque with the sign of the velocity, zero for joints
        that are left to the law; None for sharp laws
    firm : (..., n), sticking joints that are far from break-away
    margin : (..., n) [N m], break-away margin of joints at rest: break-away level less the load

    All but `direction` are None where no joint is slow.
    """

    direction: Array | None
    sticking: Array | None = None
    braking: Array | None = None
    firm: Array | None = None
    margin: Array | None = None

    def rows(self, which: Array) -> "Stiction":
        """Stiction of some rows."""
        return Stiction(*(None if x is None else x[which] for x in self))


def friction_torque(
    friction: Friction, x: Inputs, memory: Memory, stiction: Stiction | None
) -> Array:
    """Friction torque (..., n) [N m] of sliding joints; None: of the smooth law."""
    if stiction is None:
        return friction.torque(x, memory)
    w = sliding_velocity(x.w, stiction.direction, least_sliding_speed(friction.law))
    law = sharpened(friction, stiction)
    return braked(law.torque(friction.theta, x._replace(w=w), memory), stiction.braking)


def sliding_velocity(w: Array, direction: Array | None, least: float) -> Array:
    """Velocities (..., n) of a law: in the direction, where there is one, at least at a speed."""
    if direction is None or least == 0.0:
        return w
    xp = namespace(w)
    beyond = direction * xp.maximum(direction * w, 0.0 * w + least)
    return xp.where(direction == 0.0, w, beyond)


def least_sliding_speed(law: Law) -> float:
    """Speed [rad/s] beyond which the law of a sliding joint is evaluated; 0: at any speed."""
    return 4.0 * _WIDTHS * SHARP_WIDTH if is_sharp(law) else _smoothing(law)


def _smoothing(law: Law) -> float:
    """Speed [rad/s] below which a law's smoothing shows; 0 where it is wide on purpose."""
    return _WIDTHS * law.width if law.width <= NUMERICAL_WIDTH else 0.0


def is_sharp(law: Law) -> bool:
    """Whether a law's smoothing only stands for a sharp step at w = 0, and is no part of physics.

    So is a narrow tanh; an arctangent shows at all speeds.
    """
    return law.shape == "tanh" and _smoothing(law) > 0.0


def sharpened(friction: Friction, stiction: Stiction) -> Law:
    """The law without smoothing, for joints that slide in a direction."""
    return friction.law if stiction.direction is None else friction.law.sharpened()


def braked(Tf: Array, least: Array | None) -> Array:
    """Friction torque (..., m) [N m], no less than the minimum braking torque."""
    if least is None:
        return Tf
    xp = namespace(Tf)
    at_least = xp.where(least < 0, xp.minimum(Tf, least), Tf)
    return xp.where(least > 0, xp.maximum(Tf, least), at_least)


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
    M, h = now.plant.dynamics(now.state.q, now.state.w)
    x = now.inputs
    side = 0.0 * x.w + 1.0
    law, theta, memory = now.friction.law, now.friction.theta, now.state.memory
    low, high = (law.limit(theta, x._replace(w=s * side), memory) for s in (-1.0, 1.0))
    Tf = friction_torque(now.friction, x, memory, stiction)
    return Balance(M, h + now.driven, Tf, low + 0.0 * Tf, high + 0.0 * Tf, now.turns)


def has_break_away(friction: Friction) -> bool:
    """Whether friction has a break-away level; bristles hold a joint in other ways."""
    theta = friction.theta[..., None, :, :]
    x = at_rest(like(np.ones((1, friction.n)), theta))
    return bool((friction.law.limit(theta, x, friction.law.start(theta, x)) > 0).any())


def constrained(M: Array, f: Array, sticking: Array, turns: Array | None = None) -> Array:
    """Solution of M a = f - A' T with A_k a = 0 for the parts k that stick, T = 0 for the others.

    M (..., n, n), f (..., n), sticking (..., m); turns (c, n) of coupled parts, as in `Balance`
    """
    if _any_part(sticking, turns):
        return times(inverse_of_free(M, sticking, turns), f)
    held, both = _held_joints(sticking, M)
    return solve(M * both + _diagonal(held), f * (1.0 - held))


def inverse_of_free(M: Array, held: Array | None, turns: Array | None = None) -> Array:
    """Inverse of M (..., n, n) of what is free, where joints and other parts are held (..., m).

    Rows and columns of joints that are held are zero.
    """
    if held is None:
        return inverse(M)
    joints, both = _held_joints(held, M)
    inner = inverse(M * both + _diagonal(joints)) * both
    if turns is None or not _any_part(held, turns):
        return inner
    return less_held(inner, turns, held[..., M.shape[-1] :])


def _any_part(held: Array, turns: Array | None) -> bool:
    """Whether a coupled part may be held; in a program (of type object) that is not known."""
    if turns is None:
        return False
    parts = held[..., turns.shape[-1] :]
    return parts.dtype == object or bool(parts.any())


def _held_joints(held: Array, M: Array) -> tuple[Array, Array]:
    """Ones for the joints that are held (..., n), and for pairs of joints that are free."""
    joints = namespace(M).astype(held[..., : M.shape[-1]], M.dtype)
    free = 1.0 - joints
    return joints, free[..., :, None] * free[..., None, :]


def less_held(inner: Array, turns: Array, sticking: Array) -> Array:
    """Mobility (..., n, n) of free joints, less that of coupled parts that stick (..., c).

    inner - inner C' (C inner C')^-1 C inner,   C = turns (c, n)
    """
    xp = namespace(inner)
    right, left = inner @ turns.T, turns @ inner
    W = turns @ right
    alone = xp.linalg.diagonal(W)
    on = xp.astype(sticking & (alone > 0.0), inner.dtype)  # not where all joints of a part stick
    # a little more than W: parts that hold each other share the torque
    W = W * on[..., :, None] * on[..., None, :] + _diagonal(1.0 - on + _ROUNDING * alone * on)
    return inner - right * on[..., None, :] @ xp.linalg.solve(W, left * on[..., :, None])


def _diagonal(x: Array) -> Array:
    n = x.shape[-1]
    return x[..., None] * like(_identity(n), x)


@cache
def _identity(n: int) -> Array:
    return np.eye(n)


_FEW = 2  # parts


def sticking_torque(now: Balance, candidates: Array) -> Array:
    """Friction (..., m) that keeps the candidates from accelerating, as far as its levels allow.

    For each candidate j, a_j = 0 or Tf_j at a level, where a = W (f - Tf) are accelerations of the
    parts and W = A M^-1 A'; f is zero at parts that are no joints. Projected Gauss-Seidel finds it,
    sweep after sweep, from the torques that hold all candidates; where the levels allow these, they
    are the answer [Stewart2000].
    """
    W, Tf = first_torque(now, candidates)
    for _ in range(SWEEPS):
        before, Tf = Tf, swept_torque(now, W, Tf, candidates)
        # NaN (a motion that has diverged) counts as settled, whatever the others do
        if not bool((namespace(Tf).abs(Tf - before) > SETTLED).any()):
            break
    return Tf


def first_torque(now: Balance, candidates: Array) -> tuple[Array, Array]:
    """Mobility W (..., m, m) of the parts, and torques (..., m) to begin sweeps with."""
    xp, W = namespace(now.M), mobility(now.M, now.turns)
    if now.turns is None:
        a = constrained(now.M, now.f - now.friction, candidates)
        everything = now.f - times(now.M, a)
    else:
        everything = _holding(W, of_parts(now.f, 0.0 * now.turns), now.friction, candidates)
    clipped = xp.minimum(xp.maximum(everything, -now.low), now.high)
    return W, xp.where(candidates, clipped, now.friction)


def swept_torque(now: Balance, W: Array, Tf: Array, candidates: Array) -> Array:
    """Torques (..., m) after one sweep: for each part Tf_j <- clip(Tf_j + a_j / W_jj, levels)."""
    xp, m = namespace(Tf), Tf.shape[-1]
    f = now.f if now.turns is None else of_parts(now.f, 0.0 * now.turns)
    if m > _FEW and type(Tf) is np.ndarray:
        return _swept_in_place(now, W, f, np.array(Tf), candidates)
    parts = [Tf[..., j] for j in range(m)]
    for j in range(m):
        a = sum(W[..., j, i] * (f[..., i] - parts[i]) for i in range(m))
        held = xp.maximum(parts[j] + a / W[..., j, j], -now.low[..., j])
        held = xp.minimum(held, now.high[..., j])
        parts[j] = xp.where(candidates[..., j], held, parts[j])
    return columns(xp, *parts)


def _swept_in_place(now: Balance, W: Array, f: Array, Tf: Array, candidates: Array) -> Array:
    """`swept_torque` in a third of the time for arms; tensors and traces take no assignments."""
    for j in range(Tf.shape[-1]):
        a = (W[..., j, :] * (f - Tf)).sum(axis=-1)
        held = np.maximum(Tf[..., j] + a / W[..., j, j], -now.low[..., j])
        held = np.minimum(held, now.high[..., j])
        Tf[..., j] = np.where(candidates[..., j], held, Tf[..., j])
    return Tf


def _holding(W: Array, f: Array, friction: Array, candidates: Array) -> Array:
    """Friction (..., m) that holds all candidates; those that hold each other share the load."""
    on = namespace(W).astype(candidates, W.dtype)
    sliding = friction * (1.0 - on)
    shared = _SHARED * namespace(W).linalg.diagonal(W) * on
    both = W * on[..., :, None] * on[..., None, :] + _diagonal(1.0 - on + shared)
    return sliding + solve(both, times(W, f - sliding) * on)
