"""The programs of a mechanism and its friction as machine code, which `compiled.loops` runs."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.mechanics import Plant
from frictionid.programs.machine_code import machine_code

from ..torque_balance import has_break_away
from .row import NO_PROGRAM, Row, places_of, program_of

LINES = 3000  # of a law's program, which take half a second to compile: two networks of 24 x 24


class Code(NamedTuple):
    """Addresses of what the loops run: programs of `Row`, or its sequences of them."""

    begin: int
    near_rest: int
    brake: int
    stick: int
    first: int
    smooth: int
    look_back: int
    change_side: int
    stop_more: int
    end_crossing: int
    slide: int
    hold: int
    settle: int


class Places(NamedTuple):
    """Where numbers of a row begin that the loops read or write."""

    q: int
    w: int
    u: int
    feedback: int
    p: int
    theta: int
    physical: int
    memory: int
    slow: int
    dt: int
    is_slow: int
    is_near: int
    uneven: int
    crosses: int
    loosens: int
    turns_back: int
    at_stake: int
    moved: int


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


def machine_of(plant: Plant, friction: Friction, *states: Array) -> Machine | None:
    """Machine code of a plant and its friction; None where there is none.

    Symbolic mechanisms have it, and laws that do with arrays nothing but arithmetic, not too much
    of it: large networks stay what they are, products of matrices. Parameters and `states` must be
    arrays of NumPy.
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
    loop = plant.feedback is not None
    return Row(plant.mechanism, law, has_break_away(friction), loop)


@lru_cache(maxsize=64)
def _machine(row: Row) -> Machine | None:
    sizes, sequences = row.sizes, row.sequences
    names = {name for parts in sequences.values() for name in parts}
    names |= set(Code._fields) - sequences.keys()
    try:
        programs = {name: program_of(getattr(row, name), sizes) for name in sorted(names)}
    except NO_PROGRAM:
        return None
    if len(programs["torque"].lines) > LINES:
        return None
    places = places_of(sizes)
    code = machine_code(programs, places, sequences)
    at = Places(*(places[name] for name in Places._fields))
    head = places["physical"] + sizes["physical"]
    addresses = Code(*(code[name] for name in Code._fields))
    return Machine(addresses, at, row.sharp, row.entries > 0, head, sum(sizes.values()))
