"""The physics step: one place for what happens between two samples.

    M(q) dw/dt = h(q, w) + B u - Tf

integrated by RK4 on the smooth friction law, in substeps that its slope needs. A smoothed law
cannot hold a joint at rest: it creeps under load, or chatters. So friction *grips* slow joints:
those with a load below the break-away level feel that level as long as they move, stop where their
velocity crosses zero (the projection keeps the momentum of the free joints, so it never adds
energy), and then rest with w = 0 exactly, as constraints, until their load exceeds the level. The
loads of joints that stick together are found by projected Gauss-Seidel [Stewart2000].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, inverse, namespace, plain, solve, times
from frictionid.errors import InputError
from frictionid.friction import Friction, Inputs, Memory, at_rest
from frictionid.mechanics import Plant

_SLOW = 0.1  # [rad/s], five widths of the laws: below it their smoothing shows
_SWEEPS = 50
_SETTLED = 1e-12  # [N m]
_STABLE = 2.0  # RK4 is stable up to 2.78 / rate
_LONGEST = 0.005  # [s], resolves 30 rad/s of motion to 1e-7 rad per substep
_FINE = 0.00035  # [s], near rest: joints lose some 0.03 rad/s in it
_MARGIN = 1.2  # accelerations grow towards rest, by the Stribeck peak
_FASTEST = 2e5  # [1/s], 1700 substeps in a sample of 1/60 s


class Pace(NamedTuple):
    """How a step is divided: into pieces, and those that come near rest into fine substeps."""

    pieces: int
    fine: int


class State(NamedTuple):
    """State of a machine: q (..., n) [rad], w (..., n) [rad/s] and the friction's memory."""

    q: Array
    w: Array
    memory: Memory = ()


def step(
    plant: Plant, friction: Friction, state: State, u: Array, dt: Array, substeps: int
) -> State:
    """State after dt under held motor torques u, by RK4 and the grip at rest.

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
    >>> raised = State(np.array([0.4]), np.array([0.0]))       # gravity 0.076, break-away 0.1 N m
    >>> step(plant, tf, raised, np.zeros(1), np.array([1.0]), 200).q
    array([0.4])
    """
    part = dt / substeps
    for _ in range(substeps):
        state = substep(plant, friction, state, u, part)[0]
    return state


def stride(
    plant: Plant, friction: Friction, state: State, u: Array, dt: Array, pace: Pace
) -> State:
    """State after dt in some pieces, refined only for the rows that come near rest in a piece."""
    part = dt / pace.pieces
    for _ in range(pace.pieces):
        near = near_rest(plant, friction, state, u, part)
        if not bool(near.any()):
            state = substep(plant, friction, state, u, part)[0]
        elif bool(near.all()):
            state = step(plant, friction, state, u, part, pace.fine)
        else:
            fine = step(*rows(near, plant, friction, state, u, part), pace.fine)
            coarse = substep(*rows(~near, plant, friction, state, u, part))[0]
            state = _joined(near, fine, coarse, state)
    return state


def near_rest(plant: Plant, friction: Friction, state: State, u: Array, dt: Array) -> Array:
    """Rows (...) in which a joint is slow, or will be within dt, unless it is held all the time."""
    xp = namespace(state.w)
    a = acceleration(plant, friction, state, u)
    speed = xp.abs(state.w)
    brakes = (state.w * a < 0) & (speed < _MARGIN * xp.abs(a) * dt + _SLOW)
    near = brakes | (speed <= _SLOW)
    held = grip(plant, friction, state, u) if bool((speed <= _SLOW).any()) else None
    return (near if held is None else near & ~held.held).any(-1)


def _divisible(plant: Plant, friction: Friction, state: State, u: Array) -> bool:
    """Whether there are rows, and the state has the batch axes of all that takes part."""
    batch = state.q.shape[:-1]
    axes = (plant.p.shape[:-1], friction.theta.shape[:-2], u.shape[:-1])
    return bool(batch) and np.broadcast_shapes(batch, *axes) == tuple(batch)


