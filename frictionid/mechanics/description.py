"""A mechanism in symbols, and its equations of motion from the Lagrangian."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import sympy as sp

from .mechanism import Parameter


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


class Equations(NamedTuple):
    """Symbolic equations of motion in base parameters.

    M : mass matrix by rows; h, dLdq : n expressions; energy : T + V
    arguments : symbols of q, w and base parameters; base : those of the base parameters
    """

    M: list[sp.Expr]
    h: list[sp.Expr]
    dLdq: list[sp.Expr]
    energy: sp.Expr
    arguments: list[sp.Symbol]
    base: list[sp.Symbol]


def equations_of_motion(d: Description) -> Equations:
    """Equations of motion from the Lagrangian L = T - V, with the momentum p = dL/dw.

    M = dp/dw,    h = dL/dq - dp/dq w
    """
    n = range(len(d.q))
    symbols = [sp.Symbol(f"_b{i}") for i in range(len(d.base))]
    kinetic, potential = (_in_base(energy, d, symbols) for energy in energies(d))
    L = kinetic - potential
    momentum = [sp.diff(L, wi) for wi in d.w]
    M = [sp.diff(momentum[min(i, j)], d.w[max(i, j)]) for i in n for j in n]
    dLdq = [sp.diff(L, qi) for qi in d.q]
    h = [sp.expand(dLdq[i] - sum(sp.diff(momentum[i], d.q[j]) * d.w[j] for j in n)) for i in n]
    return Equations(M, h, dLdq, kinetic + potential, [*d.q, *d.w, *symbols], symbols)


def energies(d: Description) -> tuple[sp.Expr, sp.Expr]:
    """Kinetic and potential energy, as sums of physical parameters times functions of the state."""
    kinetic, potential = sp.Integer(0), sp.sympify(d.potential)
    for inertia, angle in d.rotors:
        kinetic += inertia * _rate(angle, d.q, d.w) ** 2 / 2
    for body in d.bodies:
        vx, vy, turn = (_rate(z, d.q, d.w) for z in (body.x, body.y, body.angle))
        kinetic += body.mass * (vx**2 + vy**2) / 2 + body.inertia * turn**2 / 2
        potential += body.mass * d.gravity * body.y
    return _polynomial(kinetic, d.q), sp.expand(potential)


def _rate(z: Expression, q: Sequence[sp.Symbol], w: Sequence[sp.Symbol]) -> sp.Expr:
    return sum((sp.diff(z, qi) * wi for qi, wi in zip(q, w, strict=True)), sp.Integer(0))


def _polynomial(e: sp.Expr, q: Sequence[sp.Symbol]) -> sp.Expr:
    # with sin^2 = 1 - cos^2 rotated squares cancel as polynomials: 16 times faster than trigsimp
    e = sp.expand(sp.expand_trig(sp.expand(e)))
    for qi in q:
        e = sp.expand(e.subs(sp.sin(qi) ** 2, 1 - sp.cos(qi) ** 2))
    return e


def _in_base(e: sp.Expr, d: Description, symbols: Sequence[sp.Symbol]) -> sp.Expr:
    """An energy that is linear in the base parameters, with a symbol for each of them."""
    out = sp.Integer(0)
    for motion, coefficient in by_motion(e, d).items():
        if motion.free_symbols:  # where an energy has its zero changes no motion
            out += _match(coefficient, d, symbols) * motion
    return out


def by_motion(e: sp.Expr, d: Description) -> dict[sp.Expr, sp.Expr]:
    """Coefficients of an energy, in physical parameters, by the functions of the state."""
    coefficients: dict[sp.Expr, sp.Expr] = {}
    for term in sp.Add.make_args(e):
        constant, motion = term.as_independent(*d.q, *d.w)
        coefficients[motion] = coefficients.get(motion, sp.Integer(0)) + constant
    return {motion: sp.expand(coefficient) for motion, coefficient in coefficients.items()}


def _match(coefficient: sp.Expr, d: Description, symbols: Sequence[sp.Symbol]) -> sp.Expr:
    if coefficient == 0 or not coefficient.free_symbols:
        return coefficient
    factors = combination(coefficient, [base.expression for base in d.base])
    if factors is not None:
        return sum((f * s for f, s in zip(factors, symbols, strict=True)), sp.Integer(0))
    raise ValueError(
        f"{d.kind}: the coefficient {coefficient} of the Lagrangian is no multiple of a base "
        f"parameter ({', '.join(b.name for b in d.base)}): add one to `base`"
    )


def combination(e: sp.Expr, terms: Sequence[sp.Expr]) -> list[sp.Expr] | None:
    """Numbers by which `terms` add up to an expression, or None where none do.

    >>> a, b = sp.symbols("a b")
    >>> combination(3 * a - b, [a + b, 2 * a])
    [-1, 2]
    """
    columns = [sp.expand(t).as_coefficients_dict() for t in (*terms, e)]
    rows = sorted(set().union(*columns), key=str)
    matrix = sp.Matrix([[column[row] for column in columns] for row in rows])
    reduced, pivots = matrix.rref()
    if len(terms) in pivots:
        return None
    numbers = [sp.Integer(0)] * len(terms)
    for row, pivot in enumerate(pivots):
        numbers[pivot] = reduced[row, len(terms)]
    return numbers


def bearing_forces(d: Description, a: Sequence[sp.Symbol]) -> list[sp.Expr]:
    """Forces x_1, y_1, x_2, y_2, ... that each joint's bearing bears of the bodies beyond it.

    A guide bears no force along itself: that is the motor's.
    """
    forces = []
    for joint, q in enumerate(d.q):
        beyond = [body for body in d.bodies if body.joint >= joint]
        total = [sp.Integer(0), sp.Integer(0)]
        for body in beyond:
            for axis, (place, g) in enumerate(((body.x, 0), (body.y, d.gravity))):
                rate = _rate(place, d.q, d.w)
                change = _rate(rate, d.q, d.w) + _rate(rate, d.w, a)
                total[axis] += body.mass * (change + g)
        if beyond and d.position_units[joint : joint + 1] == ("m",):
            x, y = (sp.diff(place, q) for place in (beyond[0].x, beyond[0].y))
            along = (total[0] * x + total[1] * y) / (x**2 + y**2)
            total = [total[0] - along * x, total[1] - along * y]
        forces += total
    return forces
