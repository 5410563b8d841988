"""Robots described in MJCF, the format of MuJoCo, which reads and compiles it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.mechanics.rigid_body.robot import Joint, Robot, moved, rotation

_KINDS = ("floating", "ball", "prismatic", "revolute")  # in the order of mjtJoint


def read_mjcf(path: Path) -> Robot:
    """Robot of an MJCF file: bodies, hinges, slides, armatures, gravity; actuators are left out.

    Raises
    ------
    InputError
        Where MuJoCo is not installed or cannot read the file, where the robot is no tree.
    """
    try:
        import mujoco
    except ImportError:
        raise InputError(
            f"{path}: MJCF is read by MuJoCo, which is not installed: pip install mujoco, or name "
            "a URDF of the robot"
        ) from None
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path}: MuJoCo cannot read it: {reason}") from None
    mimics = _mimics(mujoco, model, str(path))
    names = ["world", *(_name(model.body(b), "body", b) for b in range(1, model.nbody))]
    links: dict[str, Array] = {"world": np.zeros(10)}
    joints: list[Joint] = []
    anchor = np.zeros((model.nbody, 3))  # of the link's frame in the body's
    for b in range(1, model.nbody):
        own, anchor[b] = _joints_of(model, b, names, anchor, mimics)
        joints += own
        links |= {joint.child: np.zeros(10) for joint in own}
        links[names[b]] = _inertia(model, b, anchor[b])
    return Robot(
        Path(path).stem, str(path), links, tuple(joints), tuple(model.opt.gravity.tolist())
    )


def _joints_of(
    model: Any, b: int, names: list[str], anchor: Array, mimics: Mapping[int, str]
) -> tuple[list[Joint], Array]:
    """Joints of a body, the last of which carries it, and the anchor of its frame."""
    carrier = int(model.body_parentid[b])
    parent, place = names[carrier], np.zeros(3)
    turn, shift = _matrix(model.body_quat[b]), model.body_pos[b] - anchor[carrier]
    first, count = int(model.body_jntadr[b]), int(model.body_jntnum[b])
    if not count:
        return [Joint(names[b], "fixed", parent, names[b], turn, shift, np.eye(3)[2])], place
    out = []
    for j in range(first, first + count):
        joint = model.joint(j)
        kind, axis = _KINDS[int(model.jnt_type[j])], np.array(model.jnt_axis[j])
        name = _name(joint, "joint", j)
        child = names[b] if j == first + count - 1 else f"{names[b]}/{name}"
        shift = shift + turn @ (model.jnt_pos[j] - place)
        place = np.array(model.jnt_pos[j])
        if kind == "prismatic":
            shift = shift - float(joint.qpos0[0]) * turn @ axis
        elif kind == "revolute":
            turn = turn @ rotation(axis, -float(joint.qpos0[0]))
        rotor = float(model.dof_armature[model.jnt_dofadr[j]])
        out.append(Joint(name, kind, parent, child, turn, shift, axis, mimics.get(j), rotor))
        parent, turn, shift = child, np.eye(3), np.zeros(3)
    return out, place


def _inertia(model: Any, b: int, anchor: Array) -> Array:
    a, b_, c = model.body_inertia[b]
    own = np.array([model.body_mass[b], 0.0, 0.0, 0.0, a, 0.0, 0.0, b_, 0.0, c])
    return moved(own, _matrix(model.body_iquat[b]), model.body_ipos[b] - anchor)


def _matrix(quaternion: Array) -> Array:
    w, x, y, z = quaternion
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * K + 2.0 * K @ K


def _name(element: Any, kind: str, index: int) -> str:
    return str(element.name) or f"{kind}_{index}"


def _mimics(mujoco: Any, model: Any, place: str) -> dict[int, str]:
    """Joints that follow others by an equality constraint, with the names of those."""
    out = {}
    for k in range(model.neq):
        if int(model.eq_type[k]) != int(mujoco.mjtEq.mjEQ_JOINT):
            raise InputError(
                f"{place}: equality constraint {k} closes a chain, which is no tree; remove it"
            )
        other = int(model.eq_obj2id[k])
        out[int(model.eq_obj1id[k])] = (
            _name(model.joint(other), "joint", other) if other >= 0 else ""
        )
    return out
