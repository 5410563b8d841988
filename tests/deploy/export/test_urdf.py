"""Friction in a URDF: levels and slopes of joints, all else as it was."""

import numpy as np
import pytest
from fixtures.mistakes import mistakes
from fixtures.refusals import assert_refused

import frictionid as fid
from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.xml_text import elements
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, Stribeck

ROBOT = """<robot name="arm">
  <!-- two joints -->
  <link name="base"/> <link name="a"/> <link name="b"/>
  <joint name="one" type="revolute">
    <parent link="base"/>
    <child link="a"/>
    <dynamics friction='5'/>
  </joint>
  <joint name="two" type="prismatic">
    <parent link="a"/>
    <child link="b"/>
  </joint>
  <transmission name="t"><joint name="one"/></transmission>
</robot>
"""
THETA = np.array([[0.12, 0.02], [3.5, 0.7]])


def written(tmp_path, text=ROBOT, law=None, theta=THETA):
    path = tmp_path / "arm.urdf"
    path.write_bytes(text.encode())
    model = Friction(law or CoulombViscous(), theta, position_units=("rad", "m"))
    own = exported(model, ("one", "two"), (5.0, 1.0))
    return writer_of("urdf")(own, ExportSettings(into=path))


def test_levels_and_slopes_stand_in_the_joints_and_all_else_stays(tmp_path):
    made = written(tmp_path)
    text = made.files[".urdf"].decode()
    found = [e.attributes for e in elements(text.encode(), "it") if e.tag == "dynamics"]
    values = [[float(e["friction"]), float(e["damping"])] for e in found]
    np.testing.assert_array_equal(values, THETA)
    assert text == ROBOT.replace("friction='5'", 'friction="0.12" damping="0.02"').replace(
        '<child link="b"/>', '<child link="b"/>\n    <dynamics damping="0.7" friction="3.5"/>'
    )
    assert made.lost == () and made.notes == ("one had friction 5",)


def test_settings_may_be_said_by_name(tmp_path):
    friction = Friction(CoulombViscous(), THETA[:1, :])
    path = tmp_path / "arm.urdf"
    path.write_text(ROBOT)
    fit = fid.Fit(friction, None)
    made = fit.export("urdf", tmp_path / "out.urdf", settings={"into": path, "joints": ["one"]})
    assert 'friction="0.12" damping="0.02"' in made.paths[0].read_text()
    with assert_refused("unknown setting 'join'; did you mean 'joints'?"):
        fit.export("urdf", tmp_path / "new.urdf", settings={"join": ["one"]})


def test_marks_of_order_ends_of_lines_and_letters_stay(tmp_path):
    text = "\ufeff" + ROBOT.replace("two joints", "zwei Gelenke: größer").replace("\n", "\r\n")
    made = written(tmp_path, text).files[".urdf"].decode()
    new = '<dynamics damping="0.7" friction="3.5"/>'
    assert made == text.replace("friction='5'", 'friction="0.12" damping="0.02"').replace(
        '<child link="b"/>', f'<child link="b"/>\r\n    {new}'
    )


def test_what_a_urdf_cannot_hold_is_said(tmp_path):
    made = written(tmp_path, law=Stribeck(), theta=np.array([[0.1, 0.05, 0.5, 0.02]] * 2))
    assert any("no Stribeck" in sentence for sentence in made.lost) and made.held is not None


@pytest.mark.parametrize("name", ["xl330", "mx64_m6"])
def test_a_servo_brings_its_back_emf_and_says_that_its_limit_is_left(name, tmp_path):
    path, card = tmp_path / "arm.urdf", fid.machine(name)
    path.write_text(ROBOT)
    own = exported(card.friction, ("one",), card=card)
    made = writer_of("urdf")(own, ExportSettings(into=path))
    (dynamics, *_) = (e for e in elements(made.files[".urdf"], "it") if e.tag == "dynamics")
    damping = card.nearest.theta[0, 1] + card.drive.back_emf[0]
    assert float(dynamics.attributes["damping"]) == damping
    assert any(f"torque limit ({card.drive.limit[0]:.4g})" in sentence for sentence in made.lost)


CHANGES = """
prismatic -> revolute      => 'two' is revolute, .* in m
name="two" -> name="three" => no joint 'two', it has one, three
robot -> sdf               => no URDF
</robot> ->                => is no XML
"""


@mistakes(CHANGES)
def test_files_that_cannot_be_given_friction_are_refused(tmp_path, wrong, words):
    old, _, new = wrong.partition(" ->")
    text = ROBOT.replace(old, new.strip())
    with assert_refused(words):
        written(tmp_path, text)
