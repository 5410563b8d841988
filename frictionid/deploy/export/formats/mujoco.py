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
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from frictionid.arrays import Array
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.deploy.export.formats import python
from frictionid.deploy.export.nearest import break_away, differs, lost_by, nearest
from frictionid.deploy.export.xml_text import (
    Element,
    by_name,
    elements,
    read_xml,
    replaced,
    stated_before,
    with_attributes,
)
from frictionid.errors import InputError
from frictionid.mechanics import Mechanism
from frictionid.mechanics.mjcf_text import mjcf_of

_EXACT = 1e-9


def physical_parameters(mechanism: Mechanism, base: Array) -> dict[str, float]:
    """Physical parameters with these base parameters (nb), near the mechanism's own.

    Motion shows the base parameters only; of the many masses, lengths and inertias that have them,
    these differ little from the nominal ones, in proportion. Parameters that are zero stay zero,
    and gravity stays.

    Raises
    ------
    InputError
        Where no positive parameters have them.

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
    size = np.maximum(np.abs(base), 1e-3 * np.abs(base).max())

    def values(x: Array) -> dict[str, float]:
        return nominal | dict(zip(names, map(float, start * np.exp(x)), strict=True))

    def off(x: Array) -> Array:
        return (mechanism.base(values(x)) - base) / size

    # Gauss-Newton by minimum norm: of all solutions near the start, one that changes little
    solution = least_squares(off, np.zeros(len(names)), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    if np.abs(solution.fun).max() > _EXACT:
        raise InputError(
            f"{mechanism.kind}: no positive masses, lengths and inertias have the model's base "
            "parameters; name an MJCF (--into), and correct its inertias by the model's"
        )
    return values(solution.x)


_CLASS = '''
REST = 1e-4  # [rad/s]: slower joints have frictionloss alone
LEVELS = {levels}  # frictionloss [N m] where it is constant


class Friction:
    """Friction of a model's joints as a passive force.

    mujoco.set_mjcb_passive(Friction(model)): frictionloss is the break-away level, which holds a
    joint at rest; this adds what the law's torque differs by from frictionloss and damping, so that
    a sliding joint has the law's torque. The motor torque it follows is that of the step before.
    """

    def __init__(self, model):
        self.model, self.memory, self.time = model, None, None
        self.joints = [model.joint(name).id for name in JOINTS]
        self.dofs = [int(model.jnt_dofadr[j]) for j in self.joints]
        self.places = [int(model.jnt_qposadr[j]) for j in self.joints]
        model.dof_frictionloss[self.dofs] = LEVELS

    def __call__(self, model, data):
        x = dict(
            q=[float(v) for v in data.qpos[self.places]],
            w=[float(v) for v in data.qvel[self.dofs]],
            u=[float(v) for v in data.qfrc_actuator[self.dofs] + data.qfrc_applied[self.dofs]],
        )
{memory}        torques = torque({arguments})
        levels = [float(v) for v in model.dof_frictionloss[self.dofs]]
        for j, (dof, w) in enumerate(zip(self.dofs, x["w"])):
            if abs(w) > REST:
                held = levels[j] * (1.0 if w > 0.0 else -1.0) + float(model.dof_damping[dof]) * w
                data.qfrc_passive[dof] -= torques[j] - held
{levels_now}'''

_MEMORY = """        if self.time is None or data.time < self.time:
            self.memory, self.time = start({inputs}), data.time
        elif data.time - self.time {when}:
            self.memory = advance({inputs}, self.memory, data.time - self.time)
            self.time = data.time
"""

# of a law that follows q or u: the level at this place, of the direction with less
_NOW = """        both = [dict(x, w=[side * REST] * len(self.dofs)) for side in (1.0, -1.0)]
        ahead, back = (torque({both}) for y in both)
        model.dof_frictionloss[self.dofs] = [max(min(a, -b), 0.0) for a, b in zip(ahead, back)]
"""


def callback(model: ExportedFriction, settings: ExportSettings) -> tuple[bytes, str]:
    """The module, b"" where there is none, and a sentence that says what it does.

    Memory advances with each step of the engine, or once a sample where the law says so.
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
    when = "> 0.0" if time is None else f">= {time * (1 - 1e-6)!r}"
    now, both = (", ".join(f'{x}["{name}"]' for name in inputs) for x in "xy")
    follows = not has_memory and set(inputs) - {"w"}
    code = _CLASS.format(
        levels=[float(v) for v in break_away(model.friction)],
        memory=_MEMORY.format(inputs=now, when=when) if has_memory else "",
        arguments=f"{now}, self.memory" if has_memory else now,
        levels_now=_NOW.format(both=both) if follows else "",
    )
    sentence = (
        "the callback beside the MJCF computes the model's own torque of sliding joints, with "
        "frictionloss at the break-away level: mujoco.set_mjcb_passive(Friction(model))"
    )
    return python.write(sharp, settings).files[".py"] + f"\n{code}".encode(), sentence


