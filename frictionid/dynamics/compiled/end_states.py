"""End states of intervals and their derivatives, row by row, by the compiled step."""

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.loops import called, compiled
from frictionid.programs.machine_code import run_at

from ..state import State
from ..tangent.tangent import MotionModel, MotorTorque, advance_in_pieces
from .loops import begin_substep, copy, in_one, rows_of_numbers, substep
from .tangent import TangentMachine


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
    # loops are for one kind of array
    u, by, moment, moment_by = (np.ascontiguousarray(x[0]) for x in motor[:4])
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
        copy(numbers[k], row, machine.head)
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
        copy(row, numbers[k], machine.head)
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
        copy(spare[a], T[a], D)


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
