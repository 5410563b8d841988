"""The derivatives of the compiled step: programs of what `dynamics.tangent` computes of arrays."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.friction.coordinates import resting_parts
from frictionid.mechanics import Partials
from frictionid.programs.machine_code import machine_code
from frictionid.programs.program import Operand, Program, needed, with_derivatives
from frictionid.programs.trace import without_zeros

from ..law_derivatives import FreeTheta, Slopes
from ..state import State
from ..tangent import (
    MotionModel,
    advanced,
    at_break_away,
    crossed,
    displacement,
    linear,
    middle,
    without_held,
)
from .loops import Machine, machine_of, programs_of, row_of
from .row import EXTERNAL, NO_PROGRAM, Row, places_of, program_of, zero_entries


class TangentMachine(NamedTuple):
    """A machine, and the addresses of programs of its derivatives; places of what they read or set.

    change : (s, s + F + nb + n), of a state by itself, F entries of theta, base parameters, and
        the motor torque; state : s; runs, terms : see `FreeTheta`
    by_moment (n, n), by_base (n, nb) : of the angles by a moment of the torque, and by parameters
    """

    machine: Machine
    differentiate: int
    differentiate_crossing: int
    displace: int
    moment: int
    change: int
    by_moment: int
    by_base: int
    state: int
    theta: int
    runs: int
    terms: int
    base: int
    size: int


def tangent_machine_of(model: MotionModel) -> TangentMachine | None:
    """Machine code of a model and its derivatives; None where there is none."""
    row = None if model.reads.others else row_of(model.plant, model.friction)
    machine = machine_of(model.plant, model.friction)
    if row is None or machine is None:
        return None
    joint, place = (x[model.free.telling].tolist() for x in model.free[:2])
    free = tuple(zip(joint, place, strict=True))
    tangent = _tangent_machine(machine, TangentRow(row, free, model.base))
    return tangent and tangent._replace(runs=model.free.runs, terms=model.free.terms)


@lru_cache(maxsize=64)
def _tangent_machine(machine: Machine, row: "TangentRow") -> TangentMachine | None:
    sizes, step = row.sizes, programs_of(row.row)
    try:
        programs = row.programs
    except NO_PROGRAM:
        return None
    every = programs | {f"step: {name}": program for name, program in (step or {}).items()}
    every = without_zeros(every, [*EXTERNAL, "moment"])
    programs = {name: every[name] for name in programs}
    places = places_of(sizes)
    code = machine_code(programs, places, row.sequences)
    names = ("moment", "change", "by_moment", "by_base_moment")
    numbers = (*(code[name] for name in row.sequences), *(places[name] for name in names))
    state = 2 * sizes["q"] + sizes["memory"]
    counts = (state, len(row.free), 0, 0, len(row.base), sum(sizes.values()))
    return TangentMachine._make((machine, *numbers, *counts))


@dataclass(frozen=True)
class TangentRow:
    """Programs of the derivatives of a row, by free (joint, place) in theta and base parameters."""

    row: Row
    free: tuple[tuple[int, int], ...]
    base: tuple[int, ...]

    @property
    def places(self) -> list[int]:
        """Parameters of the law that are free in some joint."""
        return sorted({place for _, place in self.free})

    @property
    def sizes(self) -> dict[str, int]:
        """How many numbers each name has."""
        sizes, e, F = self.row.sizes, self.row.entries, len(self.free)
        n, m, nf = sizes["q"], sizes["slow"], len(self.base)
        s = 2 * n + e * m
        return {
            **sizes,
            **{"by_v": m * m, "by_q": m * n, "by_w": m * n, "by_u": m * n, "by_z": e * m},
            **{
                "by_theta": F * (m if self.row.coupled_by_load else 1),
                "by_base": m * nf if self.row.coupled_by_load else 0,
                "by_level": F,
                "memory_by_z": e * e * m,
                "memory_by_v": e * m,
            },
            **{"memory_by_theta": e * F, "a": n, "moment": n, "memory1": e * m},
            **{"partial_q": n * n, "partial_w": n * n, "partial_p": n * nf},
            **{"change": s * (s + F + nf + n), "by_moment": n * n, "by_base_moment": n * nf},
        }

    @property
    def programs(self) -> dict[str, Program]:
        """Programs of the derivatives, and those of the step that they need."""
        names = dict.fromkeys(name for parts in self.sequences.values() for name in parts)
        methods = {
            name: getattr(self, name, None) or getattr(self.row, name, None) for name in names
        }
        slopes = {"slopes": self._slopes(), "levels": self._levels(), "rates": self._rates()}
        slopes["partials"] = program_of(self.partials, self.sizes)
        zeros = self.row.zeros | zero_entries(slopes.values())
        others = {
            name: program_of(method, self.sizes, zeros)
            for name, method in methods.items()
            if method and name not in slopes
        }
        return slopes | others

    @property
    def sequences(self) -> dict[str, tuple[str, ...]]:
        """Programs that are run one after the other, in the order of `TangentMachine`."""
        law = ("straight", "rates", "aim", "slopes", "levels")
        start = ("to_middle", "dynamics", *law, "accelerate_middle", "partials")
        crossing = "transition_crossing" if self.row.breaks else "transition"  # nothing crosses
        return {
            "differentiate": (*start, "transition", "restore"),
            "differentiate_crossing": (*start, crossing, "restore"),
            "displace_row": ("to_end", "dynamics", "displace"),
        }

    # ------------------------------------------------------------ slopes of the law

    def _derivatives(self, function: Any, output: str, inputs: Sequence[str]) -> Program:
        """Program of a function with the derivatives of an output, numbered from 0, in each input.

        "theta" stands for each place that is free, "z" for each entry of the memory, of all parts;
        "free" for each free entry of theta alone, "base" for each free base parameter.
        """
        sizes, m = self.sizes, self.sizes["slow"]
        directions: dict[str, Collection[str]] = {}
        for name in inputs:
            if name == "z":
                for i in range(self.row.entries):
                    directions[f"z {i}"] = [f"memory_{i * m + j + 1}" for j in range(m)]
            elif name == "theta":
                P = sizes["theta"] // m
                for k in self.places:
                    directions[f"theta {k}"] = [f"theta_{j * P + k + 1}" for j in range(m)]
            elif name == "free":
                P = sizes["theta"] // m
                for k, (joint, place) in enumerate(self.free):
                    directions[f"free {k}"] = [f"theta_{joint * P + place + 1}"]
            elif name == "base":
                for k, place in enumerate(self.base):
                    directions[f"base {k}"] = [f"p_{place + 1}"]
            elif name == "each v":
                directions["each v"] = [f"v_{j + 1}" for j in range(m)]
            else:
                for j in range(sizes[name]):
                    directions[f"{name} {j}"] = [f"{name}_{j + 1}"]
        return with_derivatives(program_of(function, sizes), directions, [output])

    def _columns(self, program: Program, output: str, name: str) -> tuple[Operand, ...]:
        """Derivatives (outputs, entries of an input) as numbers, row by row."""
        count = sum(key.startswith(f"{output} by {name} ") for key in program.outputs)
        columns = [program.outputs[f"{output} by {name} {j}"] for j in range(count)]
        return tuple(value for row in zip(*columns, strict=True) for value in row)

    def _of_free(self, program: Program, output: str, entry: int = 0) -> tuple[Operand, ...]:
        """Derivatives by free entries of theta, of the same part's output."""
        m = self.sizes["slow"]
        return tuple(
            program.outputs[f"{output} by theta {place}"][entry * m + joint]
            for joint, place in self.free
        )

    def _slopes(self) -> Program:
        def torque(x: Any) -> dict[str, Array]:
            return self.row.torque(SimpleNamespace(**vars(x) | self.row.dynamics(x)))

        of_theta = ("free", "base") if self.row.coupled_by_load else ("theta",)
        program = self._derivatives(torque, "sliding", ("v", "at_q", "at_w", "u", "z", *of_theta))
        rows = {"by_v": "v", "by_q": "at_q", "by_w": "at_w", "by_u": "u"}
        outputs = {x: self._columns(program, "sliding", name) for x, name in rows.items()}
        memory = [program.outputs[f"sliding by z {i}"] for i in range(self.row.entries)]
        outputs["by_z"] = tuple(value for entry in memory for value in entry)
        outputs["by_theta"] = (
            self._columns(program, "sliding", "free")
            if self.row.coupled_by_load
            else self._of_free(program, "sliding")
        )
        outputs["by_base"] = self._columns(program, "sliding", "base")
        outputs["sliding"] = program.outputs["sliding"]
        return needed(replace(program, outputs=outputs))

    def _levels(self) -> Program:
        def level(x: Any) -> dict[str, Array]:
            w = np.where(x.braking != 0.0, x.braking, 1.0)
            return {"level": self.row.of_law(self.row.law.limit, x, w)}

        program = self._derivatives(level, "level", ("theta",))
        return needed(replace(program, outputs={"by_level": self._of_free(program, "level")}))

    def _rates(self) -> Program:
        def later(x: Any) -> dict[str, Array]:
            return {"later": self.row.later_memory(x, x.v)}

        program = self._derivatives(later, "later", ("each v", "z", "theta"))
        entries, m = range(self.row.entries), self.sizes["slow"]
        columns = [program.outputs[f"later by z {k}"] for k in entries]
        by_z = tuple(columns[k][i * m + j] for i in entries for k in entries for j in range(m))
        by_theta = tuple(value for i in entries for value in self._of_free(program, "later", i))
        outputs = {"memory_by_z": by_z, "memory_by_theta": by_theta}
        outputs["memory_by_v"] = program.outputs["later by each v"]
        return needed(replace(program, outputs=outputs))

    # ------------------------------------------------------------ a substep

    def to_middle(self, x: Any) -> dict[str, Array]:
        at = middle(State(x.q0, x.w0), State(x.q, x.w), x.dt)
        mean = (x.memory0 + x.memory) / 2
        return {"at_q": at.q, "at_w": at.w, "memory1": x.memory, "memory": mean}

    def restore(self, x: Any) -> dict[str, Array]:
        return {"memory": x.memory1}

    @property
    def free_theta(self) -> FreeTheta:
        """What is free of theta."""
        return FreeTheta(*np.array(self.free, dtype=int).reshape(-1, 2).T)

    def slopes_of(self, x: Any) -> Slopes:
        """Slopes of friction in the middle of the substep."""
        m, n, free = len(x.slow), len(x.q), self.free_theta
        moves = np.where(x.v == self.row.inputs(x).w, 1.0, 0.0)[:, None]
        by_v = x.by_v.reshape(m, m) * moves @ self.row.mechanism.friction_map
        by_q, by_w, by_u = (x.reshape(m, n) for x in (x.by_q, x.by_w, x.by_u))
        by_z = x.by_z.reshape(self.row.entries, m)
        of_theta = (
            x.by_theta.reshape(m, len(self.free))
            if self.row.coupled_by_load
            else free.of_parts(x.by_theta, m)
        )
        of_base = x.by_base.reshape(m, -1) if len(x.by_base) else np.zeros((m, len(self.base)))
        friction = Slopes(x.sliding, by_q, by_v + by_w, by_u, by_z, of_theta, of_base)
        if self.row.sharp or not self.row.breaks:
            return friction
        return at_break_away(friction, x.braking, free.of_parts(x.by_level, m))

    def accelerate_middle(self, x: Any) -> dict[str, Array]:
        return {"a": self.row.acceleration(x)}

    def partials(self, x: Any) -> dict[str, Array]:
        partials = self.row.mechanism.partials(x.p, x.at_q, x.at_w, x.a)
        by_p = partials.by_p[:, list(self.base)]
        return {"partial_q": partials.by_q, "partial_w": partials.by_w, "partial_p": by_p}

    def transition(self, x: Any) -> dict[str, Array]:
        return {"change": self._change(x)[1]}

    def transition_crossing(self, x: Any) -> dict[str, Array]:
        start, T = self._change(x)
        at = self.row.crossing(x)._replace(M=x.M_end.reshape(len(x.q), -1))
        return {"change": crossed(T, start, x.w0, at, x.dt[:, None], x.slow)}

    def _change(self, x: Any) -> tuple[Array, Array]:
        """Derivatives of w where a substep begins, and of the state (s, D) behind it."""
        n, m, e, turns = len(x.q), len(x.slow), self.row.entries, self.row.turns
        rates = None
        if e:
            of_theta = self.free_theta.of_parts(x.memory_by_theta.reshape(e, len(self.free)), m)
            by_z, by_v = x.memory_by_z.reshape(e, e, m), x.memory_by_v.reshape(e, m)
            rates = by_z, by_v, of_theta
        M, by_q, by_w = (y.reshape(n, n) for y in (x.M, x.partial_q, x.partial_w))
        partials = Partials(by_q, by_w, x.partial_p.reshape(n, -1))
        motors = self.row.mechanism.motors
        loop = x.feedback.reshape(2, n) if self.row.feedback else None
        base = tuple(range(len(self.base)))  # the partials are of these alone
        here = linear(M, self.slopes_of(x), partials, base, motors, turns, rates, loop)
        size = 2 * n + e * m
        T = np.eye(size, size + len(self.free) + len(self.base) + n) + 0.0 * x.dt
        start = without_held(T[n : 2 * n], x.sticking, x.M0.reshape(n, n), turns)
        T = np.concatenate([T[:n], start, T[2 * n :]])
        return start, advanced(T, np.eye(n), here, x.sticking, x.dt[:, None], turns)

    # ------------------------------------------------------------ moments of the torque

    def to_end(self, x: Any) -> dict[str, Array]:
        return {"at_q": x.q, "at_w": x.w}

    def displace(self, x: Any) -> dict[str, Array]:
        mechanism, resting = self.row.mechanism, resting_parts(x.w, self.row.turns) == 0.0
        way, by_moment, by_base = displacement(
            x.M.reshape(len(x.q), -1),
            resting,
            x.moment,
            lambda a: mechanism.partials(x.p, x.q, 0.0 * a, a).by_p,
            self.base,
            self.row.turns,
        )
        return {"q": x.q + way, "by_moment": by_moment, "by_base_moment": by_base}
