"""One carriage on a straight level guide: a prismatic joint, position in m, force in N."""

from __future__ import annotations

from functools import cache

import sympy as sp

from frictionid.mechanics.description import Base, Body, Description, Parameter
from frictionid.mechanics.mechanism import Mechanism


@cache
def linear_axis(driven: bool = True) -> Mechanism:
    """Mass on a level guide; the motor's inertia, seen at the carriage, is part of the mass.

    mass dw/dt = u - Tf, with w [m/s], u and Tf [N]; `driven` says whether the axis has a motor.

    Raises
    ------
    ValueError
        Unless `driven` is true or false.

    >>> linear_axis().base_names
    ('mass',)
    """
    if driven not in (False, True):
        raise ValueError(f"linear_axis: driven = {driven!r} must be true or false")
    mass, g, q, w = sp.symbols("mass g q1 w1")
    return Mechanism(
        Description(
            kind="linear_axis",
            joints=("axis",),
            q=(q,),
            w=(w,),
            gravity=g,
            parameters=(
                Parameter(mass, 1.0, "kg", "everything that moves", required=True),
                Parameter(g, 9.81, "m/s^2", "gravity, for the load of the guide"),
            ),
            bodies=(Body(mass, q, sp.Integer(0), sp.Integer(0), sp.Integer(0), 0),),
            rotors=(),
            driven=(driven,),
            base=(Base("mass", mass, "kg"),),
            angle_unit="m",
            torque_unit="N",
        )
    )
