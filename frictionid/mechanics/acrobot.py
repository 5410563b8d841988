"""The acrobot of [DeMeester2020]: two links in a vertical plane, a geared motor at joint 2 only.

q1 = 0 hangs down, counter-clockwise positive; q2 is relative to link 1.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from frictionid.mechanics.description import Base, Body, Description
from frictionid.mechanics.mechanism import Parameter
from frictionid.mechanics.symbolic import SymbolicMechanism

PARAMETERS = {
    "m1": (0.135, "kg", "link 1"),
    "m2": (0.44, "kg", "motor assembly, a point mass at joint 2"),
    "m3": (0.12, "kg", "link 2"),
    "m4": (0.084, "kg", "extra point mass on link 2"),
    "L1": (0.0875, "m", "shaft to centre of mass of link 1"),
    "L2": (0.153, "m", "shaft to joint 2"),
    "L3": (0.093, "m", "joint 2 to centre of mass of link 2"),
    "L4": (0.175, "m", "joint 2 to the extra mass"),
    "rotor": (0.0, "kg m^2", "rotor inertia on the motor side (not in the study)"),
    "gear": (18.0, "1", "gear ratio"),
    "g": (9.81, "m/s^2", "gravity"),
}
PRINTED = {
    "J_shaft": (6.91e-5, "kg m^2", "supporting shaft"),
    "J_clamp": (2.24e-5, "kg m^2", "slip-ring clamp"),
    "J_bush": (3.81e-5, "kg m^2", "clamping bush"),
    "J_link1": (3.73e-4, "kg m^2", "link 1 about its centre of mass"),
    "J2": (3.39e-4, "kg m^2", "link 2 about its centre of mass"),
}
SHAPES = {
    "M_shaft": (1.38, "kg", "supporting shaft, solid cylinder"),
    "R_shaft": (0.01, "m", "its radius"),
    "M_clamp": (0.097, "kg", "slip-ring clamp, hollow cylinder"),
    "R_clamp": (0.019, "m", "its outer radius"),
    "r_clamp": (0.01, "m", "its inner radius"),
    "M_bush": (0.26, "kg", "clamping bush, hollow cylinder"),
    "R_bush": (0.014, "m", "its outer radius"),
    "r_bush": (0.01, "m", "its inner radius"),
    "H1": (0.175, "m", "height of link 1, a plate"),
    "W1": (0.05, "m", "width of link 1"),
    "H2": (0.185, "m", "height of link 2, a plate"),
    "W2": (0.025, "m", "width of link 2"),
}


def acrobot(
    inertias: str = "printed",
    link2_rate: str = "absolute",
    *,
    m1: float | None = None,
    m2: float | None = None,
    m3: float | None = None,
    m4: float | None = None,
    L1: float | None = None,
    L2: float | None = None,
    L3: float | None = None,
    L4: float | None = None,
    rotor: float | None = None,
    gear: float | None = None,
    g: float | None = None,
    J_shaft: float | None = None,
    J_clamp: float | None = None,
    J_bush: float | None = None,
    J_link1: float | None = None,
    J2: float | None = None,
    M_shaft: float | None = None,
    R_shaft: float | None = None,
    M_clamp: float | None = None,
    R_clamp: float | None = None,
    r_clamp: float | None = None,
    M_bush: float | None = None,
    R_bush: float | None = None,
    r_bush: float | None = None,
    H1: float | None = None,
    W1: float | None = None,
    H2: float | None = None,
    W2: float | None = None,
) -> SymbolicMechanism:
    """Acrobot with the parts of [DeMeester2020].

    Parameters
    ----------
    inertias : "printed" or "shapes"
        Moments of inertia as printed, or by the shapes of the parts (the printed one of the bush
        differs by 1 %).
    link2_rate : "absolute" or "relative"
        Link 2 turns at w1 + w2; the printed energy has the relative rate w2.
    m1, m2, ... : float, optional
        Values of its parameters, SI; `frictionid mechanisms acrobot` lists their meanings.

    The rotor sits on link 1 and turns against its joint, at w1 - gear w2.

    Raises
    ------
    ValueError
        For another option.
    InputError
        For a parameter that is no finite number, or that the other kind of inertias has.

    >>> acrobot().base_names
    ('inertia_11', 'inertia_12', 'inertia_22', 'coupling', 'gravity_1', 'gravity_2')
    >>> acrobot(m4=0.1)
    acrobot(m4=0.1)
    """
    given = {name: value for name, value in locals().items() if value is not None}
    options = {name: given.pop(name) for name in ("inertias", "link2_rate")}
    other = options.items() - {"inertias": "printed", "link2_rate": "absolute"}.items()
    return SymbolicMechanism.of(_description(inertias, link2_rate), given, dict(other))


@cache
def _description(inertias: str, link2_rate: str) -> Description:
    for value, allowed in (
        (inertias, ("printed", "shapes")),
        (link2_rate, ("absolute", "relative")),
    ):
        if value not in allowed:
            raise ValueError(f"acrobot: option {value!r} must be one of {', '.join(allowed)}")
    table = PARAMETERS | (PRINTED if inertias == "printed" else SHAPES)
    s = {name: sp.Symbol(name) for name in table}
    J1, J2 = _printed(s) if inertias == "printed" else _shapes(s)
    m1, m2, m3, m4, L1, L2, L3, L4, rotor, gear, g = (s[k] for k in PARAMETERS)
    q1, q2 = sp.symbols("q1 q2")
    turn = sp.Integer(link2_rate == "absolute")

    def at(first: sp.Expr, second: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
        x = first * sp.sin(q1) + second * sp.sin(q1 + q2)
        return x, -first * sp.cos(q1) - second * sp.cos(q1 + q2)

    none = sp.Integer(0)
    bodies = (
        Body(m1, *at(L1, none), J1, q1, 0),
        Body(m2, *at(L2, none), none, q1, 0),
        Body(m3, *at(L2, L3), J2, turn * q1 + q2, 1),
        Body(m4, *at(L2, L4), none, q1 + q2, 1),
    )
    swing = m3 * L3**2 + m4 * L4**2
    fixed = J1 + m1 * L1**2 + (m2 + m3 + m4) * L2**2
    base = (
        Base("inertia_11", fixed + swing + turn * J2 + rotor, "kg m^2"),
        Base("inertia_12", swing + turn * J2 - gear * rotor, "kg m^2"),
        Base("inertia_22", swing + J2 + gear**2 * rotor, "kg m^2"),
        Base("coupling", L2 * (m3 * L3 + m4 * L4), "kg m^2"),
        Base("gravity_1", g * (m1 * L1 + (m2 + m3 + m4) * L2), "N m"),
        Base("gravity_2", g * (m3 * L3 + m4 * L4), "N m"),
    )
    return Description(
        kind="acrobot",
        joints=("joint 1", "joint 2"),
        q=(q1, q2),
        gravity=g,
        parameters=tuple(Parameter(k, *table[k]) for k in table),
        bodies=bodies,
        rotors=((rotor, q1 - gear * q2),),
        driven=(False, True),
        base=base,
    )


def _printed(s: dict[str, sp.Symbol]) -> tuple[sp.Expr, sp.Expr]:
    return s["J_shaft"] + s["J_clamp"] + s["J_bush"] + s["J_link1"], s["J2"]


def _shapes(s: dict[str, sp.Symbol]) -> tuple[sp.Expr, sp.Expr]:
    def hollow(part: str) -> sp.Expr:
        return s[f"M_{part}"] * (s[f"R_{part}"] ** 2 + s[f"r_{part}"] ** 2) / 2

    def plate(mass: str, link: int) -> sp.Expr:
        return s[mass] * (s[f"H{link}"] ** 2 + s[f"W{link}"] ** 2) / 12

    shaft = s["M_shaft"] * s["R_shaft"] ** 2 / 2
    return shaft + hollow("clamp") + hollow("bush") + plate("m1", 1), plate("m3", 2)
