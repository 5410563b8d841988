"""Friction in MJCF, the format of MuJoCo, by its own elements, see `native`.

Laws that these do not hold have frictionloss and damping of the nearest Coulomb and viscous
friction, and a Python module beside the MJCF that adds what is missing, see `callback`.

MuJoCo holds joints softly: a load below the level lets them creep, and by default each change of
direction takes 20 ms (`solreffriction`), which put predictions of real swing-ups off by 0.010 rad
after 1 s. Written files ask for the hardest that the time step allows: 0.0005 rad.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.mechanics import Mechanism
from frictionid.mechanics.mjcf_text import lacking_inertias, mjcf_of
from frictionid.mechanics.rigid_body.rigid_body_tree import RigidBodyTree, nearest_bodies
from frictionid.progress import report_step

from ..exported import ExportedFriction, ExportSettings, Written
from ..expressions import rendered
from ..native import (
    HISTORY,
    actuator_of,
    constant,
    delay_values,
    held,
    is_native,
    is_stiff,
    joint_values,
    lost_bristles,
    lost_in_mjx,
    passive_motor,
    said_of_motors,
)
from ..nearest import (
    Replay,
    armature,
    base_differences,
    break_away,
    changed,
    differs,
    kept_inertias,
    lost_by,
)
from ..round_trip import in_mujoco
from ..xml_text import (
    Element,
    by_name,
    element,
    elements,
    read_xml,
    replaced,
    stated_before,
    with_attributes,
)
from . import python

_EXACT = 1e-9
_ROUND = 0.01  # of the inertia about a link's joint, that it has at least about its centre of mass


def physical_parameters(mechanism: Mechanism, base: Array) -> dict[str, float]:
    """Physical parameters with these base parameters (nb), or the nearest, near the nominal ones.

    Motion shows the base parameters only; of the many masses, lengths and inertias that have them,
    these differ little from its own, in proportion, and are those of bodies where any of
    these are. Parameters that are zero stay zero, and gravity stays.

    Examples
    --------
    >>> from frictionid.mechanics import pendulum
    >>> m = pendulum(mass=0.4, length=0.25)
    >>> values = physical_parameters(m, 1.21 * m.base(m.nominal()))
    >>> round(values["mass"], 6), round(values["length"], 6)
    (0.484, 0.25)
    """
    nominal = mechanism.nominal()
    names = [k for k, v in nominal.items() if v and k not in ("g", "gr", "gravity")]
    start = np.array([nominal[k] for k in names])
    size = _size(base)

    def values(x: Array) -> dict[str, float]:
        return nominal | dict(zip(names, map(float, start * np.exp(x)), strict=True))

    def off(x: Array) -> Array:
        return (mechanism.base(values(x)) - base) / size

    def off_and_lacking(x: Array) -> Array:
        lacking = lacking_inertias(mechanism, values(x))
        return np.concatenate([off(x), np.maximum(lacking + _ROUND, 0.0)])

    # Gauss-Newton by minimum norm: of all solutions near the start, one that changes little
    x = least_squares(off, np.zeros(len(names)), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    if lacking_inertias(mechanism, values(x)).max() > _EXACT:
        bodies = least_squares(off_and_lacking, x, xtol=1e-10, ftol=1e-15, gtol=1e-12)
        x = bodies.x if np.abs(bodies.fun).max() <= max(_EXACT, np.abs(off(x)).max()) else x
    return values(x)


_FIRM = 1e6  # how much more base parameters count than staying near the nominal bodies
_REACHED = 1e-6  # of a base parameter


def fitted_bodies(mechanism: RigidBodyTree, base: Array) -> tuple[RigidBodyTree, dict[str, float]]:
    """A tree of bodies with these base parameters (nb,), or the nearest that bodies can have.

    Also its parameters.
    """
    bodies, rotors = nearest_bodies(mechanism, base, np.diag((_FIRM / _size(base)) ** 2))
    mechanism = replace(mechanism, tree=replace(mechanism.tree, inertia=bodies))
    named = zip(mechanism.tree.rotor_names, rotors.tolist(), strict=True)
    return mechanism, dict.fromkeys(mechanism.nominal(), 0.0) | dict(named)


def not_reached(mechanism: Mechanism, parameters: Mapping[str, float], base: Array) -> list[str]:
    """A sentence on base parameters (nb,) that these parameters do not have."""
    reached = mechanism.base(parameters)
    off = np.abs(reached - base) / _size(base)
    rows = list(zip(mechanism.base_names, reached, base, mechanism.base_units, strict=True))
    apart = [rows[k] for k in np.argsort(-off) if off[k] > _REACHED]
    said = f"no bodies have the model's base parameters: {base_differences(apart, 'written')}"
    if isinstance(mechanism, RigidBodyTree):
        said += "; fit with --consistent, which finds some that have"
    return [said] if apart else []


def _size(base: Array) -> Array:
    return np.maximum(np.abs(base), 1e-3 * np.abs(base).max())


# tendons stand for parts that turn with several joints, such as motors on moving links
_PLACES = {"joint": ("body", "frame", "replicate", "worldbody"), "fixed": ("tendon",)}
_DEFAULT = {"joint": "joint", "fixed": "tendon"}  # their elements in default classes
_SERVOS = ("position", "velocity", "intvelocity")
_KINDS = {"rad": "hinge", "m": "slide"}  # of joints, by the unit of their position
_STATED = ("frictionloss", "damping", "armature")
_HARD = "0.0001 1"  # MuJoCo takes two time steps where that is less, unless refsafe is disabled
_FINE, _FINEST = 0.00025, 0.0001  # [s]: errors grow with the step, of bristles most
_STEP = 0.002  # [s], MuJoCo's where a file names none
_KEPT = ("name", "class", "group", "joint", "ctrllimited", "ctrlrange")  # of a motor made a servo
Change = tuple[int, int, bytes]


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """An MJCF whose joints have friction and drives, and a callback where it cannot hold a law."""
    rotors = None
    if settings.into is None:
        text, where, notes, inertias = _mechanism(model)
        listed = elements(text, where)
    else:
        rotors, carried = armature(model)
        where, notes, inertias = str(settings.into), [], kept_inertias(model, "MJCF", carried)
        text, listed = read_xml(settings.into, "MJCF", "mujoco", "mujocoinclude")
    joints, there = _joints(listed, model, where), _actuators(listed)
    motors = [j for k, j in model.driven.items() if _is_written(model, there.get(k), listed)]
    friction, native = held(model, motors), is_native(model)
    lost = lost_bristles(model)
    if not native:
        lost = lost_by(model, friction, "MJCF", "frictionloss and damping")
    other = friction if lost else None
    changes, passive, said = _with_friction(friction, model.back_emf, joints, text, listed, rotors)
    apart = constant(friction)
    driven, added, of_motors = _drives(model, apart, text, listed)
    added += passive
    if added:
        notes += lost_in_mjx(model, added)
        block = b"\n    ".join([b"  <actuator>", *added]) + b"\n  </actuator>\n"
        changes.append((listed[0].close, listed[0].close, block))
    files, notes = {".xml": replaced(text, changes + driven)}, notes + said + of_motors
    if not native and differs(model, friction):
        code, sentence = b"", "no callback: it adds friction to joints, not to tendons"
        if all(joint.tag == "joint" for joint in joints):
            code, sentence = callback(model, settings, apart)
        files |= {"_callback.py": code} if code else {}
        (notes if code else lost).append(sentence)
    return Written(files, (*lost, *inertias), other, tuple(notes))


def replay(model: ExportedFriction, written: Written) -> Replay | None:
    """How far predictions of the written file are from ours, without its callback."""
    return in_mujoco(model, written.files[".xml"].decode())


def _with_friction(
    friction: Friction,
    back_emf: Array,
    joints: list[Element],
    text: bytes,
    listed: list[Element],
    rotors: Array | None,
) -> tuple[list[Change], list[bytes], list[str]]:
    """Joints with new attributes, passive motors that hold their bristles or cogging, and notes."""
    changes: list[Change] = []
    motors: list[bytes] = []
    notes: list[str] = []
    hard = not any(e.tag == "flag" and e.attributes.get("refsafe") == "disable" for e in listed)
    soft = [hard and _inherited(joint, "solreffriction", listed) is None for joint in joints]
    for j, joint in enumerate(joints):
        new = joint_values(friction, j, float(back_emf[j]))
        new |= {"solreffriction": _HARD} if soft[j] else {}
        new |= {} if rotors is None else {"armature": repr(float(rotors[j]))}
        before = {name: _inherited(joint, name, listed) for name in _STATED if name in new}
        notes += stated_before(joint.name, before, new)
        tag = text[joint.start : joint.end]
        changes.append((joint.start, joint.end, with_attributes(tag, new)))
        if values := passive_motor(friction, j):
            place = "joint" if joint.tag == "joint" else "tendon"
            name = {"name": f"friction of {joint.name}", place: joint.name}
            motors.append(element("dcmotor", {**name, **values}))
    if any(e.tag == "include" or "file" in e.attributes for e in listed):
        notes.append(
            "the MJCF names other files: keep it in the folder of the one that it is made from"
        )
    if any(soft):
        notes.append(f'solreffriction="{_HARD}": friction is as hard as the time step allows')
    return changes, motors, notes


def _drives(
    model: ExportedFriction, apart: Array, text: bytes, listed: list[Element]
) -> tuple[list[Change], list[bytes], list[str]]:
    """Changed and new actuators of the joints' motors, and sentences on them."""
    there = _actuators(listed)
    steps = [e.attributes["timestep"] for e in listed if "timestep" in e.attributes]
    late = delay_values(model.delay, float(steps[0]) if steps else _STEP)
    changes: list[Change] = []
    added: list[bytes] = []
    left, servos = list[str](), list[str]()
    for name, j in model.driven.items():
        (kind, values), e = actuator_of(model, j, float(apart[j])), there.get(name)
        if not _is_written(model, e, listed):
            if e is not None:
                servos.append(name)
            elif values or late:
                left.append(f"{name} has no actuator: gain, bias and delay of its torque are left")
            continue
        if e is None:
            added.append(element(kind, {"name": name, "joint": name, **values, **late}))
            continue
        tag = text[e.start : e.end]
        if values:
            kept = {k: v for k, v in e.attributes.items() if k in _KEPT}
            if not _is_servo(e, listed):  # a range of torques is none of targets
                kept.pop("ctrlrange", None)
                kept["ctrllimited"] = "false"
            tag = element(kind, {**kept, **values, **late})
            changes.append((e.start, e.after, tag))
        elif late:
            changes.append((e.start, e.end, with_attributes(tag, late)))
    if servos:
        left.append(f"actuators that are servos of the file stay as they are: {', '.join(servos)}")
    if len(servos) == len(model.driven):
        return changes, added, left
    is_late = bool(late and (changes or added))
    if is_late:
        end = listed[0].close
        changes.append((end, end, f"<!-- {HISTORY} -->\n".encode()))
    return changes, added, left + said_of_motors(model, is_late=is_late)


