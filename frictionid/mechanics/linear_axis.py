"""One carriage on a straight level guide: a prismatic joint, position in m, force in N."""

from __future__ import annotations

from functools import cache

import sympy as sp

from frictionid.mechanics.description import Base, Body, Description
from frictionid.mechanics.mechanism import Parameter
from frictionid.mechanics.symbolic import SymbolicMechanism


def linear_axis(
    driven: bool = True, *, mass: float | None = None, g: float | None = None
) -> SymbolicMechanism:
    """Mass on a level guide; the motor's inertia, seen at the carriage, is part of the mass.

    mass dw/dt = u - Tf, with w [m/s], u and Tf [N]; `driven` says whether the axis has a motor.

    Raises
    ------
    ValueError
        Unless `driven` is true or false.
    InputError
        For a parameter that is no finite number.

    >>> linear_axis(mass=20.0).base_names
    ('mass',)
    """
    if driven not in (False, True):
        raise ValueError(f"linear_axis: driven = {driven!r} must be true or false")
    given = {name: value for name, value in (("mass", mass), ("g", g)) if value is not None}
    return SymbolicMechanism.of(_description(driven), given, {} if driven else {"driven": False})


@cache
def _description(driven: bool) -> Description:
    mass, g, q = sp.symbols("mass g q1")
    return Description(
        kind="linear_axis",
        joints=("axis",),
        q=(q,),
        gravity=g,
        parameters=(
            Parameter("mass", 1.0, "kg", "everything that moves", required=True),
            Parameter("g", 9.81, "m/s^2", "gravity, for the load of the guide"),
        ),
        bodies=(Body(mass, q, 0),),
        rotors=(),
        driven=(driven,),
        base=(Base("mass", mass, "kg"),),
        position_units=("m",),
    )
