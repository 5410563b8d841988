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

_SLOW = 0.1  # [rad/s]: slower joints may come to rest
_WIDTHS = 5.0  # of a law's smoothing: beyond them it does not show
_SWEEPS = 50
_SETTLED = 1e-12  # [N m]
_STABLE = 2.0  # RK4 is stable up to 2.78 / rate
_LONGEST = 0.005  # [s], resolves 30 rad/s of motion to 1e-7 rad per substep
_FINE = 0.0007  # [s], near rest: joints lose some 0.05 rad/s in it
_FIRM = 0.9  # of the break-away level: joints held by more may break away within a piece
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
    held = grip(plant, friction, state, u)
    a = acceleration(plant, friction, state, u, held)
    speed = xp.abs(state.w)
    brakes = (state.w * a < 0) & (speed < _MARGIN * xp.abs(a) * dt + _SLOW)
    near = brakes | (speed <= _SLOW)
    return (near if held.firm is None else near & ~held.firm).any(-1)


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

    physical = plant.parameters  # only bearing loads need them
    if friction.law.uses_load:
        physical = {name: some(xp.asarray(v), 0) for name, v in physical.items()}
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
        out = 1.0 * xp.broadcast_to(x, (*which.shape, x.shape[-1]))
        out[which], out[~which] = y, n
        return out

    memory = zip(yes.memory, no.memory, like.memory, strict=True)
    return State(one(yes.q, no.q, like.q), one(yes.w, no.w, like.w), tuple(one(*z) for z in memory))


def substep(
    plant: Plant, friction: Friction, state: State, u: Array, dt: Array
) -> tuple[State, Grip, Crossing | None]:
    """State after one substep, the grip of friction in it, and what joints crossed w = 0."""
    held = grip(plant, friction, state, u)
    memory = advanced(plant, friction, state, u, dt / 2)

    def accelerate(q: Array, w: Array) -> Array:
        return acceleration(plant, friction, State(q, w, memory), u, held)

    q, w = rk4(accelerate, state.q, state.w, dt)
    memory = advanced(plant, friction, State(q, w, memory), u, dt / 2)
    after = State(q, w, memory)
    crossing = _crossing(plant, friction, state, after, u, held)
    return after if crossing is None else _beyond(crossing, state, after, dt), held, crossing


class Grip(NamedTuple):
    """What friction does beyond the smooth law.

    side (..., n): which way a joint slides in a substep, so that a law smoothed at w = 0 is sharp
    there; None for laws that have no break-away level. held (..., n): joints at rest. brakes
    (..., n) [N m]: the least that friction brakes with, with the sign of the velocity, zero for
    joints that are left to the law. firm (..., n): held well below the break-away level. All None
    where no joint is slow.
    """

    side: Array | None
    held: Array | None = None
    brakes: Array | None = None
    firm: Array | None = None

    def take(self, which: Array) -> Grip:
        """That of some rows."""
        return Grip(*(None if x is None else x[which] for x in self))


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
    Tf = resistance(friction, inputs(plant, friction, state, u), state.memory, grip)
    if grip is None or grip.held is None:
        return solve(M, f - Tf)
    return constrained(M, f - Tf, grip.held)


def resistance(friction: Friction, x: Inputs, memory: Memory, grip: Grip | None) -> Array:
    """Friction torque (..., n) [N m] of joints that slide to their side, or are gripped."""
    if grip is None:
        return friction.torque(x, memory)
    return braked(friction.torque(x._replace(w=sliding(friction, x.w, grip)), memory), grip)


def sliding(friction: Friction, w: Array, grip: Grip) -> Array:
    """Velocities (..., n) at which the law is asked: beyond its smoothing, to the joint's side."""
    least = _smoothing(friction)
    if grip.side is None or least == 0.0:
        return w
    xp = namespace(w)
    beyond = grip.side * xp.maximum(grip.side * w, 0.0 * w + least)
    return xp.where(grip.side == 0.0, w, beyond)


