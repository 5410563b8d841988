"""What a block of parameters is: part of what is fitted, free as a whole or in part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.mechanics import Mechanism
from frictionid.mechanics.calibration import Calibration


class Guess(NamedTuple):
    """Current values of a fit: friction (theta (n, P)), calibration (no batch axes), mechanism."""

    friction: Friction
    calibration: Calibration
    mechanism: Mechanism


class Entry(NamedTuple):
    """One free parameter: block, name, unit, value, bounds, and standard deviation of its prior.

    `place` says where the block keeps it; the prior's mean is the value that the fit begins with,
    its deviation infinite where there is no prior.
    """

    block: str
    name: str
    unit: str
    value: float
    low: float = -float("inf")
    high: float = float("inf")
    prior: float = float("inf")
    place: tuple[int, ...] = ()


class Block(Protocol):
    """A block: its free parameters, and how they enter.

    `enters` is "friction", "base", "torque", "angle" or "actuator": which of the physics' inputs
    they are.
    """

    @property
    def name(self) -> str: ...
    @property
    def enters(self) -> str: ...

    def entries(self, guess: Guess) -> tuple[Entry, ...]:
        """The free parameters."""

    def put(self, guess: Guess, entries: Sequence[Entry], values: Array) -> Guess:
        """The guess with other values of the block's free parameters."""


class Torque(Protocol):
    """A block that changes the motor torque, or (`enters` "angle") the measured angle."""

    def slope(self, guess: Guess, entries: Sequence[Entry], logged: Array, later: Array) -> Array:
        """Derivatives (E, ..., n) of the motor torque at each joint.

        logged (..., n) is the delayed torque as it was logged, later (..., n) its own derivative by
        the delay.
        """


def joints_of(mechanism: Mechanism, *, driven: bool) -> tuple[int, ...]:
    """Joints of a mechanism, or those that have a motor."""
    d = mechanism.description
    return tuple(j for j in range(mechanism.n) if d.driven[j] or not driven)


def checked(prior: float | None, name: str) -> float:
    """Standard deviation of a prior, infinite for none.

    Raises
    ------
    InputError
        Where it is not positive.
    """
    if prior is None:
        return float("inf")
    if not prior > 0:
        raise InputError(f"block {name!r}: prior = {prior} must be a positive standard deviation")
    return float(prior)


def with_joints(
    calibration: Calibration, field: str, entries: Sequence[Entry], values: Array
) -> Calibration:
    """The calibration with some joints' values of a field replaced."""
    new = np.array(getattr(calibration, field), dtype=float)
    for entry, value in zip(entries, values, strict=True):
        new[entry.place[0]] = value
    return replace(calibration, **{field: new})
