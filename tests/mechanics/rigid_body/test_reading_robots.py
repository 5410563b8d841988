"""What a URDF says is what moves; what is wrong with one is said in a line."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from fixtures import driven_wrist as wrist
from fixtures.mistakes import changes, rows
from fixtures.random_robots import motions, random_robot, urdf_text
from fixtures.refusals import assert_refused
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.errors import InputError
from frictionid.mechanics import mechanism_of, mjcf, urdf
from frictionid.mechanics.mechanism import Mechanism
from frictionid.mechanics.rigid_body.robot_files import read_urdf

INERTIAL = (
    '<inertial><mass value="2.0"/>'
    '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.025"/></inertial>'
)


def link(name, inside=INERTIAL):
    return f'<link name="{name}">{inside}</link>'


def joint(name, parent, child, kind="revolute", inside='<axis xyz="0 0 1"/>'):
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="0.1 0.05 0.2" rpy="0.3 0.2 0.1"/>'
        f'<parent link="{parent}"/><child link="{child}"/>{inside}</joint>'
    )


def text(*elements):
    return f'<robot name="r">{"".join(elements)}</robot>'


ARM = (
    *(link(name) for name in ("base", "upper", "fore", "hand", "finger")),
    joint("shoulder", "base", "upper"),
    joint("elbow", "upper", "fore", "prismatic", '<axis xyz="0 1 1"/>'),
    joint("wrist", "fore", "hand", "fixed"),
    joint("gripper", "hand", "finger", "continuous"),
)
TEXT = text(*ARM)


@pytest.fixture
def read(tmp_path):
    """Mechanism of a text and options."""

    def make(content, name="robot.urdf", **options):
        (tmp_path / name).write_text(content)
        return urdf(tmp_path / name, **options)

    return make


def dynamics(mechanism, q, w):
    return mechanism.dynamics(mechanism.base({}), q, w)


def assert_each_close(ours, theirs, **tolerance):
    for one, other in zip(ours, theirs, strict=True):
        assert_allclose(one, other, **tolerance)


def test_what_is_fixed_needs_no_axis_and_may_be_welded_to_a_world_that_no_link_names(read):
    """As CAD exporters and Drake write them; half a turn about z leaves gravity as it is."""
    weld = joint("weld", "world", "base", "fixed").replace("0.3 0.2 0.1", "0 0 3.14159265358979")
    fixed = [e.replace("0 0 1", "0 0 0") if "fixed" in e else e for e in (*ARM, weld)]
    welded = read(text(*fixed))
    plain = read(TEXT)
    assert welded.joints == plain.joints
    q, w = np.ones((2, 3))
    assert_each_close(dynamics(welded, q, w), dynamics(plain, q, w), rtol=1e-9)


def test_every_joint_that_can_move_does(read):
    arm = read(TEXT)
    assert arm.joints == ("shoulder", "elbow", "gripper")
    assert arm.position_units == ("rad", "m", "rad")
    assert arm.torque_units == ("N m", "N", "N m")
    assert arm.driven == (True,) * 3


def test_a_gear_is_the_reduction_of_the_joints_transmission(tmp_path):
    (tmp_path / "geared.urdf").write_text(wrist.geared((3, "x", -5)))
    assert [j.gear for j in read_urdf(tmp_path / "geared.urdf").joints] == [3.0, 0.0, -5.0]


def test_locked_joints_stand_where_they_are_locked(read):
    whole = read(TEXT)
    part = read(TEXT, joints=["shoulder", "elbow"], locked={"gripper": 0.7})
    q, w, _ = motions(0, (20, 3))
    q[:, 2], w[:, 2] = 0.7, 0.0
    (M, h), (small, force) = dynamics(whole, q, w), dynamics(part, q[:, :2], w[:, :2])
    assert_each_close((small, force), (M[:, :2, :2], h[:, :2]), atol=1e-12)
    moved = dynamics(read(TEXT, joints=["shoulder", "elbow"]), q[:, :2], w[:, :2])
    assert np.abs(moved[0] - small).max() > 1e-4


def test_beyond_a_base_link_the_rest_is_left_out(read):
    part = read(TEXT, base="fore", gravity=[0.0, 3.0, -9.0])
    alone = text(link("fore"), *ARM[3:5], *ARM[7:])
    other = read(alone, "other.urdf", gravity=[0.0, 3.0, -9.0])
    assert part.joints == ("gripper",)
    assert part == other
    q, w, _ = motions(0, (20, 1))
    assert_each_close(dynamics(part, q, w), dynamics(other, q, w), atol=1e-14)


def test_a_mechanism_is_what_its_file_says_and_how_it_is_read(read):
    one, same = read(TEXT), read(TEXT)
    heavier, other = (read(TEXT.replace('"2.0"', '"2.1"', count)) for count in (1, -1))
    assert one == same and hash(one) == hash(same)
    assert one == heavier  # the base is heavier, which nothing shows
    assert one != other
    assert one != read(TEXT, driven=[True, True, False])


def test_its_table_is_the_mechanism_again(read):
    arm = read(TEXT, joints=["shoulder", "elbow"], locked={"gripper": 0.2}, payload="finger")
    arm = arm.with_values({"rotor_elbow": 0.1, "payload_mass": 0.3})
    arm = replace(arm, tolerances={"payload_mass": 5.0})
    again = mechanism_of(arm.table)
    assert again == arm and again.values == arm.values and again.tolerances == arm.tolerances
    assert_array_equal(again.base({}), arm.base({}))


def test_a_payload_is_a_body_fixed_to_its_link(read):
    body = (
        '<inertial><origin xyz="0.02 -0.01 0.05"/><mass value="0.7"/>'
        '<inertia ixx="0.001" ixy="0.0002" ixz="0" iyy="0.002" iyz="0.0001" izz="0.0015"/>'
        "</inertial>"
    )
    held = '<joint name="held" type="fixed"><parent link="finger"/><child link="load"/></joint>'
    whole = read(text(*ARM, link("load", body), held))
    arm = read(TEXT, "arm.urdf", payload="finger")
    values = {"mass": 0.7, "x": 0.02, "y": -0.01, "z": 0.05, "Ixx": 1e-3, "Ixy": 2e-4}
    values |= {"Iyy": 2e-3, "Iyz": 1e-4, "Izz": 1.5e-3}
    q, w, _ = motions(0, (20, 3))
    p = arm.base({f"payload_{k}": v for k, v in values.items()})
    assert_each_close(arm.dynamics(p, q, w), dynamics(whole, q, w), atol=1e-12)
    several = arm.base({"payload_mass": np.array([0.0, 0.7])})
    assert several.shape == (2, len(arm.base_names))
    assert_allclose(several[0], arm.base({}), rtol=0, atol=1e-15)


MIMIC = '<axis xyz="0 0 1"/><mimic joint="shoulder"/>'
CONTENTS = [
    (None, "cannot be read"),
    ("<robot", "is no XML"),
    ("<sdf/>", "is not <robot>"),
    (f'<!DOCTYPE r [<!ENTITY a "b">]>{TEXT}', "entities"),
    (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">'
        f'<xacro:property name="mass" value="2"/>{ARM[0]}</robot>',
        "is a xacro file; make a URDF of it first",
    ),
    (text(), "no <link>"),
    (text(link("a")), "no joint moves"),
    (text(*ARM, link("hand")), "two links are called 'hand'"),
    (text(*ARM, joint("gripper", "base", "hand")), "two joints"),
    (text(*ARM, joint("more", "base", "hand")), "closed chain"),
    (text(*ARM, joint("more", "hand", "base")), "none is the root"),
    (text(*ARM, link("table")), "are not connected"),
    (text(*ARM, joint("more", "nand", "hand")), "'nand'"),
    (text(*ARM[:8], joint("gripper", "hand", "finger", inside=MIMIC)), "mimic"),
]
EDITS = """
prismatic -> screw => type 'screw'
prismatic -> floating => is floating
0 1 1 -> 0 0 0 => has no direction
ixx="0.02" -> ixx="nan" => must be a number
0 1 1 -> 0 1 => must be 3 numbers
value="2.0" -> value="-2" => is negative
<mass value="2.0"/> -> <!-- --> => no <mass>
"""
OPTIONS = """
joints = ["elbo"] => there is no joint 'elbo'.*elbow
joints = ["wrist"] => is fixed
joints = ["gripper", "gripper"] => named twice
joints = ["elbow", "shoulder"] => name it first
joints = "elbow" => options: joints: it should be a valid list, not 'elbow'
base = "bass" => is no link.*base
locked = {elbow = 0.1} => it moves
joints = ["elbow"]; locked = {gripper = "x"} => locked.gripper: it should be a valid number, not 'x'
gravity = [0.0, -9.81] => three numbers
payload = "hat" => is no link
payload = "base" => does not move
driven = [true] => for each of
"""
WRONG = [
    *((content, {}, said) for content, said in CONTENTS),
    *((TEXT.replace(*edit.split(" -> ")), {}, said) for edit, said in rows(EDITS)),
    *((TEXT, changes(options), said) for options, said in rows(OPTIONS)),
    (text(*ARM, joint("m", "hand", "base")), {"base": "base"}, "closes a loop"),
    (TEXT.replace("prismatic", "planar"), {"joints": ["gripper"]}, "nothing holds"),
]


@pytest.mark.parametrize(("content", "options", "expected"), WRONG, ids=[row[-1] for row in WRONG])
def test_what_is_wrong_is_said_in_a_line(tmp_path, content, options, expected):
    path = tmp_path / "robot.urdf"
    if content is not None:
        path.write_text(content)
    with assert_refused(expected):
        urdf(path, **options).nominal()


def test_a_mechanism_is_of_one_file_or_kind():
    with assert_refused("urdf and kind"):
        mechanism_of({"urdf": "arm.urdf", "kind": "pendulum"})
    with assert_refused("urdf = 3 must be a file"):
        mechanism_of({"urdf": 3})
    with assert_refused("no option 'joint'"):
        mechanism_of({"urdf": "arm.urdf", "joint": ["a"]})


def test_mjcf_that_is_none_is_said_in_a_line(tmp_path):
    pytest.importorskip("mujoco", reason="the test extra installs it")
    path = tmp_path / "robot.xml"
    for content, expected in (
        (None, "no such file"),
        ("<mujoco><sink/></mujoco>", "MuJoCo cannot read"),
        ("<mujoco><worldbody/></mujoco>", "no joint moves"),
        (
            '<mujoco><worldbody><body name="a"><freejoint name="f"/><geom size="1"/></body>'
            "</worldbody></mujoco>",
            "is floating",
        ),
    ):
        if content is not None:
            path.write_text(content)
        with assert_refused(expected):
            mjcf(path)


def test_shapes_and_a_free_root_do_not_matter_where_inertias_are_stated(tmp_path):
    pytest.importorskip("mujoco", reason="the test extra installs it")
    body = (
        '<mujoco><compiler inertiafromgeom="{rule}"/>{assets}<worldbody><body name="trunk">{root}'
        '<inertial mass="5" pos="0 0 0" diaginertia="1 1 1"/>{shape}<body name="leg" pos="0 0.1 0">'
        '<joint name="hip" axis="1 0 0"/><inertial mass="1" pos="0 0 -0.2" diaginertia=".1 .1 .1"/>'
        "{shape}</body></body></worldbody></mujoco>"
    )
    assets = (
        '<asset><mesh name="m" file="gone.obj"/><hfield name="h" file="gone.png" size="1 1 1 1"/>'
        '<texture name="t" type="2d" file="gone.png"/><material name="s" texture="t"/></asset>'
    )
    shape = '<geom type="mesh" mesh="m" material="s"/><geom size="0.1" material="s"/>'
    bare, full = tmp_path / "bare.xml", tmp_path / "full.xml"
    bare.write_text(body.format(rule="auto", assets="", root="", shape=""))
    full.write_text(body.format(rule="auto", assets=assets, root="<freejoint/>", shape=shape))
    with assert_refused("where the machine is held: base = 'trunk'"):
        mjcf(full)
    held, legs = mjcf(full, base="trunk"), mjcf(bare)
    assert held.joints == legs.joints == ("hip",)
    assert_array_equal(held.tree.inertia, legs.tree.inertia)
    full.write_text(body.format(rule="true", assets=assets, root="", shape=shape))
    with assert_refused(r"gone\.obj"):
        mjcf(full)


SOUND = urdf_text(random_robot(np.random.default_rng(0), 3, fixed=1))
NASTY = st.sampled_from(
    ["", "nan", "1e400", "-1", "0 0", "x", "link_0", "base", "fixed", "floating", "\u2603", "0 0 0"]
)


@given(data=st.data())
def test_a_damaged_urdf_is_read_or_refused_in_a_line(read, data):
    """Attributes changed or lost, elements lost or doubled, text cut off."""
    root = ET.fromstring(SOUND)
    for _ in range(data.draw(st.integers(1, 3))):
        elements = list(root.iter())
        element = elements[data.draw(st.integers(0, len(elements) - 1))]
        action = data.draw(st.sampled_from(["change", "lose", "remove", "double", "tag"]))
        if action in ("change", "lose") and element.attrib:
            key = data.draw(st.sampled_from(sorted(element.attrib)))
            if action == "change":
                element.set(key, data.draw(NASTY))
            else:
                del element.attrib[key]
        elif action == "tag":
            element.tag = data.draw(st.sampled_from(["link", "joint", "axis", "mimic", "robot"]))
        elif len(element):
            inner = element[data.draw(st.integers(0, len(element) - 1))]
            if action == "double":
                element.append(inner)
            else:
                element.remove(inner)
    content = ET.tostring(root, encoding="unicode")
    if data.draw(st.integers(0, 9)) == 0:
        content = content[: data.draw(st.integers(0, len(content)))]
    try:
        mechanism = read(content)
        mechanism.nominal()
    except InputError as error:
        assert re.fullmatch(r"[^\n]+", str(error))
    else:
        assert isinstance(mechanism, Mechanism)
        M, h = dynamics(mechanism, *np.zeros((2, 1, mechanism.n)))
        assert np.isfinite(M).all() and np.isfinite(h).all()
