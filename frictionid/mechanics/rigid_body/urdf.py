"""Robots described in URDF, the format of ROS."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.mechanics.rigid_body.robot import Joint, Robot, moved

KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_LARGEST_FILE = 20_000_000  # bytes
_LARGEST = 1e9  # of any number, in SI units


def read_urdf(path: Path) -> Robot:
    """Robot of a URDF file: links, joints and inertias; shapes, limits and friction are left out.

    Raises
    ------
    InputError
        Where it is no URDF, with the element at fault and what to do.
    """
    place = str(path)
    root = _root(path)
    if root.tag != "robot":
        raise InputError(
            f"{place}: <{root.tag}> is not <robot>, as a URDF begins; name a URDF file"
        )
    links: dict[str, Array] = {}
    for element in root.findall("link"):
        name = _name(element, links, place)
        links[name] = _inertia(element, f"{place}: link {name!r}")
    names: dict[str, None] = {}
    joints = []
    for element in root.findall("joint"):
        name = _name(element, names, place)
        names[name] = None
        joints.append(_joint(element, name, f"{place}: joint {name!r}"))
    if not links:
        raise InputError(f"{place}: the robot has no <link>; a mechanism needs links and joints")
    return Robot(root.get("name") or path.stem, place, links, tuple(joints))


def _root(path: Path) -> ET.Element:
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise InputError(f"{path}: more than 20 MB is no URDF; name the robot's description")
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: is no text in UTF-8; name a URDF file") from None
    if "<!DOCTYPE" in text.upper() or "<!ENTITY" in text.upper():
        raise InputError(f"{path}: declares XML entities, which a URDF does not need; remove them")
    if "http://www.ros.org/wiki/xacro" in text or "<xacro:" in text:
        raise InputError(
            f"{path}: is a xacro file; make a URDF of it first: xacro {path.name} > arm.urdf"
        )
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise InputError(f"{path}: is no XML ({error}); name a URDF file") from None
    except ValueError as error:
        raise InputError(f"{path}: is no XML ({error}); name a URDF file") from None


def _name(element: ET.Element, others: Iterable[str], place: str) -> str:
    name = element.get("name", "")
    if not name or not name.isprintable():
        raise InputError(f"{place}: a <{element.tag}> has no printable name; give it one")
    if name in others:
        raise InputError(f"{place}: two {element.tag}s are called {name!r}; rename one")
    return name


def _joint(element: ET.Element, name: str, where: str) -> Joint:
    kind = element.get("type", "")
    if kind not in KINDS:
        raise InputError(f"{where} has type {kind!r}; a URDF knows {', '.join(KINDS)}")
    ends = {}
    for role in ("parent", "child"):
        end = element.find(role)
        if end is None or not end.get("link"):
            raise InputError(f'{where} names no {role}: <{role} link="..."/>')
        ends[role] = str(end.get("link"))
    turn, shift = _origin(element, where)
    mimic = element.find("mimic")
    return Joint(
        name,
        kind,
        ends["parent"],
        ends["child"],
        turn,
        shift,
        _axis(element, where),
        None if mimic is None else mimic.get("joint", ""),
    )


def _axis(element: ET.Element, where: str) -> Array:
    found = element.find("axis")
    axis = np.array([1.0, 0.0, 0.0] if found is None else _numbers(found, "xyz", 3, where))
    length = np.linalg.norm(axis)
    if not length > 0:
        raise InputError(f'{where}: its axis has no direction; <axis xyz="0 0 1"/> is one')
    return axis / length


def _inertia(element: ET.Element, where: str) -> Array:
    """Inertial parameters (10,) about the link's frame."""
    inertial = element.find("inertial")
    if inertial is None:
        return np.zeros(10)
    mass = inertial.find("mass")
    own = inertial.find("inertia")
    if mass is None or own is None:
        missing = "mass" if mass is None else "inertia"
        raise InputError(f"{where}: its <inertial> has no <{missing}>; give it, or remove both")
    weight = _numbers(mass, "value", 1, where)[0]
    if weight < 0:
        raise InputError(f"{where}: mass = {weight:g} kg is negative; masses are 0 or more")
    six = [_numbers(own, f"i{k}", 1, where)[0] for k in ("xx", "xy", "xz", "yy", "yz", "zz")]
    turn, shift = _origin(inertial, where)
    return moved(np.array([weight, 0.0, 0.0, 0.0, *six]), turn, shift)


def _origin(element: ET.Element, where: str) -> tuple[Array, Array]:
    """Rotation and translation of an <origin>, at the parent's frame where there is none."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    shift = _numbers(origin, "xyz", 3, where, "0 0 0")
    roll, pitch, yaw = _numbers(origin, "rpy", 3, where, "0 0 0")
    (a, b, c), (x, y, z) = map(np.cos, (roll, pitch, yaw)), map(np.sin, (roll, pitch, yaw))
    turn = [
        [c * b, c * y * x - z * a, c * y * a + z * x],
        [z * b, z * y * x + c * a, z * y * a - c * x],
        [-y, b * x, b * a],
    ]
    return np.array(turn), np.array(shift)


def _numbers(
    element: ET.Element, key: str, count: int, where: str, default: str | None = None
) -> list[float]:
    """The numbers of an attribute, all finite and of a size that machines have."""
    text = element.get(key, default)
    if text is None:
        raise InputError(f"{where}: <{element.tag}> has no {key}; give it")
    try:
        values = [float(part) for part in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(v) and abs(v) < _LARGEST for v in values):
        what = "a number" if count == 1 else f"{count} numbers"
        raise InputError(f"{where}: <{element.tag} {key}={text[:60]!r}> must be {what}")
    return values
