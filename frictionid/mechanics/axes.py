"""Mechanisms without links: a linear axis, two masses with a spring between them, unit inertia."""

from functools import cache

import sympy as sp

from frictionid.config import NotNegative

from .description import Base, Body, Description
from .mechanism import Parameter, Value
from .symbolic import SymbolicMechanism

_ROUND = 1e-5  # [rad], over which the corners of a dead zone are rounded


def two_mass_axis(
    hanging: bool = False,
    gap: float = 0.0,
    *,
    motor_inertia: Value = None,
    load_inertia: Value = None,
    stiffness: Value = None,
    moment: Value = None,
) -> SymbolicMechanism:
    """Motor q1, as seen at the load, and load q2, with a spring between them; q2 = 0 hangs down.

        Jm dw1/dt = u - k D(q1 - q2) - Tf1,    Jl dw2/dt = k D(q1 - q2) - m g l sin q2 - Tf2

    Both angles are measured: by the encoder of the motor, over the gear, and by one at the load.
    `hanging` says whether gravity acts on the load, with its moment m g l [N m].
    `gap` [rad] is the backlash of the gear: D(x) = x - gap/2 beyond it, x + gap/2 below, and zero
    where |x| < gap/2, the dead zone of a spring with play [Nordin2002]. Without it D(x) = x.

    >>> two_mass_axis(motor_inertia=0.01, load_inertia=0.05, stiffness=300.0).base_names
    ('motor_inertia', 'load_inertia', 'stiffness')
    """
    return SymbolicMechanism.of_kind(_two_mass_axis, locals())


@cache
def _two_mass_axis(hanging: bool = False, gap: NotNegative = 0.0) -> Description:
    motor, load, k, moment, q1, q2 = sp.symbols("motor_inertia load_inertia stiffness moment q1 q2")
    spring = k * _energy(q1 - q2, float(gap))
    at_load = "of motor and gear about the axis, at the load"
    weight = (Parameter("moment", 1.0, "N m", "gravity moment of the load", required=True),)
    return Description(
        kind="two_mass_axis",
        joints=("motor", "load"),
        q=(q1, q2),
        gravity=0,
        parameters=(
            Parameter("motor_inertia", 0.01, "kg m^2", at_load, required=True),
            Parameter("load_inertia", 0.05, "kg m^2", "of the load about its axis", True),
            Parameter("stiffness", 300.0, "N m/rad", "of gear, belt or shaft", required=True),
            *(weight if hanging else ()),
        ),
        bodies=(),
        rotors=((motor, q1), (load, q2)),
        driven=(True, False),
        base=(
            Base("motor_inertia", motor, "kg m^2"),
            Base("load_inertia", load, "kg m^2"),
            Base("stiffness", k, "N m/rad"),
            *((Base("gravity", moment, "N m"),) if hanging else ()),
        ),
        potential=spring - (moment * sp.cos(q2) if hanging else 0),
        drawing=((0, 0), (sp.sin(q1), -sp.cos(q1)), (0, 0), (sp.sin(q2), -sp.cos(q2))),
    )


def _energy(twist: sp.Expr, gap: float) -> sp.Expr:
    """Energy of a spring of stiffness 1 that is slack where |twist| < gap/2.

    Its slope is twist + (|twist - gap/2| - |twist + gap/2|)/2, with |y| = (y^2 + _ROUND^2)^(1/2).
    """
    if gap == 0.0:
        return twist**2 / 2

    def size(y: sp.Expr) -> sp.Expr:  # integral of (y^2 + _ROUND^2)^(1/2)
        root = sp.sqrt(y**2 + _ROUND**2)
        return (y * root + _ROUND**2 * sp.asinh(y / _ROUND)) / 2

    return twist**2 / 2 + (size(twist - gap / 2) - size(twist + gap / 2)) / 2


def linear_axis(driven: bool = True, *, mass: Value = None, g: Value = None) -> SymbolicMechanism:
    """Mass on a level guide; the motor's inertia, seen at the carriage, is part of the mass.

    mass dw/dt = u - Tf, with w [m/s], u and Tf [N]; `driven` says whether the axis has a motor.

    >>> linear_axis(mass=20.0).base_names
    ('mass',)
    """
    return SymbolicMechanism.of_kind(_linear_axis, locals())


@cache
def _linear_axis(driven: bool = True) -> Description:
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


@cache
def unit_inertia(position_units: tuple[str, ...] = ("rad",)) -> SymbolicMechanism:
    """M = I, h = 0 and B = 0: friction is a negative acceleration [rad/s^2], or [m/s^2].

    Its only base parameter is the inertia, 1.

    >>> import numpy as np
    >>> machine = unit_inertia(("rad", "rad"))
    >>> M, h = machine.dynamics(np.ones(1), np.array([0.3, -1.0]), np.array([5.0, 2.0]))
    >>> bool((M == np.eye(2)).all() and (h == 0).all() and (machine.B == 0).all())
    True
    """
    joints = len(position_units)
    inertia, gravity = sp.symbols("inertia g")
    q = sp.symbols(f"q1:{joints + 1}")
    unit = "kg m^2" if "rad" in position_units else "kg"
    return SymbolicMechanism.from_description(
        Description(
            kind="unit",
            joints=tuple(f"joint {j + 1}" for j in range(joints)),
            q=tuple(q),
            gravity=gravity,
            parameters=(Parameter("inertia", 1.0, unit, "of each joint"),),
            bodies=(),
            rotors=tuple((inertia, angle) for angle in q),
            driven=(False,) * joints,
            base=(Base("inertia", inertia, unit),),
            position_units=position_units,
            torque_units=tuple(f"{unit}/s^2" for unit in position_units),
        )
    )
