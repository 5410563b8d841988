"""A tree of rigid bodies: which joint carries which, where they sit, and what the bodies weigh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array

MOMENTS = ("mass", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
MOMENT_UNITS = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)


@dataclass(frozen=True, eq=False)
class Tree:
    """n joints, each of which carries a body; what is fixed to a body is part of it.

    Attributes
    ----------
    joints, bodies : names (n,)
    parent : array of int, shape (n,)
        Joint that carries each joint, -1 for the base. It stands before those that it carries.
    prismatic : array of bool, shape (n,)
    axis, turn, shift : arrays, shapes (n, 3), (n, 3, 3), (n, 3)
        Axis in the joint's frame; frame of the joint in its parent's at position zero.
    inertia : array, shape (n, 10)
        Mass [kg], first moments [kg m] and inertias [kg m^2] about the origin of the body's frame,
        in the order of `MOMENTS`.
    rotor_names, rotors : names (r,), and array, shape (r, n)
        Rotor k turns at rotors[k] w, in units of its joint: with the inertia seen there, the mass
        matrix has rotors' diag(inertia) rotors beside that of the bodies.
    gravity : array, shape (3,) [m/s^2], in the frame of the base
    """

    joints: tuple[str, ...]
    bodies: tuple[str, ...]
    parent: Array
    prismatic: Array
    axis: Array
    turn: Array
    shift: Array
    inertia: Array
    rotor_names: tuple[str, ...]
    rotors: Array
    gravity: Array

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def rotor_units(self) -> tuple[str, ...]:
        """Units of the rotors' inertias: kg at prismatic joints."""
        at = [int(np.argmax(np.abs(row))) for row in self.rotors]
        return tuple("kg" if self.prismatic[i] else "kg m^2" for i in at)


def with_rotors(tree: Tree, coupled: Sequence[tuple[str, tuple[float, ...]]]) -> Tree:
    """The tree with a rotor for each part that turns with several joints: name, and turns (n,)."""
    names = (*tree.rotor_names, *(f"rotor_{name}" for name, _ in coupled))
    rows = np.array([row for _, row in coupled]).reshape(-1, tree.n)
    return replace(tree, rotor_names=names, rotors=np.vstack([tree.rotors, rows]))