def _actuators(listed: list[Element]) -> dict[str, Element]:
    """Actuators of joints, by the joints' names."""
    inside = (e for e in listed if e.parent is not None and e.parent.tag == "actuator")
    return {e.attributes["joint"]: e for e in inside if "joint" in e.attributes}


def _is_servo(e: Element, listed: list[Element]) -> bool:
    feedback = (_inherited(e, "biasprm", listed) or "").split()[1:3]
    return e.tag in _SERVOS or any(map(float, feedback))


def _is_written(model: ExportedFriction, e: Element | None, listed: list[Element]) -> bool:
    """Whether a joint's motor is written; without a drive servos of a file stay as they are."""
    return model.drive is not None or (e is not None and not _is_servo(e, listed))


def _mechanism(model: ExportedFriction) -> tuple[bytes, str, list[str], list[str]]:
    """MJCF of the data's mechanism, what it is, notes, and lost inertias."""
    mechanism = model.mechanism
    notes = whose_parameters(model)
    lost: list[str] = []
    if mechanism is None:
        raise InputError(
            "mujoco: name the MJCF whose joints are given the friction (--into robot.xml), or the "
            "data set whose mechanism is written (--dataset)"
        )
    parameters, base = model.friction.parameters, model.calibration.base
    if model.data is not None and base is not None:
        report_step("masses and inertias", 1)
        if isinstance(mechanism, RigidBodyTree):
            mechanism, parameters = fitted_bodies(mechanism, base)
        else:
            parameters = physical_parameters(mechanism, base)
        lost = not_reached(mechanism, parameters, base)
        if not lost:
            notes.append("masses and inertias are such that the model's base parameters hold")
        rotors = [p.name for p in mechanism.parameters if p.rotor]
        if rotors and not any(parameters[name] for name in rotors):
            said = f"no rotor is described ({', '.join(rotors)} of [mechanism.parameters])"
            notes.append(f"{said}: its inertia is in that of the bodies, armature is 0")
    used = {k: v for k, v in parameters.items() if k in mechanism.nominal()}
    step = _FINEST if passive_motor(model.friction, 0) else _FINE
    text = mjcf_of(mechanism, used, timestep=step)
    if is_stiff(model, step):
        text = text.replace('integrator="RK4"', 'integrator="implicitfast"')
    return text.encode(), f"MJCF of {mechanism.kind}", notes, lost


