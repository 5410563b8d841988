"""One joint that carries a pendulum: q = 0 hangs down, counter-clockwise positive."""

from functools import cache

import sympy as sp

from .description import Base, Body, Description
from .mechanism import Parameter, Value
from .symbolic import SymbolicMechanism

_MOTOR = (
    Parameter("kt", 0.0, "N m/A", "torque constant of the motor, at the joint"),
    Parameter("R", 0.0, "Ohm", "resistance of the motor"),
)


def pendulum(
    driven: bool = True,
    motor: bool = False,
    *,
    mass: Value = None,
    length: Value = None,
    inertia: Value = None,
    rotor: Value = None,
    gear: Value = None,
    g: Value = None,
    kt: Value = None,
    R: Value = None,
) -> SymbolicMechanism:
    """Pendulum of mass and length (to its centre of mass), reflected rotor inertia included.

    (m l^2 + J + N^2 Jr) dw/dt = -m g l sin q + u - Tf

    `driven` says whether the joint has a motor. With `motor`, the constants kt and R of a DC motor
    are parameters, too: torques of recordings with its voltage follow from them. At zero those of
    the recordings are used.

    >>> pendulum(mass=0.4, length=0.25).base_names
    ('inertia', 'gravity')
    """
    return SymbolicMechanism.of_kind(_pendulum, locals())


@cache
def _pendulum(driven: bool = True, motor: bool = False) -> Description:
    m, length, J, rotor, gear, g = sp.symbols("mass length inertia rotor gear g")
    q = sp.Symbol("q1")
    parameters = (
        Parameter("mass", 1.0, "kg", "mass of all that the joint carries", required=True),
        Parameter("length", 1.0, "m", "joint to centre of mass", required=True),
        Parameter("inertia", 0.0, "kg m^2", "inertia about the centre of mass"),
        Parameter("rotor", 0.0, "kg m^2", "rotor inertia on the motor side"),
        Parameter("gear", 1.0, "1", "gear ratio"),
        Parameter("g", 9.81, "m/s^2", "gravity"),
    )
    return Description(
        kind="pendulum",
        joints=("joint 1",),
        q=(q,),
        gravity=g,
        parameters=(*parameters, *(_MOTOR if motor else ())),
        bodies=(Body(m, length * sp.sin(q), -length * sp.cos(q), J, q, 0),),
        rotors=((rotor, gear * q),),
        driven=(driven,),
        base=(
            Base("inertia", m * length**2 + J + gear**2 * rotor, "kg m^2"),
            Base("gravity", m * g * length, "N m"),
        ),
    )
