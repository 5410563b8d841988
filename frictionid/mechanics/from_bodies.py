"""Mechanisms of one's own, from their bodies: all else is derived."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import sympy as sp

from frictionid.config import nearest
from frictionid.errors import InputError

from .description import Base, Body, Description, Expression, by_motion, combination, energies
from .mechanism import Parameter
from .symbolic import SymbolicMechanism

_LONGEST = 24  # of an expression that serves as a name


class Joint(NamedTuple):
    """A joint: name, symbol of its position, "rad" or "m", and whether a motor drives it."""

    name: str
    q: sp.Symbol
    unit: str = "rad"
    driven: bool = True


def from_bodies(
    bodies: Sequence[Body],
    joints: Sequence[Joint],
    parameters: Sequence[Parameter],
    *,
    kind: str = "own",
    rotors: Sequence[tuple[Expression, Expression]] = (),
    potential: Expression = 0,
    base: Mapping[str, Expression] | None = None,
) -> SymbolicMechanism:
    """Mechanism of bodies in a vertical plane, in SymPy expressions of positions and parameters.

    Its equations of motion, base parameters and bearing loads follow. y points upwards; a parameter
    named g is the gravity, without one there is none (a level plane).

    Parameters
    ----------
    bodies : sequence of Body
    joints : sequence of Joint
        In the order of the recordings' columns.
    parameters : sequence of Parameter
        Of the symbols in the expressions, by their names.
    kind : str
        Name in messages, and in [mechanism]; `module:function` where files name it so.
    rotors : sequence of (inertia, angle by which it turns)
        Inertias that turn without being bodies, such as those of geared motors.
    potential : expression
        Energy beside that of gravity, such as k q^2 / 2 of a spring.
    base : mapping of str to expression, optional
        Names of the base parameters. By default they are found, and called by what they are.

    Raises
    ------
    InputError
        For a symbol that is no parameter, or a parameter in which the energy is not linear after
        any regrouping, such as a length inside a sine.

    Examples
    --------
    >>> q, mass, length = sp.symbols("q mass length")
    >>> swing = from_bodies(
    ...     [Body(mass, length * sp.sin(q), -length * sp.cos(q))],
    ...     [Joint("hinge", q)],
    ...     [Parameter("mass", 0.5, "kg", "bob"), Parameter("length", 0.2, "m", "of the string"),
    ...      Parameter("g", 9.81, "m/s^2", "gravity")],
    ... )
    >>> dict(zip(swing.base_names, swing.base_units))
    {'length^2*mass': 'kg m^2', 'g*length*mass': 'N m'}
    """
    described = Description(
        kind=kind,
        joints=tuple(joint.name for joint in joints),
        q=tuple(_plain(joint.q) for joint in joints),
        gravity=sp.Symbol("g") if any(p.name == "g" for p in parameters) else 0,
        parameters=tuple(parameters),
        bodies=tuple(Body(*map(_plain, body[:-1]))._replace(joint=body.joint) for body in bodies),
        rotors=tuple((_plain(inertia), _plain(angle)) for inertia, angle in rotors),
        driven=tuple(joint.driven for joint in joints),
        base=(),
        position_units=tuple(joint.unit for joint in joints),
        potential=_plain(potential),
    )
    _check(described)
    parts = list(_parts(described))
    derived = _derived(parts) if base is None else _named(base, parts)
    return SymbolicMechanism.from_description(replace(described, base=tuple(derived)))


def _parts(d: Description) -> Iterator[Base]:
    """Coefficients of the Lagrangian without their numbers: kinetic ones first, short ones first.

    They are named after what they belong to, "inertia" or "potential".
    """
    symbols = set(d.symbols)
    for name, energy in zip(("inertia", "potential"), energies(d), strict=True):
        coefficients = by_motion(energy, d)
        for motion, coefficient in sorted(
            coefficients.items(), key=lambda x: (len(x[1].args), str(x))
        ):
            if inside := motion.free_symbols & symbols:
                raise InputError(
                    f"{d.kind}: parameter {str(min(inside, key=str))!r} stands inside {motion}, "
                    "where no regrouping makes the equations linear in it: write the number"
                )
            if motion.free_symbols and coefficient != 0:
                yield Base(name, _without_number(coefficient), _unit(motion, d))


def _derived(parts: Sequence[Base]) -> Iterator[Base]:
    """Base parameters: the first coefficients of which none is a combination of others."""
    chosen: list[Base] = []
    for part in parts:
        if combination(part.expression, [c.expression for c in chosen]) is None:
            chosen.append(part)
    for k, part in enumerate(chosen):
        text = str(part.expression).replace("**", "^").replace(" ", "")
        long = f"{part.name}_{k + 1}"
        yield part._replace(name=text if len(text) <= _LONGEST else long)


def _named(base: Mapping[str, Expression], parts: Sequence[Base]) -> Iterator[Base]:
    """Base parameters of given names, with the units that their coefficients have."""
    for name, text in base.items():
        expression = sp.expand(_plain(text))
        units = [p.unit for p in parts if sp.cancel(p.expression / expression).is_number]
        yield Base(name, expression, units[0] if units else "")


def _without_number(e: sp.Expr) -> sp.Expr:
    """An expression without its number in front: no halves, and no minus."""
    part = e.primitive()[1]
    return -part if part.could_extract_minus_sign() else part


def _unit(motion: sp.Expr, d: Description) -> str:
    """Unit of the coefficient by which a function of the state becomes an energy."""
    powers = motion.as_powers_dict()
    moving = list(zip(d.q, d.w, d.position_units, strict=True))
    metres = int(sum(powers[q] + powers[w] for q, w, unit in moving if unit == "m"))
    rates = int(sum(powers[w] for w in d.w))
    if rates == 0:
        return {0: "N m", 1: "N"}.get(metres, "N/m" + f"^{metres - 1}" * (metres > 2))
    length = {0: "", 1: " m"}.get(2 - metres, f" m^{2 - metres}")
    return f"kg{length}" + ("" if rates == 2 else f" s^{rates - 2}")


def _plain(e: Expression) -> sp.Expr:
    """An expression whose symbols have names and nothing else, as those of the parameters."""
    expression = sp.sympify(e)
    return expression.xreplace({s: sp.Symbol(s.name) for s in expression.free_symbols})


def _check(d: Description) -> None:
    names = [*map(str, d.q), *(p.name for p in d.parameters)]
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise InputError(f"{d.kind}: {twice[0]!r} names two parameters or joints; rename one")
    for joint, unit in zip(d.joints, d.position_units, strict=True):
        if unit not in ("rad", "m"):
            raise InputError(f'{d.kind}: the unit of {joint} is {unit!r}; it must be "rad" or "m"')
    parts = [e for body in d.bodies for e in body[:-1]] + [e for pair in d.rotors for e in pair]
    unknown = sorted(set().union(*(e.free_symbols for e in (*parts, d.potential))), key=str)
    for symbol in unknown:
        if str(symbol) not in names:
            raise InputError(
                f"{d.kind}: the symbol {str(symbol)!r} is neither a joint's position nor a "
                f"parameter; {nearest(str(symbol), names)}"
            )
    for body in d.bodies:
        if body.joint not in range(len(d.q)):
            raise InputError(
                f"{d.kind}: a body has joint = {body.joint}; joints count from 0 to {len(d.q) - 1}"
            )
