"""The physics step: one place for what happens between two samples.

    M(q) dw/dt = h(q, w) + B u - Tf

integrated by RK4 on the smooth friction law, in substeps that its slope needs. A smoothed law cannot
hold a joint at rest: it creeps under load, or chatters. So each substep ends with the *hold*: joints
about to stop under a load below the break-away level get w = 0 exactly (the projection keeps the
momentum of the free joints, so it never adds energy), and joints at rest stay there, as constraints,
until their load exceeds that level. The loads of joints that stick together are found by projected
Gauss-Seidel [Stewart2000].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, inverse, namespace, solve, times
from frictionid.errors import InputError
from frictionid.friction import Friction, Inputs, Memory, at_rest
from frictionid.mechanics import Plant

_SWEEPS = 50
_STABLE = 2.0  # RK4 is stable up to 2.78 / rate
_LONGEST = 0.005  # [s], resolves 30 rad/s of motion to 1e-7 rad per substep
_MOST = 2000


class State(NamedTuple):
    """State of a machine: q (..., n) [rad], w (..., n) [rad/s] and the friction's memory."""

    q: Array
    w: Array
    memory: Memory = ()


def step(plant: Plant, friction: Friction, state: State, u: Array, dt: Array, substeps: int) -> State:
    """State after dt under held motor torques u, by RK4 and the hold.

    Parameters
    ----------
    plant, friction
        Their batch axes, and those of state, u and dt, broadcast against each other.
    state : State, arrays of shape (..., n)
    u : array, shape (..., n) [N m]
    dt : array, shape (..., 1) [s]
    substeps : int

    Examples
    --------
    >>> from frictionid.laws import CoulombViscous
    >>> from frictionid.mechanics import pendulum
    >>> plant = Plant.of(pendulum(), {"mass": 0.1, "length": 0.2})
    >>> tf = Friction(CoulombViscous(), np.array([[0.1, 0.0]]))
    >>> raised = State(np.array([0.4]), np.array([0.0]))       # gravity 0.076 N m, break-away 0.1 N m
    >>> step(plant, tf, raised, np.zeros(1), np.array([1.0]), 200).q
    array([0.4])
    """
    part = dt / substeps
    for _ in range(substeps):
        state = _substep(plant, friction, state, u, part)
    return state


def _substep(plant: Plant, friction: Friction, state: State, u: Array, dt: Array) -> State:
    held = _held(plant, friction, state, u)
    memory = _advanced(plant, friction, state, u, dt / 2)
    q, w = _rk4(plant, friction, State(state.q, state.w, memory), u, dt, held)
    memory = _advanced(plant, friction, State(q, w, memory), u, dt / 2)
    return _stop(plant, friction, state.w, State(q, w, memory), u, dt)


def _rk4(
    plant: Plant, friction: Friction, state: State, u: Array, dt: Array, held: Array | None
) -> tuple[Array, Array]:
    q, w, memory = state
    a1 = acceleration(plant, friction, state, u, held)
    w2 = w + dt / 2 * a1
    a2 = acceleration(plant, friction, State(q + dt / 2 * w, w2, memory), u, held)
    w3 = w + dt / 2 * a2
    a3 = acceleration(plant, friction, State(q + dt / 2 * w2, w3, memory), u, held)
    w4 = w + dt * a3
    a4 = acceleration(plant, friction, State(q + dt * w3, w4, memory), u, held)
    return q + dt / 6 * (w + 2 * w2 + 2 * w3 + w4), w + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


def acceleration(
    plant: Plant, friction: Friction, state: State, u: Array, held: Array | None = None
) -> Array:
    """Joint accelerations dw/dt (..., n) [rad/s^2]; joints where `held` is true do not move."""
    M, h = plant.dynamics(state.q, state.w)
    driven = _driven(plant, u)
    f = h + driven - friction.torque(inputs(plant, friction, state, u), state.memory)
    return solve(M, f) if held is None else _constrained(M, f, held)


