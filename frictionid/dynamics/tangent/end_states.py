"""End states of many intervals, integrated by the physics step, with all their derivatives.

The motion is that of `step.substep`, nothing else; the derivatives follow the variational equation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, times
from frictionid.dynamics import step
from frictionid.dynamics.compiled.end_states import advanced, tangent_machine_of
from frictionid.dynamics.state import State, velocities
from frictionid.dynamics.tangent.substep import advance_tangent
from frictionid.dynamics.tangent.tangent import (
    MotionModel,
    MotorTorque,
    Tangent,
    initial_tangent,
    inverse_of_free,
)
from frictionid.friction import Memory

COMPILED = 500  # intervals: fewer are done before loops are compiled


class EndStates(NamedTuple):
    """States q, w (K, n) and memory at the end of K intervals, and their derivatives.

    by_start (K, s, s) and by_parameters (K, s, D - s), of all s = 2 n + (entries
    of the memory) m numbers of a state.
    """

    q: Array
    w: Array
    memory: Memory
    by_start: Array
    by_parameters: Array


def end_states(
    model: MotionModel, start: State, motor: MotorTorque, dt: Array, fine: int
) -> EndStates:
    """End states of intervals of length dt (K,) that start at states (K, n), with derivatives.

    fine : substeps of a piece in which a joint comes near rest; other pieces are one substep
    """
    machine = tangent_machine_of(model) if len(dt) >= COMPILED else None
    if machine is not None:
        q, w, T = advanced(machine, model, (start.q, start.w), motor, dt, fine)
        size = T.shape[1]
        return EndStates(q, w, (), T[..., :size], T[..., size:])
    state, tangent = start, initial_tangent(model, start, motor.by.shape[1])
    part = (dt / len(motor.u))[:, None]
    for piece, u in enumerate(motor.u):
        near = step.near_rest(model.plant, model.friction, state, u, part)
        ends = []
        for rows, count in ((np.flatnonzero(~near), 1), (np.flatnonzero(near), fine)):
            if len(rows):
                own = tangent.take(rows)
                torque = motor.of(rows, piece, count)
                here = _rows_of(state, rows)
                end = _substeps(model.take(rows), here, own, torque, part[rows] / count)
                tangent.put(rows, own)
                ends.append((rows, end))
        state = _merged(state, ends)
    matrix = np.stack(tangent.rows()).transpose(2, 0, 1)
    size = matrix.shape[1]
    return EndStates(state.q, state.w, state.memory, matrix[..., :size], matrix[..., size:])


def _rows_of(state: State, rows: Array) -> State:
    return State(state.q[rows], state.w[rows], tuple(z[rows] for z in state.memory))


def _merged(state: State, ends: list[tuple[Array, State]]) -> State:
    """The state of all rows from those of some rows each."""
    q, w = np.empty_like(state.q), np.empty_like(state.w)
    memory = tuple(np.empty_like(z) for z in state.memory)
    for rows, end in ends:
        q[rows], w[rows] = end.q, end.w
        for whole, part in zip(memory, end.memory, strict=True):
            whole[rows] = part
    return State(q, w, memory)


def _substeps(
    model: MotionModel, state: State, tangent: Tangent, motor: MotorTorque, dt: Array
) -> State:
    """State after some substeps; the derivatives change in place."""
    for k, (u, by) in enumerate(zip(motor.u, motor.by, strict=True)):
        substep = step.substep(model.plant, model.friction, state, u, dt)
        advance_tangent(model, tangent, state, substep, u, by, dt)
        state = substep[0]
        if motor.moment is not None and motor.moment_by is not None and motor.moment[k].any():
            state = _displaced(model, state, tangent, motor.moment[k], motor.moment_by[k])
    return state


def _displaced(
    model: MotionModel, state: State, tangent: Tangent, moment: Array, moment_by: Array
) -> State:
    """State displaced by M^-1 moment, for the torque's variation about its mean in a substep."""
    n = len(tangent.q)
    resting = velocities(model.plant, state) == 0.0
    M = model.plant.mechanism.inertia(model.plant.p, state.q)
    A = inverse_of_free(M, resting, model.turns)
    first = len(tangent.q[0]) - len(moment_by)
    for i in range(n):
        for j in range(n):
            tangent.q[i][first:] += A[:, i, j] * moment_by[:, :, j]
    displacement = times(A, moment)
    if model.base:
        # M displacement = moment, and M is linear in the base parameters
        p, mechanism, zero = model.plant.p, model.plant.mechanism, 0.0 * displacement
        inert, rest = (mechanism.partials(p, state.q, zero, a).by_p for a in (displacement, zero))
        for k, place in enumerate(model.base, first - len(model.base)):
            for i in range(n):
                tangent.q[i][k] -= (A[:, i] * (inert - rest)[..., place]).sum(-1)
    return state._replace(q=state.q + displacement)
