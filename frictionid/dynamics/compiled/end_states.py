"""End states of intervals and their derivatives, row by row, by the compiled step."""

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.machine_code import called, compiled, run_at

from ..tangent import MotionModel, MotorTorque, advance_in_pieces
from .loops import begin_substep, copy, in_one, rows_of_numbers, substep
from .tangent import TangentMachine


def advance_compiled(
    tangent: TangentMachine,
    model: MotionModel,
    nodes: Array,
    T: Array,
    motor: MotorTorque,
    dt: Array,
    parts: int,
) -> None:
    """Advance states (K, s) and derivatives T (K, s, D), in place, see `dynamics.end_states`."""
    K, size = nodes.shape

    def rows(x: Array, *shape: int) -> Array:
        return np.broadcast_to(x, (K, *shape)).reshape(K, -1)

    numbers = rows_of_numbers(tangent.machine, model.plant, model.friction.theta, (), rows)
    numbers[:, :size] = nodes
    each = model.free.combinations
    # loops are for one kind of array
    free = np.ascontiguousarray(model.free.joint), np.zeros((0, 0)) if each is None else each

    def advance(rows: Array, torque: MotorTorque, dt: Array, may_halve: bool) -> Array:
        torques = (np.ascontiguousarray(x) for x in torque[:4])
        return _advance(tangent, *free, numbers, T, rows, *torques, dt, may_halve)

    def in_halves(rows: Array, torque: MotorTorque, dt: Array) -> None:
        advance(rows, torque, dt, False)

    advance_in_pieces(advance, in_halves, motor, dt, parts)
    nodes[:] = numbers[:, :size]


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
    dt: Array,
    may_halve: bool,
) -> Array:
    """Advance some rows of states and derivatives T (K, s, D) by one piece or by halves, in place.

    Of S = 2, 4, ... pieces halves are substeps, halved in their turn where they are too long near
    rest. One piece that is too long stays, if it may be halved: the numbers, of the k, of these.

    joint (F,), each (F, r) : of combinations, see `FreeTheta`; r = 0 where entries are free
    rows : (k,) of them; u (S, k, n), by (S, E, k, n), moment, moment_by: see `MotorTorque`
    dt : (k,) [s] of a piece
    """
    machine, at, (S, E, _, n) = tangent.machine, tangent.machine.at, by.shape
    row, before = np.zeros(tangent.size), np.zeros(machine.head)
    spare, size = np.zeros(T.shape[1:]), T.shape[1]
    count, total = size * (size + tangent.theta + tangent.base + n), np.zeros(each.shape[1])
    counts = size, tangent.theta, tangent.runs, tangent.terms
    combined = np.zeros(size * (T.shape[2] - E + n))
    torque, torque_by = np.zeros((2, n)), np.zeros((2, E, n))
    again = np.zeros(len(rows), np.bool_)
    for i in range(len(rows)):
        k, done, length = rows[i], 0, max(S // 2, 1)
        while done < S:
            varies = _merge(u, moment, i, done, length, dt[i], torque)
            for e in range(E):
                each_by = torque_by[:, e]
                varies |= _merge(by[:, e], moment_by[:, e], i, done, length, dt[i], each_by)
            copy(numbers[k], row, machine.head)
            row[at.dt] = length * dt[i]
            for j in range(n):
                row[at.u + j] = torque[0, j]
            if not may_halve and length == 1:
                begin_substep(machine, row)
                substep(machine, row)
            elif not in_one(machine, row, before):
                if S == 1:
                    again[i] = True
                    break
                length //= 2
                continue
            crosses = row[at.crosses] != 0.0
            run_at(tangent.differentiate_crossing if crosses else tangent.differentiate, row)
            change = row[tangent.change : tangent.change + count]
            if len(total):
                _combined_change(counts, joint, each, change, combined, total)
                change = combined
            _change(change, T[k], torque_by[0], spare)
            if varies:
                _displace(tangent, row, T[k], torque[1], torque_by[1])
            copy(row, numbers[k], machine.head)
            done += length
            while 2 * length < S and done % (2 * length) == 0:
                length *= 2
    return np.flatnonzero(again)


@called
def _merge(u: Array, moment: Array, i: int, first: int, count: int, dt: float, out: Array) -> bool:
    """Set torque and moment out (2, n) of pieces (S, k, n) of dt [s] as of one; true if it varies.

    See `MotorTorque.as_one`.
    """
    varies = False
    for j in range(u.shape[2]):
        mean = 0.0
        for s in range(first, first + count):
            mean += u[s, i, j] / count
        about = 0.0
        for s in range(first, first + count):
            ahead = (first + count - s - 0.5) * dt * dt
            about += moment[s, i, j]
            if count > 1:
                about += ahead * (u[s, i, j] - mean)
        out[0, j], out[1, j] = mean, about
        varies |= about != 0.0
    return varies


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
