"""Friction in a URDF: `<dynamics damping friction>` of joints that stand in a file."""

from collections.abc import Sequence

import numpy as np

from frictionid.data.servo import PositionControl
from frictionid.errors import InputError
from frictionid.files import json_text

from ...compensation import listed
from ..exported import ExportedFriction, ExportSettings, Written
from ..nearest import kept_inertias, lost_by, lost_of_motors, nearest, whose_gains
from ..xml_text import Element, by_name, element, read_xml, replaced, stated_before, with_attributes

_TYPES = {"rad": ("revolute", "continuous"), "m": ("prismatic",)}
held = nearest


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """The URDF with the Coulomb level [N m] and the viscous coefficient [N m s/rad] of joints."""
    path = settings.into
    if path is None:
        raise InputError(
            "urdf: name the URDF whose joints are given the friction (--into robot.urdf)"
        )
    text, elements = read_xml(path, "URDF", "robot")
    children = (e for e in elements[0].children if e.tag == "joint")
    joints = by_name(children, model.joints, str(path))
    friction = nearest(model)
    changes: list[tuple[int, int, bytes]] = []
    notes: list[str] = []
    rows = zip(joints, model.units, friction.theta, model.back_emf, strict=True)
    for joint, unit, (level, slope), back_emf in rows:
        if joint.attributes.get("type") not in _TYPES[unit]:
            raise InputError(
                f"{path}: joint {joint.name!r} is {joint.attributes.get('type')}, the model's "
                f"position is in {unit}: its friction needs a joint {' or '.join(_TYPES[unit])}"
            )
        new = {"damping": repr(float(slope + back_emf)), "friction": repr(float(level))}
        dynamics = next((e for e in joint.children if e.tag == "dynamics"), None)
        if dynamics is None:
            changes.append(_inserted(text, joint, element("dynamics", new)))
            continue
        tag = text[dynamics.start : dynamics.end]
        changes.append((dynamics.start, dynamics.end, with_attributes(tag, new)))
        notes += stated_before(joint.name, dynamics.attributes, new)
    lost = lost_by(model, friction, "URDF", "friction and damping")
    other = friction if lost else None
    lost += kept_inertias(model, "URDF") + lost_of_motors(model, "URDF", has_drives=False)
    content = {".urdf": replaced(text, changes)}
    if model.drive is not None:
        limit, damping = listed(model.drive.limit), listed(model.back_emf)
        said = f"the motors' torque limit ({limit}) is left: <limit effort> stays as it was"
        lost += [said] * bool(np.isfinite(model.drive.limit).any())
        notes += [f"damping includes the motors' back-EMF ({damping})", *whose_gains(model)]
        content["_controllers.yaml"] = _controllers(model.joints, model.drive)
        notes.append("ros2_control: gains for effort interfaces stand beside it; it was not run")
    return Written(content, tuple(lost), other, tuple(notes))


def _controllers(joints: Sequence[str], drive: PositionControl) -> bytes:
    """Parameters of ros2_control's joint_trajectory_controller with the servos' gains (JSON).

    Its d acts on the velocity error: without target velocities, on the velocity as here.
    """
    rows = zip(joints, drive.kp, drive.kv, strict=False)
    gains = {name: {"p": float(p), "i": 0.0, "d": float(d)} for name, p, d in rows}
    parameters = {
        "joints": list(gains),
        "command_interfaces": ["effort"],
        "state_interfaces": ["position", "velocity"],
        "gains": gains,
    }
    return json_text({"joint_trajectory_controller": {"ros__parameters": parameters}}).encode()


def _inserted(text: bytes, joint: Element, new: bytes) -> tuple[int, int, bytes]:
    """A new element as a joint's last, indented as the others."""
    if joint.is_empty:
        tag = text[joint.start : joint.end].removesuffix(b"/>").rstrip()
        return joint.start, joint.end, tag + b">" + new + b"</joint>"
    if not joint.children:
        return joint.close, joint.close, new
    first, end = joint.children[0].start, joint.children[-1].after
    line = text.rfind(b"\n", joint.end, first)
    line -= text[line - 1 : line] == b"\r"
    indent = text[line:first] if line >= 0 else b""
    return end, end, indent + new
