"""Written files run by MuJoCo as they are: servos, delays and bristles move as we predict."""

import re
from dataclasses import replace
from types import ModuleType

import mujoco
import numpy as np
import pandas as pd
import pytest
import yaml
from drive_logs import ServoPendulum
from fixtures import tiny_pendulums
from fixtures.paths import DATA
from fixtures.shared import shared
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.data.plants import Calibration
from frictionid.data.readers.dataset import load_dataset
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.formats.isaac import write as isaac
from frictionid.deploy.export.formats.mujoco import write as mujoco_files
from frictionid.deploy.export.formats.urdf import write as urdf
from frictionid.deploy.export.round_trip import in_mujoco

RIG = ServoPendulum(coulomb=0.03, viscous=0.02, delay=0.012)
FRICTION = fid.Friction(fid.CoulombViscous(), [[0.03, 0.02]])
LUGRE = [[0.2, 0.06, 0.5, 0.01, 0.002, 0.3, 0.1], [0.1, 0.05, 0.5, 0.01, 0.002, 0.3, 0.1]]
ACTUATOR = {"target": "target", "output": "torque", "P": 4.0, "D": 0.05, "limit": 0.4}
MACHINE = fid.mechanisms.pendulum(mass=RIG.mass, length=RIG.length)


@shared
def servo():
    frames = {"soft": pd.DataFrame(RIG.log(4.0, 0.05, seed=1, seconds=4.0))}
    return fid.Dataset.from_frames(frames, MACHINE, time="t", angle="q", actuator=ACTUATOR)


def calibrated(n, **parts):
    return replace(Calibration.ideal(n), **{k: np.asarray(v) for k, v in parts.items()})


def written_into(folder, text, model, data):
    """An export into a file of this text, and the place of what was written."""
    path, out = folder / "arm.xml", folder / "out.xml"
    path.write_text(text)
    settings = ExportSettings(into=path, joints=("hip",))
    return fid.export(model, "mujoco", out, data=data, settings=settings), out


def test_a_servo_with_late_targets_and_a_limit_runs_as_ours(servo, tmp_path):
    friction = replace(FRICTION, calibration=calibrated(1, target_delay=0.012, bias=[0.01]))
    done = fid.export(friction, "mujoco", tmp_path / "servo.xml", data=servo)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "servo.xml"))
    assert model.actuator_delay[0] == 0.012 and model.actuator_gainprm[0, 0] == 4.0
    assert_allclose(model.actuator_forcerange[0], [0.01 - 0.4, 0.01 + 0.4])
    assert done.lost == () and done.round_trip.predictions > 5
    assert done.round_trip.mean_apart < 2e-4 < 2e-3 < done.round_trip.at_once
    assert (
        f"without delay, as in MJX 3.17, it is {done.round_trip.at_once:.2g} rad" in done.notes[-1]
    )
    for said in ("\n".join(done.notes), (tmp_path / "servo.xml").read_text()):
        assert "history of controls begins at 0: start elsewhere with mj_initCtrlHistory" in said


def test_of_several_gains_and_payloads_it_is_said_whose_are_written(tmp_path):
    """The first is heavier, the last stiffer: the file runs as the one between."""
    heavy = replace(RIG, mass=2.0 * RIG.mass)
    rigs = {"a": (heavy, 4.0), "b": (RIG, 4.0), "c": (RIG, 8.0)}
    frames = {
        name: pd.DataFrame(rig.log(gain, 0.05, seed=1, seconds=4.0))
        for name, (rig, gain) in rigs.items()
    }
    actuator = {**ACTUATOR, "recordings": {"c": {"P": 8.0}}}
    columns = {"time": "t", "angle": "q", "parameters": {"a": {"mass": heavy.mass}}}
    data = fid.Dataset.from_frames(frames, MACHINE, actuator=actuator, **columns)
    friction = replace(FRICTION, calibration=calibrated(1, target_delay=0.012))
    done = fid.export(friction, "mujoco", tmp_path / "servo.xml", data=data)
    assert done.round_trip.predictions > 5 and done.round_trip.mean_apart < 2e-4
    said = "recordings differ in their gains: those of a are written"
    assert said in done.notes
    assert "recordings differ in mass: written is the mechanism's, as in b" in done.notes
    assert said in fid.export(friction, "isaac", tmp_path / "servo.py", data=data).notes


