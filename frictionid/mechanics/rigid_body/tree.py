"""A tree of rigid bodies: which joint carries which, where they sit, and what the bodies weigh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.mechanics.rigid_body.inertia import composite, world_inertias
from frictionid.mechanics.rigid_body.kinematics import accelerations, placements, velocities

MOMENTS = ("mass", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
MOMENT_UNITS = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)


class Pose(NamedTuple):
    """Frames, joint motions and inertias of all bodies at K samples, in the frame of the base.

    R (K, n, 3, 3), o (K, n, 3), S (K, n, 6), see `kinematics`; inertia and carried (K, n, 10), of
    each body and of all that its joint carries.
    """

    R: Array
    o: Array
    S: Array
    inertia: Array
    carried: Array


class Motion(NamedTuple):
    """Velocities v, changes dS of the joint motions and accelerations less gravity, (K, n, 6)."""

    v: Array
    dS: Array
    a: Array


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
    rotors : array, shape (r, n)
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
    rotors: Array
    gravity: Array

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def rotor_names(self) -> tuple[str, ...]:
        """Names of the rotors' inertias, after the joints that they turn with."""
        return tuple(f"rotor_{self.joints[int(np.argmax(np.abs(row)))]}" for row in self.rotors)

    @property
    def rotor_units(self) -> tuple[str, ...]:
        """Units of the rotors' inertias: kg at prismatic joints."""
        at = [int(np.argmax(np.abs(row))) for row in self.rotors]
        return tuple("kg" if self.prismatic[i] else "kg m^2" for i in at)

    def pose(self, q: Array, inertia: Array) -> Pose:
        """Frames and inertias at angles q (K, n); inertia (1, n, 10) or (K, n, 10)."""
        q = np.ascontiguousarray(q)
        R, o, S = placements(self.parent, self.prismatic, self.axis, self.turn, self.shift, q)
        own = world_inertias(np.ascontiguousarray(inertia), R, o)
        return Pose(R, o, S, own, composite(self.parent, own))

    def motion(self, S: Array, w: Array, rate: Array) -> Motion:
        """Motion of the bodies at joint velocities w and their rates dw/dt (K, n)."""
        w, rate = np.ascontiguousarray(w), np.ascontiguousarray(rate)
        v, dS = velocities(self.parent, S, w)
        return Motion(v, dS, accelerations(self.parent, self.gravity, S, dS, w, rate))
