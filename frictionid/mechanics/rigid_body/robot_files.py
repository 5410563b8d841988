"""Robots described in URDF, the format of ROS, and in MJCF, that of MuJoCo, which reads it."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.files import regular_file

from .robot import Joint, Limits, Robot, moved

_WORLD = "world"
KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_XACRO = ("{http://www.ros.org/wiki/xacro}", "{http://wiki.ros.org/xacro}")  # of its elements
_LARGEST_FILE = 20_000_000  # bytes
_LARGEST = 1e9  # of any number, in SI units


def robot_format(path: Path) -> str:
    """Format of a file that describes a robot, "urdf" or "mjcf", by its root; "" of others."""
    try:
        with path.open("rb") as file:
            root = next((tag for _, tag in ET.iterparse(file, events=("start",))), None)
    except (ET.ParseError, ValueError, OSError):
        return "urdf" if path.suffix == ".urdf" else ""
    return "" if root is None else {"robot": "urdf", "mujoco": "mjcf"}.get(root.tag, "")


def read_urdf(path: Path) -> Robot:
    """Robot of a URDF file: links, joints, inertias and limits; shapes and friction are left out.

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
    joints: dict[str, Joint] = {}
    gears = dict(_reductions(root))
    for element in root.findall("joint"):
        name = _name(element, joints, place)
        joint = _joint(element, name, f"{place}: joint {name!r}")
        joints[name] = joint._replace(gear=gears.get(name, 0.0))
    if not links:
        raise InputError(f"{place}: the robot has no <link>; a mechanism needs links and joints")
    if any(joint.parent == _WORLD for joint in joints.values()):
        links.setdefault(_WORLD, np.zeros(10))  # files of Drake weld to it without naming it
    return Robot(root.get("name") or path.stem, place, links, tuple(joints.values()))


def _root(path: Path) -> ET.Element:
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise InputError(f"{path}: more than 20 MB is no URDF; name the robot's description")
        text = regular_file(path).read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: is no text in UTF-8; name a URDF file") from None
    if "<!DOCTYPE" in text.upper() or "<!ENTITY" in text.upper():
        raise InputError(f"{path}: declares XML entities, which a URDF does not need; remove them")
    xacro = InputError(
        f"{path}: is a xacro file; make a URDF of it first: xacro {path.name} > arm.urdf"
    )
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError) as error:
        if "<xacro:" in text:
            raise xacro from None
        raise InputError(f"{path}: is no XML ({error}); name a URDF file") from None
    if any(str(element.tag).startswith(_XACRO) for element in root.iter()):
        raise xacro  # its output declares the name, and has no such element left
    return root


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
        _axis(element, kind, where),
        None if mimic is None else mimic.get("joint", ""),
        limits=_limits(element, kind),
    )


def _reductions(root: ET.Element) -> Iterator[tuple[str, float]]:
    """Joints whose transmission is theirs alone, and its reduction; what is no number is none."""
    for entry in root.iter("transmission"):
        joints, ratios = entry.findall("joint"), [*entry.iter("mechanicalReduction")]
        if len(joints) == len(ratios) == 1:
            with suppress(ValueError):
                ratio = float(ratios[0].text or "")
                yield joints[0].get("name", ""), ratio if abs(ratio) < _LARGEST else 0.0


def _limits(element: ET.Element, kind: str) -> Limits:
    """Limits of a joint; what is no number is none, nor is zero, which stands for none known.

    >>> limit = '<j><limit lower="-1" upper="2" effort="43" velocity="0"/></j>'
    >>> _limits(ET.fromstring(limit), "revolute")
    Limits(lower=-1.0, upper=2.0, velocity=inf, effort=43.0)
    """
    entry = element.find("limit")
    values: dict[str, float] = {}
    for name, text in ({} if entry is None else entry.attrib).items():
        try:
            values[name] = float(text)
        except ValueError:
            continue
    values = {name: x for name, x in values.items() if math.isfinite(x) and name in Limits._fields}
    span = values.get("upper", 0.0) - values.get("lower", 0.0)
    ends = ("lower", "upper") * (kind != "continuous" and span > 0)
    kept = [*ends, *(name for name in ("velocity", "effort") if values.get(name, 0.0) > 0)]
    return Limits(**{name: values[name] for name in kept if name in values})


def _axis(element: ET.Element, kind: str, where: str) -> Array:
    """Direction (3,) of a joint's axis; what is fixed has none, whatever its file says."""
    entry = None if kind == "fixed" else element.find("axis")
    axis = np.array([1.0, 0.0, 0.0] if entry is None else _numbers(entry, "xyz", 3, where))
    length = np.linalg.norm(axis)
    if not length > 0:
        raise InputError(f'{where}: its axis has no direction; <axis xyz="0 0 1"/> is one')
    return axis / length


def _inertia(element: ET.Element, where: str) -> Array:
    """Inertial parameters (10,) about the link's frame."""
    inertial = element.find("inertial")
    if inertial is None:
        return np.zeros(10)
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        missing = "mass" if mass is None else "inertia"
        raise InputError(f"{where}: its <inertial> has no <{missing}>; give it, or remove both")
    weight = _numbers(mass, "value", 1, where)[0]
    if weight < 0:
        raise InputError(f"{where}: mass = {weight:g} kg is negative; masses are 0 or more")
    six = [_numbers(inertia, f"i{k}", 1, where)[0] for k in ("xx", "xy", "xz", "yy", "yz", "zz")]
    turn, shift = _origin(inertial, where)
    return moved(np.array([weight, 0.0, 0.0, 0.0, *six]), turn, shift)