def rows(
    which: Array, plant: Plant, friction: Friction, state: State, u: Array, dt: Array
) -> tuple[Plant, Friction, State, Array, Array]:
    """Those rows of all that takes part in a step, which (...) true or false."""
    xp, shape = namespace(state.q), tuple(state.q.shape[:-1])

    def some(x: Array, tail: int) -> Array:
        batch = tuple(x.shape[: x.ndim - tail])
        if not batch or set(batch) == {1}:
            return xp.reshape(x, x.shape[x.ndim - tail :])
        return xp.broadcast_to(x, (*shape, *x.shape[x.ndim - tail :]))[which]

    physical = {name: some(xp.asarray(v), 0) for name, v in plant.parameters.items()}
    return (
        replace(plant, parameters=physical, p=some(plant.p, 1)),
        replace(friction, theta=some(friction.theta, 2)),
        State(state.q[which], state.w[which], tuple(some(z, 1) for z in state.memory)),
        some(u, 1),
        some(dt, 1),
    )


def _joined(which: Array, yes: State, no: State, like: State) -> State:
    xp = namespace(like.q)

    def one(y: Array, n: Array, x: Array) -> Array:
        out = xp.asarray(xp.broadcast_to(x, (*which.shape, x.shape[-1])), copy=True)
        out[which], out[~which] = y, n
        return out

    memory = zip(yes.memory, no.memory, like.memory, strict=True)
    return State(one(yes.q, no.q, like.q), one(yes.w, no.w, like.w), tuple(one(*z) for z in memory))


def substep(
    plant: Plant, friction: Friction, state: State, u: Array, dt: Array
) -> tuple[State, Grip | None]:
    """State after one substep, and the grip of friction in it."""
    held = grip(plant, friction, state, u)
    memory = advanced(plant, friction, state, u, dt / 2)

    def accelerate(q: Array, w: Array) -> Array:
        return acceleration(plant, friction, State(q, w, memory), u, held)

    q, w = rk4(accelerate, state.q, state.w, dt)
    memory = advanced(plant, friction, State(q, w, memory), u, dt / 2)
    return _stop(plant, friction, state, State(q, w, memory), u, dt, held), held


class Grip(NamedTuple):
    """What friction does beyond the smooth law: joints held at rest, and the least it brakes with.

    held (..., n), true or false; brakes (..., n) [N m] has the sign of the velocity, and is zero
    for joints that are left to the smooth law.
    """

    held: Array
    brakes: Array


def rk4(
    accelerate: Callable[[Array, Array], Array], q: Array, w: Array, dt: Array
) -> tuple[Array, Array]:
    """Angles and velocities after dt by the Runge-Kutta method of order 4, dw/dt = accelerate."""
    a1 = accelerate(q, w)
    w2 = w + dt / 2 * a1
    a2 = accelerate(q + dt / 2 * w, w2)
    w3 = w + dt / 2 * a2
    a3 = accelerate(q + dt / 2 * w2, w3)
    w4 = w + dt * a3
    a4 = accelerate(q + dt * w3, w4)
    return q + dt / 6 * (w + 2 * w2 + 2 * w3 + w4), w + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


def acceleration(
    plant: Plant, friction: Friction, state: State, u: Array, grip: Grip | None = None
) -> Array:
    """Joint accelerations dw/dt (..., n) [rad/s^2]."""
    M, h = plant.dynamics(state.q, state.w)
    f = h + driven(plant, u)
    Tf = friction.torque(inputs(plant, friction, state, u), state.memory)
    return solve(M, f - Tf) if grip is None else constrained(M, f - braked(Tf, grip), grip.held)


def braked(Tf: Array, grip: Grip) -> Array:
    """Friction torque (..., n) [N m], on gripped joints no less than the break-away level."""
    xp = namespace(Tf)
    most = xp.where(grip.brakes < 0, xp.minimum(Tf, grip.brakes), Tf)
    return xp.where(grip.brakes > 0, xp.maximum(Tf, grip.brakes), most)


