"""End states of many intervals, integrated by the physics step, with all their derivatives.

The motion is that of `step.substep`, nothing else; the derivatives follow the variational equation.
"""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from frictionid.arrays import Array, solve
from frictionid.dynamics import step
from frictionid.friction import Inputs, Memory
from frictionid.friction.coordinates import of_parts, onto_joints, resting_parts, torque_map

from .compiled.end_states import advance_compiled
from .compiled.loops import are_many
from .compiled.tangent import tangent_machine_of
from .law_derivatives import FreeTheta, by_input, by_memory, by_theta, slopes
from .state import Instant, State, state_of
from .tangent import (
    MemoryRates,
    MotionModel,
    MotorTorque,
    advance_in_halves,
    advance_in_pieces,
    advanced,
    at_break_away,
    crossed,
    displacement,
    linear,
    middle,
    without_held,
)
from .torque_balance import constrained

COMPILED = 64  # pieces of intervals of two joints: fewer are done before loops are compiled


def end_states(
    model: MotionModel, nodes: Array, motor: MotorTorque, dt: Array, parts: int
) -> tuple[Array, Array]:
    """Numbers (K, s) of the states dt (K,) after nodes (K, s), and their derivatives (K, s, D).

    The first s directions are those of the nodes, see `tangent`.

    parts : of a piece, a power of two: at most so many substeps where a joint comes near rest;
        other pieces are one substep
    """
    nodes, size = nodes.copy(), nodes.shape[1]
    T = np.zeros((*nodes.shape, size + model.directions + motor.by.shape[1]))
    T[:, range(size), range(size)] = 1.0
    many = are_many(len(motor.u) * len(dt), COMPILED, model.plant.n)
    machine = tangent_machine_of(model) if many else None
    if machine is None:
        _advance_on_arrays(model, nodes, T, motor, dt, parts)
    else:
        advance_compiled(machine, model, nodes, T, motor, dt, parts)
    return nodes, T


def _advance_on_arrays(
    model: MotionModel, nodes: Array, T: Array, motor: MotorTorque, dt: Array, parts: int
) -> None:
    """Advance states (K, s) and their derivatives T (K, s, D), in place."""
    state = state_of(nodes, model.plant.mechanism)  # views

    def advance(rows: Array, torque: MotorTorque, dt: Array, may_halve: bool) -> Array:
        again = _too_long(model, state, rows, torque, dt) if may_halve else rows[:0]
        done = np.delete(np.arange(len(rows)), again)
        if len(done):
            at, torque = rows[done], torque.part(done, slice(1))
            end, T[at] = _substep(model.take(at), _taken(state, at), T[at], torque, dt[done, None])
            for whole, part in zip(_arrays(state), _arrays(end), strict=True):
                whole[at] = part
        return again

    advance_in_pieces(advance, partial(advance_in_halves, advance), motor, dt, parts)


def _arrays(state: State) -> tuple[Array, ...]:
    return state.q, state.w, *state.memory


def _taken(state: State, rows: Array) -> State:
    return State(state.q[rows], state.w[rows], tuple(z[rows] for z in state.memory))


def _too_long(
    model: MotionModel, state: State, rows: Array, motor: MotorTorque, dt: Array
) -> Array:
    """Which of some rows of states are near rest, and uneven in a substep of dt (k,)."""

    def instant(which: Array) -> tuple[Instant, Array]:
        here = model.take(rows[which]).instant(_taken(state, rows[which]), motor.u[0][which])
        return here, dt[which, None]

    every = instant(np.arange(len(rows)))
    near = np.flatnonzero(step.near_rest(*every)[0])
    if every[0].remembers or not len(near):
        return near
    return near[step.substep(*instant(near)).uneven]