def _smoothing(friction: Friction) -> float:
    """Speed [rad/s] below which a law's smoothing shows; 0 where it is wide on purpose."""
    reach = _WIDTHS * float(getattr(friction.law, "width", _SLOW / _WIDTHS))
    return reach if reach <= _SLOW * (1 + 1e-9) else 0.0


def braked(Tf: Array, grip: Grip) -> Array:
    """Friction torque (..., n) [N m], on gripped joints no less than the break-away level."""
    if grip.brakes is None:
        return Tf
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


def grip(plant: Plant, friction: Friction, state: State, u: Array) -> Grip:
    """Grip of friction on joints, above all on those that are slow or at rest (w = 0 exactly).

    Slow joints whose load is below break-away feel that level: under the smoothed law they would
    creep where the two balance, at 1.5 widths under 0.9 of the level. Joints at rest are held
    while their load is below it.
    """
    xp = namespace(state.w)
    if not _holds(friction):
        return Grip(None)
    side, some = xp.sign(state.w), (xp.abs(state.w) <= _SLOW).any(-1)
    if not bool(some.any()):
        return Grip(side)
    if not _divisible(plant, friction, state, u) or bool(some.all()):
        return _grip(plant, friction, state, u)
    inner = _grip(*rows(some, plant, friction, state, u, u)[:4])
    held, brakes = xp.zeros_like(state.w) > 0, xp.zeros_like(state.w)
    side, firm = 1.0 * side, xp.zeros_like(state.w) > 0
    side[some], held[some], brakes[some], firm[some] = inner
    return Grip(side, held, brakes, firm)


def _grip(plant: Plant, friction: Friction, state: State, u: Array) -> Grip:
    xp = namespace(state.w)
    now = balance(plant, friction, state, u, None)
    slow, resting = xp.abs(state.w) <= _SLOW, state.w == 0.0
    Tf = _holding(now, slow)
    below = slow & _within(Tf, now)
    level = xp.where(state.w > 0, now.high, -now.low)
    brakes = xp.where(below & ~resting, level, 0.0 * level)
    if bool(resting.any()) and bool((below & ~resting).any()):
        # a joint at rest feels that the others still slide
        now = now._replace(sliding=braked(now.sliding, Grip(None, None, brakes)))
        Tf = _holding(now, resting)
        below = resting & _within(Tf, now)
    # a joint that breaks away slides against the friction that could not hold it
    side = xp.where(resting, xp.sign(Tf), xp.sign(state.w))
    firm = (Tf > -_FIRM * now.low) & (Tf < _FIRM * now.high)
    return Grip(side, below & resting, brakes, below & resting & firm)


class Crossing(NamedTuple):
    """Joints that crossed w = 0 in a substep, of the k rows (...) that are true in `rows`.

    stops, passes (k, n): those that come to rest there, and those that slide on to the other side;
    still (k, n): all at rest after it. share (k, n): of the substep, before the crossing. kick
    (k, n) [rad/s^2]: by how much friction of the other side accelerates. M (k, n, n); w (k, n):
    velocities as if nothing had happened.
    """

    rows: Array
    stops: Array
    passes: Array
    still: Array
    share: Array
    kick: Array
    M: Array
    w: Array


def _crossing(
    plant: Plant, friction: Friction, before: State, after: State, u: Array, held: Grip
) -> Crossing | None:
    """Joints that crossed w = 0; under a load below break-away they come to rest."""
    if held.side is None:
        return None
    xp = namespace(after.w)
    crossed = held.side * after.w < 0.0
    some = crossed.any(-1)
    if not bool(some.any()):
        return None
    if _divisible(plant, friction, after, u) and not bool(some.all()):
        old, part, at = State(before.q[some], before.w[some]), held.take(some), crossed[some]
        plant, friction, after, u, _ = rows(some, plant, friction, after, u, u)
        return _crossed(plant, friction, old, after, u, part, at)._replace(rows=some)
    return _crossed(plant, friction, before, after, u, held, crossed)._replace(
        rows=xp.zeros_like(some) == xp.zeros_like(some)
    )


