"""Friction in a URDF: `<dynamics damping friction>` of joints that stand in a file."""

from __future__ import annotations

from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.deploy.export.nearest import lost_by, nearest
from frictionid.deploy.export.xml_text import Element, by_name, read_xml, replaced, with_attributes
from frictionid.errors import InputError

_TYPES = {"rad": ("revolute", "continuous"), "m": ("prismatic",)}
held = nearest


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """The URDF with the Coulomb level [N m] and the viscous coefficient [N m s/rad] of joints."""
    path = settings.into
    if path is None:
        raise InputError(
            "urdf: name the URDF whose joints are given the friction (--into robot.urdf)"
        )
    text, found = read_xml(path)
    if not found or found[0].tag != "robot":
        raise InputError(f"{path}: is no URDF, its first element must be <robot>")
    joints = by_name((e for e in found[0].children if e.tag == "joint"), own.joints, str(path))
    friction = nearest(own)
    changes, notes = [], []
    for joint, unit, (level, slope) in zip(joints, own.units, friction.theta, strict=True):
        if joint.attributes.get("type") not in _TYPES[unit]:
            raise InputError(
                f"{path}: joint {joint.name!r} is {joint.attributes.get('type')}, the model's "
                f"position is in {unit}: its friction needs a joint {' or '.join(_TYPES[unit])}"
            )
        new = {"damping": repr(float(slope)), "friction": repr(float(level))}
        dynamics = next((e for e in joint.children if e.tag == "dynamics"), None)
        if dynamics is None:
            changes.append(_inserted(text, joint, with_attributes(b"<dynamics/>", new)))
            continue
        tag = text[dynamics.start : dynamics.end]
        changes.append((dynamics.start, dynamics.end, with_attributes(tag, new)))
        before = {k: v for k, v in dynamics.attributes.items() if k in new and v != new[k]}
        if before:
            notes.append(f"{joint.name} had {', '.join(f'{k} {v}' for k, v in before.items())}")
    lost = lost_by(own, friction, "URDF", "friction and damping")
    other = friction if lost else None
    return Written({".urdf": replaced(text, changes)}, tuple(lost), other, tuple(notes))


def _inserted(text: bytes, joint: Element, element: bytes) -> tuple[int, int, bytes]:
    """The element as a joint's last, indented as the others."""
    if joint.is_empty:
        tag = text[joint.start : joint.end].removesuffix(b"/>").rstrip()
        return joint.start, joint.end, tag + b">" + element + b"</joint>"
    if not joint.children:
        return joint.close, joint.close, element
    last = joint.children[-1]
    end = last.end if last.is_empty else text.index(b">", last.close) + 1
    first = joint.children[0].start
    line = text.rfind(b"\n", joint.end, first)
    line -= text[line - 1 : line] == b"\r"
    indent = text[line:first] if line >= 0 else b""
    return end, end, indent + element
