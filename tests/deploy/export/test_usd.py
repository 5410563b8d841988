"""Friction in USD: joints have it as Newton and PhysX read it, and the user's stage stays."""

import math
from dataclasses import replace

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.data.envelope import Envelope
from frictionid.data.plants import Calibration
from frictionid.data.servo import PositionControl
from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.nearest import break_away, nearest
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, Stribeck

pytest.importorskip("pxr", reason="the extra usd installs it")
from pxr import Sdf, Usd, UsdGeom, UsdPhysics

LEVELS = np.array([[0.12, 0.02], [3.5, 0.7]])
STICKING = np.array([[0.1, 0.05, 0.5, 0.02], [3.0, 1.0, 0.3, 0.7]])
AXES = ("angular", "linear")
ONE, NONE = np.ones(2), np.zeros(2)
MOTORS = Envelope(*np.array([[0.8, 1.5], [4.0, 10.0], [12.0, 20.0]]))
PLAIN = PositionControl(20 * ONE, 0.5 * ONE, np.array([0.8, np.inf]), 0.1 * ONE, 0.0, NONE)
LATE = PLAIN._replace(delay=0.012)
CLIPPED = PositionControl(
    *(20 * ONE, 0.5 * ONE, MOTORS.peak, NONE, 0.0, NONE, MOTORS.stall, MOTORS.slope)
)


def robot(folder, meters=1.0, mass=1.0, rate=500, name="arm"):
    """A stage with a revolute, a prismatic and a fixed joint, with attributes of its own."""
    path = folder / f"{name}.usda"
    stage = Usd.Stage.CreateNew(str(path))
    if meters:
        UsdGeom.SetStageMetersPerUnit(stage, meters)
        UsdPhysics.SetStageKilogramsPerUnit(stage, mass)
    UsdGeom.SetStageUpAxis(stage, "Z")
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/arm").GetPrim())
    scene = UsdPhysics.Scene.Define(stage, "/scene").GetPrim()
    if rate:
        scene.CreateAttribute("physxScene:timeStepsPerSecond", Sdf.ValueTypeNames.UInt).Set(rate)
    hip = UsdPhysics.RevoluteJoint.Define(stage, "/arm/hip")
    hip.CreateUpperLimitAttr(40.0)
    UsdPhysics.DriveAPI.Apply(hip.GetPrim(), "angular").CreateStiffnessAttr(7.0)
    for name, value in (("armature", 0.3), ("maxJointVelocity", 90.0), ("jointFriction", 0.4)):
        hip.GetPrim().CreateAttribute(f"physxJoint:{name}", Sdf.ValueTypeNames.Float).Set(value)
    hip.GetPrim().CreateAttribute("newton:friction", Sdf.ValueTypeNames.Float).Set(5.0)
    UsdPhysics.PrismaticJoint.Define(stage, "/arm/rail")
    UsdPhysics.FixedJoint.Define(stage, "/arm/weld")
    servo = stage.DefinePrim("/arm/servo", "NewtonActuator")
    servo.CreateRelationship("newton:targets").SetTargets([hip.GetPath()])
    stage.Save()
    return path


def composed(made, path):
    """The stage of an export beside the user's, from its file."""
    out = path.with_name("out.usda")
    out.write_bytes(made.files[".usda"])
    return Usd.Stage.Open(str(out))


def written(path, law=None, theta=LEVELS, drive=None, joints=("hip", "rail"), **parts):
    model = Friction(law or CoulombViscous(), theta, position_units=("rad", "m"), **parts)
    own = replace(exported(model, joints, (5.0, 1.0)), drive=drive)
    return own, writer_of("usd")(own, ExportSettings(into=path, folder=path.parent))


def number(stage, joint, name):
    return stage.GetPrimAtPath(f"/arm/{joint}").GetAttribute(name).Get()


def schemas(stage, joint):
    """Applied schemas, with those that this USD does not know."""
    return set(stage.GetPrimAtPath(f"/arm/{joint}").GetPrimTypeInfo().GetAppliedAPISchemas())


@pytest.mark.parametrize("meters, mass", [(1.0, 1.0), (0.01, 1.0), (0.1, 0.001)])
def test_newton_and_physx_read_the_friction_in_si(tmp_path, meters, mass):
    """The torque at a speed, as their docs say: degrees to radians, stage units to SI."""
    path = robot(tmp_path, meters, mass)
    own, made = written(path, Stribeck(), STICKING)
    stage, friction = composed(made, path), nearest(own)
    newtons = mass * meters  # of a stage's unit of force
    for j, (joint, axis) in enumerate(zip(("hip", "rail"), AXES, strict=True)):
        effort, speed = (newtons * meters, 180 / math.pi) if j == 0 else (newtons, 1 / meters)
        newton = [number(stage, joint, f"newton:{name}") for name in ("friction", "damping")]
        names = ("dynamicFrictionEffort", "viscousFrictionCoefficient", "staticFrictionEffort")
        physx = [number(stage, joint, f"physxJointAxis:{axis}:{name}") for name in names]
        assert newton == physx[:2]
        si = [newton[0] * effort, newton[1] * effort * speed]
        assert_allclose(si, friction.theta[j], rtol=1e-6)
        assert physx[2] * effort == pytest.approx(break_away(own.friction)[j], rel=1e-6)
        assert {"NewtonJointAPI", f"PhysxJointAxisAPI:{axis}"} <= schemas(stage, joint)
    assert made.held is not None and any("breaks away" in line for line in made.lost)
    assert "hip had friction 5" in made.notes


