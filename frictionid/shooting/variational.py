"""The physics step together with its sensitivities, for many intervals side by side.

The motion is that of `step.substep`, nothing else. Beside it travel derivatives of q and w in the
directions

    start q (n), start w (n), start memory, free friction, base parameters, torque directions

by the variational equation M da + (d(M a - h + Tf)/d(q, w, ...)) = 0, linearised in the middle of
each substep and integrated by the implicit midpoint rule in w: second order, and stable however
steep friction is. A joint that is held has no derivatives, one that comes to rest keeps that of its
angle, and hands its momentum on.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, inverse, solve, times
from frictionid.dynamics import step
from frictionid.dynamics.step import Crossing, State, Stiction
from frictionid.dynamics.stiction import braked, constrained, driven, inputs
from frictionid.friction import Friction, Memory
from frictionid.mechanics import Partials, Plant
from frictionid.shooting.law_derivatives import (
    SPEED,
    Free,
    Seen,
    Slopes,
    by_memory,
    by_theta,
    slopes,
)

_GRAZE = 0.01  # [rad/s]


class Forces(NamedTuple):
    """Motor torque of K intervals in S equal pieces, and its derivatives in E directions.

    u (S, K, n) [N m], by (S, E, K, n); moment (S, K, n) [N m s^2], that of the torque about the end
    of each piece beyond what its mean has, and moment_by (S, E, K, n). finer(rows, piece, parts):
    forces of some intervals in parts of a piece. Without these the torque is u throughout.
    """

    u: Array
    by: Array
    moment: Array | None = None
    moment_by: Array | None = None
    finer: Callable[[Array, int, int], Forces] | None = None

    def of(self, rows: Array, piece: int, parts: int) -> Forces:
        """Those of some intervals in equal parts of a piece."""
        if parts > 1 and self.finer is not None:
            return self.finer(rows, piece, parts)
        at = np.repeat(piece, parts)
        u, by = self.u[at][:, rows], self.by[at][:, :, rows]
        if parts > 1 or self.moment is None or self.moment_by is None:
            return Forces(u, by)
        return Forces(u, by, self.moment[at][:, rows], self.moment_by[at][:, :, rows])


class Ends(NamedTuple):
    """Ends of K intervals: q, w (K, n), memory, and their derivatives.

    by_start (K, s, s) and by_parameters (K, s, D - s), of all s = (2 + entries of the memory) n
    numbers of a state.
    """

    q: Array
    w: Array
    memory: Memory
    by_start: Array
    by_parameters: Array


class Scene(NamedTuple):
    """What the intervals share: plant (p for each of K), friction, what of it is free and seen.

    base : places of the free base parameters
    """

    plant: Plant
    friction: Friction
    free: Free
    base: tuple[int, ...]
    seen: Seen

    def take(self, rows: Array) -> Scene:
        """That of some rows; friction may have one entry for each, or one for all."""
        batch = np.ndim(self.friction.theta) > 2
        friction = self.friction[rows] if batch else self.friction
        return self._replace(plant=self.plant[rows], friction=friction)

    @property
    def directions(self) -> int:
        """Number of free friction and base parameters."""
        return len(self.free.joint) + len(self.base)


class _Tangent(NamedTuple):
    """Derivatives: q and w a (D, K) for each joint, memory (D, K) for each entry and joint."""

    q: list[Array]
    w: list[Array]
    memory: list[list[Array]]


def ends(scene: Scene, start: State, forces: Forces, dt: Array, fine: int) -> Ends:
    """Ends of intervals of length dt (K,) that start at states (K, n), with all derivatives.

    fine : substeps of a piece in which a joint comes near rest; other pieces are one substep
    """
    state, tangent = start, _begin(scene, start, forces.by.shape[1])
    part = (dt / len(forces.u))[:, None]
    for piece, u in enumerate(forces.u):
        near = step.near_rest(scene.plant, scene.friction, state, u, part)
        parts = []
        for rows, count in ((np.flatnonzero(~near), 1), (np.flatnonzero(near), fine)):
            if len(rows):
                here = State(state.q[rows], state.w[rows], tuple(z[rows] for z in state.memory))
                there = _taken(tangent, rows)
                own = forces.of(rows, piece, count)
                end = _piece(scene.take(rows), here, there, own, part[rows] / count)
                parts.append((rows, end, there))
        state = _put(state, tangent, parts)
    D = len(tangent.q[0])
    memory = [entry for rows in tangent.memory for entry in rows]
    matrix = np.stack([*tangent.q, *tangent.w, *memory]).transpose(2, 0, 1)
    size = matrix.shape[1]
    return Ends(state.q, state.w, state.memory, matrix[..., :size], matrix[..., size:D])


def _piece(scene: Scene, state: State, tangent: _Tangent, forces: Forces, dt: Array) -> State:
    """State after some substeps; the derivatives change in place."""
    for k, (u, by) in enumerate(zip(forces.u, forces.by, strict=True)):
        course = step.substep(scene.plant, scene.friction, state, u, dt)
        _carry(scene, tangent, state, course, u, by, dt)
        state = course[0]
        if forces.moment is not None and forces.moment_by is not None and forces.moment[k].any():
            state = _moved(scene, state, tangent, forces.moment[k], forces.moment_by[k])
    return state


def _moved(scene: Scene, state: State, tangent: _Tangent, moment: Array, moment_by: Array) -> State:
    """State with the way that a torque makes beyond its mean; the derivatives change in place."""
    n = len(tangent.q)
    resting = state.w == 0.0
    A = _inverse_of_free(scene.plant.mechanism.inertia(scene.plant.p, state.q), resting)
    first = len(tangent.q[0]) - len(moment_by)
    for i in range(n):
        for j in range(n):
            tangent.q[i][first:] += A[:, i, j] * moment_by[:, :, j]
    way = times(A, moment)
    if scene.base:
        # M way = moment, and M is linear in the base parameters
        p, mechanism, zero = scene.plant.p, scene.plant.mechanism, 0.0 * way
        inert, rest = (mechanism.partials(p, state.q, zero, a).by_p for a in (way, zero))
        for k, place in enumerate(scene.base, first - len(scene.base)):
            for i in range(n):
                tangent.q[i][k] -= (A[:, i] * (inert - rest)[..., place]).sum(-1)
    return state._replace(q=state.q + way)


def _taken(tangent: _Tangent, rows: Array) -> _Tangent:
    return _Tangent(
        [x[:, rows] for x in tangent.q],
        [x[:, rows] for x in tangent.w],
        [[x[:, rows] for x in entry] for entry in tangent.memory],
    )


def _put(state: State, tangent: _Tangent, parts: list[tuple[Array, State, _Tangent]]) -> State:
    """The state of all rows from those of its parts; the derivatives change in place."""
    q, w = np.empty_like(state.q), np.empty_like(state.w)
    memory = [np.empty_like(z) for z in state.memory]
    for rows, end, own in parts:
        q[rows], w[rows] = end.q, end.w
        for all_rows, some in zip(memory, end.memory, strict=True):
            all_rows[rows] = some
        pairs = [*zip(tangent.q, own.q, strict=True), *zip(tangent.w, own.w, strict=True)]
        for entry, part in zip(tangent.memory, own.memory, strict=True):
            pairs += zip(entry, part, strict=True)
        for all_rows, some in pairs:
            all_rows[:, rows] = some
    return State(q, w, tuple(memory))


def _begin(scene: Scene, start: State, torques: int) -> _Tangent:
    K, n = start.q.shape
    size = n * (2 + len(start.memory))
    D = size + scene.directions + torques
    rows = [np.zeros((D, K)) for _ in range(size)]
    for i, row in enumerate(rows):
        row[i] = 1.0
    memory = [rows[(2 + i) * n : (3 + i) * n] for i in range(len(start.memory))]
    return _Tangent(rows[:n], rows[n : 2 * n], memory)


def _carry(
    scene: Scene,
    tangent: _Tangent,
    before: State,
    course: tuple[State, Stiction, Crossing | None],
    u: Array,
    by: Array,
    dt: Array,
) -> None:
    """The derivatives, in place, from the begin to the end of a substep."""
    after, stiction, crossing = course
    middle = State(
        (before.q + after.q) / 2 + (before.w - after.w) * dt / 8,
        (before.w + after.w) / 2,
        tuple((a + b) / 2 for a, b in zip(before.memory, after.memory, strict=True)),
    )
    h, n = dt[:, 0], len(tangent.q)
    held = None if stiction.held is None or not stiction.held.any() else stiction.held
    if held is not None:
        for j in range(n):
            tangent.w[j] *= ~held[:, j]
    start = None if crossing is None else [w[:, crossing.rows] for w in tangent.w]
    rates = _memory_rates(scene, middle, u, dt / 2)
    _remember(scene, tangent, rates)
    M, of, torques = _linearised(scene, middle, u, stiction)
    # implicit in w: M da = -(... + by_w (dw + dt/2 da))
    A = _inverse_of_free(M + h[:, None, None] / 2 * torques.by_w, held)
    for j in range(n):
        tangent.q[j] += h / 2 * tangent.w[j]
    change = [_torque(scene, tangent, of, torques, by, i) for i in range(n)]
    out = np.empty_like(change[0])
    for i in range(n):
        for j in range(n):
            tangent.w[i] -= np.multiply(h * A[:, i, j], change[j], out=out)
        tangent.q[i] += np.multiply(h / 2, tangent.w[i], out=out)
    _remember(scene, tangent, rates)
    if crossing is not None and start is not None:
        _cross(tangent, start, before.w[crossing.rows], crossing, h[crossing.rows])


def _linearised(
    scene: Scene, middle: State, u: Array, stiction: Stiction
) -> tuple[Array, Slopes, Partials]:
    """M, the slopes of friction, and those of the torques M a - h + Tf in q, w and p."""
    M, h = scene.plant.dynamics(middle.q, middle.w)
    of = slopes(scene.plant, scene.friction, middle, u, scene.free, scene.seen, stiction)
    if stiction.minimum is not None:
        of = _gripped(scene, middle, u, stiction, of)
    force = h + driven(scene.plant, u) - of.torque
    a = solve(M, force) if stiction.held is None else constrained(M, force, stiction.held)
    by_q, by_w, by_p = scene.plant.mechanism.partials(scene.plant.p, middle.q, middle.w, a)
    return M, of, Partials(by_q if of.by_q is None else by_q + of.by_q, by_w + of.by_w, by_p)


def _torque(
    scene: Scene, tangent: _Tangent, of: Slopes, torques: Partials, by: Array, i: int
) -> Array:
    """Change (D, K) of the torque M a - h - B u + Tf that joint i needs, but for da."""
    n, nb = len(tangent.q), len(scene.base)
    theta = n * (2 + len(tangent.memory))
    p = theta + len(scene.free.joint)
    t = torques.by_q[:, i, 0] * tangent.q[0]
    out = np.empty_like(t)
    for j in range(n):
        if j:
            t += np.multiply(torques.by_q[:, i, j], tangent.q[j], out=out)
        t += np.multiply(torques.by_w[:, i, j], tangent.w[j], out=out)
    for slope, entry in zip(of.by_memory, tangent.memory, strict=True):
        t += np.multiply(slope[:, i], entry[i], out=out)
    for k in scene.free.of(i):
        t[theta + k] += of.by_theta[k]
    for k, place in enumerate(scene.base):
        t[p + k] += torques.by_p[:, i, place]
    if scene.plant.mechanism.description.driven[i]:
        t[p + nb :] -= by[:, :, i]
    if of.by_u is not None:
        for j in range(n):
            t[p + nb :] += of.by_u[:, i, j] * by[:, :, j]
    return t


def _inverse_of_free(M: Array, held: Array | None) -> Array:
    """Inverse of M of the joints that are free, zero in rows and columns of those held."""
    if held is None:
        return inverse(M)
    free = 1.0 - held.astype(float)
    both = free[..., :, None] * free[..., None, :]
    return inverse(M * both + (1.0 - free)[..., None] * np.eye(M.shape[-1])) * both


def _gripped(scene: Scene, state: State, u: Array, stiction: Stiction, of: Slopes) -> Slopes:
    """Slopes where joints are gripped: there friction is the break-away level, whatever w is."""
    torque = braked(of.torque, stiction)
    level = torque != of.torque
    rows = np.flatnonzero(level.any(-1))
    if not len(rows):
        return of
    scene = scene.take(rows)
    plant = scene.plant
    some = State(state.q[rows], state.w[rows], tuple(z[rows] for z in state.memory))
    x = inputs(plant, scene.friction, some, u[rows])
    minimum = stiction.minimum[rows]  # type: ignore[index]
    x = x._replace(w=np.where(level[rows], minimum, 1.0))
    law, theta, memory = scene.friction.law, scene.friction.theta, some.memory
    sign, zero = np.sign(minimum), 0.0 * x.w

    def limit(theta: Array) -> Array:
        return sign * law.limit(theta, x, memory) + zero

    own = of.by_theta.copy()
    found = by_theta(theta, scene.free, limit, None, zero)
    own[:, rows] = np.where(level[rows][:, scene.free.joint].T, found, own[:, rows])
    moves = ~level
    return of._replace(
        torque=torque,
        by_q=None if of.by_q is None else of.by_q * moves[..., None],
        by_w=of.by_w * moves[..., None],
        by_u=None if of.by_u is None else of.by_u * moves[..., None],
        by_memory=tuple(z * moves for z in of.by_memory),
        by_theta=own,
    )


class _Rates(NamedTuple):
    """How the memory after some time depends on memory, velocity and theta before it."""

    by_memory: tuple[Memory, ...]
    by_w: Memory
    by_theta: tuple[Array, ...]


def _memory_rates(scene: Scene, state: State, u: Array, dt: Array) -> _Rates:
    law, theta = scene.friction.law, scene.friction.theta
    if not state.memory or law.sample_time is not None:
        return _Rates((), (), ())
    x = inputs(scene.plant, scene.friction, state, u)
    up, down = (
        law.advance(theta, x._replace(w=x.w + s * SPEED), state.memory, dt) for s in (1.0, -1.0)
    )
    by_w = tuple((a - b) / (2 * SPEED) for a, b in zip(up, down, strict=True))

    def one(i: int) -> tuple[Memory, Array]:
        def of_memory(memory: Memory) -> Array:
            return law.advance(theta, x, memory, dt)[i]

        def of_theta(theta: Array) -> Array:
            return law.advance(theta, x, state.memory, dt)[i]

        own = by_theta(theta, scene.free, of_theta, None, 0.0 * x.w)
        return by_memory(of_memory, state.memory), own

    inner, own = zip(*(one(i) for i in range(len(state.memory))), strict=True)
    return _Rates(inner, by_w, own)


def _remember(scene: Scene, tangent: _Tangent, rates: _Rates) -> None:
    """The derivatives of the memory, in place, over the time of the rates."""
    theta = len(tangent.q) * (2 + len(tangent.memory))
    new = []
    for inner, by_w, own in zip(rates.by_memory, rates.by_w, rates.by_theta, strict=True):
        rows = []
        for j, dw in enumerate(tangent.w):
            change = by_w[:, j] * dw
            for slope, entry in zip(inner, tangent.memory, strict=True):
                change += slope[:, j] * entry[j]
            for k in scene.free.of(j):
                change[theta + k] += own[k]
            rows.append(change)
        new.append(rows)
    tangent.memory[:] = new or tangent.memory


def _cross(tangent: _Tangent, start: list[Array], w0: Array, crossing: Crossing, h: Array) -> None:
    """Derivatives behind w = 0, in place; those of w at the begin are given.

    A joint that stops keeps that of its angle and hands its momentum on; one that passes feels the
    other side's friction sooner or later.
    """
    n, rows, w1 = len(tangent.q), crossing.rows, crossing.w
    angle, end = [q[:, rows] for q in tangent.q], [w[:, rows] for w in tangent.w]
    for j in range(n):
        angle[j] -= np.where(crossing.stops[:, j], h / 2, 0.0) * end[j]
    if crossing.passes.any():
        later = np.zeros_like(end[0])
        for j in range(n):
            # minus the derivative of the time since the crossing; bounded where w = 0 is just met
            gap = np.maximum((w0[:, j] - w1[:, j]) ** 2, _GRAZE**2)
            part = np.where(crossing.passes[:, j], h / gap, 0.0)
            later += part * (w0[:, j] * end[j] - w1[:, j] * start[j])
        for i in range(n):
            end[i] = end[i] - crossing.kick[:, i] * later
    if crossing.stops.any():
        free = _inverse_of_free(crossing.M, crossing.still)
        kept = (free[..., None] * crossing.M[:, None]).sum(-2)
        kept = np.where(crossing.stops.any(-1)[:, None, None], kept, np.eye(n))
        end = [sum(kept[:, i, j] * end[j] for j in range(n)) for i in range(n)]
    for i in range(n):
        tangent.q[i][:, rows], tangent.w[i][:, rows] = angle[i], end[i]
