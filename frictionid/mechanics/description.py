"""Description of a mechanism in symbols: its bodies, joints and parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import sympy as sp


class Parameter(NamedTuple):
    """A physical parameter of a mechanism: symbol, default value, unit and meaning.

    required : a data set must give it; the default then serves examples only
    """

    symbol: sp.Symbol
    default: float
    unit: str
    meaning: str
    required: bool = False


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
    """A mechanism in symbols; `Mechanism` evaluates its equations of motion.

    Attributes
    ----------
    kind, joints : names of the mechanism and of its joints
    q, w, gravity : symbols of angles, velocities and g
    parameters, bodies, base : see `Parameter`, `Body` and `Base`
    rotors : pairs (inertia, angular rate)
    driven : which joints have a motor
    angle_unit, torque_unit : "m" and "N" for prismatic joints
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
    angle_unit: str = "rad"
    torque_unit: str = "N m"