# tendons stand for parts that turn with several joints, such as motors on moving links
_PLACES = {"joint": ("body", "frame", "replicate", "worldbody"), "fixed": ("tendon",)}
_DEFAULT = {"joint": "joint", "fixed": "tendon"}  # their elements in default classes
_KINDS = {"rad": "hinge", "m": "slide"}  # of joints, by the unit of their position
_STATED = ("frictionloss", "damping", "armature")
_HARD = "0.0001 1"  # MuJoCo takes two time steps where that is less, unless refsafe is disabled
held = nearest


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """An MJCF whose joints have the friction, and a callback where they cannot hold it."""
    friction = nearest(model)
    lost = lost_by(model, friction, "MJCF", "frictionloss and damping")
    if settings.into is None:
        text, where, notes = _mechanism(model)
        listed = elements(text, where)
    else:
        where, notes = str(settings.into), []
        text, listed = read_xml(settings.into, "MJCF", "mujoco", "mujocoinclude")
    joints = _joints(listed, model, where)
    values = [
        {"frictionloss": repr(float(level)), "damping": repr(float(slope))}
        for level, slope in friction.theta
    ]
    if not any(e.tag == "flag" and e.attributes.get("refsafe") == "disable" for e in listed):
        for joint, new in zip(joints, values, strict=True):
            if _inherited(joint, "solreffriction", listed) is None:
                new["solreffriction"] = _HARD
    if settings.into is not None:
        if (rotor := model.rotor) is not None:
            values[0]["armature"] = repr(rotor)
        for joint, new in zip(joints, values, strict=True):
            before = {name: _inherited(joint, name, listed) for name in _STATED if name in new}
            notes += stated_before(joint.name, before, new)
        if any(e.tag == "include" or "file" in e.attributes for e in listed):
            notes.append(
                "the MJCF names other files: keep it in the folder of the one that it is made from"
            )
    if any("solreffriction" in new for new in values):
        notes.append(f'solreffriction="{_HARD}": friction is as hard as the time step allows')
    changes = [
        (joint.start, joint.end, with_attributes(text[joint.start : joint.end], new))
        for joint, new in zip(joints, values, strict=True)
    ]
    files = {".xml": replaced(text, changes)}
    if differs(model, friction):
        code, sentence = b"", "no callback: it adds friction to joints, not to tendons"
        if all(joint.tag == "joint" for joint in joints):
            code, sentence = callback(model, settings)
        files |= {"_callback.py": code} if code else {}
        (notes if code else lost).append(sentence)
    return Written(files, tuple(lost), friction if lost else None, tuple(notes))


def _mechanism(model: ExportedFriction) -> tuple[bytes, str, list[str]]:
    """MJCF of the data's mechanism."""
    if model.data is None:
        raise InputError(
            "mujoco: name the MJCF whose joints are given the friction (--into robot.xml), or the "
            "data set whose mechanism is written (--dataset)"
        )
    mechanism, notes = model.data.mechanism, []
    parameters: Mapping[str, float] = model.friction.parameters
    if (calibration := model.friction.calibration) is not None:
        if calibration.base is not None:
            parameters = physical_parameters(mechanism, calibration.base)
            notes.append("masses and inertias are such that the model's base parameters hold")
        notes.append("gain, bias, delay and offset of the calibration are not in the MJCF")
    used = {k: v for k, v in parameters.items() if k in mechanism.nominal()}
    return mjcf_of(mechanism, used).encode(), f"MJCF of {mechanism.kind}", notes


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
    """Value of a joint's attribute, by itself or by its default class; None where there is none."""
    if name in joint.attributes:
        return joint.attributes[name]
    chosen, body = joint.attributes.get("class"), joint.parent
    while chosen is None and body is not None:
        chosen, body = body.attributes.get("childclass"), body.parent
    defaults = [e for e in listed if e.tag == "default"]
    top = [e for e in defaults if e.parent is not None and e.parent.tag == "mujoco"]
    classes = [e for e in defaults if chosen is not None and e.attributes.get("class") == chosen]
    default: Element | None = next(iter(classes or top), None)
    while default is not None and default.tag == "default":
        for child in default.children:
            if child.tag == _DEFAULT[joint.tag] and name in child.attributes:
                return child.attributes[name]
        default = default.parent
    return None