def _origin(element: ET.Element, where: str) -> tuple[Array, Array]:
    """Rotation and translation of an <origin>, at the parent's frame where there is none."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    shift = _numbers(origin, "xyz", 3, where, "0 0 0")
    angles = _numbers(origin, "rpy", 3, where, "0 0 0")
    return Rotation.from_euler("xyz", angles).as_matrix(), np.array(shift)


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


_ALWAYS = 1  # of mjtInertiaFromGeom: shapes replace stated inertias
_KINDS = ("floating", "ball", "prismatic", "revolute")  # in the order of mjtJoint


def read_mjcf(path: Path) -> Robot:
    """Robot of an MJCF file: bodies, hinges, slides, armatures, limits, gravity.

    Files of meshes, height fields, textures and skins need not be there where inertias are stated.

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
        model = without_shapes(mujoco.MjSpec.from_file(str(path))).compile()
    except (ValueError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path}: MuJoCo cannot read it: {reason}") from None
    mimics = _mimics(mujoco, model, str(path))
    names = [_WORLD, *(_name_in_mujoco(model.body(b), "body", b) for b in range(1, model.nbody))]
    links: dict[str, Array] = {_WORLD: np.zeros(10)}
    joints: list[Joint] = []
    anchor = np.zeros((model.nbody, 3))  # of the link's frame in the body's
    for b in range(1, model.nbody):
        carrying, anchor[b] = _joints_of(model, b, names, anchor, mimics)
        joints += carrying
        links |= {joint.child: np.zeros(10) for joint in carrying}
        links[names[b]] = _body_inertia(model, b, anchor[b])
    return Robot(path.stem, str(path), links, tuple(joints), tuple(model.opt.gravity.tolist()))


def without_shapes(spec: Any) -> Any:
    """The model without what only pictures and contacts need, and with it the files of that."""
    for element in (*spec.textures, *spec.skins, *spec.pairs, *spec.sensors):
        spec.delete(element)
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    by_shapes = spec.compiler.inertiafromgeom == _ALWAYS
    for body in spec.bodies:
        if body.name == _WORLD or (body.explicitinertial and not by_shapes):
            for shape in [g for g in body.geoms if g.meshname or g.hfieldname]:
                spec.delete(shape)
    used = {shape.meshname for shape in spec.geoms}
    for asset in (*(mesh for mesh in spec.meshes if mesh.name not in used), *spec.hfields):
        spec.delete(asset)
    return spec


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
        name = _name_in_mujoco(joint, "joint", j)
        child = names[b] if j == first + count - 1 else f"{names[b]}/{name}"
        shift = shift + turn @ (model.jnt_pos[j] - place)
        place = np.array(model.jnt_pos[j])
        if kind == "prismatic":
            shift = shift - float(joint.qpos0[0]) * turn @ axis
        elif kind == "revolute":
            turn = turn @ Rotation.from_rotvec(-float(joint.qpos0[0]) * axis).as_matrix()
        rotor = float(model.dof_armature[model.jnt_dofadr[j]])
        joints = (name, kind, parent, child, turn, shift, axis, mimics.get(j), rotor)
        out.append(Joint(*joints, _limits_in_mujoco(model, j), _gains_in_mujoco(model, j)))
        parent, turn, shift = child, np.eye(3), np.zeros(3)
    return out, place


def _limits_in_mujoco(model: Any, j: int) -> Limits:
    """Range of a joint, and the largest torque of a motor at it."""
    low, high = model.jnt_range[j] if model.jnt_limited[j] else (-np.inf, np.inf)
    effort = np.inf
    for k in _actuators(model, j):
        if model.actuator_forcelimited[k]:
            effort = abs(model.actuator_forcerange[k, 1] * model.actuator_gear[k, 0])
        elif model.actuator_ctrllimited[k] and not model.actuator_biastype[k]:
            gain = model.actuator_gainprm[k, 0] * model.actuator_gear[k, 0]
            effort = abs(gain * model.actuator_ctrlrange[k, 1])
    return Limits(float(low), float(high), effort=float(effort))


def _gains_in_mujoco(model: Any, j: int) -> tuple[float, float] | None:
    """P and D of a position actuator at a joint, None without one."""
    for k in _actuators(model, j):
        P, (_, by_angle, by_rate) = model.actuator_gainprm[k, 0], model.actuator_biasprm[k, :3]
        if P > 0 and by_angle == -P and model.actuator_gear[k, 0] == 1:
            return float(P), float(-by_rate)
    return None


def _actuators(model: Any, j: int) -> Array:
    """Actuators at a joint."""
    at = (model.actuator_trnid[:, 0] == j) & (model.actuator_trntype == 0)
    return np.flatnonzero(at)


def _body_inertia(model: Any, b: int, anchor: Array) -> Array:
    xx, yy, zz = model.body_inertia[b]
    at_centre = np.array([model.body_mass[b], 0.0, 0.0, 0.0, xx, 0.0, 0.0, yy, 0.0, zz])
    return moved(at_centre, _matrix(model.body_iquat[b]), model.body_ipos[b] - anchor)


def _matrix(quaternion: Array) -> Array:
    return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()


def _name_in_mujoco(element: Any, kind: str, index: int) -> str:
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
            _name_in_mujoco(model.joint(other), "joint", other) if other >= 0 else ""
        )
    return out