def inputs(plant: Plant, friction: Friction, state: State, u: Array) -> Inputs:
    """What friction may depend on at a state; the bearing load only for laws that use it."""
    load = plant.load(state.q, state.w, u) if friction.law.uses_load else 0.0 * state.w
    return Inputs(state.q, state.w, u, load)


def driven(plant: Plant, u: Array) -> Array:
    """Torques B u (..., n) [N m]: those of joints that have a motor."""
    xp = namespace(u)
    driven = [float(d) for d in plant.mechanism.description.driven]
    return u * xp.asarray(driven, dtype=u.dtype)


def constrained(M: Array, f: Array, held: Array) -> Array:
    """Solution of M a = f for the free joints, with a = 0 for the held ones."""
    xp = namespace(M)
    free = 1.0 - xp.astype(held, M.dtype)
    both = free[..., :, None] * free[..., None, :]
    return solve(M * both + _diagonal(1.0 - free), f * free)


def _diagonal(x: Array) -> Array:
    xp = namespace(x)
    return x[..., None] * xp.eye(x.shape[-1], dtype=x.dtype)


def advanced(plant: Plant, friction: Friction, state: State, u: Array, dt: Array) -> Memory:
    """Memory after dt at a state, for laws whose memory advances with each substep."""
    law = friction.law
    if not state.memory or law.sample_time is not None:
        return state.memory
    return law.advance(friction.theta, inputs(plant, friction, state, u), state.memory, dt)


def grip(plant: Plant, friction: Friction, state: State, u: Array) -> Grip | None:
    """Grip of friction on joints that are slow or at rest (w = 0 exactly), None where none is.

    Slow joints whose load is below break-away feel that level: under the smoothed law they would
    creep where the two balance, at 1.5 widths under 0.9 of the level. Joints at rest are held
    while their load is below it.
    """
    xp = namespace(state.w)
    slow = xp.abs(state.w) <= _SLOW
    some = slow.any(-1)
    if not bool(some.any()):
        return None
    if _divisible(plant, friction, state, u) and not bool(some.all()):
        inner = grip(*rows(some, plant, friction, state, u, u)[:4])
        return _scattered(some, inner, state.w)
    now = balance(plant, friction, state, u)
    held = _below_break_away(now, slow)
    resting = state.w == 0.0
    level = xp.where(state.w > 0, now.high, -now.low)
    found = Grip(held & resting, xp.where(held & ~resting, level, 0.0 * level))
    if not bool(resting.any()) or not bool((held & ~resting).any()):
        return found
    # a joint at rest feels that the others still slide
    now = now._replace(sliding=braked(now.sliding, found))
    return found._replace(held=_below_break_away(now, resting))


def _scattered(which: Array, inner: Grip | None, like: Array) -> Grip | None:
    """Grip of all rows from that of some."""
    if inner is None:
        return None
    xp = namespace(like)
    held, brakes = xp.zeros_like(like) > 0, xp.zeros_like(like)
    held[which], brakes[which] = inner
    return Grip(held, brakes)


class Landing(NamedTuple):
    """Joints that come to rest in a substep: which stop, which stand still after it, and M there.

    stops, still (k, n), true or false; M (k, n, n); of the k rows (...) that are true in `rows`.
    """

    stops: Array
    still: Array
    M: Array
    rows: Array


def landing(
    plant: Plant, friction: Friction, before: State, after: State, u: Array, held: Grip | None
) -> Landing | None:
    """Joints that crossed w = 0 in a substep under a load below break-away, None where none did."""
    xp = namespace(after.w)
    crossed = (before.w != 0.0) & (before.w * after.w <= 0.0)
    if not bool(crossed.any()):
        return None
    some = crossed.any(-1)
    if _divisible(plant, friction, after, u) and not bool(some.all()):
        old = State(before.q[some], before.w[some])
        part = None if held is None else Grip(held.held[some], held.brakes[some])
        plant, friction, after, u, _ = rows(some, plant, friction, after, u, u)
        found = landing(plant, friction, old, after, u, part)
        return None if found is None else found._replace(rows=some)
    now = balance(plant, friction, after, u)
    resting = xp.zeros_like(crossed)
    if held is not None:
        now, resting = now._replace(sliding=braked(now.sliding, held)), held.held
    stops = crossed & _below_break_away(now, crossed | resting)
    return Landing(stops, stops | resting, now.M, xp.ones_like(some)) if bool(stops.any()) else None