def _crossed(
    plant: Plant,
    friction: Friction,
    before: State,
    after: State,
    u: Array,
    held: Grip,
    crossed: Array,
) -> Crossing:
    xp = namespace(after.w)
    now = balance(plant, friction, after, u, held)
    resting = xp.zeros_like(crossed) if held.held is None else held.held
    stops = crossed & _within(_holding(now, crossed | resting), now)
    passes = crossed & ~stops
    x = inputs(plant, friction, after, u)
    other = resistance(friction, x, after.memory, Grip(-held.side))  # type: ignore[operator]
    gain = xp.where(passes, now.sliding - other, 0.0 * other)
    still = stops | resting
    kick = constrained(now.M, gain, still)
    share = before.w / xp.where(crossed, before.w - after.w, 1.0)
    return Crossing(crossed, stops, passes, still, share, kick, now.M, after.w)


def _beyond(crossing: Crossing, before: State, after: State, dt: Array) -> State:
    """State behind a crossing.

    Joints that stop have w = 0 and the angle of the crossing, behind it friction would have pushed
    them back; they take any impulse, the others keep their momentum. Joints that pass have felt the
    friction of the other side since.
    """
    xp, at = namespace(after.w), crossing.rows
    span = xp.broadcast_to(dt, after.w.shape)[at]
    since = xp.where(crossing.passes, (1.0 - crossing.share) * span, 0.0 * span)
    since = xp.max(since, axis=-1)[..., None]
    w = crossing.w + crossing.kick * since
    w = constrained(crossing.M, times(crossing.M, w), crossing.still)
    some = crossing.stops.any(-1)[..., None]
    w = xp.where(some, w, crossing.w + crossing.kick * since)
    stopped = before.q[at] + crossing.share * span / 2 * before.w[at]
    slid = after.q[at] + crossing.kick * since**2 / 2
    q_all, w_all = (1.0 * x for x in (after.q, after.w))
    q_all[at] = xp.where(crossing.stops, stopped, slid)
    w_all[at] = w
    return State(q_all, w_all, after.memory)


class Balance(NamedTuple):
    """What acts on the joints: M, f = h + B u, friction while sliding, and break-away levels."""

    M: Array
    f: Array
    sliding: Array
    low: Array
    high: Array


def balance(plant: Plant, friction: Friction, state: State, u: Array, held: Grip | None) -> Balance:
    """Torques at a state; `low` and `high` limit negative and positive friction, both positive."""
    M, h = plant.dynamics(state.q, state.w)
    x = inputs(plant, friction, state, u)
    one = 0.0 * state.w + 1.0
    law, theta, memory = friction.law, friction.theta, state.memory
    low, high = (law.limit(theta, x._replace(w=s * one), memory) for s in (-1.0, 1.0))
    Tf = resistance(friction, x, memory, held)
    return Balance(M, h + driven(plant, u), Tf, low + 0.0 * Tf, high + 0.0 * Tf)


def _holding(now: Balance, candidates: Array) -> Array:
    """Friction (..., n) that keeps the candidates from accelerating, as far as its levels allow.

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
    return xp.stack(columns, axis=-1)


def _within(Tf: Array, now: Balance) -> Array:
    """Where friction is within its levels."""
    return (Tf > -now.low) & (Tf < now.high)


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


def pace_of(plant: Plant, friction: Friction, dt: float, *, longest: float = _LONGEST) -> Pace:
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
    pieces = int(np.ceil(max(dt / longest, dt * away / _STABLE, 1.0)))
    near = away if _holds(friction) else stiffness(plant, friction)
    part = dt / pieces
    return Pace(pieces, int(np.ceil(max(part / _FINE, part * near / _STABLE, 1.0))))


def _holds(friction: Friction) -> bool:
    """Whether friction has a break-away level; bristles hold a joint in other ways."""
    theta = friction.theta[..., None, :, :]
    x = at_rest(namespace(theta).ones((1, friction.n), dtype=theta.dtype))
    return bool((friction.law.limit(theta, x, friction.law.start(theta, x)) > 0).any())


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
