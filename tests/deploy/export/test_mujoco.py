"""Friction in MJCF: the text stays as it is, and MuJoCo has the model's torques."""

import re
from types import ModuleType

import mujoco
import numpy as np
import pytest
from fixtures.mistakes import mistakes
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction, Inputs
from frictionid.friction.laws import (
    CoulombViscous,
    Dahl,
    FilmLag,
    GearLoad,
    LoadDependent,
    LuGre,
    Quadratic,
    Stribeck,
    Sum,
)
from frictionid.mechanics import Plant, pendulum
from frictionid.mechanics.mjcf_text import mjcf_of

ROBOT = """<?xml version="1.0"?>
<!-- a leg -->
<mujoco model="leg">
  <compiler angle="radian"/>
  <default>
    <joint damping="0.3"/>
    <default class="foot"><joint armature="0.001" damping="0.7"/></default>
  </default>
  <worldbody>
    <body name="thigh">
      <joint  name='hip'   axis="0 1 0"
              frictionloss = "9" /> <!-- > "quoted" -->
      <geom type="capsule" size="0.02" fromto="0 0 0  0 0 -0.3"/>
      <body name="shank" pos="0 0 -0.3" childclass="foot">
        <joint name="knee" axis="0 1 0"></joint>
        <geom type="capsule" size="0.02" fromto="0 0 0  0 0 -0.3" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="hip" joint="hip"/><motor name="knee" joint="knee"/></actuator>
</mujoco>
"""
NUMBERS = np.array([[0.12, 0.02], [0.05, 0.01]])
STRIBECK = np.array([[0.1, 0.05, 0.5, 0.02], [0.03, 0.0, 0.5, 0.01]])


@pytest.fixture(autouse=True)
def no_callback():
    """What a test has set ends with it."""
    yield
    mujoco.set_mjcb_passive(None)


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / "leg.xml"
    path.write_text(ROBOT)
    return path


def written(law, theta, path, joints=("hip", "knee"), speeds=(5.0, 5.0)):
    own = exported(Friction(law, theta), joints, speeds[: len(theta)])
    return writer_of("mujoco")(own, ExportSettings(into=path))


def loaded(made):
    model = mujoco.MjModel.from_xml_string(made.files[".xml"].decode())
    module = ModuleType("callback")
    exec(made.files.get("_callback.py", b""), vars(module))
    return model, module


def test_joints_have_the_numbers_and_nothing_else_of_the_text_changes(robot):
    made = written(CoulombViscous(), NUMBERS, robot)
    model, _ = loaded(made)
    assert_array_equal(model.dof_frictionloss, NUMBERS[:, 0])
    assert_array_equal(model.dof_damping, NUMBERS[:, 1])
    own = r'\s*(frictionloss|damping|solreffriction)\s*=\s*"[^"]*"'
    joints = re.compile(r"<joint[^>]*name[^>]*>")
    before, after = (
        joints.sub(lambda m: re.sub(own, "", m.group()).replace(" />", "/>"), text)
        for text in (ROBOT, made.files[".xml"].decode())
    )
    assert before == after
    assert made.lost == () and made.held is None and list(made.files) == [".xml"]
    assert "hip had frictionloss 9, damping 0.3" in made.notes
    assert "knee had damping 0.7" in made.notes


FILES = """
<mujoco -> <robot                 => is no XML|is no MJCF
<?xml version="1.0"?> -> <!DOCTYPE mujoco []> => document type
axis="0 1 0" -> type="ball"       => 'hip' is a ball joint
name='hip' -> name='other'        => no joint 'hip', it has knee, other; .* --joints
name='hip' -> name='knee'         => no joint 'hip'
</mujoco> ->                      => is no XML in UTF-8
name='hip' -> name='other'><include file="hip.xml"/></joint><joint => hip.*includes hip.xml
"""


@mistakes(FILES)
def test_files_that_cannot_be_given_friction_are_refused_in_one_line(robot, wrong, words):
    old, _, new = wrong.partition(" ->")
    robot.write_text(ROBOT.replace(old, new.strip(), 1))
    with assert_refused(words):
        written(CoulombViscous(), NUMBERS, robot)


def test_a_part_that_turns_with_two_joints_is_a_tendon(robot):
    tendon = '<tendon><fixed name="motor"><joint joint="hip" coef="1"/>'
    tendon += '<joint joint="knee" coef="-2"/></fixed></tendon>'
    robot.write_text(ROBOT.replace("</mujoco>", tendon + "</mujoco>"))
    made = written(CoulombViscous(), NUMBERS, robot, ("hip", "motor"))
    model, _ = loaded(made)
    assert_array_equal(model.tendon_frictionloss, NUMBERS[1:, 0])
    assert_array_equal(model.tendon_damping, NUMBERS[1:, 1])
    other = written(Stribeck(), STRIBECK, robot, ("hip", "motor"))
    assert "_callback.py" not in other.files and "not to tendons" in other.lost[-1]


