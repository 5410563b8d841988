"""Two links in a vertical plane: the acrobot of a study, and the double pendulum.

q1 = 0 hangs down, counter-clockwise positive; q2 is relative to link 1. The acrobot, with a geared
motor at joint 2 only, is that of [DeMeester2020]. The symbols of the double pendulum are those of
the published models of the DFKI double pendulum [Wiebe2024]: I1 and I2 are about the joints, the
rotor of the second motor sits on link 1 and turns against its joint (M12 gets - gr Ir).
"""

from functools import cache

import sympy as sp

from .description import Base, Body, Description, Expression
from .mechanism import Parameter, Value
from .symbolic import SymbolicMechanism

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
