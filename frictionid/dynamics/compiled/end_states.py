"""End states of many intervals and their derivatives by the compiled step, row after row."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.compiled import layout as at
from frictionid.dynamics.compiled import tangent_layout as more
from frictionid.dynamics.compiled.machine import (
    limit_program,
    machine_of,
    program_of,
    torque_program,
)
from frictionid.dynamics.compiled.step import begin_substep, is_near_rest, substep
from frictionid.dynamics.compiled.tangent import advance_tangent, displace
from frictionid.dynamics.compiled.tangent_layout import TangentMachine
from frictionid.dynamics.tangent.tangent import MotionModel, MotorTorque
from frictionid.friction import Law
from frictionid.mechanics import Mechanism
from frictionid.programs.derivative import with_derivatives
from frictionid.programs.loops import compiled, pointer
from frictionid.programs.machine_code import machine_code
from frictionid.programs.program import Program


def tangent_machine_of(model: MotionModel) -> TangentMachine | None:
    """Functions of a model and its derivatives; None where they cannot be compiled."""
    machine = None if model.reads.others else machine_of(model.plant, model.friction)
    if machine is None:
        return None
    law, mechanism, n = model.friction.law, model.plant.mechanism, model.plant.n
    places = tuple(_places(model))
    slopes = _slopes(law.sharpened() if machine.breaks else law, n, places)
    limits, partials = _limits(law, n, places), _partials(mechanism)
    if slopes is None or limits is None or partials is None:
        return None
    return TangentMachine(
        machine, machine_code(slopes), machine_code(limits), machine_code(partials), len(places)
    )


def _places(model: MotionModel) -> list[int]:
    """Parameters of the law that are free in some joint."""
    return [int(place) for place in np.unique(model.free.place)]


@lru_cache(maxsize=64)
def _partials(mechanism: Mechanism) -> Program | None:
    n, base = mechanism.n, len(mechanism.base_names)

    def partials(x: Mapping[str, Array]) -> Mapping[str, Array]:
        own = mechanism.partials(x["p"], x["q"], x["w"], x["a"])
        return {"by q": own.by_q, "by w": own.by_w, "by p": own.by_p}

    return program_of(partials, {"q": n, "w": n, "a": n, "p": base})


@lru_cache(maxsize=64)
def _slopes(law: Law, n: int, places: tuple[int, ...]) -> Program | None:
    program = torque_program(law, n)
    if program is None:
        return None
    own = {x: [f"{x}_{j + 1}" for j in range(n)] for x in ("w", "q", "u")}
    return with_derivatives(program, {**own, **_parameters(law, n, places)}, ["Tf"])


@lru_cache(maxsize=64)
def _limits(law: Law, n: int, places: tuple[int, ...]) -> Program | None:
    program = limit_program(law, n)
    if program is None:
        return None
    return with_derivatives(program, _parameters(law, n, places), ["limit"])


def _parameters(law: Law, n: int, places: tuple[int, ...]) -> dict[str, list[str]]:
    """Some parameters, each of all joints: friction of a joint depends on its own alone."""
    count = len(law.names)
    return {f"parameter {k}": [f"theta_{j * count + k + 1}" for j in range(n)] for k in places}


def advanced(
    tangent: TangentMachine,
    model: MotionModel,
    start: tuple[Array, Array],
    motor: MotorTorque,
    dt: Array,
    fine: int,
) -> tuple[Array, Array, Array]:
    """End states q, w (K, n) and their derivatives (K, 2n, D), see `sensitivities.end_states`."""
    plant, n = model.plant, model.plant.n
    q, w = (np.array(x, order="C") for x in start)
    theta = model.friction.theta
    flat = np.array(theta.reshape(math.prod(theta.shape[:-2]), tangent.machine.theta), order="C")
    motors, slow = plant.mechanism.motors, plant.slow_like(w[0])
    p = np.array(plant.p.reshape(-1, plant.p.shape[-1]), order="C")
    fixed = motors, slow, p, flat
    free = np.stack([model.free.joint, np.searchsorted(_places(model), model.free.place)], axis=-1)
    base = np.array(model.base, dtype=int)
    T = np.zeros((len(q), 2 * n, 2 * n + model.directions + motor.by.shape[1]))
    T[:, range(2 * n), range(2 * n)] = 1.0
    state, part, every = (q, w, T), dt / len(motor.u), np.arange(len(q))
    for piece in range(len(motor.u)):
        torques = _torques(motor.of(every, piece, 1))
        near = _advance(tangent, *fixed, free, base, *state, every, *torques, part, fine > 1)
        rows = np.flatnonzero(near)
        if len(rows):
            torques = _torques(motor.of(rows, piece, fine))
            _advance(tangent, *fixed, free, base, *state, rows, *torques, part[rows] / fine, False)
    return q, w, T


def _torques(motor: MotorTorque) -> tuple[Array, Array, Array, Array, Array]:
    """Torques u, by, moment, moment_by, and the substeps (S,) in which a moment counts."""
    u, by = (np.ascontiguousarray(x) for x in (motor.u, motor.by))  # loops are for one kind
    if motor.moment is None or motor.moment_by is None:
        return u, by, u, by, np.zeros(len(u), dtype=bool)
    some: Array = motor.moment.any(axis=(1, 2))  # type: ignore[assignment]
    return u, by, np.ascontiguousarray(motor.moment), np.ascontiguousarray(motor.moment_by), some


@compiled
def _advance(
    tangent: TangentMachine,
    motors: Array,
    slow: Array,
    p: Array,
    theta: Array,
    free: Array,
    base: Array,
    q: Array,
    w: Array,
    T: Array,
    rows: Array,
    u: Array,
    by: Array,
    moment: Array,
    moment_by: Array,
    varies: Array,
    dt: Array,
    coarse: bool,
) -> Array:
    """Advance some rows of states q, w (K, n) and derivatives T (K, 2n, D), in place.

    Where steps are coarse, those with a joint that comes near rest stay as they are: (k,), true.

    rows : (k,) of them; u (S, k, n), by (S, E, k, n), moment, moment_by: see `MotorTorque`, in S
    substeps; varies (S,): whether a moment counts; dt (k,): of a substep [s]
    """
    n, D = q.shape[1], T.shape[2]
    machine = tangent.machine
    numbers = at.new_row(machine, motors, slow, more.lines_of(n, tangent))
    kept, more_kept = np.zeros(2 * n * D), np.zeros(2 * n * D)
    row, own, spare = pointer(numbers), pointer(kept), pointer(more_kept)
    near = np.zeros(len(rows), np.bool_)
    for i in range(len(rows)):
        k = rows[i]
        at.set_parameters(
            machine, row, n, p[k if len(p) > 1 else 0], theta[k if len(theta) > 1 else 0]
        )
        at.set_state(row, n, q[k], w[k], u[0, i])
        for j in range(2 * n):
            for d in range(D):
                own[j * D + d] = T[k, j, d]
        for s in range(len(u)):
            for j in range(n):
                row[at.U * n + j] = u[s, i, j]
            begin_substep(machine, row, n)
            if coarse and is_near_rest(row, n, dt[i]):
                near[i] = True
                break
            crossed = substep(machine, row, n, dt[i])
            advance_tangent(tangent, row, n, own, D, spare, free, base, by[s, :, i], dt[i], crossed)
            if varies[s]:
                displace(tangent, row, n, own, D, base, moment[s, i], moment_by[s, :, i])
        for j in range(n):
            q[k, j], w[k, j] = row[at.Q * n + j], row[at.W * n + j]
        for j in range(2 * n):
            for d in range(D):
                T[k, j, d] = own[j * D + d]
    numbers[0] = 0.0  # they live until here
    kept[0] = more_kept[0] = 0.0
    return near
