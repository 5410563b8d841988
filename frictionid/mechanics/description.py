"""Description of a mechanism in symbols: its bodies, joints and parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import sympy as sp

from frictionid.mechanics.mechanism import Parameter


class Base(NamedTuple):
    """A base parameter: name, expression in physical parameters, and unit."""

    name: str
    expression: sp.Expr
    unit: str


Expression: TypeAlias = Any  # of SymPy, or a number


class Body(NamedTuple):
    """A rigid body in a vertical plane, y upwards.

    mass ; x, y : its centre of mass ; inertia : about that ; angle : by which it turns ; joint :
    the last one, from 0, that lies between it and the ground
    """

    mass: Expression
    x: Expression
    y: Expression
    inertia: Expression = 0
    angle: Expression = 0
    joint: int = 0


@dataclass(frozen=True)
class Description:
    """A mechanism in symbols; `SymbolicMechanism` evaluates its equations of motion.

    Attributes
    ----------
    kind, joints : names of the mechanism and of its joints
    q : symbols of the positions ; gravity : of g, or 0
    parameters, bodies, base : see `Parameter`, `Body` and `Base`; the symbol of a parameter has its
        name
    rotors : pairs (inertia, angle by which it turns)
    potential : energy beside that of gravity, as of springs
    drawing : points (x, y) of a line that draws it, where bodies alone would not do
    driven : which joints have a motor
    position_units : "rad" or "m" of each joint; all "rad" where there are none
    torque_units : of each joint, where they do not follow from those of the positions
    """

    kind: str
    joints: tuple[str, ...]
    q: tuple[sp.Symbol, ...]
    gravity: Expression
    parameters: tuple[Parameter, ...]
    bodies: tuple[Body, ...]
    rotors: tuple[tuple[Expression, Expression], ...]
    driven: tuple[bool, ...]
    base: tuple[Base, ...]
    position_units: tuple[str, ...] = ()
    torque_units: tuple[str, ...] = ()
    potential: Expression = 0
    drawing: tuple[tuple[Expression, Expression], ...] = ()

    @property
    def line(self) -> tuple[tuple[Expression, Expression], ...]:
        """Points (x, y) of the line that draws it: its own, or origin and bodies joint by joint."""
        bodies = sorted(self.bodies, key=lambda body: body.joint)
        return self.drawing or ((0, 0), *((body.x, body.y) for body in bodies))

    @property
    def w(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the velocities."""
        return tuple(sp.Symbol(f"_w{j}") for j in range(len(self.q)))

    @property
    def symbols(self) -> list[sp.Symbol]:
        """Symbols of the parameters."""
        return [sp.Symbol(parameter.name) for parameter in self.parameters]