def _stop(
    plant: Plant,
    friction: Friction,
    before: State,
    after: State,
    u: Array,
    dt: Array,
    held: Grip | None,
) -> State:
    """State with w = 0 for the joints that land, their angle that of the crossing.

    Behind it friction would have pushed them back. Joints at rest or stopping take any impulse, the
    others keep their momentum.
    """
    stop = landing(plant, friction, before, after, u, held)
    if stop is None:
        return after
    xp, at, stops = namespace(after.w), stop.rows, stop.stops
    w0, w1 = before.w[at], after.w[at]
    share = w0 / xp.where(stops, w0 - w1, 1.0)  # of the substep, until it stops
    span = xp.broadcast_to(dt, after.w.shape)[at]
    stopped = before.q[at] + share * span / 2 * w0
    w = constrained(stop.M, times(stop.M, w1), stop.still)
    q_all, w_all = (xp.asarray(x, copy=True) for x in (after.q, after.w))
    q_all[at] = xp.where(stops, stopped, after.q[at])
    w_all[at] = xp.where(stops.any(-1)[..., None], w, w1)
    return State(q_all, w_all, after.memory)


class Balance(NamedTuple):
    """What acts on the joints: M, f = h + B u, friction while sliding, and break-away levels."""

    M: Array
    f: Array
    sliding: Array
    low: Array
    high: Array


def balance(plant: Plant, friction: Friction, state: State, u: Array) -> Balance:
    """Torques at a state; `low` and `high` limit negative and positive friction, both positive."""
    M, h = plant.dynamics(state.q, state.w)
    x = inputs(plant, friction, state, u)
    one = 0.0 * state.w + 1.0
    law, theta, memory = friction.law, friction.theta, state.memory
    low, high = (law.limit(theta, x._replace(w=s * one), memory) for s in (-1.0, 1.0))
    smooth = friction.torque(x, state.memory)
    return Balance(M, h + driven(plant, u), smooth, low + 0.0 * smooth, high + 0.0 * smooth)


def _below_break_away(now: Balance, candidates: Array) -> Array:
    """Which of the candidates friction can keep from accelerating, shape (..., n).

    Projected Gauss-Seidel on a_j = 0 with -low <= Tf_j <= high. It starts from the torques that
    hold all candidates: where the levels allow these, they are the answer.
    """
    M, f, sliding, low, high = now
    xp = namespace(M)
    A = inverse(M)
    holding = f - times(M, constrained(M, f - sliding, candidates))
    clipped = xp.minimum(xp.maximum(holding, -low), high)
    Tf = xp.where(candidates, clipped, sliding)
    columns = [Tf[..., j] for j in range(M.shape[-1])]
    for _ in range(_SWEEPS):
        moved = False
        for j in range(len(columns)):
            a = sum(A[..., j, i] * (f[..., i] - columns[i]) for i in range(len(columns)))
            wanted = xp.maximum(columns[j] + a / A[..., j, j], -low[..., j])
            wanted = xp.minimum(wanted, high[..., j])
            new = xp.where(candidates[..., j], wanted, columns[j])
            # NaN (a motion that has diverged) counts as settled, whatever the others do
            moved = moved or bool((xp.abs(new - columns[j]) > _SETTLED).any())
            columns[j] = new
        if not moved:
            break
    Tf = xp.stack(columns, axis=-1)
    return candidates & (Tf > -low) & (Tf < high)


def euler_step(plant: Plant, friction: Friction, state: State, u: Array, dt: Array) -> State:
    """State after dt by explicit Euler, q' = q + w dt: the study's step, kept for comparison."""
    a = acceleration(plant, friction, state, u)
    memory = advanced(plant, friction, state, u, dt)
    return State(state.q + dt * state.w, state.w + dt * a, memory)


