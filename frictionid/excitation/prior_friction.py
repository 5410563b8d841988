"""Prior friction: the values that a design of experiments starts from."""

from __future__ import annotations

import math

import numpy as np

from frictionid.errors import InputError
from frictionid.excitation.limits import Limits, numbers_of, table_of
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous

SHARE = 0.05
_EXAMPLE = "coulomb=[0.1,0.05],viscous=0.001"


def prior_friction_of(text: str, limits: Limits) -> Friction:
    """Coulomb and viscous friction of a text; default: 5 % of the largest torque limit.

    That share is each joint's Coulomb friction, and its viscous friction at the velocity limit.

    Raises
    ------
    InputError
        For an unknown name or a number that is not possible.

    Examples
    --------
    >>> limits = Limits(np.array([0.0, 0.2]), np.array([10.0, 20.0]), np.array([np.inf, np.inf]))
    >>> print(prior_friction_of("viscous=0.002", limits))
    CoulombViscous(width=0.02, shape='tanh', symmetric=True)
      joint 1  coulomb 0.01 N m, viscous 0.002 N m s/rad
      joint 2  coulomb 0.01 N m, viscous 0.002 N m s/rad
    """
    given = table_of("--friction", text, CoulombViscous().names, _EXAMPLE)
    joints = (len(limits.torque), "joints")
    level = SHARE * float(limits.torque.max())
    coulomb = np.full(joints[0], level)
    viscous = level / limits.velocity
    if "coulomb" in given:
        coulomb = numbers_of("--friction", "coulomb", given["coulomb"], joints)
    if "viscous" in given:
        viscous = numbers_of("--friction", "viscous", given["viscous"], joints)
    if not all(math.isfinite(v) and v > 0 for v in (*coulomb, *viscous)):
        raise InputError(
            f"--friction: Coulomb {coulomb.tolist()} and viscous {viscous.tolist()} must be finite "
            "and positive"
        )
    return Friction(CoulombViscous(), np.stack([coulomb, viscous], axis=-1))
