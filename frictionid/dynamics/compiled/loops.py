"""The physics step and its derivatives, row by row: what machine code is run for, and when."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.compiled.machine import Machine
from frictionid.dynamics.compiled.tangent import TangentMachine
from frictionid.dynamics.state import State
from frictionid.dynamics.tangent.tangent import MotionModel, MotorTorque, advance_in_pieces
from frictionid.dynamics.torque_balance import SWEEPS
from frictionid.friction import Memory
from frictionid.mechanics import Plant
from frictionid.programs.loops import called, compiled, kept
from frictionid.programs.machine_code import run_at


@called
def _copy(source: Array, target: Array, count: int) -> None:
    """Copy the first numbers; a slice takes a second to compile, for the words of its error."""
    for k in range(count):
        target[k] = source[k]


@called
def _settle(machine: Machine, row: Array) -> None:
    """Sweep over the parts until the friction that holds them has settled."""
    for _ in range(SWEEPS):
        run_at(machine.code.settle, row)
        if row[machine.at.moved] == 0.0:
            break


@kept
def begin_substep(machine: Machine, row: Array) -> None:
    """Set the stiction and the accelerations where a substep begins."""
    code = machine.code
    run_at(code.begin, row)
    if row[machine.at.is_slow] == 0.0:
        run_at(code.first, row)
        return
    run_at(code.near_rest, row)
    _settle(machine, row)
    if not machine.sharp:
        run_at(code.brake, row)
        _settle(machine, row)
    run_at(code.stick, row)


@kept
def substep(machine: Machine, row: Array) -> None:
    """Make one substep that has begun."""
    code, at = machine.code, machine.at
    run_at(code.smooth, row)
    if row[at.crosses] + row[at.loosens] == 0.0:
        return
    run_at(code.look_back, row)
    _settle(machine, row)
    if row[at.crosses] != 0.0:
        run_at(code.change_side, row)
        if row[at.turns_back] != 0.0:
            run_at(code.hold, row)
            _settle(machine, row)
        run_at(code.stop_more, row)
        if row[at.at_stake] != 0.0:
            run_at(code.hold, row)
            _settle(machine, row)
        run_at(code.end_crossing, row)
    else:
        run_at(code.slide, row)


@kept
def in_one(machine: Machine, row: Array, before: Array) -> bool:
    """Make one substep; false where it is too long near rest, and the row as before.

    It is where a part crosses w = 0 or breaks away in it, or accelerations bend; with memory,
    which bends unseen, always.
    """
    begin_substep(machine, row)
    near = row[machine.at.is_near] != 0.0
    if near and machine.remembers:
        return False
    if near:
        _copy(row, before, machine.head)
    substep(machine, row)
    if near and row[machine.at.uneven] != 0.0:
        _copy(before, row, machine.head)
        return False
    return True


@called
def adaptive_step(
    machine: Machine, row: Array, before: Array, dt: float, pieces: int, parts: int
) -> None:
    """Advance by dt in some pieces, each halved in which a substep is too long near rest.

    parts : of a piece, at most, a power of two
    """
    at = machine.at
    for _ in range(pieces):
        done, length = 0, parts
        while done < parts:
            row[at.dt] = dt / pieces * length / parts
            if length == 1:
                begin_substep(machine, row)
                substep(machine, row)
            elif not in_one(machine, row, before):
                length //= 2
                continue
            done += length
            while length < parts and done % (2 * length) == 0:
                length *= 2


def rolled_out(
    machine: Machine,
    plant: Plant,
    theta: Array,
    start: State,
    u: Array,
    dt: Array,
    sizes: Array,
    runaway: float,
) -> tuple[Array, Array, Memory]:
    """Motion q, w (T + 1, ..., n) from start states (..., n), NaN after a divergence; last memory.

    Parameters
    ----------
    plant, theta (..., n, P), u (T, ..., n), dt (T, ...)
        Their batch axes broadcast against those of the start, which has all of them.
    sizes : int array, shape (T, 2): pieces of each interval, and their most parts near rest
    runaway : times as fast as slow joints, rows have diverged
    """
    batch, T, n = start.q.shape[:-1], len(u), plant.n
    count = math.prod(batch)

    def rows(x: Array, *shape: int) -> Array:
        wide = np.array(np.broadcast_to(x, (*batch, *shape)), order="C")
        return wide.reshape(count, math.prod(shape))

    q, w = np.empty((2, T + 1, *start.q.shape))
    q[0], w[0] = start.q, start.w
    flat = [x.reshape(T + 1, count, n) for x in (q, w)]
    driven = rows(np.moveaxis(u, 0, -2), T, n).reshape(count, T, n)
    each = rows(np.moveaxis(dt, 0, -1), T)
    numbers = rows_of_numbers(machine, plant, theta, start.memory, rows)
    _rollout(machine, numbers, plant.slow_like(np.zeros(n)), *flat, driven, each, sizes, runaway)
    first, parts = machine.at.memory, plant.parts
    last = (numbers[:, first + k * parts :][:, :parts] for k in range(len(start.memory)))
    return q, w, tuple(z.reshape(*batch, parts) for z in last)


def rows_of_numbers(
    machine: Machine, plant: Plant, theta: Array, memory: tuple[Array, ...], rows: Any
) -> Array:
    """Parameters and memory of rows (K, head)."""
    at, slow = machine.at, plant.slow_like(np.zeros(plant.parts))
    columns = {at.slow: rows(slow, plant.parts), at.p: rows(plant.p, plant.p.shape[-1])}
    columns[at.theta] = rows(theta, *theta.shape[-2:])
    if plant.feedback is not None:
        columns[at.feedback] = rows(plant.feedback, 2, plant.n)
    for k, z in enumerate(memory):
        columns[at.memory + k * plant.parts] = rows(z, plant.parts)
    physical = (
        plant.parameters.values() if machine.head > at.physical else ()
    )  # only loads need them
    for k, x in enumerate(physical):
        columns[at.physical + k] = rows(np.asarray(x)[..., None], 1)
    out = np.zeros((len(columns[at.p]), machine.head))
    for first, values in columns.items():
        out[:, first : first + values.shape[1]] = values
    return out


@compiled
def _rollout(
    machine: Machine,
    numbers: Array,
    slow: Array,
    q: Array,
    w: Array,
    u: Array,
    dt: Array,
    sizes: Array,
    runaway: float,
) -> None:
    B, T, n = u.shape
    at, row, before = machine.at, np.zeros(machine.size), np.zeros(machine.head)
    for b in range(B):
        _copy(numbers[b], row, machine.head)
        for j in range(n):
            row[at.q + j], row[at.w + j] = q[0, b, j], w[0, b, j]
        alive = True
        for k in range(T):
            if alive:
                for j in range(n):
                    row[at.u + j] = u[b, k, j]
                adaptive_step(machine, row, before, dt[b, k], sizes[k, 0], sizes[k, 1])
                total = 0.0
                for j in range(n):
                    total += abs(row[at.w + j]) / slow[j]
                alive = total < runaway
            for j in range(n):
                q[k + 1, b, j] = row[at.q + j] if alive else np.nan
                w[k + 1, b, j] = row[at.w + j] if alive else np.nan
        _copy(row, numbers[b], machine.head)


def end_states_of(
    tangent: TangentMachine,
    model: MotionModel,
    start: State,
    motor: MotorTorque,
    dt: Array,
    parts: int,
) -> tuple[State, Array]:
    """End states (K, n) and their derivatives (K, s, D), see `tangent.end_states`."""
    plant, (K, n) = model.plant, start.q.shape

    def rows(x: Array, *shape: int) -> Array:
        return np.broadcast_to(x, (K, *shape)).reshape(K, -1)

    numbers = rows_of_numbers(tangent.machine, plant, model.friction.theta, start.memory, rows)
    size = 2 * n + len(start.memory) * plant.parts
    numbers[:, : 2 * n] = np.concatenate([start.q, start.w], axis=-1)
    T = np.zeros((K, size, size + model.directions + motor.by.shape[1]))
    T[:, range(size), range(size)] = 1.0
    each = model.free.combinations
    free = model.free.joint, np.zeros((0, 0)) if each is None else each

    def advance(rows: Array, torque: MotorTorque, dt: Array, may_halve: bool) -> Array:
        return _advance(tangent, *free, numbers, T, rows, *_torques(torque), dt, may_halve)

    advance_in_pieces(advance, motor, dt, parts)
    q, w, memory = np.split(numbers[:, :size], [n, 2 * n], axis=-1)
    entries = np.split(memory, len(start.memory), axis=-1) if start.memory else ()
    return State(q, w, tuple(entries)), T


def _torques(motor: MotorTorque) -> tuple[Array, Array, Array, Array, bool]:
    """Torques u, by, moment, moment_by of one piece, and whether any moment counts."""
    u, by = (np.ascontiguousarray(x[0]) for x in (motor.u, motor.by))  # loops are for one kind
    if motor.moment is None or motor.moment_by is None:
        return u, by, u, by, False
    moment, moment_by = (np.ascontiguousarray(x[0]) for x in (motor.moment, motor.moment_by))
    return u, by, moment, moment_by, bool(moment.any())


@compiled
def _advance(
    tangent: TangentMachine,
    joint: Array,
    each: Array,
    numbers: Array,
    T: Array,
    rows: Array,
    u: Array,
    by: Array,
    moment: Array,
    moment_by: Array,
    varies: bool,
    dt: Array,
    may_halve: bool,
) -> Array:
    """Advance some rows of states and derivatives T (K, s, D) by a substep, in place.

    Those too long near rest stay as they are, if they may be halved: their numbers, of the k.

    joint (F,), each (F, r) : of combinations, see `FreeTheta`; r = 0 where entries are free
    rows : (k,) of them; u (k, n), by (E, k, n), moment, moment_by: see `MotorTorque`
    varies : whether a moment counts; dt (k,) [s]
    """
    machine, at, n = tangent.machine, tangent.machine.at, u.shape[1]
    row, before = np.zeros(tangent.size), np.zeros(machine.head)
    spare, size = np.zeros(T.shape[1:]), T.shape[1]
    count, total = size * (size + tangent.theta + tangent.base + n), np.zeros(each.shape[1])
    counts = size, tangent.theta, tangent.runs, tangent.terms
    combined = np.zeros(size * (T.shape[2] - by.shape[0] + n))
    again = np.zeros(len(rows), np.bool_)
    for i in range(len(rows)):
        k = rows[i]
        _copy(numbers[k], row, machine.head)
        row[at.dt] = dt[i]
        for j in range(n):
            row[at.u + j] = u[i, j]
        if not may_halve:
            begin_substep(machine, row)
            substep(machine, row)
        elif not in_one(machine, row, before):
            again[i] = True
            continue
        crosses = row[at.crosses] != 0.0
        run_at(tangent.differentiate_crossing if crosses else tangent.differentiate, row)
        change = row[tangent.change : tangent.change + count]
        if len(total):
            _combined_change(counts, joint, each, change, combined, total)
            change = combined
        _change(change, T[k], by[:, i], spare)
        if varies:
            _displace(tangent, row, T[k], moment[i], moment_by[:, i])
        _copy(row, numbers[k], machine.head)
    return np.flatnonzero(again)


@called
def _change(change: Array, T: Array, by: Array, spare: Array) -> None:
    """Put derivatives T (s, D) through a change (s, s + F + n); by (E, n) : of the motor torque."""
    (size, D), (E, n) = T.shape, by.shape
    free = D - size - E
    width = size + free + n
    for a in range(size):
        first = a * width
        for d in range(D):
            spare[a, d] = 0.0
        for b in range(size):
            factor = change[first + b]
            if factor != 0.0:
                for d in range(D):
                    spare[a, d] += factor * T[b, d]
        for k in range(free):
            spare[a, size + k] += change[first + size + k]
        for j in range(n):
            factor = change[first + size + free + j]
            for e in range(E):
                spare[a, size + free + e] += factor * by[e, j]
    for a in range(size):
        _copy(spare[a], T[a], D)


@called
def _combined_change(
    counts: tuple[int, int, int, int],
    joint: Array,
    each: Array,
    change: Array,
    out: Array,
    total: Array,
) -> None:
    """Set the change out (s, s + D + ...) by what is free, from that by entries of theta.

    counts : s, F, and of runs and their terms; joint (F,), each (F, r) : see `FreeTheta`
    total : (r,), room for those of a run
    """
    size, theta, runs, terms = counts
    r, single = len(total), theta - 2 * runs
    width, wide = len(change) // size, len(out) // size
    rest = width - size - theta
    for a in range(size):
        for b in range(wide):
            out[a * wide + b] = change[a * width + b] if b < size else 0.0
        for b in range(1, rest + 1):
            out[(a + 1) * wide - b] = change[(a + 1) * width - b]
    for k in range(single + runs):
        entry, at = k, size + k
        if k < single:
            for i in range(r):
                total[i] = each[k, i]
        else:
            entry, at = single + (k - single) * terms, size + 2 * k - single
            if not _sum_run(total, each, entry, terms, change, at, width):
                continue
        for a in range(size):
            first, factor = a * wide + size + joint[entry] * r, change[a * width + at]
            for i in range(r):
                out[first + i] += factor * total[i]


@called
def _sum_run(
    total: Array, each: Array, entry: int, terms: int, change: Array, at: int, width: int
) -> bool:
    """Set the total of T_v(x) times combinations of a run; false where the run is idle.

    T_v are Chebyshev's polynomials; slopes by the first two, at change, are f and f x, of any f.
    """
    most, x = 0.0, 0.0
    for k in range(at, len(change), width):
        if abs(change[k]) > most:
            most, x = abs(change[k]), change[k + 1] / change[k]
    if most == 0.0:
        return False
    before, here = x, 1.0
    total[:] = 0.0
    for v in range(entry, entry + terms):
        for i in range(len(total)):
            total[i] += here * each[v, i]
        before, here = here, 2.0 * x * here - before
    return True


@called
def _displace(
    tangent: TangentMachine, row: Array, T: Array, moment: Array, moment_by: Array
) -> None:
    """Displace a row by a moment (n,) of the torque, whose derivatives are moment_by (E, n)."""
    E, n = moment_by.shape
    for j in range(n):
        row[tangent.moment + j] = moment[j]
    run_at(tangent.displace, row)
    last = T.shape[1] - E
    for i in range(n):
        for k in range(tangent.base):
            T[i, last - tangent.base + k] += row[tangent.by_base + i * tangent.base + k]
        for j in range(n):
            for e in range(E):
                T[i, last + e] += row[tangent.by_moment + i * n + j] * moment_by[e, j]
