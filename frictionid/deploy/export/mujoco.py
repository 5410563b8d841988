"""Friction in MJCF, the format of MuJoCo: frictionloss and damping of joints, or a callback.

MuJoCo's joints hold Coulomb friction (`frictionloss`, which holds a joint at rest, too) and viscous
friction (`damping`). Friction of other laws is a passive force: a Python module beside the MJCF has
the function for `mujoco.set_mjcb_passive`.

MuJoCo holds joints softly: a load below the level lets them creep, and by default each change of
direction takes 20 ms (`solreffriction`), which put predictions of real swing-ups off by 0.010 rad
after 1 s. Written files ask for the hardest that the time step allows: 0.0005 rad.
"""

from __future__ import annotations

from collections.abc import Mapping

from frictionid.deploy.export.exported import ExportedFriction
from frictionid.deploy.export.formats import ExportSettings, Written
from frictionid.deploy.export.mujoco_callback import callback
from frictionid.deploy.export.nearest import differs, lost_by, nearest
from frictionid.deploy.export.physical import physical_parameters
from frictionid.deploy.export.xml_text import (
    Element,
    by_name,
    elements,
    read_xml,
    replaced,
    with_attributes,
)
from frictionid.errors import InputError
from frictionid.mechanics.mjcf_text import mjcf_of

# tendons stand for parts that turn with several joints, such as motors on moving links
_PLACES = {"joint": ("body", "frame", "replicate", "worldbody"), "fixed": ("tendon",)}
_DEFAULT = {"joint": "joint", "fixed": "tendon"}  # their elements in default classes
_STATED = ("frictionloss", "damping", "armature")
_HARD = "0.0001 1"  # MuJoCo takes two time steps where that is less, unless refsafe is disabled
held = nearest


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """An MJCF whose joints have the friction, and a callback where they cannot hold it."""
    friction = nearest(own)
    lost = lost_by(own, friction, "MJCF", "frictionloss and damping")
    if settings.into is None:
        text, where, notes = _mechanism(own)
        found = elements(text, where)
    else:
        where, notes = str(settings.into), []
        text, found = read_xml(settings.into)
        if not found or found[0].tag not in ("mujoco", "mujocoinclude"):
            raise InputError(f"{where}: is no MJCF, its first element must be <mujoco>")
    joints = _joints(found, own, where)
    values = [
        {"frictionloss": _text(level), "damping": _text(slope)} for level, slope in friction.theta
    ]
    if not any(e.tag == "flag" and e.attributes.get("refsafe") == "disable" for e in found):
        for joint, new in zip(joints, values, strict=True):
            if _inherited(joint, "solreffriction", found) is None:
                new["solreffriction"] = _HARD
    rotor = own.friction.parameters.get("rotor")
    if settings.into is not None and rotor is not None and len(joints) == 1:
        values[0]["armature"] = _text(rotor)
    if settings.into is not None:
        notes += [*_stated(joints, values, found), *_included(found)]
    if any("solreffriction" in new for new in values):
        notes.append(f'solreffriction="{_HARD}": friction is as hard as the time step allows')
    changes = [
        (joint.start, joint.end, with_attributes(text[joint.start : joint.end], new))
        for joint, new in zip(joints, values, strict=True)
    ]
    files = {".xml": replaced(text, changes)}
    if differs(own, friction):
        code, sentence = b"", "no callback: it adds friction to joints, not to tendons"
        if all(joint.tag == "joint" for joint in joints):
            code, sentence = callback(own, settings)
        if code:
            files["_callback.py"] = code
            notes.append(sentence)
        else:
            lost.append(sentence)
    other = friction if lost else None
    return Written(files, tuple(lost), other, tuple(notes))


def _mechanism(own: ExportedFriction) -> tuple[bytes, str, list[str]]:
    """MJCF of the data's mechanism."""
    if own.data is None:
        raise InputError(
            "mujoco: name the MJCF whose joints are given the friction (--into robot.xml), or the "
            "data set whose mechanism is written (--dataset)"
        )
    mechanism, notes = own.data.mechanism, []
    parameters: Mapping[str, float] = own.friction.parameters
    if (calibration := own.friction.calibration) is not None:
        if calibration.base is not None:
            parameters = physical_parameters(mechanism, calibration.base)
            notes.append("masses and inertias are such that the model's base parameters hold")
        notes.append("gain, bias, delay and offset of the calibration are not in the MJCF")
    known = {k: v for k, v in parameters.items() if k in mechanism.nominal()}
    return mjcf_of(mechanism, known).encode(), f"MJCF of {mechanism.kind}", notes


def _joints(found: list[Element], own: ExportedFriction, where: str) -> list[Element]:
    """The joints with friction, in the model's order."""
    bodies = [e for e in found if e.parent is not None and e.parent.tag in _PLACES.get(e.tag, ())]
    files = [e.attributes.get("file", "") for e in found if e.tag == "include"]
    known = {e.name for e in bodies}
    if files and not set(own.joints) <= known:
        missing = next(name for name in own.joints if name not in known)
        raise InputError(
            f"{where}: has no joint {missing!r} itself, and includes {', '.join(files)}: name the "
            "file with the joints (--into)"
        )
    joints = by_name(bodies, own.joints, where)
    for joint, unit in zip(joints, own.units, strict=True):
        kind = _inherited(joint, "type", found) or "hinge"
        if joint.tag == "joint" and kind != ("hinge" if unit == "rad" else "slide"):
            raise InputError(
                f"{where}: joint {joint.name!r} is a {kind} joint, the model's position is in "
                f"{unit}: friction of one joint needs a {'hinge' if unit == 'rad' else 'slide'}"
            )
    return joints


def _stated(joints: list[Element], values: list[dict[str, str]], found: list[Element]) -> list[str]:
    """Notes on values that stand in the file already."""
    notes = []
    for joint, new in zip(joints, values, strict=True):
        before = {name: _inherited(joint, name, found) for name in _STATED if name in new}
        old = ", ".join(f"{k} {v}" for k, v in before.items() if v is not None and v != new[k])
        if old:
            notes.append(f"{joint.name} had {old}")
    return notes


def _included(found: list[Element]) -> list[str]:
    if not any(e.tag == "include" or "file" in e.attributes for e in found):
        return []
    return ["the MJCF names other files: keep it in the folder of the one that it is made from"]


def _inherited(joint: Element, name: str, found: list[Element]) -> str | None:
    """Value of a joint's attribute, by itself or by its default class; None where none is given."""
    if name in joint.attributes:
        return joint.attributes[name]
    chosen = joint.attributes.get("class")
    body = joint.parent
    while chosen is None and body is not None:
        chosen, body = body.attributes.get("childclass"), body.parent
    defaults = [e for e in found if e.tag == "default"]
    top = [e for e in defaults if e.parent is not None and e.parent.tag == "mujoco"]
    classes = [e for e in defaults if chosen is not None and e.attributes.get("class") == chosen]
    own: Element | None = next(iter(classes or top), None)
    while own is not None and own.tag == "default":
        for child in own.children:
            if child.tag == _DEFAULT[joint.tag] and name in child.attributes:
                return child.attributes[name]
        own = own.parent
    return None


def _text(value: float) -> str:
    return repr(float(value))
