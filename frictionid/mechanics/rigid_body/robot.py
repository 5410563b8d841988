"""A robot as files describe it, and the tree of rigid bodies of the joints that move."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.errors import InputError

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
    floating : whether the base moves, as recordings say
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
    floating: bool = False

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


MOVING = ("revolute", "continuous", "prismatic")
_STANDARD_GRAVITY = 9.81


class Limits(NamedTuple):
    """Lowest and highest position, velocity and torque of a joint's motor; infinite if not said."""

    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf


class Joint(NamedTuple):
    """A joint between two links; turn and shift place its frame, the child's, in the parent's.

    gains : P [N m/rad] and D [N m s/rad] of the file's position controller, where it has one
    gear : turns of the motor for one of the joint, 0 where the file does not say them
    """

    name: str
    kind: str
    parent: str
    child: str
    turn: Array
    shift: Array
    axis: Array
    mimic: str | None = None
    rotor: float = 0.0
    limits: Limits = Limits()
    gains: tuple[float, float] | None = None
    gear: float = 0.0


class Robot(NamedTuple):
    """Links with inertial parameters (10,) about their frames, see `tree.Tree`, and joints.

    place : file that describes it, for messages
    """

    name: str
    place: str
    links: Mapping[str, Array]
    joints: tuple[Joint, ...]
    gravity: tuple[float, ...] = (0.0, 0.0, -_STANDARD_GRAVITY)


class Attached(NamedTuple):
    """Where a link is fixed: body of the tree, and frame in that body's."""

    body: int
    turn: Array
    shift: Array


Couplings = Mapping[str, Mapping[str, float]]  # turns for one of each joint, part by part


class Choice(NamedTuple):
    """What a [mechanism] table says beside the file, see `mechanism_table.urdf`."""

    joints: Sequence[str] | None = None
    base: str | None = None
    locked: Mapping[str, float] | None = None
    gravity: Sequence[float] | None = None
    payload: str | None = None
    driven: Sequence[bool] | bool = True
    coupled: Couplings | None = None
    floating: bool = False


def tree_of(robot: Robot, choice: Choice) -> tuple[Tree, dict[str, Attached]]:
    """Tree of the joints that move, fixed joints merged, and where each link is in it.

    Raises
    ------
    InputError
        Where links and joints are no tree, or the choice does not fit them.
    """
    below, locked = _by_parent(robot), choice.locked or {}
    afloat = [j.child for j in robot.joints if j.kind == "floating"] if choice.floating else []
    base = _base(robot, choice.base or next(iter(afloat), None))
    reached = _reached(robot, below, base)
    moving = _moving(robot, choice, reached)
    _check_locked(robot, locked, moving, reached)
    index = {name: i for i, name in enumerate(moving)}
    attached = {base: Attached(-1, np.eye(3), np.zeros(3))}
    n = len(moving)
    inertia, frames = np.zeros((n, 10)), {}
    parent = np.full(n, -1)
    for joint in reached:
        carrier = attached[joint.parent]
        turn, shift = carrier.turn @ joint.turn, carrier.shift + carrier.turn @ joint.shift
        if joint.name in index:
            i = index[joint.name]
            frames[i], parent[i] = (joint, turn, shift), carrier.body
            attached[joint.child] = Attached(i, np.eye(3), np.zeros(3))
        else:
            turn, shift = _locked_at(joint, locked.get(joint.name, 0.0), turn, shift)
            attached[joint.child] = Attached(carrier.body, turn, shift)
        here = attached[joint.child]
        if here.body >= 0:
            inertia[here.body] += moved(robot.links[joint.child], here.turn, here.shift)
    _check_order(robot, moving, parent)
    placed, turns, shifts = zip(*(frames[i] for i in range(n)), strict=True)
    return Tree(
        joints=moving,
        bodies=tuple(joint.child for joint in placed),
        parent=parent,
        prismatic=np.array([joint.kind == "prismatic" for joint in placed]),
        axis=np.array([joint.axis for joint in placed]),
        turn=np.array(turns),
        shift=np.array(shifts),
        inertia=inertia,
        rotor_names=tuple(f"rotor_{name}" for name in moving),
        rotors=np.eye(n),
        gravity=np.array(robot.gravity if choice.gravity is None else choice.gravity, dtype=float),
        floating=choice.floating,
    ), attached


def moved(inertia: Array, turn: Array, shift: Array) -> Array:
    """Inertial parameters (10,) in a frame in which their own has this orientation and origin.

    >>> import numpy as np
    >>> mass = np.array([2.0] + 9 * [0.0])
    >>> moved(mass, np.eye(3), np.array([0.0, 0.0, 0.5]))[[0, 3, 4, 7, 9]]
    array([2. , 1. , 0.5, 0.5, 0. ])
    """
    mass, h = inertia[0], turn @ inertia[1:4]
    turned = turn @ matrix_of(inertia[4:]) @ turn.T
    first = h + mass * shift
    about = np.outer(first, shift) + np.outer(shift, h)
    J = turned + np.trace(about) * np.eye(3) - (about + about.T) / 2
    return np.array([mass, *first, *J[UPPER]])


UPPER = np.triu_indices(3)  # places of xx, xy, xz, yy, yz, zz in a symmetric matrix


def matrix_of(six: Array) -> Array:
    """Symmetric matrices (..., 3, 3) of xx, xy, xz, yy, yz, zz (..., 6)."""
    return six[..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]