def semi_implicit_step(
    plant: Plant, friction: Friction, state: State, u: Array, dt: Array
) -> State:
    """State after dt by semi-implicit Euler, q' = q + w' dt: what backward differences imply."""
    a = acceleration(plant, friction, state, u)
    memory = advanced(plant, friction, state, u, dt)
    w = state.w + dt * a
    return State(state.q + dt * w, w, memory)


def substeps(plant: Plant, friction: Friction, dt: float) -> int:
    """Substeps that RK4 needs in dt [s]: law slope times largest eigenvalue of 1/M sets them.

    Raises
    ------
    InputError
        When the law is so steep that no reasonable number of substeps resolves it.
    """
    rate = stiffness(plant, friction)
    count = int(np.ceil(max(dt / _LONGEST, dt * rate / _STABLE, 1.0)))
    if rate > _FASTEST:
        raise InputError(
            f"{friction.law}: slopes of {slopes(friction)} N m s/rad slow a joint down within "
            f"{1 / rate:.1g} s and need {count} substeps in {dt:.3g} s: widen the law's "
            "smoothing, or check its parameters"
        )
    return count


def pace_of(plant: Plant, friction: Friction, dt: float) -> Pace:
    """Pieces of a step of dt [s], and their substeps near rest.

    Where friction can hold a joint, its slope through w = 0 is no matter of stability: a joint
    under too little load is gripped there, one under more passes through. It is for laws with a
    bristle, whose break-away level is zero.

    Raises
    ------
    InputError
        When the law is so steep that no reasonable number of substeps resolves it.
    """
    substeps(plant, friction, dt)
    away = stiffness(plant, friction, _SLOW)
    pieces = int(np.ceil(max(dt / _LONGEST, dt * away / _STABLE, 1.0)))
    near = away if _holds(friction) else stiffness(plant, friction)
    part = dt / pieces
    return Pace(pieces, int(np.ceil(max(part / _FINE, part * near / _STABLE, 1.0))))


def _holds(friction: Friction) -> bool:
    theta = friction.theta[..., None, :, :]
    x = at_rest(namespace(theta).asarray(np.ones((1, friction.n)), dtype=theta.dtype))
    return bool((plain(friction.law.limit(theta, x, friction.law.start(theta, x))) > 0).any())


def stiffness(plant: Plant, friction: Friction, beyond: float = 0.0) -> float:
    """Fastest rate [1/s] at which friction slows a joint: largest eigenvalue of M^-1 dTf/dw.

    The worst case over a grid of configurations and over the batches of plant and friction, at
    speeds `beyond` some [rad/s].
    """
    grid = np.linspace(-np.pi, np.pi, 9)
    q = np.stack(np.meshgrid(*[grid] * plant.n, indexing="ij"), axis=-1).reshape(-1, plant.n)
    p = np.unique(plain(plant.p).reshape(-1, plant.p.shape[-1]), axis=0)
    A = inverse(plant.mechanism.inertia(p[:, None], q))
    root = np.sqrt(slopes(friction, beyond))
    return float(np.linalg.eigvalsh(root[:, None] * A * root).max())


def slopes(friction: Friction, beyond: float = 0.0) -> Array:
    """Largest slope dTf/dw of each joint over all batches, or zero, shape (n,) [N m s/rad].

    At speeds `beyond` some [rad/s].
    """
    w = np.concatenate([[0.0], np.logspace(-4, 1.5, 45)])
    w = w[w >= beyond]
    theta = friction.theta[..., None, :, :]
    grid = np.repeat(np.concatenate([-w[::-1], w])[:, None], friction.n, axis=1)
    columns = namespace(theta).asarray(grid, dtype=theta.dtype)
    width = 1e-5

    def torque(w: Array) -> Array:
        x = at_rest(w)
        return plain(friction.law.torque(theta, x, friction.law.start(theta, x)))

    rise = (torque(columns + width) - torque(columns - width)) / (2 * width)
    return np.maximum(rise.reshape(-1, friction.n).max(axis=0), 0.0)