def _substep(
    model: MotionModel, state: State, T: Array, motor: MotorTorque, dt: Array
) -> tuple[State, Array]:
    """State (K, n) after a substep of dt (K, 1), and its derivatives T (K, s, D)."""
    now, by = model.instant(state, motor.u[0]), np.moveaxis(motor.by[0], 0, -1)
    end = step.substep(now, dt)
    after, T = end.state, _advanced(model, T, now, end, by, dt)
    if motor.moment.any():
        by = np.moveaxis(motor.moment_by[0], 0, -1)
        after, T = _displaced(model, after, T, motor.moment[0], by)
    return after, T


def _advanced(
    model: MotionModel,
    T: Array,
    now: Instant,
    end: step.Substepped,
    by: Array,
    dt: Array,
) -> Array:
    """Derivatives T at the end of a substep; by (K, n, E) of the motor torque."""
    plant, n, turns, h = model.plant, by.shape[-2], model.turns, dt[..., None]
    before, stiction = now.state, end.stiction
    held = None if stiction.sticking is None or not stiction.sticking.any() else stiction.sticking
    if held is not None:
        T = T.copy()
        M = plant.mechanism.inertia(plant.p, before.q)
        T[:, n : 2 * n] = without_held(T[:, n : 2 * n], held, M, turns)
    now = now._replace(state=middle(before, end.state, dt))
    friction = slopes(now, model.free, model.base, model.reads, stiction)
    if stiction.braking is not None and stiction.braking.any():
        minimum = stiction.braking
        friction = at_break_away(friction, minimum, _limit_slopes(now, model.free, minimum))
    M, h0 = plant.dynamics(now.state.q, now.state.w)
    force = h0 + now.driven - onto_joints(friction.torque, turns)
    a = solve(M, force) if held is None else constrained(M, force, held, turns)
    partials = plant.mechanism.partials(plant.p, now.state.q, now.state.w, a)
    rates = memory_rates(now, model.free, dt / 2)
    motors = plant.mechanism.motors
    here = linear(M, friction, partials, model.base, motors, turns, rates, plant.feedback)
    start, T = T, advanced(T, by, here, held, h, turns)
    if end.crossing is not None:
        rows, cross = end.crossing
        slow = plant.slow_like(of_parts(before.w, turns))
        w = start[rows, n : 2 * n]
        T[rows] = crossed(T[rows], w, before.w[rows], cross, h[rows], slow)
    return T


def _limit_slopes(now: Instant, free: FreeTheta, braking: Array) -> Array:
    """Slopes (K, m, F) of break-away levels by free entries of theta, where joints are braked."""
    x = now.inputs._replace(w=np.where(braking != 0.0, braking, 1.0))
    law, theta, zero = now.friction.law, now.friction.theta, 0.0 * x.w

    def limit(theta: Array) -> Array:
        return law.limit(theta, x, now.state.memory) + zero

    return free.of_parts(by_theta(theta, free, limit, None, zero), x.w.shape[-1])


def memory_rates(now: Instant, free: FreeTheta, dt: Array) -> MemoryRates | None:
    """How the memory changes over dt at states; None for laws that advance with the samples."""
    if not now.remembers:
        return None
    law, theta, x, state = now.friction.law, now.friction.theta, now.inputs, now.state

    def later(theta: Array, x: Inputs, memory: Memory) -> Array:
        """All entries (e, K, m)."""
        return np.stack([z + 0.0 * x.w for z in law.advance(theta, x, memory, dt)])

    of_w = by_input(lambda x: later(theta, x, state.memory), x, "w")
    of_memory = np.stack(by_memory(lambda z: later(theta, x, z), state.memory), axis=1)
    of_theta = by_theta(theta, free, lambda t: later(t, x, state.memory), None, 0.0 * x.w)
    return (
        np.moveaxis(of_memory, 2, 0),
        np.moveaxis(of_w, 1, 0),
        free.of_parts(
            np.moveaxis(np.broadcast_to(of_theta, (len(of_w), *of_theta.shape[-2:])), 1, 0),
            x.w.shape[-1],
        ),
    )