def whose_parameters(model: ExportedFriction) -> list[str]:
    """A sentence on whose payload is written, where recordings differ in it."""
    recordings = () if model.data is None else model.data.recordings
    names = ", ".join(sorted({name for r in recordings for name in changed(model, r)}))
    same = next((r.name for r in recordings if not changed(model, r)), "no recording")
    said = f"recordings differ in {names}: written is the mechanism's, as in {same}"
    return [said] if names else []


def _joints(listed: list[Element], model: ExportedFriction, where: str) -> list[Element]:
    """The joints with friction, in the model's order."""
    bodies = [e for e in listed if e.parent is not None and e.parent.tag in _PLACES.get(e.tag, ())]
    files = [e.attributes.get("file", "") for e in listed if e.tag == "include"]
    names = {e.name for e in bodies}
    if files and (missing := [name for name in model.joints if name not in names]):
        raise InputError(
            f"{where}: has no joint {missing[0]!r} itself, and includes {', '.join(files)}: name "
            "the file with the joints (--into)"
        )
    joints = by_name(bodies, model.joints, where)
    for joint, unit in zip(joints, model.units, strict=True):
        kind, wanted = _inherited(joint, "type", listed) or "hinge", _KINDS[unit]
        if joint.tag == "joint" and kind != wanted:
            raise InputError(
                f"{where}: joint {joint.name!r} is a {kind} joint, the model's position is in "
                f"{unit}: friction of one joint needs a {wanted}"
            )
    return joints