def test_a_backlash_that_a_target_has_not_is_named_with_what_it_costs(servo, tmp_path):
    loose = calibrated(1, target_delay=0.012, backlash=[0.02])
    friction = replace(FRICTION, calibration=loose)
    done, other = (
        fid.export(friction, to, tmp_path / f"servo.{to}", data=servo) for to in ("mujoco", "isaac")
    )
    assert done.round_trip.apart > 2e-3
    for made in (done, other):
        assert made.lost[0] == "backlash of 0.02 rad is left: the target has none"
        assert f"{made.cost.apart:.3g} from these" in made.lost[1]
        assert made.cost.apart == pytest.approx(done.round_trip.apart, rel=0.3)


def test_a_servo_is_written_into_a_file_in_place_of_its_motor(servo, tmp_path):
    text = (
        '<mujoco><worldbody><body><joint name="hip" axis="0 1 0"/><geom size=".1"/></body>'
        '</worldbody><actuator><position name="hip" joint="hip" kp="9"></position></actuator>'
        "</mujoco>"
    )
    _, out = written_into(tmp_path, text, FRICTION, servo)
    model = mujoco.MjModel.from_xml_path(str(out))
    assert model.nu == 1
    assert_allclose(model.actuator_biasprm[0, :3], [0.0, -4.0, -0.05])


OF_A_MAKER = """<mujoco><option timestep="0.0002"/><default><default class="arm">
<general biastype="affine" ctrlrange="-1 1"/></default></default>
<asset><mesh name="shell" file="shell.stl"/></asset><worldbody><body>
<joint name="hip" axis="0 -1 0"/><inertial pos="0 0 -0.2" mass="0.2" diaginertia="1e-9 1e-9 1e-9"/>
<geom type="mesh" mesh="shell"/></body></worldbody><actuator>{}</actuator></mujoco>"""
SERVO = '<general class="arm" joint="hip" gainprm="90" biasprm="0 -90 -9"/>'
TORQUE = '<general class="arm" joint="hip" gainprm="2" biasprm="0.1 0 0" ctrllimited="false"/>'


@pytest.mark.parametrize("actuator", [SERVO, TORQUE, "", '<motor joint="hip"/>'])
def test_logged_torques_move_a_file_of_a_maker_whatever_its_actuators(actuator, tmp_path):
    """Its meshes are elsewhere; a servo of its own does not take torques, and stays."""
    friction = replace(FRICTION, calibration=calibrated(1, gain=[1.1], bias=[0.01]))
    text = OF_A_MAKER.format(actuator)
    done, out = written_into(tmp_path, text, friction, tiny_pendulums.dataset())
    assert done.round_trip.predictions > 5 and done.round_trip.mean_apart < 1e-3
    assert (actuator == SERVO) == (SERVO in out.read_text())


def test_a_range_of_torques_is_none_of_the_targets_of_a_servo(servo, tmp_path):
    motor = OF_A_MAKER.format('<motor joint="hip" gear="4" ctrlrange="-0.1 0.1"/>')
    text = written_into(tmp_path, motor, FRICTION, servo)[1].read_text()
    assert "-0.1 0.1" not in text and 'ctrllimited="false"' in text