def test_what_a_user_made_survives_and_the_file_stays(tmp_path):
    path = robot(tmp_path)
    before = path.read_bytes()
    _, made = written(path)
    stage = composed(made, path)
    assert path.read_bytes() == before and made.lost == ()
    assert stage.GetRootLayer().subLayerPaths == ["./arm.usda"]
    alone = Usd.Stage.Open(str(path))
    for name in ("metersPerUnit", "kilogramsPerUnit", "upAxis", "defaultPrim"):
        assert stage.GetMetadata(name) == alone.GetMetadata(name)
    assert [p.GetPath() for p in stage.Traverse()] == [p.GetPath() for p in alone.Traverse()]
    assert number(stage, "hip", "physics:upperLimit") == 40.0
    assert number(stage, "hip", "drive:angular:physics:stiffness") == 7.0
    # PhysX would take the axis' defaults in place of these, and add the friction by the load
    assert number(stage, "hip", "physxJointAxis:angular:armature") == pytest.approx(0.3)
    assert number(stage, "hip", "physxJointAxis:angular:maxJointVelocity") == 90.0
    assert number(stage, "hip", "physxJoint:jointFriction") == 0.0


def test_friction_is_as_hard_as_the_step_allows_where_the_user_says_nothing(tmp_path):
    """For the MuJoCo solver of Newton, whose friction takes 20 ms to turn round by default."""
    path = robot(tmp_path)
    own = Usd.Stage.Open(str(path))
    kind = Sdf.ValueTypeNames.DoubleArray
    rail = own.GetPrimAtPath("/arm/rail").CreateAttribute("mjc:solreffriction", kind)
    rail.Set([0.01, 1.0])
    own.Save()
    stage = composed(written(path)[1], path)
    assert list(number(stage, "hip", "mjc:solreffriction")) == [1e-4, 1.0]
    assert list(number(stage, "rail", "mjc:solreffriction")) == [0.01, 1.0]


def test_a_rotor_is_armature_in_the_stage_s_units(tmp_path):
    path = robot(tmp_path, meters=0.01)
    model = Friction(CoulombViscous(), LEVELS[:1], {"rotor": 0.002})
    settings = ExportSettings(into=path, folder=tmp_path)
    stage = composed(writer_of("usd")(exported(model, ("hip",), (5.0,)), settings), path)
    for name in ("newton:armature", "physxJointAxis:angular:armature"):
        assert number(stage, "hip", name) == pytest.approx(0.002 * 100**2)  # kg cm^2


@pytest.mark.parametrize("meters", [1.0, 0.01])
def test_position_control_is_a_drive_with_the_torque_of_the_model(tmp_path, meters):
    path = robot(tmp_path, meters)
    own, made = written(path, drive=PLAIN)
    stage = composed(made, path)
    for j, (joint, axis) in enumerate(zip(("hip", "rail"), AXES, strict=True)):
        drive = UsdPhysics.DriveAPI(stage.GetPrimAtPath(f"/arm/{joint}"), axis)
        position = math.degrees(0.03) if j == 0 else 0.03 / meters  # of an error in rad, or m
        effort = meters ** (2 - j)
        values = (drive.GetStiffnessAttr(), drive.GetDampingAttr(), drive.GetMaxForceAttr())
        stiffness, damping, most = (effort * value.Get() for value in values)
        assert_allclose(stiffness * position, PLAIN.kp[j] * 0.03, rtol=1e-6)
        assert_allclose(damping * position, PLAIN.kv[j] * 0.03, rtol=1e-6)
        assert_allclose(most, PLAIN.limit[j], rtol=1e-6)
        assert drive.GetTypeAttr().Get() == "force"
        passive = number(stage, joint, "newton:damping") * effort * position / 0.03
        assert passive == pytest.approx(own.friction.theta[j, 1] + PLAIN.back_emf[j], rel=1e-6)
    # it would act beside the drive
    assert not stage.GetPrimAtPath("/arm/servo").IsActive()