def _displaced(
    model: MotionModel, state: State, T: Array, moment: Array, moment_by: Array
) -> tuple[State, Array]:
    """State displaced by M^-1 moment, for the torque's variation about its mean in a substep."""
    plant, n = model.plant, moment.shape[-1]
    way, by_moment, by_base = displacement(
        plant.mechanism.inertia(plant.p, state.q),
        resting_parts(state.w, model.turns) == 0.0,
        moment,
        lambda a: plant.mechanism.partials(plant.p, state.q, 0.0 * a, a).by_p,
        model.base,
        model.turns,
    )
    T = T.copy()
    last = T.shape[-1] - moment_by.shape[-1]
    T[:, :n, last:] += by_moment @ moment_by
    T[:, :n, last - len(model.base) : last] += by_base
    return state._replace(q=state.q + way), T


# --- Memories that advance with the samples -------------------------------------------------------


def memory_after_sample(
    model: MotionModel, nodes: Array, T: Array, motor: MotorTorque, dt: Array
) -> tuple[Array, Array]:
    """Nodes and T after a sample, which memory z takes in with the torque that follows.

    z' = advance(theta, x, z),    dz' = dz'/dx dx + dz'/dz dz + dz'/dtheta dtheta

    dt : (K,) [s] since the sample before
    """
    (K, size), n = nodes.shape, model.plant.n
    end = state_of(nodes, model.plant.mechanism)
    x = model.instant(end, motor.u[0]).inputs
    m = x.w.shape[-1]
    law, theta = model.friction.law, model.friction.theta

    def advanced(theta: Array, x: Inputs, memory: Memory) -> Array:
        """All entries of the memory, (entries, K, m)."""
        later = law.advance(theta, x, memory, dt[:, None])
        return np.stack([np.broadcast_to(entry, (K, m)) for entry in later])

    after = np.zeros((len(end.memory), K, m, T.shape[-1]))
    for slope, change in _by_inputs(model, lambda x: advanced(theta, x, end.memory), x, T, motor):
        after += slope[..., None] * change
    for e, slope in enumerate(by_memory(lambda z: advanced(theta, x, z), end.memory)):
        after += slope[..., None] * T[:, 2 * n + e * m : 2 * n + (e + 1) * m]
    if not law.reads_window:
        slopes = by_theta(theta, model.free, lambda t: advanced(t, x, end.memory), None, 0.0 * x.w)
        free = model.free.of_parts(slopes, m)
        after[..., size : size + free.shape[-1]] += free
    rows = np.moveaxis(after, 0, 1).reshape(K, size - 2 * n, -1)
    nodes = np.concatenate([end.q, end.w, *advanced(theta, x, end.memory)], axis=-1)
    return nodes, np.concatenate([T[:, : 2 * n], rows], axis=1)


def _by_inputs(
    model: MotionModel,
    advanced: Callable[[Inputs], Array],
    x: Inputs,
    before: Array,
    motor: MotorTorque,
) -> Iterator[tuple[Array, Array]]:
    """Slopes (entries, K, m) in each input that the law reads, and its derivatives (K, m, D)."""
    mechanism, m = model.plant.mechanism, x.w.shape[-1]
    n, A = mechanism.n, mechanism.friction_map
    changes = {"w": A @ before[:, n : 2 * n]}
    if model.reads.q:
        changes["q"] = A @ before[:, :n]
    if model.reads.u:
        by = np.zeros((len(before), n, before.shape[-1]))
        by[..., before.shape[-1] - motor.by.shape[1] :] = np.moveaxis(motor.by[0], 0, -1)
        if model.plant.feedback is not None:
            K, B = np.moveaxis(model.plant.feedback, -2, 0)[..., None]
            by = by - K * before[:, :n] - B * before[:, n : 2 * n]
        changes["u"] = torque_map(mechanism) @ by
    for name, change in changes.items():
        for joints in np.eye(m) if model.reads.others else np.ones((1, m)):
            yield by_input(advanced, x, name, joints), change[:, joints > 0]
