"""Friction in USD: a layer over a stage, whose joints have what Newton and PhysX read.

`NewtonJointAPI` has a level and damping [Newton2026]; `PhysxJointAxisAPI`, of joints in
articulations, a break-away level as well [PhysX2025]; `MjcJointAPI` makes friction as hard as the
time step allows where Newton solves by MuJoCo. Position control is a drive; with a delay or
a torque-speed envelope it is a `NewtonActuator` and the drive has no gains: Newton adds up both.

Numbers are in the stage's units of mass and length. At revolute joints damping and gains of drives
are per degree: Newton's importer and PhysX's parser multiply them by 180/pi [Omniverse2026]. A
`NewtonActuator` counts in radians.
"""

import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from frictionid.data.servo import PositionControl
from frictionid.errors import InputError, needs
from frictionid.files import read_bytes
from frictionid.friction import Friction

from ..exported import ExportedFriction, ExportSettings, Written
from ..nearest import (
    armature,
    break_away,
    kept_inertias,
    lost_by,
    lost_of_motors,
    nearest,
    whose_gains,
)
from ..xml_text import by_name, stated_before

with needs("usd"):
    from pxr import Sdf, Tf, Usd, UsdGeom, UsdPhysics

_JOINTS = {"rad": ("PhysicsRevoluteJoint", "angular"), "m": ("PhysicsPrismaticJoint", "linear")}
_RATES = ("newton:timeStepsPerSecond", "physxScene:timeStepsPerSecond")
_HARD = (1e-4, 1.0)  # [s]: softer friction of MuJoCo lets a joint creep for 20 ms
_OF_ONE_LAYER = ("subLayers", "subLayerOffsets", "layerRelocates")
held = nearest


class Joint(NamedTuple):
    """A joint of a stage, and the factors of SI numbers there.

    prim : its prim; axis : "angular" or "linear"
    effort : of N m, or N; gain : of N m/rad and kg m^2, or N/m and kg
    by_degree : of gains, per degree where it turns; speed : of rad/s, or m/s
    """

    prim: Any
    axis: str
    effort: float
    gain: float
    by_degree: float
    speed: float


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A layer that has the stage as its sublayer, and joints with friction and position control."""
    path, drive, friction = settings.into, model.drive, nearest(model)
    if path is None:
        raise InputError(
            "usd: name the stage whose joints are given the friction (--into robot.usda)"
        )
    stage = _stage(path)
    rates = (prim.GetAttribute(name).Get() for prim in stage.Traverse() for name in _RATES)
    rate = next(filter(None, rates), 1000)  # Newton's
    delay = 0.0 if drive is None else max(drive.delay, 0.0)
    steps = round(delay * rate)
    notes: list[str] = []
    rotors, carried = armature(model)
    for j, joint in enumerate(_joints(stage, model, str(path))):
        rotor = None if rotors is None else float(rotors[j])
        notes += _friction(model, friction, j, joint, rotor)
        if drive is not None and j in model.driven.values():
            notes += _drive(joint, drive, j, steps)
    if delay:
        notes.append(f"targets are {1e3 * delay:.3g} ms late: {steps} steps at {rate:g} Hz")
    notes += whose_gains(model)
    sublayer = os.path.relpath(path.resolve(), settings.folder.resolve())
    notes.append(f"the layer names {sublayer}: open it in place of that, and move both together")
    lost = lost_by(model, friction, "Newton", "friction and damping")
    other = friction if lost else None
    lost += kept_inertias(model, "USD", carried) + lost_of_motors(model, "USD", has_drives=True)
    return Written({".usda": _layer(stage, sublayer)}, tuple(lost), other, tuple(notes))


def _stage(path: Path) -> Any:
    """The stage of a file, whose session layer is written."""
    read_bytes(path)
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException:
        raise InputError(f"{path}: is no stage that USD can open") from None
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        raise InputError(
            f"{path}: states no metersPerUnit, which USD takes as 0.01 and Newton as 1: add it"
        )
    stage.SetEditTarget(stage.GetSessionLayer())
    return stage


def _joints(stage: Any, model: ExportedFriction, where: str) -> Iterable[Joint]:
    """The model's joints, in its order."""
    meters = UsdGeom.GetStageMetersPerUnit(stage)
    inertia = UsdPhysics.GetStageKilogramsPerUnit(stage) * meters**2
    paths = (prim.GetPath() for prim in stage.Traverse() if prim.IsA(UsdPhysics.Joint))
    for path, unit in zip(by_name(paths, model.joints, where), model.units, strict=True):
        prim, (kind, axis) = stage.GetPrimAtPath(path), _JOINTS[unit]
        if prim.GetTypeName() != kind:
            raise InputError(
                f"{where}: joint {path.name!r} is a {prim.GetTypeName()}, the model's position is "
                f"in {unit}: its friction needs a {kind}"
            )
        speed, degree = (1.0, math.radians(1.0)) if unit == "rad" else (1.0 / meters, 1.0)
        effort = 1.0 / (inertia * speed)
        yield Joint(prim, axis, effort, effort / speed, effort / speed * degree, speed)


