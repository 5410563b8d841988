"""What a mechanism consists of: its bodies, joints and parameters, in symbols."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import sympy as sp


class Parameter(NamedTuple):
    """A physical parameter of a mechanism: symbol, default value, unit and meaning."""

    symbol: sp.Symbol
    default: float
    unit: str
    meaning: str


class Base(NamedTuple):
    """A base parameter: its name, its expression in the physical ones, and its unit."""

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
    """What a mechanism consists of; `Mechanism` turns it into numbers.

    `q` and `w` are the joints' symbols, `gravity` that of g, `rotors` pairs (inertia, rate),
    `driven` says which joints have a motor, `joints` names them.
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