def test_a_card_has_the_friction_of_its_recordings_where_there_are_no_data(tmp_path):
    card = fid.machine("xl330")
    done = fid.export("machine:xl330", "mujoco", tmp_path / "xl330.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "xl330.xml"))
    numbers = [model.dof_frictionloss[0], model.dof_damping[0] - card.drive.back_emf[0]]
    assert_allclose(numbers, card.nearest.theta[0], rtol=1e-12)
    assert not model.actuator_damping.any()  # which MJX leaves out
    assert card.nearest.cost in done.lost
    assert model.dof_armature[0] == card.mechanism.nominal()["rotor"]
    assert model.actuator_gainprm[0, 0] == card.drive.kp[0]


def test_friction_that_differs_by_direction_is_a_constant_torque_of_the_motor():
    """Levels .3 and .1 are .2 and a constant .1; a callback does not count it again."""
    data = tiny_pendulums.dataset()
    for law, row in (
        (fid.CoulombViscous(symmetric=False), [0.3, 0.1, 0.02]),
        (fid.Stribeck(symmetric=False), [0.3, 0.1, 0.05, 0.05, 0.3, 0.02]),
    ):
        friction = replace(fid.Friction(law, [row]), calibration=calibrated(1, bias=[0.05]))
        own = exported(friction, ("joint 1",), (20.0,), data)
        made, module = mujoco_files(own, ExportSettings()), ModuleType("callback")
        model = mujoco.MjModel.from_xml_string(made.files[".xml"].decode())
        assert model.actuator_biasprm[0, 0] == pytest.approx(0.05 - 0.1, abs=2e-3)
        exec(made.files.get("_callback.py", b"Friction = None"), vars(module))
        run = in_mujoco(own, made.files[".xml"].decode(), module.Friction, most=8)
        assert run.predictions > 5 and run.mean_apart < 5e-3
        assert bool(made.lost) == isinstance(law, fid.Stribeck)


def test_every_card_with_a_mechanism_is_a_file_that_mujoco_reads(tmp_path):
    cards = [card for card in map(fid.machine, fid.machines().index) if card.mechanism is not None]
    assert len(cards) > 5
    for card in cards:
        fid.export(card, "mujoco", tmp_path / f"{card.name}.xml")
        model = mujoco.MjModel.from_xml_path(str(tmp_path / f"{card.name}.xml"))
        assert model.nv == card.mechanism.n


def test_a_servo_that_only_the_data_know_is_named_where_they_are_not(servo, tmp_path):
    """A fit names its data, its friction alone does not."""
    fit = fid.fit(servo, "coulomb_viscous", method="one_step")
    for model in (fit, fit.friction):
        done = fid.export(model, "isaac", tmp_path / "actuators.py", replace=True)
        assert any("gains and delay of the servo" in x for x in done.lost) == (model is not fit)


def test_a_servo_for_isaac_has_its_gains_its_limit_and_its_delay(servo):
    friction = replace(FRICTION, calibration=calibrated(1, target_delay=0.012))
    text = isaac(exported(friction, ("hip",), (5.0,), servo), ExportSettings()).files[".py"]
    for field in ("stiffness={'hip': 4.0}", "damping={'hip': 0.05}", "effort_limit={'hip': 0.4}"):
        assert field in text.decode()
    assert "DELAY = 0.012" in text.decode()


def test_a_servo_for_ros_has_its_gains_beside_the_urdf(servo, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text('<robot name="a"><link name="b"/><joint name="hip" type="continuous"/></robot>')
    made = urdf(exported(FRICTION, ("hip",), (5.0,), servo), ExportSettings(into=path))
    controller = yaml.safe_load(made.files["_controllers.yaml"])["joint_trajectory_controller"]
    assert controller["ros__parameters"]["gains"]["hip"] == {"p": 4.0, "i": 0.0, "d": 0.05}
    assert 'friction="0.03"' in made.files[".urdf"].decode()


@pytest.mark.real
@pytest.mark.parametrize("law", ["coulomb_viscous", "lugre"])
def test_real_motion_with_a_delay_is_within_a_milliradian_of_ours(law, real_data, tmp_path):
    data = load_dataset(DATA / "dfki_c1", real_data / "dfki_double_pendulum")
    data = replace(data, recordings=data.recordings[:2])
    base = 1.03 * data.mechanism.base(data.mechanism.nominal())
    calibration = calibrated(2, base=base, delay=0.0034, bias=[0.02, -0.01])
    friction = fid.Friction(fid.CoulombViscous(), [[0.2614, 0.01], [0.1475, 0.003119]])
    if law == "lugre":
        friction = fid.Friction(fid.LuGre(), LUGRE)
    friction = replace(friction, calibration=calibration)
    done = fid.export(friction, "mujoco", tmp_path / "c1.xml", data=data)
    assert done.round_trip.predictions >= 40
    assert done.round_trip.mean_apart < 1e-3 < 5e-3 < done.round_trip.at_once
    said = r"MJX 3.17 takes no dcmotor .*; the nearest frictionloss and damping are 0.0\d+ rad from"
    assert any(re.match(said, note) for note in done.notes) == (law == "lugre")
