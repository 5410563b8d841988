"""The mechanism that a dataset.toml names, and the units that its joints have."""

import hashlib

import numpy as np
from fixtures.dataset_files import described, load, motion, write
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose

from frictionid.data.readers.dataset import dataset_files, load_dataset
from frictionid.data.recordings import Dataset
from frictionid.mechanics import pendulum, unit_inertia


def test_a_mechanism_that_does_not_exist_is_named_with_the_file(tmp_path):
    with assert_refused(r"dataset\.toml: \[mechanism\] kind = 'acrobott' is unk"):
        load(tmp_path, described(mechanism__kind="acrobott"))
    recordings = load(tmp_path).recordings
    with assert_refused(r"kind = 'acrobott' is unknown; did you mean 'acrobot'"):
        Dataset("rig", {"kind": "acrobott"}, recordings)
    with assert_refused(r"a mechanism must be one of .*, not 'acrobot'"):
        Dataset("rig", "acrobot", recordings)


def test_a_mechanism_that_is_not_driven_needs_no_columns_of_torque(tmp_path):
    table = {"kind": "pendulum", "driven": False, "parameters": {"mass": 1.0, "length": 0.5}}
    columns = {"time": "time", "angle": "q1"}
    document = described(mechanism=table, columns=columns)
    recording = load(tmp_path, document).recordings[0]
    assert recording.torque.value.shape == recording.angle.value.shape
    assert not recording.torque.value.any()
    with assert_refused("'columns.torque' is missing"):
        load(tmp_path, described(mechanism=table | {"driven": True}, columns=columns))


def test_joints_may_have_units_of_their_own(tmp_path):
    columns = motion() | {"q1": np.full(9, 250.0), "q2": np.full(9, 180.0), "u2": np.full(9, 4.0)}
    own = unit_inertia(("m", "rad"))
    document = described(
        mechanism__parameters={},
        columns__torque=["u1", "u2"],
        columns__velocity=["w1", "w2"],
        units={"angle": ["mm", "deg"], "velocity": ["mm/s", "rpm"], "torque": ["N", "A"]},
        motor={"kt": [1.0, 0.5], "gear": [1.0, 2.0]},
        sigma={"angle": [0.5, 0.1]},
    )
    written = write(tmp_path, document, a_csv=columns)
    recording = load_dataset(written, mechanism=own).recordings[0]
    assert_allclose(recording.angle.value[0], [0.25, np.pi])
    assert_allclose(recording.angle.sigma, [0.0005, 0.1 * np.pi / 180])
    assert_allclose(recording.velocity.value[:, 0], columns["w1"] / 1000)
    assert_allclose(recording.velocity.value[:, 1], columns["w2"] * np.pi / 30)
    assert_allclose(recording.torque.value[:, 0], columns["u1"])  # no current
    assert_allclose(recording.torque.value[:, 1], 4.0)
    for units, words in (
        (["deg", "mm"], "1 of unit slides: correct the unit, one per joint$"),
        (["mm", "deg", "deg"], "units.angle has 3 units for 2 joints"),
    ):
        document["units"]["angle"] = units
        with assert_refused(words):
            load_dataset(write(tmp_path, document, a_csv=columns), mechanism=own)


def test_a_unit_of_one_joint_that_turns_is_refused(tmp_path):
    document = described(
        mechanism={"kind": "pendulum", "parameters": {"mass": 1.0, "length": 1.0}},
        columns={"time": "time", "angle": "q1", "torque": "u1"},
        units={"angle": "mm"},
    )
    write(tmp_path, document, a_csv=motion())
    with assert_refused(r"'?joint.* turns: correct the unit$"):
        load_dataset(tmp_path)


TILTING = """<robot name="tilting"><link name="base"/><link name="arm"><inertial>
<origin xyz="0 0 -0.2"/><mass value="0.5"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/>
<axis xyz="0 -1 0"/></joint></robot>"""


def with_urdf(folder, **changes):
    document = described(mechanism=None, columns__angle=["q1"], columns__torque=["u1"], **changes)
    document["mechanism"] = {"urdf": "arm/tilting.urdf"}
    return load(folder, document)


def test_a_urdf_beside_the_data_set_describes_its_mechanism(tmp_path, monkeypatch):
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm/tilting.urdf").write_text(TILTING)
    (tmp_path / "other").mkdir()
    monkeypatch.chdir(tmp_path / "other")
    data = with_urdf(tmp_path)
    p = data.mechanism.base({})
    alike = pendulum(mass=0.5, length=0.2, inertia=0.01)
    at = np.array([0.3]), np.array([2.0])
    for one, other in zip(
        data.mechanism.dynamics(p, *at), alike.dynamics(alike.base({}), *at), strict=True
    ):
        assert_allclose(one, other)
    digest = hashlib.sha256(TILTING.encode()).hexdigest()
    assert data.hashes["arm/tilting.urdf"] == digest
    assert tmp_path / "arm/tilting.urdf" in dataset_files(tmp_path)
    assert with_urdf(tmp_path, sha256={"arm/tilting.urdf": digest}).hashes == data.hashes
    with assert_refused(r"tilting\.urdf is not the described file"):
        with_urdf(tmp_path, sha256={"arm/tilting.urdf": "0" * 64})


def test_a_urdf_that_is_not_there_is_named(tmp_path):
    with assert_refused(r"tilting\.urdf"):
        with_urdf(tmp_path)
