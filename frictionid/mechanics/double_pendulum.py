"""Two links in a vertical plane, either or both joints driven by geared motors.

q1 = 0 hangs down, counter-clockwise positive; q2 is relative to link 1. The symbols are those of
the published models of the DFKI double pendulum [Wiebe2024]: I1 and I2 are about the joints, the
rotor of the second motor sits on link 1 and turns against its joint (M12 gets - gr Ir).
"""

from __future__ import annotations

from functools import cache
from itertools import product

import sympy as sp

from frictionid.mechanics.description import Base, Body, Description
from frictionid.mechanics.mechanism import Parameter
from frictionid.mechanics.symbolic import SymbolicMechanism

PARAMETERS = {
    "m1": (0.5, "kg", "mass of link 1"),
    "m2": (0.5, "kg", "mass of link 2"),
    "l1": (0.2, "m", "joint 1 to joint 2"),
    "r1": (0.1, "m", "joint 1 to centre of mass of link 1"),
    "r2": (0.1, "m", "joint 2 to centre of mass of link 2"),
    "I1": (0.01, "kg m^2", "inertia of link 1 about joint 1"),
    "I2": (0.01, "kg m^2", "inertia of link 2 about joint 2"),
    "Ir": (0.0, "kg m^2", "rotor inertia on the motor side"),
    "gr": (1.0, "1", "gear ratio"),
    "g": (9.81, "m/s^2", "gravity"),
}
OPTIONAL = ("Ir", "gr", "g")


def double_pendulum(
    driven: tuple[bool, bool] = (True, True),
    *,
    m1: float | None = None,
    m2: float | None = None,
    l1: float | None = None,
    r1: float | None = None,
    r2: float | None = None,
    I1: float | None = None,
    I2: float | None = None,
    Ir: float | None = None,
    gr: float | None = None,
    g: float | None = None,
) -> SymbolicMechanism:
    """Double pendulum with motors at the joints where `driven` is true.

    A rotor is counted at each driven joint only. Without one at joint 2, M12 and M22 have the same
    constant part: inertia_12 is then no base parameter.

    m1, m2, ... : values of its parameters, SI; `frictionid mechanisms double_pendulum` lists them

    Raises
    ------
    ValueError
        Unless `driven` is a pair of true and false.
    InputError
        For a parameter that is no finite number.

    >>> double_pendulum().base_names
    ('inertia_11', 'inertia_12', 'inertia_22', 'coupling', 'gravity_1', 'gravity_2')
    """
    given = {name: value for name, value in locals().items() if value is not None}
    options = {"driven": given.pop("driven")}
    if driven not in product((False, True), repeat=2):
        raise ValueError(f"double_pendulum: driven = {driven!r} must be a pair of true and false")
    other = options if driven != (True, True) else {}
    return SymbolicMechanism.of(_description(driven), given, other)


@cache
def _description(driven: tuple[bool, bool]) -> Description:
    s = {name: sp.Symbol(name) for name in PARAMETERS}
    m1, m2, l1, r1, r2, I1, I2, Ir, gr, g = s.values()
    q1, q2 = sp.symbols("q1 q2")
    first, second = (sp.Integer(bool(d)) for d in driven)
    x2, y2 = l1 * sp.sin(q1) + r2 * sp.sin(q1 + q2), -l1 * sp.cos(q1) - r2 * sp.cos(q1 + q2)
    bodies = (
        Body(m1, r1 * sp.sin(q1), -r1 * sp.cos(q1), I1 - m1 * r1**2, q1, 0),
        Body(m2, x2, y2, I2 - m2 * r2**2, q1 + q2, 1),
    )
    reflected = first * gr**2 * Ir + second * Ir
    inertia_12 = Base("inertia_12", I2 - gr * Ir, "kg m^2")
    base = (
        Base("inertia_11", I1 + I2 + m2 * l1**2 + reflected, "kg m^2"),
        *((inertia_12,) if second else ()),
        Base("inertia_22", I2 + second * gr**2 * Ir, "kg m^2"),
        Base("coupling", m2 * l1 * r2, "kg m^2"),
        Base("gravity_1", g * (m1 * r1 + m2 * l1), "N m"),
        Base("gravity_2", g * m2 * r2, "N m"),
    )
    return Description(
        kind="double_pendulum",
        joints=("joint 1", "joint 2"),
        q=(q1, q2),
        gravity=g,
        parameters=tuple(
            Parameter(k, *PARAMETERS[k], required=k not in OPTIONAL) for k in PARAMETERS
        ),
        bodies=bodies,
        rotors=((first * Ir, gr * q1), (second * Ir, q1 - gr * q2)),
        driven=(bool(driven[0]), bool(driven[1])),
        base=base,
        drawing=((0, 0), (l1 * sp.sin(q1), -l1 * sp.cos(q1)), (x2, y2)),
    )
