"""Mechanisms beside the pendulum: axes without links, unit inertia, two links in a plane."""

from functools import cache

import sympy as sp

from frictionid.config import NotNegative

from .description import Base, Body, Description, Expression
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


# --- Two links ----------------------------------------------------------------------------------
# The plane is vertical; q1 = 0 hangs down, counter-clockwise positive; q2 is relative to link 1.
# The acrobot of a study, with a geared motor at joint 2 only, is that of [DeMeester2020]. The
# symbols of the double pendulum are those of the published models of the DFKI double pendulum
# [Wiebe2024]: I1 and I2 are about the joints, the rotor of the second motor sits on link 1 and
# turns against its joint (M12 gets - gr Ir).

_Q1, _Q2 = sp.symbols("q1 q2")


def _at(first: Expression, second: Expression) -> tuple[Expression, Expression]:
    """Place (x, y) at these distances along link 1 and then along link 2."""
    x = first * sp.sin(_Q1) + second * sp.sin(_Q1 + _Q2)
    return x, -first * sp.cos(_Q1) - second * sp.cos(_Q1 + _Q2)


_LINKS = (
    Parameter("m1", 0.5, "kg", "mass of link 1", required=True),
    Parameter("m2", 0.5, "kg", "mass of link 2", required=True),
    Parameter("l1", 0.2, "m", "joint 1 to joint 2", required=True),
    Parameter("r1", 0.1, "m", "joint 1 to centre of mass of link 1", required=True),
    Parameter("r2", 0.1, "m", "joint 2 to centre of mass of link 2", required=True),
    Parameter("I1", 0.01, "kg m^2", "inertia of link 1 about joint 1", required=True),
    Parameter("I2", 0.01, "kg m^2", "inertia of link 2 about joint 2", required=True),
    Parameter("Ir", 0.0, "kg m^2", "rotor inertia on the motor side"),
    Parameter("gr", 1.0, "1", "gear ratio"),
    Parameter("g", 9.81, "m/s^2", "gravity"),
)


def double_pendulum(
    driven: tuple[bool, bool] = (True, True),
    *,
    m1: Value = None,
    m2: Value = None,
    l1: Value = None,
    r1: Value = None,
    r2: Value = None,
    I1: Value = None,
    I2: Value = None,
    Ir: Value = None,
    gr: Value = None,
    g: Value = None,
) -> SymbolicMechanism:
    """Double pendulum with motors at the joints where `driven` is true.

    A rotor is counted at each driven joint only. Without one at joint 2, M12 and M22 have the same
    constant part: inertia_12 is then no base parameter.

    m1, m2, ... : values of its parameters, SI; `frictionid mechanisms double_pendulum` lists them

    >>> double_pendulum().base_names
    ('inertia_11', 'inertia_12', 'inertia_22', 'coupling', 'gravity_1', 'gravity_2')
    """
    return SymbolicMechanism.of_kind(_double_pendulum, locals())


@cache
def _double_pendulum(driven: tuple[bool, bool] = (True, True)) -> Description:
    m1, m2, l1, r1, r2, I1, I2, Ir, gr, g = (sp.Symbol(p.name) for p in _LINKS)
    first, second = (sp.Integer(bool(d)) for d in driven)
    bodies = (
        Body(m1, *_at(r1, 0), I1 - m1 * r1**2, _Q1, 0),
        Body(m2, *_at(l1, r2), I2 - m2 * r2**2, _Q1 + _Q2, 1),
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
        q=(_Q1, _Q2),
        gravity=g,
        parameters=_LINKS,
        bodies=bodies,
        rotors=((first * Ir, gr * _Q1), (second * Ir, _Q1 - gr * _Q2)),
        driven=(bool(driven[0]), bool(driven[1])),
        base=base,
        drawing=((0, 0), _at(l1, 0), _at(l1, r2)),
    )


