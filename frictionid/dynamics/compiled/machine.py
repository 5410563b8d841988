"""A mechanism and its friction as functions for the compiled step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.compiled.layout import Machine
from frictionid.dynamics.sliding_friction import is_sharp, least_sliding_speed
from frictionid.dynamics.torque_balance import has_break_away
from frictionid.friction import Friction, Inputs, Law
from frictionid.mechanics import Mechanism, Plant
from frictionid.programs.machine_code import machine_code
from frictionid.programs.program import Program
from frictionid.programs.trace import traced

LINES = 3000  # of a law's program, which take half a second to compile: two networks of 24 x 24


def machine_of(plant: Plant, friction: Friction, *states: Array) -> Machine | None:
    """Functions of a plant and its friction; None where they cannot be compiled.

    Symbolic mechanisms are compiled, and laws of a joint's own motion and motor torque without
    memory that do with arrays nothing but arithmetic, not too much of it: large networks stay what
    they are, products of matrices. Parameters and `states` must be arrays of NumPy.
    """
    law, mechanism = friction.law, plant.mechanism
    arrays = (plant.p, friction.theta, *states)
    if not all(isinstance(x, np.ndarray) and x.dtype == float for x in arrays):
        return None
    if mechanism.coupled or friction.theta.shape[-2] != mechanism.n:
        return None
    breaks = has_break_away(friction)
    sliding = law.sharpened() if breaks else law
    programs = _dynamics(mechanism), torque_program(sliding, mechanism.n)
    limit = limit_program(law, mechanism.n)
    if limit is None or any(program is None for program in programs):
        return None
    dynamics, torque, levels = (machine_code(p) for p in (*programs, limit) if p is not None)
    beyond = least_sliding_speed(friction) if breaks else 0.0
    base, parameters = len(mechanism.base_names), mechanism.n * len(law.names)
    return Machine(
        dynamics,
        torque,
        levels,
        breaks,
        is_sharp(friction),
        beyond,
        base,
        parameters,
        -(-base // mechanism.n),
        len(law.names),
    )


@lru_cache(maxsize=64)
def _dynamics(mechanism: Mechanism) -> Program | None:
    n, base = mechanism.n, len(mechanism.base_names)

    def terms(x: Mapping[str, Array]) -> Mapping[str, Array]:
        M, h = mechanism.dynamics(x["p"], x["q"], x["w"])
        return {"M": M, "h": h}

    return program_of(terms, {"q": n, "w": n, "p": base})


@lru_cache(maxsize=64)
def torque_program(law: Law, n: int) -> Program | None:
    """Program of a law's torques Tf for n joints, of w, q, u and theta; None: it has none."""
    return _law_program(law, n, "Tf", law.torque)


@lru_cache(maxsize=64)
def limit_program(law: Law, n: int) -> Program | None:
    """The same of its break-away levels, "limit", in the direction of w."""
    return _law_program(law, n, "limit", law.limit)


def _law_program(
    law: Law, n: int, name: str, function: Callable[[Array, Inputs, tuple[()]], Array]
) -> Program | None:
    if law.uses_load or law.uses_temperature or law.has_memory:
        return None
    count = len(law.names)

    def computed(x: Mapping[str, Array]) -> Mapping[str, Array]:
        theta, zero = x["theta"].reshape(n, count), 0.0 * x["w"]
        return {name: function(theta, Inputs(x["q"], x["w"], x["u"], zero), ()) + zero}

    program = program_of(computed, {"w": n, "q": n, "u": n, "theta": n * count})
    return program if program is not None and len(program.lines) <= LINES else None


def program_of(
    function: Callable[[Mapping[str, Array]], Mapping[str, Array]], inputs: Mapping[str, int]
) -> Program | None:
    """Program of a function of arrays; None where it does what programs cannot."""
    try:
        return traced(function, inputs)
    except (NotImplementedError, TypeError, ValueError, AttributeError):
        return None
