"""The functions that code of a friction has: start, torque and advance, or torque alone."""

from __future__ import annotations

from typing import NamedTuple

from frictionid.deploy.export.exported import ExportedFriction
from frictionid.deploy.export.expressions import Block, blocks, names
from frictionid.programs.program import Program


class Element(NamedTuple):
    """One number of an argument: entry `entry` of joint `joint`, both from 0."""

    argument: str
    joint: int = 0
    entry: int = 0


class Function(NamedTuple):
    """A function of arrays with an entry for each joint.

    arguments : "q", "w", "u", "load", "memory" (entries, each of all joints) and "dt"
    says : what it gives
    """

    name: str
    arguments: tuple[str, ...]
    program: Program
    says: str

    @property
    def code(self) -> tuple[Block, ...]:
        """Its expressions, joint by joint."""
        return blocks(self.program)

    def read(self, code: tuple[Block, ...]) -> dict[str, Element]:
        """Where the inputs that the code reads stand in the arguments, by their names in it."""
        own = names(code)
        return {name: element_of(name) for name in self.program.inputs if name in own}


def element_of(name: str) -> Element:
    """Where an input or output of a program stands.

    >>> element_of("w_2"), element_of("memory_3_1")
    (Element(argument='w', joint=1, entry=0), Element(argument='memory', joint=0, entry=2))
    """
    group, _, joint = name.rpartition("_")
    if group.startswith("memory_"):
        return Element("memory", int(joint) - 1, int(group.removeprefix("memory_")) - 1)
    return Element(group, int(joint) - 1)


def signatures(own: ExportedFriction) -> str:
    """Calls of the functions, as in "torque(w, memory)", for people."""
    made = functions(own)
    names = {"start": "memory = ", "advance": "memory = ", "torque": "Tf = "}
    return "; ".join(f"{names[f.name]}{f.name}({', '.join(f.arguments)})" for f in made)


def functions(own: ExportedFriction) -> tuple[Function, ...]:
    """Functions of a friction; those of a static law have no memory."""
    programs = own.programs
    x, time = programs.inputs, own.law.sample_time
    torque = "Friction torques Tf, one for each joint."
    if not programs.memory:
        return (Function("torque", x, programs.torque, torque),)
    when = "each step" if time is None else f"each {time:g} s"
    return (
        Function("start", x, programs.start, "Memory at the start of a motion."),
        Function("torque", (*x, "memory"), programs.torque, torque),
        Function(
            "advance",
            (*x, "memory", "dt"),
            programs.advance,
            f"Memory after dt [s], at the inputs after it; to be called {when}.",
        ),
    )
