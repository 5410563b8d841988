"""Joints of unit inertia on which nothing but friction acts, for models without physics.

    dw/dt = -Tf

The friction of this mechanism is the negative acceleration that such a model predicts.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from frictionid.mechanics.description import Base, Description
from frictionid.mechanics.mechanism import Parameter
from frictionid.mechanics.symbolic import SymbolicMechanism


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
    one = "kg m^2" if "rad" in position_units else "kg"
    return SymbolicMechanism.of(
        Description(
            kind="unit",
            joints=tuple(f"joint {j + 1}" for j in range(joints)),
            q=tuple(q),
            gravity=gravity,
            parameters=(Parameter("inertia", 1.0, one, "of each joint"),),
            bodies=(),
            rotors=tuple((inertia, angle) for angle in q),
            driven=(False,) * joints,
            base=(Base("inertia", inertia, one),),
            position_units=position_units,
            torque_units=tuple(f"{unit}/s^2" for unit in position_units),
        )
    )