def inputs(plant: Plant, friction: Friction, state: State, u: Array) -> Inputs:
    """What friction may depend on at a state; the bearing load only for laws that use it."""
    load = plant.load(state.q, state.w, u) if friction.law.uses_load else 0.0 * state.w
    return Inputs(state.q, state.w, u, load)


def _driven(plant: Plant, u: Array) -> Array:
    xp = namespace(u)
    return u * xp.asarray(np.diag(plant.mechanism.B), dtype=u.dtype)


def _constrained(M: Array, f: Array, held: Array) -> Array:
    """Solution of M a = f for the free joints, with a = 0 for the held ones."""
    xp = namespace(M)
    free = 1.0 - xp.astype(held, M.dtype)
    both = free[..., :, None] * free[..., None, :]
    return solve(M * both + _diagonal(1.0 - free), f * free)


def _diagonal(x: Array) -> Array:
    xp = namespace(x)
    return x[..., None] * xp.eye(x.shape[-1], dtype=x.dtype)


def _advanced(plant: Plant, friction: Friction, state: State, u: Array, dt: Array) -> Memory:
    law = friction.law
    if not state.memory or law.sample_time is not None:
        return state.memory
    return law.advance(friction.theta, inputs(plant, friction, state, u), state.memory, dt)


def _held(plant: Plant, friction: Friction, state: State, u: Array) -> Array | None:
    """Joints at rest (w = 0 exactly) whose load is below break-away, or None where none rests."""
    resting = state.w == 0.0
    if not bool(resting.any()):
        return None
    return _below_break_away(plant, friction, state, u, resting)[0]


def _stop(
    plant: Plant, friction: Friction, before: Array, state: State, u: Array, dt: Array
) -> State:
    """State with w = 0 for the joints that friction stops within this substep and then holds.

    A joint stops when it crosses zero, or when friction beyond its load would bring it to rest in
    less than another substep: without that it would creep at a fraction of the law's width.
    """
    xp = namespace(state.w)
    M, h = plant.dynamics(state.q, state.w)
    A = inverse(M)
    ease = xp.linalg.diagonal(A) * dt
    low, high = _limits(plant, friction, state, u)
    reach = ease * xp.maximum(low, high)
    moving = before != 0.0
    near = moving & ((before * state.w <= 0.0) | (xp.abs(state.w) <= reach))
    if not bool(near.any()):
        return state
    stuck, Tf = _below_break_away(plant, friction, state, u, near, (A, h, low, high))
    spare = xp.where(state.w > 0, high - Tf, Tf + low)
    stops = stuck & ((before * state.w <= 0.0) | (xp.abs(state.w) <= ease * spare))
    free = 1.0 - xp.astype(stops, M.dtype)
    both = free[..., :, None] * free[..., None, :]
    w = solve(M * both + _diagonal(1.0 - free), free * times(M, state.w)) * free
    return State(state.q, xp.where(stops.any(-1)[..., None], w, state.w), state.memory)


def _limits(plant: Plant, friction: Friction, state: State, u: Array) -> tuple[Array, Array]:
    """Break-away levels against negative and positive impending motion, both positive."""
    x = inputs(plant, friction, state, u)
    one = 0.0 * state.w + 1.0
    limit = friction.law.limit
    return limit(friction.theta, x._replace(w=-one)), limit(friction.theta, x._replace(w=one))