def _friction(
    model: ExportedFriction, friction: Friction, j: int, joint: Joint, rotor: float | None
) -> Iterable[str]:
    """Gives a joint friction, and its rotor's inertia [kg m^2]; notes."""
    prim, axis = joint.prim, f"physxJointAxis:{joint.axis}"
    level, viscous = friction.theta[j]
    viscous = viscous + model.back_emf[j]
    of_joint = {"friction": joint.effort * level, "damping": joint.by_degree * viscous}
    of_axis = {
        "staticFrictionEffort": joint.effort * max(level, break_away(model.friction)[j]),
        "dynamicFrictionEffort": of_joint["friction"],
        "viscousFrictionCoefficient": of_joint["damping"],
    }
    for name in ("armature", "maxJointVelocity"):  # the axis' own replace the joint's
        before = prim.GetAttribute(f"physxJoint:{name}").Get()
        if before is not None and not prim.GetAttribute(f"{axis}:{name}"):
            of_axis[name] = before
    if rotor is not None:
        of_joint["armature"] = of_axis["armature"] = joint.gain * rotor
    if prim.GetAttribute("physxJoint:jointFriction"):  # acts beside the axis'
        yield from _author(prim, "PhysxJointAPI", "physxJoint", {"jointFriction": 0.0})
    prim.AddAppliedSchema("MjcJointAPI")
    hardness = prim.CreateAttribute("mjc:solreffriction", Sdf.ValueTypeNames.DoubleArray, False)
    if not hardness.HasAuthoredValue():
        hardness.Set(list(_HARD))
    yield from _author(prim, "NewtonJointAPI", "newton", of_joint)
    yield from _author(prim, f"PhysxJointAxisAPI:{joint.axis}", axis, of_axis)


def _drive(joint: Joint, drive: PositionControl, j: int, steps: int) -> Iterable[str]:
    """Gives a joint position control in place of its own, as a drive or an actuator; notes."""
    prim, motor = joint.prim, drive.envelope(j)
    stage, target = prim.GetStage(), prim.GetPath()
    kp, kv, limit = (float(x[j]) for x in (drive.kp, drive.kv, drive.limit))
    for other in list(stage.Traverse()):
        if target in other.GetRelationship("newton:targets").GetTargets():
            other.SetActive(False)
    gain, limit = 0.0 if steps or motor else joint.by_degree, joint.effort * limit
    UsdPhysics.DriveAPI.Apply(prim, joint.axis).CreateTypeAttr("force")
    values = {"stiffness": gain * kp, "damping": gain * kv, "maxForce": limit}
    yield from _author(prim, f"PhysicsDriveAPI:{joint.axis}", f"drive:{joint.axis}:physics", values)
    if gain:
        return
    place = target.ReplaceName(f"frictionid_{target.name}")
    while stage.GetPrimAtPath(place):
        place = place.ReplaceName(f"{place.name}_")
    actuator = stage.DefinePrim(place, "NewtonActuator")
    actuator.CreateRelationship("newton:targets", False).SetTargets([target])
    schemas: dict[str, Mapping[str, float]] = {
        "NewtonPDControlAPI": {"kp": joint.gain * kp, "kd": joint.gain * kv},
        "NewtonMaxEffortClampingAPI": {"maxEffort": limit},
    }
    if motor is not None:
        schemas["NewtonDCMotorClampingAPI"] = {
            "saturationEffort": joint.effort * float(motor.stall),
            "velocityLimit": joint.speed * float(motor.no_load),
            "maxMotorEffort": limit,
        }
    if steps:
        schemas["NewtonActuatorDelayAPI"] = {"delaySteps": steps}
    for schema, attributes in schemas.items():
        yield from _author(actuator, schema, "newton", attributes)


def _author(prim: Any, schema: str, namespace: str, values: Mapping[str, float]) -> Iterable[str]:
    """Applies a schema with its attributes; a note on other values that stood there."""
    before, types = {}, Sdf.ValueTypeNames
    prim.AddAppliedSchema(schema)
    for name, value in values.items():
        kind = types.Int if isinstance(value, int) else types.Float
        attribute = prim.CreateAttribute(f"{namespace}:{name}", kind, False)
        if attribute.HasAuthoredValue() and isinstance(old := attribute.Get(), float):
            before[name] = f"{old:.4g}"
        attribute.Set(value)
    return stated_before(prim.GetName(), before, {name: f"{x:.4g}" for name, x in values.items()})


def _layer(stage: Any, sublayer: str) -> bytes:
    """The session layer over a file, with the file's own facts: those of the first layer hold."""
    layer, root = Sdf.Layer.CreateAnonymous(".usda"), stage.GetRootLayer().pseudoRoot
    layer.TransferContent(stage.GetSessionLayer())
    for name in root.ListInfoKeys():
        if name not in _OF_ONE_LAYER:
            layer.pseudoRoot.SetInfo(name, root.GetInfo(name))
    layer.subLayerPaths = [f"./{sublayer}"]
    return layer.ExportToString().encode()