_PARTS = (
    Parameter("m1", 0.135, "kg", "link 1"),
    Parameter("m2", 0.44, "kg", "motor assembly, a point mass at joint 2"),
    Parameter("m3", 0.12, "kg", "link 2"),
    Parameter("m4", 0.084, "kg", "extra point mass on link 2"),
    Parameter("L1", 0.0875, "m", "shaft to centre of mass of link 1"),
    Parameter("L2", 0.153, "m", "shaft to joint 2"),
    Parameter("L3", 0.093, "m", "joint 2 to centre of mass of link 2"),
    Parameter("L4", 0.175, "m", "joint 2 to the extra mass"),
    Parameter("rotor", 0.0, "kg m^2", "rotor inertia on the motor side (not in the study)"),
    Parameter("gear", 18.0, "1", "gear ratio"),
    Parameter("g", 9.81, "m/s^2", "gravity"),
    Parameter("J_shaft", 6.91e-5, "kg m^2", "supporting shaft"),
    Parameter("J_clamp", 2.24e-5, "kg m^2", "slip-ring clamp"),
    Parameter("J_bush", 3.81e-5, "kg m^2", "clamping bush"),
    Parameter("J_link1", 3.73e-4, "kg m^2", "link 1 about its centre of mass"),
    Parameter("J2", 3.39e-4, "kg m^2", "link 2 about its centre of mass"),
)


def acrobot(
    *,
    m1: Value = None,
    m2: Value = None,
    m3: Value = None,
    m4: Value = None,
    L1: Value = None,
    L2: Value = None,
    L3: Value = None,
    L4: Value = None,
    rotor: Value = None,
    gear: Value = None,
    g: Value = None,
    J_shaft: Value = None,
    J_clamp: Value = None,
    J_bush: Value = None,
    J_link1: Value = None,
    J2: Value = None,
) -> SymbolicMechanism:
    """Acrobot with the parts of [DeMeester2020].

    m1, m2, ... : values of its parameters, SI; `frictionid mechanisms acrobot` lists them

    Link 2 turns at w1 + w2 (the printed energy has w2). The rotor sits on link 1 and turns against
    its joint, at w1 - gear w2.

    >>> acrobot().base_names
    ('inertia_11', 'inertia_12', 'inertia_22', 'coupling', 'gravity_1', 'gravity_2')
    >>> acrobot(m4=0.1)
    acrobot(m4=0.1)
    """
    return SymbolicMechanism.of_kind(_acrobot, locals())


@cache
def _acrobot() -> Description:
    symbols = [sp.Symbol(p.name) for p in _PARTS]
    m1, m2, m3, m4, L1, L2, L3, L4, rotor, gear, g = symbols[:11]
    J1, J2 = sum(symbols[11:15]), symbols[15]
    bodies = (
        Body(m1, *_at(L1, 0), J1, _Q1, 0),
        Body(m2, *_at(L2, 0), 0, _Q1, 0),
        Body(m3, *_at(L2, L3), J2, _Q1 + _Q2, 1),
        Body(m4, *_at(L2, L4), 0, _Q1 + _Q2, 1),
    )
    swing = m3 * L3**2 + m4 * L4**2
    fixed = J1 + m1 * L1**2 + (m2 + m3 + m4) * L2**2
    base = (
        Base("inertia_11", fixed + swing + J2 + rotor, "kg m^2"),
        Base("inertia_12", swing + J2 - gear * rotor, "kg m^2"),
        Base("inertia_22", swing + J2 + gear**2 * rotor, "kg m^2"),
        Base("coupling", L2 * (m3 * L3 + m4 * L4), "kg m^2"),
        Base("gravity_1", g * (m1 * L1 + (m2 + m3 + m4) * L2), "N m"),
        Base("gravity_2", g * (m3 * L3 + m4 * L4), "N m"),
    )
    return Description(
        kind="acrobot",
        joints=("joint 1", "joint 2"),
        q=(_Q1, _Q2),
        gravity=g,
        parameters=_PARTS,
        bodies=bodies,
        rotors=((rotor, _Q1 - gear * _Q2),),
        driven=(False, True),
        base=base,
    )