def _below_break_away(
    plant: Plant,
    friction: Friction,
    state: State,
    u: Array,
    candidates: Array,
    known: tuple[Array, Array, Array, Array] | None = None,
) -> tuple[Array, Array]:
    """Which candidates friction can keep from accelerating, and the friction torques that do.

    Projected Gauss-Seidel on a_j = 0 with -low <= Tf_j <= high; the other joints' friction is that
    of the smooth law. One candidate needs one sweep, coupled ones converge geometrically.
    """
    xp = namespace(state.w)
    if known is None:
        M, h = plant.dynamics(state.q, state.w)
        known = (inverse(M), h, *_limits(plant, friction, state, u))
    A, h, low, high = known
    smooth = friction.torque(inputs(plant, friction, state, u), state.memory)
    Tf = xp.where(candidates, 0.0 * (smooth + low), smooth + 0.0 * low)
    f = h + _driven(plant, u)
    columns = [Tf[..., j] + 0.0 * f[..., j] for j in range(plant.n)]
    for _ in range(_SWEEPS):
        change = 0.0
        for j in range(plant.n):
            others = sum(A[..., j, i] * (f[..., i] - columns[i]) for i in range(plant.n))
            wanted = xp.maximum(columns[j] + others / A[..., j, j], -low[..., j])
            wanted = xp.minimum(wanted, high[..., j])
            new = xp.where(candidates[..., j], wanted, columns[j])
            change = max(change, float(xp.abs(new - columns[j]).max()))
            columns[j] = new
        if change < 1e-12:
            break
    Tf = xp.stack(columns, axis=-1)
    return candidates & (Tf > -low) & (Tf < high), Tf


def euler_step(plant: Plant, friction: Friction, state: State, u: Array, dt: Array) -> State:
    """State after dt by explicit Euler, q' = q + w dt: the study's step, kept for comparison."""
    a = acceleration(plant, friction, state, u)
    memory = _advanced(plant, friction, state, u, dt)
    return State(state.q + dt * state.w, state.w + dt * a, memory)


def semi_implicit_step(
    plant: Plant, friction: Friction, state: State, u: Array, dt: Array
) -> State:
    """State after dt by semi-implicit Euler, q' = q + w' dt, the step that backward differences imply."""
    a = acceleration(plant, friction, state, u)
    memory = _advanced(plant, friction, state, u, dt)
    w = state.w + dt * a
    return State(state.q + dt * w, w, memory)


def substeps(plant: Plant, friction: Friction, dt: float) -> int:
    """Substeps that RK4 needs for steps of at most dt [s]: law slope times largest eigenvalue of 1/M.

    Raises
    ------
    InputError
        When the law is so steep that no reasonable number of substeps resolves it.
    """
    rate = stiffness(plant, friction)
    count = int(np.ceil(max(dt / _LONGEST, dt * rate / _STABLE, 1.0)))
    if count > _MOST:
        raise InputError(
            f"{friction.law}: slopes of {slopes(friction)} N m s/rad need {count} substeps in "
            f"{dt:.3g} s (at most {_MOST}): widen the law's smoothing, or check its parameters"
        )
    return count


def stiffness(plant: Plant, friction: Friction) -> float:
    """Fastest rate [1/s] at which friction slows a joint: largest eigenvalue of M^-1 dTf/dw.

    The worst case over a grid of configurations and over the batches of plant and friction.
    """
    grid = np.linspace(-np.pi, np.pi, 9)
    q = np.stack(np.meshgrid(*[grid] * plant.n, indexing="ij"), axis=-1).reshape(-1, plant.n)
    p = np.unique(np.asarray(plant.p).reshape(-1, plant.p.shape[-1]), axis=0)
    A = inverse(plant.mechanism.inertia(p[:, None], q))
    root = np.sqrt(slopes(friction))
    return float(np.linalg.eigvalsh(root[:, None] * A * root).max())


def slopes(friction: Friction) -> Array:
    """Largest slope dTf/dw of each joint over all batches, at least zero, shape (n,) [N m s/rad]."""
    w = np.concatenate([[0.0], np.logspace(-4, 1.5, 45)])
    columns = np.repeat(np.concatenate([-w[::-1], w])[:, None], friction.n, axis=1)
    theta = friction.theta[..., None, :, :]
    width = 1e-5

    def torque(w: Array) -> Array:
        x = at_rest(w)
        return np.asarray(friction.law.torque(theta, x, friction.law.start(theta, x)))

    rise = (torque(columns + width) - torque(columns - width)) / (2 * width)
    return np.maximum(rise.reshape(-1, friction.n).max(axis=0), 0.0)
