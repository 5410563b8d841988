"""Limits of a machine, from the text of an option: torque of each motor, velocity and angle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.config import nearest, parse_toml
from frictionid.errors import InputError
from frictionid.mechanics import Mechanism

_EXAMPLE = "torque=0.14,velocity=[10,20],angle=3.1"


class Limits(NamedTuple):
    """Largest magnitudes: torque (n,) [N m], zero without a motor; velocity, angle (n,), SI."""

    torque: Array
    velocity: Array
    angle: Array


def limits_of(text: str, mechanism: Mechanism) -> Limits:
    """Limits of a text, one number for all or a list; an angle that is not named has no limit.

    Torques have one number for each motor, velocities and angles one for each joint.

    Raises
    ------
    InputError
        For an unknown name, a missing one, or anything that is no positive number.

    Examples
    --------
    >>> from frictionid.mechanics import acrobot
    >>> limits_of("torque=0.14, velocity=[10, 20]", acrobot())
    Limits(torque=array([0.  , 0.14]), velocity=array([10., 20.]), angle=array([inf, inf]))
    """
    given = table_of("--limits", text, Limits._fields, _EXAMPLE)
    for name in ("torque", "velocity"):
        if name not in given:
            raise InputError(f"--limits {text!r} lacks {name}: e.g. {_EXAMPLE}")
    driven = np.flatnonzero(mechanism.driven)
    if not driven.size:
        raise InputError(
            f"[mechanism] {mechanism.kind} has no motor: there is no torque to suggest"
        )
    torque = np.zeros(mechanism.n)
    torque[driven] = numbers_of("--limits", "torque", given["torque"], (driven.size, "motors"))
    joints = (mechanism.n, "joints")
    angle = numbers_of("--limits", "angle", given.get("angle", math.inf), joints)
    return Limits(torque, numbers_of("--limits", "velocity", given["velocity"], joints), angle)


def table_of(option: str, text: str, known: tuple[str, ...], example: str) -> Mapping[str, Any]:
    """Values by name of an option "name=value,name=[value,value]"."""
    try:
        table = parse_toml(f"x = {{{text}}}", option)["x"]
    except InputError:
        raise InputError(
            f"{option} {text!r} cannot be read: give name=number or name=[number,number] with "
            f"commas, e.g. {example}"
        ) from None
    for name in table:
        if name not in known:
            raise InputError(f"{option}: {name!r} is unknown; {nearest(name, known)}")
    return table


def numbers_of(option: str, name: str, value: Any, count: tuple[int, str]) -> Array:
    """One positive number for each of the joints or motors, from one number or a list."""
    numbers = value if isinstance(value, list) else [value]
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int | float) or not number > 0:
            raise InputError(f"{option}: {name} = {number!r} must be positive")
    if len(numbers) not in (1, count[0]):
        raise InputError(
            f"{option}: {name} has {len(numbers)} numbers for {count[0]} {count[1]}; "
            "give one, or one for each"
        )
    return np.broadcast_to(np.array(numbers, dtype=float), (count[0],)).copy()