def _inherited(joint: Element, name: str, listed: list[Element]) -> str | None:
    """Value of an element's attribute, by itself or its default class; None where there is none."""
    if name in joint.attributes:
        return joint.attributes[name]
    chosen, body = joint.attributes.get("class"), joint.parent
    while chosen is None and body is not None:
        chosen, body = body.attributes.get("childclass"), body.parent
    defaults = [e for e in listed if e.tag == "default"]
    top = [e for e in defaults if e.parent is not None and e.parent.tag == "mujoco"]
    classes = [e for e in defaults if chosen is not None and e.attributes.get("class") == chosen]
    default = next(iter(classes or top), None)
    while default is not None and default.tag == "default":
        for child in default.children:
            if child.tag == _DEFAULT.get(joint.tag, joint.tag) and name in child.attributes:
                return child.attributes[name]
        default = default.parent
    return None


def callback(model: ExportedFriction, settings: ExportSettings, apart: Array) -> tuple[bytes, str]:
    """The module, b"" where there is none, and a sentence that says what it does.

    Memory advances with each step of the engine, or once a sample where the law says so.

    apart : constant friction (n,) [N m] against which the file's motors pull
    """
    law = model.friction.law.sharpened()
    sharp = replace(model, friction=replace(model.friction, law=law))
    try:
        inputs, has_memory = sharp.programs.inputs, bool(sharp.programs.memory)
    except InputError as error:
        return b"", f"no callback: {error}"
    if "load" in inputs:
        return b"", "no callback: MuJoCo gives no passive force the load in the bearings"
    time = model.law.sample_time
    context = {
        "levels": break_away(model.friction).tolist(),
        "apart": apart.tolist(),
        "back_emf": model.back_emf.tolist(),
        "inputs": ", ".join(f'x["{name}"]' for name in inputs),
        "has_memory": has_memory,
        "when": "> 0.0" if time is None else f">= {time * (1 - 1e-6)!r}",
        "follows": not has_memory and set(inputs) - {"w"},
    }
    code = rendered("callback.py.j2", model, settings, context)
    sentence = (
        "the callback beside the MJCF computes the model's own torque of sliding joints, with "
        "frictionloss at the break-away level: mujoco.set_mjcb_passive(Friction(model))"
    )
    return python.write(sharp, settings).files[".py"] + code, sentence
