"""Joint states of ROS 2 bags: what was written comes back, and mistakes are one line."""

import re
import sys

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.formats.ros import read as read_ros

pytest.importorskip("rosbags", reason="rosbags is not installed")
from fixtures.bags import START, STORE, TYPE, message, write
from fixtures.mistakes import rows


@pytest.fixture
def motion():
    """Times [ns], positions, velocities and efforts (50, 2) with even and uneven steps."""
    generator = np.random.default_rng(1)
    times = np.cumsum(generator.integers(1_000_000, 9_000_000, 50))
    return times - times[0], *(generator.standard_normal((50, 2)) for _ in range(3))


def states(motion, names=("shoulder", "elbow"), effort=True):
    times, q, w, u = motion
    out = []
    for k, t in enumerate(times):
        # the order of the joints may change from message to message
        order = [1, 0] if k % 2 else [0, 1]
        own = [names[i] for i in order]
        cells = [v[k, order] for v in (q, w, u)]
        cells[2] = cells[2] if effort else []
        out.append((int(t) + 5_000_000, message(START + int(t), own, *cells)))
    return out


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_joint_states_come_back_whatever_their_order(motion, tmp_path, plugin):
    times, q, w, u = motion
    file = write(tmp_path / "bag", states(motion), plugin)
    settings = {"joints": ["elbow", "shoulder"], "driven": ["elbow"]}
    found = read_ros(file, settings)
    assert_allclose(found.angle.time, 1e-9 * times, rtol=0, atol=1e-12)
    assert_array_equal(found.angle.value, q[:, ::-1])
    assert_array_equal(found.velocity.value, w[:, ::-1])
    assert_array_equal(found.torque.value, np.stack([u[:, 1], 0 * u[:, 0]], axis=1))
    received = read_ros(file, {**settings, "clock": "received"})
    assert_allclose(received.angle.time, found.angle.time, atol=1e-12)


def test_a_bag_is_a_data_set(motion, tmp_path):
    file = write(tmp_path / "bag", states(motion))
    (tmp_path / "dataset.toml").write_text(
        'name = "bags"\n[mechanism]\nkind = "acrobot"\n[reader]\nkind = "ros"\n'
        'driven = ["elbow"]\n[recordings]\npatterns = ["bag/*.mcap"]\n'
    )
    recording = load_dataset(tmp_path).recordings[0]
    assert recording.name == f"bag/{file.stem}"
    assert_array_equal(recording.angle.value, motion[1])


TABLES = """
name = "bags"
mechanism = { kind = "pendulum", parameters = { mass = 0.5, length = 0.3 } }
recordings = { patterns = ["bag/*.mcap"] }
reader = { kind = "ros", topic = "/joint_states" }
"""


def loaded(folder, text):
    (folder / "dataset.toml").write_text(TABLES + text)
    return load_dataset(folder).recordings[0]


def test_columns_of_a_bag_have_units_and_motors_as_those_of_any_table(motion, tmp_path):
    times, q, w, u = motion
    write(tmp_path / "bag", states(motion))
    names = 'time = "time"\nangle = "position[elbow]"\nvelocity = "velocity[elbow]"\n'
    text = f'[columns]\n{names}torque = "effort[elbow]"\n[units]\ntorque = "mA"\n'
    found = loaded(tmp_path, text + "[motor]\nkt = 0.1\ngear = 20.0\n")
    assert_allclose(found.angle.time, 1e-9 * times, rtol=0, atol=1e-12)
    assert_array_equal(found.angle.value[:, 0], q[:, 1])
    assert_array_equal(found.velocity.value[:, 0], w[:, 1])
    assert_allclose(found.torque.value[:, 0], 0.1 * 20.0 * 1e-3 * u[:, 1])


CHANGES = """
[elbow] -> [knee]                   => has no joint 'knee'
/position[ -> /effort[              => has one; name another topic
position -> positions               => positions.elbow.': write time, position.joint.
/joint_commands -> /joint_command   => did you mean '/joint_commands'
"""


def test_targets_of_a_bag_come_from_a_topic_of_its_own(motion, tmp_path):
    times, q, _, _ = motion
    commands = [
        (late, message(START + late, ["elbow"], [0.3], [], []))
        for late in range(0, 400_000_000, 7_000_000)
    ]
    write(tmp_path / "bag", {"/joint_states": states(motion), "/joint_commands": commands})
    text = """
columns = { time = "time", angle = "position[elbow]" }
[actuator]
time = "/joint_commands/time"
target = "/joint_commands/position[elbow]"
output = "torque"
P = 2.0
"""
    found = loaded(tmp_path, text)
    torque = found.servo.torque(found.angle.time, found.angle.value, 0 * found.angle.value)
    assert_allclose(torque[:, 0], 2.0 * (0.3 - q[:, 1]), atol=1e-12)
    for wrong, words in rows(CHANGES):
        with assert_refused(words):
            loaded(tmp_path, text.replace(*wrong.split(" -> ")))


def test_passive_joints_need_no_effort(motion, tmp_path):
    file = write(tmp_path / "bag", states(motion, effort=False))
    assert not read_ros(file, {"driven": []}).torque.value.any()
    with assert_refused(r"have no effort; without motors set driven = \[\]"):
        read_ros(file, {})


def test_mistakes_are_reported_in_one_line(motion, tmp_path):
    good = states(motion)
    file = write(tmp_path / "good", good)
    two = write(tmp_path / "two", good, topics=("/a", "/b"))
    header = STORE.types["std_msgs/msg/Header"]
    other = write(
        tmp_path / "other", [(0, header(good[0][1].header.stamp, "x"))], kind="std_msgs/msg/Header"
    )
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(file.read_bytes()[: len(file.read_bytes()) // 2])
    empty = tmp_path / "empty.db3"
    empty.write_bytes(b"")
    back = write(tmp_path / "back", [*good, good[3]])
    few = write(tmp_path / "few", good[:1])
    cases = (
        (file, {"joints": ["shoulder", "elbw"]}, "has no joint 'elbw'; did you mean 'elbow'?"),
        (file, {"topic": "/joint_state"}, "did you mean '/joint_states'?"),
        (file, {"driven": ["knee"]}, "driven: 'knee' is no joint"),
        (file, {"topc": "/x"}, "unknown key 'topc'; did you mean 'topic'?"),
        (two, {}, "has the topics /a, /b: name one"),
        (other, {}, f"has no topic of {TYPE}"),
        (torn, {}, "is no whole ROS 2 bag"),
        (empty, {}, "is no whole ROS 2 bag"),
        (back, {}, "time must increase"),
        (few, {}, "has 1 joint states"),
        (tmp_path / "good/metadata.yaml", {}, "is no .mcap or .db3 file"),
    )
    for path, settings, said in cases:
        with assert_refused(re.escape(said)) as complaint:
            read_ros(path, settings)
        assert str(path) in str(complaint.value)


def test_without_the_package_its_installation_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    file = tmp_path / "a.mcap"
    file.write_bytes(b"x")
    with assert_refused(r"pip install 'frictionid\[ros\]'"):
        read_ros(file, {})
