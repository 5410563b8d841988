"""Description of a mechanism in symbols: its bodies, joints and parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import sympy as sp

from frictionid.mechanics.mechanism import Parameter


class Base(NamedTuple):
    """A base parameter: name, expression in physical parameters, and unit."""

    name: str
    expression: sp.Expr
    unit: str


class Body(NamedTuple):
    """A rigid body: mass, centre of mass (x, y), inertia about it, angular rate, carrying joint."""

    mass: sp.Expr
    x: sp.Expr
    y: sp.Expr
    inertia: sp.Expr
    rate: sp.Expr
    joint: int


@dataclass(frozen=True)
class Description:
    """A mechanism in symbols; `SymbolicMechanism` evaluates its equations of motion.

    Attributes
    ----------
    kind, joints : names of the mechanism and of its joints
    q, w, gravity : symbols of angles, velocities and g
    parameters, bodies, base : see `Parameter`, `Body` and `Base`; the symbol of a parameter has its
        name
    rotors : pairs (inertia, angular rate)
    driven : which joints have a motor
    position_units : "rad" or "m" of each joint; all "rad" where there are none
    torque_units : of each joint, where they do not follow from those of the positions
    """

    kind: str
    joints: tuple[str, ...]
    q: tuple[sp.Symbol, ...]
    w: tuple[sp.Symbol, ...]
    gravity: sp.Symbol
    parameters: tuple[Parameter, ...]
    bodies: tuple[Body, ...]
    rotors: tuple[tuple[sp.Expr, sp.Expr], ...]
    driven: tuple[bool, ...]
    base: tuple[Base, ...]
    position_units: tuple[str, ...] = ()
    torque_units: tuple[str, ...] = ()

    @property
    def symbols(self) -> list[sp.Symbol]:
        """Symbols of the parameters."""
        return [sp.Symbol(parameter.name) for parameter in self.parameters]
