"""Mechanisms that a file describes: which of its joints move, from where, with which payload."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.config import check_arguments, nearest
from frictionid.errors import InputError
from frictionid.files import sha256

from .base_parameters import base_parameters
from .rigid_body_tree import RigidBodyTree, parameters_of_tree
from .robot import Choice, Couplings, Robot, Tree, tree_of, with_rotors
from .robot_files import read_mjcf, read_urdf


def urdf(
    urdf: str | Path,
    joints: Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    gravity: Sequence[float] | None = None,
    payload: str | None = None,
    driven: Sequence[bool] | bool = True,
    coupled: Couplings | None = None,
    floating: bool = False,
) -> RigidBodyTree:
    """Mechanism of n joints that a URDF describes.

    Parameters
    ----------
    urdf : path
    joints : names of the joints that move, in the order of the recordings' columns
        All that can, if not given. The others are locked.
    base : link that stands still
        The root, if not given; what it does not carry is left out.
    locked : positions [rad or m] of joints that do not move, zero if not named
    gravity : (x, y, z) [m/s^2] in the frame of the base, (0, 0, -9.81) if not given
    payload : link that carries a payload
        Its mass, centre of mass and inertia then are parameters payload_mass, ... of each
        recording.
    driven : whether each joint has a motor, or one answer for all
    coupled : motors, or other parts, that turn with several joints, and so have friction and an
        inertia of their own: {"motor_6": {"joint_5": 1.0, "joint_6": 1.0}} for one that turns by as
        much as these two together
    floating : whether the base moves, as recordings say: the link that a free joint carries, if
        none is named; gravity then is that of a base that stands upright

    Raises
    ------
    InputError
        Where the file is no URDF, its joints are no tree, or an option does not fit them.
    """
    return _mechanism("urdf", read_urdf, locals())


def mjcf(
    mjcf: str | Path,
    joints: Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    gravity: Sequence[float] | None = None,
    payload: str | None = None,
    driven: Sequence[bool] | bool = True,
    coupled: Couplings | None = None,
    floating: bool = False,
) -> RigidBodyTree:
    """Mechanism of n joints that an MJCF describes, with its armatures as rotors; see `urdf`.

    Gravity is that of the file if not given. MuJoCo reads the file and must be installed.
    """
    return _mechanism("mjcf", read_mjcf, locals())


_TURNS = 1e6  # of a coupled part for one of a joint, at most
FORMATS: Mapping[str, Callable[..., RigidBodyTree]] = {"urdf": urdf, "mjcf": mjcf}


def _mechanism(
    kind: str, read: Callable[[Path], Robot], arguments: Mapping[str, Any]
) -> RigidBodyTree:
    """Mechanism of a file, under the name of its format, and of options."""
    file = arguments[kind]
    if not isinstance(file, str | Path):
        raise InputError(f'[mechanism] {kind} = {file!r} must be a file: {kind} = "arm.{kind}"')
    robot = read(Path(file))
    choice = Choice(**{name: arguments[name] for name in Choice._fields})
    payload, usual = choice.payload, choice._field_defaults
    changed = {k: value for k, value in choice._asdict().items() if value is not usual[k]}
    _check_choice(choice)
    tree, attached = tree_of(robot, choice)
    if payload is not None and payload not in attached:
        raise InputError(
            f"{robot.place}: payload = {payload!r} is no link beyond the base; "
            f"{nearest(payload, attached)}"
        )
    at = None if payload is None else attached[payload]
    if at is not None and at.body < 0:
        raise InputError(
            f"{robot.place}: payload = {payload!r} does not move; name a link beyond a joint"
        )
    coupled = _coupled(choice.coupled, tree)
    tree = with_rotors(tree, coupled)
    named = {joint.name: joint.rotor for joint in robot.joints}
    rotors = np.array([*(named[name] for name in tree.joints), *(0.0 for _ in coupled)])
    reduction = base_parameters(tree, np.concatenate([tree.inertia.ravel(), rotors]))
    return RigidBodyTree(
        kind=kind,
        joints=tree.joints,
        position_units=tuple("m" if p else "rad" for p in tree.prismatic),
        driven=_driven(choice.driven, tree.joints),
        parameters=parameters_of_tree(tree, rotors, payload is not None),
        base_names=reduction.names,
        base_units=reduction.units,
        base_meanings=("",) * len(reduction.names),
        options={kind: robot.place, **changed},
        coupled=coupled,
        floating=tree.floating,
        tree=tree,
        reduction=reduction,
        identity=_identity(tree),
        payload=at,
    )


def _check_choice(choice: Choice) -> None:
    check_arguments(Choice, choice._asdict(), "[mechanism] options")
    gravity = choice.gravity
    if gravity is not None and not (len(gravity) == 3 and max(map(abs, gravity)) < 1e3):
        raise InputError(
            f"[mechanism] gravity = {gravity!r} must be three numbers [m/s^2] in the frame of the "
            "base: [0.0, 0.0, -9.81] where its z axis points up"
        )


def _driven(driven: Sequence[bool] | bool, joints: tuple[str, ...]) -> tuple[bool, ...]:
    each = (driven,) * len(joints) if isinstance(driven, bool) else tuple(driven)
    if len(each) != len(joints):
        raise InputError(
            f"[mechanism] driven = {driven!r} must be true, false or one of these for each of "
            f"{', '.join(joints)}"
        )
    return each


def _coupled(table: Couplings | None, tree: Tree) -> tuple[tuple[str, tuple[float, ...]], ...]:
    """Names of the coupled parts, and their turns for one of each joint."""
    if table is None:
        return ()
    example = "coupled.motor_6 = { joint_5 = 1.0, joint_6 = 1.0 }"
    out = []
    for name, turns in table.items():
        where = f"[mechanism] coupled: {name}"
        if len(turns) < 2:
            raise InputError(f"{where} = {turns!r} must name two joints or more: {example}")
        if name in tree.joints:
            raise InputError(f"{where} has the name of a joint; call it otherwise, as {example}")
        for joint, value in turns.items():
            if joint not in tree.joints:
                raise InputError(
                    f"{where} names {joint!r}, no joint that moves; {nearest(joint, tree.joints)}"
                )
            if not 0 < abs(value) < _TURNS:
                raise InputError(f"{where}: {joint} = {value!r} must be its turns, not zero")
        out.append((name, tuple(float(turns.get(joint, 0.0)) for joint in tree.joints)))
    return tuple(out)


def _identity(tree: Tree) -> str:
    arrays = (tree.parent, tree.prismatic, tree.axis, tree.turn, tree.shift, tree.inertia)
    every = (*arrays, tree.rotors, tree.gravity)
    return sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in every))