def gear(moment):
    row = [0.02, 0.01, 0.2, 0.1, 0.05, 0.1, 0.05, 0.01, 0.02, 0.8, 1.5]
    return GearLoad(moment=moment), np.array([row, row])


@pytest.mark.parametrize("law", [(Stribeck(), STRIBECK), gear(0.3)], ids=["stribeck", "gear_load"])
def test_a_sliding_joint_has_the_models_torque(robot, law):
    made = written(*law, robot)
    model, module = loaded(made)
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    own = exported(Friction(*law), speeds=(5.0, 5.0)).friction
    mujoco.set_mjcb_passive(module.Friction(model))
    for _ in range(100):
        data.qpos, data.qvel, data.ctrl = rng.uniform(-3, 3, (3, 2))
        for _ in range(3):  # the motor torque, and the level, are those of the evaluation before
            mujoco.mj_forward(model, data)
        levels = model.dof_frictionloss * np.sign(data.qvel)
        x = Inputs(data.qpos, data.qvel, data.ctrl, 0.0 * data.ctrl)
        wanted = own.law.sharpened().torque(own.theta, x, ())
        assert_allclose(levels - data.qfrc_passive, wanted, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("share, moves", [(0.9, False), (1.1, True)])
def test_a_joint_breaks_away_at_the_models_level(robot, share, moves):
    made = written(Stribeck(), STRIBECK, robot)
    model, module = loaded(made)
    model.opt.gravity = 0.0
    data = mujoco.MjData(model)
    data.ctrl[0] = share * (STRIBECK[0, 0] + STRIBECK[0, 1])
    mujoco.set_mjcb_passive(module.Friction(model))
    mujoco.mj_step(model, data, 200)
    assert abs(data.qpos[0]) > 0.01 if moves else abs(data.qpos[0]) < 1e-3


def test_what_is_lost_is_said(robot):
    made = written(Stribeck(), STRIBECK, robot)
    text = "\n".join(made.lost)
    assert "no Stribeck" in text and "hip breaks away at 0.15 N m by the model" in text
    assert made.held is not None and made.held.law == CoulombViscous()
    assert any("set_mjcb_passive" in note for note in made.notes)
    loads = written(LoadDependent(), np.full((2, 3), 0.1), robot)
    assert "_callback.py" not in loads.files
    assert any("no callback" in sentence for sentence in loads.lost)


RIG = pendulum(mass=0.4, length=0.25)
MOTIONS = {
    "stribeck": Friction(Stribeck(), [[0.1, 0.05, 0.5, 0.02]]),
    "arctan": Friction(CoulombViscous(width=0.3, shape="arctan"), [[0.1, 0.02]]),
    "film_lag": Friction(FilmLag(), [[0.05, 0.03, 0.5, 0.01, 0.02]]),
    "lugre": Friction(LuGre(), [[0.05, 0.03, 0.5, 0.01, 0.002, 0.0, 0.1]]),
    "dahl": Friction(Dahl(), [[0.08, 0.01, 0.002]]),
    "cogging": Friction(
        Sum(("coulomb_viscous", {"kind": "cogging", "harmonics": [7]})), [[0.1, 0.02, 0.03, -0.05]]
    ),
    "quadratic": Friction(Quadratic(), [[0.1, 0.02, 0.01]]),
}


def moved(made, u, step):
    """Angles of the pendulum in MuJoCo, a motor torque for each 10 ms."""
    model, module = loaded(made)
    model.opt.timestep = step
    data, out = mujoco.MjData(model), []
    data.qpos[0] = 0.5
    mujoco.set_mjcb_passive(module.Friction(model) if vars(module).get("Friction") else None)
    for torque in u[:, 0]:
        data.ctrl[0] = torque
        mujoco.mj_step(model, data, round(0.01 / step))
        out.append(data.qpos[0])
    mujoco.set_mjcb_passive(None)
    return np.array(out)


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_is_ours_to_first_order_in_the_step(name, tmp_path):
    """A second that stops, breaks away, and turns."""
    friction, path = MOTIONS[name], tmp_path / "pendulum.xml"
    path.write_text(mjcf_of(RIG))
    made = written(friction.law, friction.theta, path, ("joint 1",), (20.0,))
    assert ("_callback.py" in made.files) == (name in ("stribeck", "arctan", "film_lag"))
    u = 0.6 * np.sin(0.04 * np.arange(100))[:, None]
    start = State(np.array([0.5]), np.array([0.0]))
    ours = rollout(Plant.from_parameters(RIG, {}), friction, start, u, np.full(100, 0.01)).q[1:, 0]
    coarse, fine = (np.abs(moved(made, u, step) - ours).max() for step in (0.002, 0.0005))
    assert fine < 0.5 * coarse < 0.005
