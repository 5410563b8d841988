"""One joint that carries a pendulum: q = 0 hangs down, counter-clockwise positive."""

from __future__ import annotations

from functools import cache

import sympy as sp

from frictionid.mechanics.lagrange import Base, Body, Description, Mechanism, Parameter


@cache
def pendulum(driven: bool = True) -> Mechanism:
    """Pendulum of mass and length (to its centre of mass), reflected rotor inertia included.

    (m l^2 + J + N^2 Jr) dw/dt = -m g l sin q + u - Tf

    Raises
    ------
    ValueError
        Unless `driven` is true or false.

    >>> pendulum().base_names
    ('inertia', 'gravity')
    """
    if driven not in (False, True):
        raise ValueError(f"pendulum: driven = {driven!r} must be true or false")
    m, length, J, rotor, gear, g = symbols = sp.symbols("mass length inertia rotor gear g")
    q, w = sp.symbols("q1 w1")
    defaults = (1.0, 1.0, 0.0, 0.0, 1.0, 9.81)
    units = ("kg", "m", "kg m^2", "kg m^2", "1", "m/s^2")
    meanings = (
        "mass",
        "joint to centre of mass",
        "inertia about the centre of mass",
        "rotor inertia on the motor side",
        "gear ratio",
        "gravity",
    )
    return Mechanism(
        Description(
            kind="pendulum",
            joints=("joint 1",),
            q=(q,),
            w=(w,),
            gravity=g,
            parameters=tuple(map(Parameter, symbols, defaults, units, meanings)),
            bodies=(Body(m, length * sp.sin(q), -length * sp.cos(q), J, w, 0),),
            rotors=((rotor, gear * w),),
            driven=(driven,),
            base=(
                Base("inertia", m * length**2 + J + gear**2 * rotor, "kg m^2"),
                Base("gravity", m * g * length, "N m"),
            ),
        )
    )