@pytest.mark.parametrize("rate, steps", [(500, 6), (None, 12)])
def test_a_delay_is_in_an_actuator_in_place_of_the_drive(tmp_path, rate, steps):
    path = robot(tmp_path, meters=0.1, rate=rate)
    _, made = written(path, drive=LATE)
    stage = composed(made, path)
    for j, joint in enumerate(("hip", "rail")):
        actuator = stage.GetPrimAtPath(f"/arm/frictionid_{joint}")
        targets = actuator.GetRelationship("newton:targets").GetTargets()
        assert actuator.GetTypeName() == "NewtonActuator" and targets == [f"/arm/{joint}"]
        assert "NewtonActuatorDelayAPI" in schemas(stage, actuator.GetName())
        values = {a.GetName(): a.Get() for a in actuator.GetAttributes()}
        gain = 0.1 ** (2 - 2 * j)  # radians, not degrees
        assert values["newton:delaySteps"] == steps
        assert gain * values["newton:kp"] == pytest.approx(20.0)
        assert gain * values["newton:kd"] == pytest.approx(0.5)
        assert 0.1 ** (2 - j) * values["newton:maxEffort"] == pytest.approx(LATE.limit[j])
        assert number(stage, joint, f"drive:{AXES[j]}:physics:stiffness") == 0.0
    assert any(f"12 ms late: {steps} steps at" in note for note in made.notes) and made.lost == ()


def test_an_envelope_is_that_of_a_dc_motor(tmp_path):
    path = robot(tmp_path, meters=0.1)
    stage = composed(written(path, drive=CLIPPED)[1], path)
    w = np.linspace(-30.0, 30.0, 61)
    for j, joint in enumerate(("hip", "rail")):
        names = ("saturationEffort", "velocityLimit", "maxMotorEffort")
        stall, no_load, peak = (number(stage, f"frictionid_{joint}", f"newton:{n}") for n in names)
        speed = w if j == 0 else w / 0.1
        fast = no_load * (1 + peak / stall)
        top = np.minimum(stall * (1 - np.clip(speed, -fast, fast) / no_load), peak)
        ours = Envelope(*(x[j] for x in MOTORS)).top(w)
        assert_allclose(0.1 ** (2 - j) * top, ours, atol=1e-6)


def test_what_no_drive_holds_is_said(tmp_path):
    path = robot(tmp_path)
    late = Calibration(None, ONE, np.array(0.004), NONE, NONE)
    assert any("delay of 4 ms" in line for line in written(path, calibration=late)[1].lost)
    biased = PLAIN._replace(bias=0.01 * ONE)
    assert any("constant torque" in line for line in written(path, drive=biased)[1].lost)


def test_a_layer_of_ours_can_be_written_into_again(tmp_path):
    path = robot(tmp_path)
    composed(written(path, drive=LATE)[1], path)
    again = path.with_name("out.usda")
    made = written(again, theta=2 * LEVELS, drive=CLIPPED)[1]
    assert b"@./out.usda@" in made.files[".usda"]
    third = path.with_name("third.usda")
    third.write_bytes(made.files[".usda"])
    stage = Usd.Stage.Open(str(third))
    assert number(stage, "rail", "newton:friction") == pytest.approx(7.0)
    actuators = [p for p in stage.Traverse() if p.GetTypeName() == "NewtonActuator"]
    assert {str(p.GetPath()) for p in actuators} == {
        "/arm/frictionid_hip_",
        "/arm/frictionid_rail_",
    }


def test_a_file_in_another_folder_names_the_stage(tmp_path):
    path, out = robot(tmp_path), tmp_path / "made/arm.usda"
    out.parent.mkdir()
    model = Friction(CoulombViscous(), LEVELS, position_units=("rad", "m"))
    settings = ExportSettings(into=path, joints=("hip", "rail"))
    done = fid.export(model, "usd", out, speeds=(5.0, 1.0), settings=settings)
    assert any("../arm.usda" in note for note in done.notes)
    assert number(Usd.Stage.Open(str(out)), "hip", "newton:friction") == pytest.approx(0.12)


def test_stages_that_cannot_be_given_friction_are_refused(tmp_path):
    path = robot(tmp_path)
    with assert_refused(r"no joint 'knee', it has hip, rail, weld"):
        written(path, joints=("hip", "knee"))
    with assert_refused(r"'weld' is a PhysicsFixedJoint, .* in m: .*Prismatic"):
        written(path, joints=("hip", "weld"))
    with assert_refused(r"'rail' is a PhysicsPrismaticJoint, .* in rad"):
        written(path, joints=("rail", "hip"))
    with assert_refused("metersPerUnit"):
        written(robot(tmp_path, meters=None, name="unknown"))
    stage = Usd.Stage.Open(str(robot(tmp_path, name="two")))
    UsdPhysics.RevoluteJoint.Define(stage, "/other/hip")
    stage.Save()
    with assert_refused("2 joints 'hip'"):
        written(tmp_path / "two.usda")
    for name, text in (("arm.urdf", "<robot/>"), ("broken.usda", '#usda 1.0\ndef "a" {')):
        (tmp_path / name).write_text(text)
        with assert_refused("is no stage that USD can open"):
            written(tmp_path / name)
    with assert_refused("cannot be read"):
        written(tmp_path / "missing.usda")
    own = exported(Friction(CoulombViscous(), LEVELS), ("hip", "rail"))
    with assert_refused(r"--into robot\.usda"):
        writer_of("usd")(own, ExportSettings())