def _locked_at(joint: Joint, at: float, turn: Array, shift: Array) -> tuple[Array, Array]:
    if joint.kind == "prismatic":
        return turn, shift + at * turn @ joint.axis
    rotated = Rotation.from_rotvec(at * joint.axis).as_matrix()
    return (turn @ rotated if at else turn), shift


def _by_parent(robot: Robot) -> dict[str, list[Joint]]:
    """Joints of each link; refuses what is no tree."""
    below: dict[str, list[Joint]] = {name: [] for name in robot.links}
    carried: dict[str, str] = {}
    for joint in robot.joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in robot.links:
                raise InputError(
                    f"{robot.place}: joint {joint.name!r} names {link!r} as its {role}, which is "
                    f"no link; {nearest(link, robot.links)}"
                )
        if joint.child in carried:
            raise InputError(
                f"{robot.place}: link {joint.child!r} is the child of two joints, "
                f"{carried[joint.child]!r} and {joint.name!r}: a closed chain is no tree; "
                "remove one of them"
            )
        carried[joint.child] = joint.name
        below[joint.parent].append(joint)
    return below


def _base(robot: Robot, wanted: str | None) -> str:
    if wanted is not None:
        if wanted not in robot.links:
            raise InputError(
                f"{robot.place}: base = {wanted!r} is no link; {nearest(wanted, robot.links)}"
            )
        return wanted
    children = {joint.child for joint in robot.joints}
    roots = [name for name in robot.links if name not in children]
    if len(roots) == 1:
        return roots[0]
    if not roots:
        raise InputError(
            f"{robot.place}: every link is the child of a joint, so that none is the root; "
            'name the link that stands still: base = "..." in [mechanism]'
        )
    raise InputError(
        f"{robot.place}: links {', '.join(map(repr, roots[:4]))} are not connected; name the one "
        'that stands still: base = "..." in [mechanism]'
    )


def _reached(robot: Robot, below: Mapping[str, list[Joint]], base: str) -> list[Joint]:
    """Joints beyond the base link, each after the one that carries it."""
    joints, todo = [], [base]
    while todo:
        beyond = below[todo.pop()]
        for joint in beyond:
            if joint.child == base:
                raise InputError(
                    f"{robot.place}: joint {joint.name!r} closes a loop through {base!r}: a closed "
                    "chain is no tree; remove a joint of the loop"
                )
        joints += beyond
        todo += [joint.child for joint in reversed(beyond)]
    return joints


def _moving(robot: Robot, choice: Choice, reached: list[Joint]) -> tuple[str, ...]:
    """Names of the joints that move, checked."""
    by_name = {joint.name: joint for joint in reached}
    if choice.joints is None:
        chosen = tuple(j.name for j in reached if j.kind != "fixed")
    else:
        chosen = tuple(choice.joints)
    for name in chosen:
        if name not in by_name:
            beyond = " beyond the base" if any(j.name == name for j in robot.joints) else ""
            raise InputError(
                f"{robot.place}: there is no joint {name!r}{beyond}; {nearest(name, by_name)}"
            )
        if chosen.count(name) > 1:
            raise InputError(f"{robot.place}: joint {name!r} is named twice in joints")
        if by_name[name].kind not in MOVING:
            raise InputError(
                f"{robot.place}: joint {name!r} is {by_name[name].kind}, but joints that move are "
                f"{', '.join(MOVING)}; name others in joints = [...], or what stands still where "
                f"the machine is held: base = {by_name[name].child!r}, or whose motion is "
                "recorded: floating = true"
            )
    if not chosen:
        raise InputError(f"{robot.place}: no joint moves; friction needs at least one")
    _check_mimics(robot, by_name, chosen)
    return chosen


def _check_mimics(robot: Robot, by_name: Mapping[str, Joint], chosen: tuple[str, ...]) -> None:
    for joint in by_name.values():
        if joint.mimic is not None and (joint.name in chosen or joint.mimic in chosen):
            raise InputError(
                f"{robot.place}: joint {joint.name!r} follows {joint.mimic!r} (mimic), which is no "
                "joint of its own; name the joints that move without the two in joints = [...]"
            )


def _check_locked(
    robot: Robot, locked: Mapping[str, float], moving: tuple[str, ...], reached: list[Joint]
) -> None:
    for name, value in locked.items():
        by_name = {joint.name: joint for joint in reached if joint.name not in moving}
        if name not in by_name:
            reason = (
                "it moves" if name in moving else nearest(name, by_name) if by_name else "all move"
            )
            raise InputError(f"{robot.place}: joint {name!r} cannot be locked: {reason}")
        if not np.isfinite(value) or by_name[name].kind not in MOVING:
            raise InputError(
                f"{robot.place}: locked joint {name!r} = {value!r} must be a finite number, and "
                f"the joint {', '.join(MOVING)}"
            )
    for joint in reached:
        if joint.kind in ("floating", "planar") and joint.name not in moving:
            raise InputError(
                f"{robot.place}: joint {joint.name!r} is {joint.kind}, so that nothing holds what "
                f"it carries; where the machine is held, name it: base = {joint.child!r}; or say "
                "floating = true where its motion is recorded"
            )


def _check_order(robot: Robot, moving: tuple[str, ...], parent: Array) -> None:
    for i, p in enumerate(parent):
        if p > i:
            raise InputError(
                f"{robot.place}: joint {moving[p]!r} carries {moving[i]!r}; name it first in "
                "joints = [...], and the columns of the recordings in the same order"
            )
