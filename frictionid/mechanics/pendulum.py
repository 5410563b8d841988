"""One joint that carries a pendulum: q = 0 hangs down, counter-clockwise positive."""

from __future__ import annotations

from functools import cache

import sympy as sp

from frictionid.mechanics.description import Base, Body, Description
from frictionid.mechanics.mechanism import Parameter
from frictionid.mechanics.symbolic import SymbolicMechanism

_MOTOR = (
    Parameter("kt", 0.0, "N m/A", "torque constant of the motor, at the joint"),
    Parameter("R", 0.0, "Ohm", "resistance of the motor"),
)


def pendulum(
    driven: bool = True,
    motor: bool = False,
    *,
    mass: float | None = None,
    length: float | None = None,
    inertia: float | None = None,
    rotor: float | None = None,
    gear: float | None = None,
    g: float | None = None,
    kt: float | None = None,
    R: float | None = None,
) -> SymbolicMechanism:
    """Pendulum of mass and length (to its centre of mass), reflected rotor inertia included.

    (m l^2 + J + N^2 Jr) dw/dt = -m g l sin q + u - Tf

    `driven` says whether the joint has a motor. With `motor`, the constants kt and R of a DC motor
    are parameters, too: torques of recordings with its voltage follow from them. At zero those of
    the recordings are used.

    Raises
    ------
    ValueError
        Unless `driven` and `motor` are true or false.

    >>> pendulum(mass=0.4, length=0.25).base_names
    ('inertia', 'gravity')
    """
    given = {name: value for name, value in locals().items() if value is not None}
    options = {name: given.pop(name) for name in ("driven", "motor")}
    for name, value in options.items():
        if value not in (False, True):
            raise ValueError(f"pendulum: {name} = {value!r} must be true or false")
    other = options.items() - {"driven": True, "motor": False}.items()
    return SymbolicMechanism.of(_description(driven, motor), given, dict(other))


@cache
def _description(driven: bool, motor: bool) -> Description:
    m, length, J, rotor, gear, g = symbols = sp.symbols("mass length inertia rotor gear g")
    q = sp.Symbol("q1")
    defaults = (1.0, 1.0, 0.0, 0.0, 1.0, 9.81)
    required = (True, True, False, False, False, False)
    units = ("kg", "m", "kg m^2", "kg m^2", "1", "m/s^2")
    meanings = (
        "mass of all that the joint carries",
        "joint to centre of mass",
        "inertia about the centre of mass",
        "rotor inertia on the motor side",
        "gear ratio",
        "gravity",
    )
    return Description(
        kind="pendulum",
        joints=("joint 1",),
        q=(q,),
        gravity=g,
        parameters=(
            *map(Parameter, map(str, symbols), defaults, units, meanings, required),
            *(_MOTOR if motor else ()),
        ),
        bodies=(Body(m, length * sp.sin(q), -length * sp.cos(q), J, q, 0),),
        rotors=((rotor, gear * q),),
        driven=(driven,),
        base=(
            Base("inertia", m * length**2 + J + gear**2 * rotor, "kg m^2"),
            Base("gravity", m * g * length, "N m"),
        ),
    )
