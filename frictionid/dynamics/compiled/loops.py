"""The physics step row by row: what machine code is run for, and when."""

import math
from collections import namedtuple
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.mechanics import Plant
from frictionid.programs.machine_code import called, compiled, kept, machine_code, run_at
from frictionid.programs.program import Program
from frictionid.programs.trace import without_zeros

from ..state import State
from ..torque_balance import SWEEPS, has_break_away
from .row import EXTERNAL, NO_PROGRAM, Row, places_of, program_of

INERTIAS = 100  # entries of M that are not zero: ten joints in a row compile in some 15 s
RUNAWAY = 1e5  # times as fast as slow joints, motions have diverged: they are frozen as NaN
LINES = 3000  # of a law's program, which take half a second to compile: two networks of 24 x 24


# Addresses of what the loops run: programs of `Row`, or its sequences of them.
Code = namedtuple(
    "Code",
    "begin near_rest brake stick first smooth look_back change_side stop_more "
    "end_crossing slide hold settle",
)
# Where numbers of a row begin that the loops read or write.
Places = namedtuple(
    "Places",
    "q w u feedback p theta physical memory slow dt is_slow is_near uneven crosses "
    "loosens turns_back at_stake moved",
)


class Machine(NamedTuple):
    """A mechanism and its friction for the compiled step.

    sharp : whether the law's smoothing only stands for a step at w = 0
    remembers : whether the law has memory
    head, size : numbers of a row that are state and parameters, and all
    """

    code: Code
    at: Places
    sharp: bool
    remembers: bool
    head: int
    size: int


def are_many(intervals: int, least: int, n: int) -> bool:
    """Whether so many intervals are worth compiling, at least those of two joints, by joint."""
    return intervals >= least * max(1.0, n / 2)


def machine_of(plant: Plant, friction: Friction, *states: Array) -> Machine | None:
    """Machine code of a plant and its friction; None where there is none.

    Laws have it that do with arrays nothing but arithmetic, not too much of it: large networks stay
    what they are, products of matrices. Parameters and `states` must be arrays of NumPy.
    """
    row = row_of(plant, friction, *states)
    return None if row is None else _machine(row)


def row_of(plant: Plant, friction: Friction, *states: Array) -> Row | None:
    """What the programs are of; None for what they cannot be."""
    law, arrays = friction.law, (plant.p, friction.theta, *states)
    if not all(isinstance(x, np.ndarray) and x.dtype == float for x in arrays):
        return None
    if friction.theta.shape[-2] != plant.parts or law.uses_temperature or law.sample_time:
        return None
    if plant.p.shape[-1] != len(plant.mechanism.base_names):  # a base that moves
        return None
    loop = plant.feedback is not None
    return Row(plant.mechanism, law, has_break_away(friction), loop)


@lru_cache(maxsize=64)
def _machine(row: Row) -> Machine | None:
    sizes, programs = row.sizes, programs_of(row)
    if programs is None:
        return None
    places = places_of(sizes)
    code = machine_code(programs, places, row.sequences)
    at = Places(*(places[name] for name in Places._fields))
    head = places["physical"] + sizes["physical"]
    addresses = Code(*(code[name] for name in Code._fields))
    return Machine(addresses, at, row.sharp, row.entries > 0, head, sum(sizes.values()))


@lru_cache(maxsize=64)
def programs_of(row: Row) -> dict[str, Program] | None:
    """The programs of a row; None where there are none, or where they are too long."""
    sizes, sequences = row.sizes, row.sequences
    names = {name for parts in sequences.values() for name in parts}
    names |= set(Code._fields) - sequences.keys()
    try:
        if row.inertias > INERTIAS:
            return None
        programs = {
            name: program_of(getattr(row, name), sizes, row.zeros) for name in sorted(names)
        }
    except NO_PROGRAM:
        return None
    if len(programs["torque"].lines) > LINES:
        return None
    return without_zeros(programs, EXTERNAL)


@called
def copy(source: Array, target: Array, count: int) -> None:
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
        copy(row, before, machine.head)
    substep(machine, row)
    if near and row[machine.at.uneven] != 0.0:
        copy(before, row, machine.head)
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
) -> State:
    """Motion q, w (T + 1, ..., n) from start states (..., n), NaN after a divergence; last memory.

    Parameters
    ----------
    plant, theta (..., n, P), u (T, ..., n), dt (T, ...)
        Their batch axes broadcast against those of the start, which has all of them.
    sizes : int array, shape (T, 2): pieces of each interval, and their most parts near rest
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
    _rollout(machine, numbers, plant.slow_like(np.zeros(n)), *flat, driven, each, sizes)
    first, parts = machine.at.memory, plant.parts
    last = (numbers[:, first + k * parts :][:, :parts] for k in range(len(start.memory)))
    return State(q, w, tuple(z.reshape(*batch, parts) for z in last))


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
) -> None:
    B, T, n = u.shape
    at, row, before = machine.at, np.zeros(machine.size), np.zeros(machine.head)
    for b in range(B):
        copy(numbers[b], row, machine.head)
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
                alive = total < RUNAWAY
            for j in range(n):
                q[k + 1, b, j] = row[at.q + j] if alive else np.nan
                w[k + 1, b, j] = row[at.w + j] if alive else np.nan
        copy(row, numbers[b], machine.head)
