"""Logs of drives, LeRobot and UR: the motion that was written comes back, mistakes are one line."""

import copy
import tomllib

import numpy as np
import pytest
import tomli_w
from fixtures.log_formats import (
    ANGLE,
    DRIVE,
    ELEMENTS,
    LEROBOT,
    PARTS,
    PENDULUM,
    PREAMBLE,
    RATED,
    SPEED,
    TIME,
    TORQUE,
    UNRATED,
    lerobot,
    recorder,
    rtde,
)
from fixtures.mistakes import changes, mistakes
from fixtures.paths import ROOT
from fixtures.refusals import assert_refused
from fixtures.tiny_pendulums import changed
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.dataset_toml import check_dataset_toml

few = settings(max_examples=25)


def load(folder, kind, pattern="*.csv", content=None, **tables):
    """The data set of a reader; a.csv has the content."""
    if content is not None:
        (folder / "a.csv").write_bytes(content)
    document = {
        "name": "rig",
        "mechanism": PENDULUM,
        "reader": {"kind": kind, **tables.pop("reader", {})},
        "recordings": {"patterns": [pattern]},
        **tables,
    }
    (folder / "dataset.toml").write_text(tomli_w.dumps(document))
    return load_dataset(folder)


def assert_not_loaded(words, *arguments, **tables):
    with assert_refused(words):
        load(*arguments, **tables)


# --- Recorders of drives --------------------------------------------------------------------------


@few
@given(
    st.sampled_from([(";", True), ("\t", True), (";", False), (",", False), ("\t", False)]),
    st.permutations([0, 1, 2]),
    st.sampled_from([PREAMBLE, [], ["Größe;°C"], ["a\tb"] * 7]),
)
def test_a_recorder_s_file_gives_the_motion_back_however_it_is_laid_out(
    tmp_path, cells, order, preamble
):
    separator, comma = cells
    content = recorder(separator, comma, order, preamble)
    place = {k: "Time" if not at else f"Time[{at + 1}]" for at, k in enumerate(order)}
    time = {"angle": place[0], "torque": place[1], "velocity": place[2]}
    own = {**DRIVE, "columns": {**DRIVE["columns"], "time": time}}
    (found,) = load(tmp_path, "drive_recorder", content=content, **own).recordings
    assert_allclose(found.angle.time, TIME, atol=1e-12)
    assert_allclose(found.torque.time, TIME[::2], atol=1e-12)
    assert_allclose(found.velocity.time, TIME[::5], atol=1e-12)
    assert_allclose(found.angle.value[:, 0], ANGLE, atol=1e-10)
    assert_allclose(found.velocity.value[:, 0], SPEED[::5], atol=1e-10)
    assert_allclose(found.torque.value[:, 0], TORQUE[::2], atol=1e-5)


def test_per_mille_of_a_rated_current_is_a_torque_by_its_constant(tmp_path):
    found = load(tmp_path, "drive_recorder", content=recorder(), **DRIVE)
    torque = found.recordings[0].torque.value
    own = {**DRIVE, "motor": {**UNRATED, "rated_current": 5.0, "kt": 0.25}}
    current = load(tmp_path, "drive_recorder", **own).recordings[0].torque.value
    assert_allclose(current, torque * (5.0 * 0.25 / RATED))


def test_a_wrong_clock_of_a_recorder_is_refused(tmp_path):
    names = {**DRIVE["columns"], "time": "Time"}
    assert_not_loaded(
        r"'0x6077' stands behind the time 'Time\[2\]', which differs from 'Time'",
        *(tmp_path, "drive_recorder", "*.csv", recorder()),
        **{**DRIVE, "columns": {**names, "velocity": "606Ch"}},
    )


def test_targets_of_a_recorder_have_the_time_column_in_front_of_them(tmp_path):
    content = recorder(order=(1, 0)).replace(b"0x6077:00", b"0x607A:00")
    own = {
        "columns": {"time": "Time[2]", "angle": "0x6064"},
        "units": {"time": "ms", "angle": "counts"},
        "motor": UNRATED,
        "actuator": {"time": "Time", "target": "0x607A", "output": "torque", "P": 2.0},
    }
    (found,) = load(tmp_path, "drive_recorder", content=content, **own).recordings
    assert_allclose(found.angle.value[:, 0], ANGLE, atol=1e-10)
    assert_allclose(found.servo.goal.time, TIME[::2], atol=1e-12)
    del own["actuator"]["time"]
    assert_not_loaded(
        r"'0x607A' stands behind the time 'Time', which differs from 'Time\[2\]'.*\[actuator\]",
        *(tmp_path, "drive_recorder"),
        **own,
    )


RECORDERS = r"""
units = {}; motor = {} => units.angle of 0x6064 must be stated: "counts"
units = {angle = "deg", velocity = "rpm"}; motor = {}
    => units.torque of 0x6077 must be stated: by CiA 402 "permille"
motor = {counts_per_turn = 9} => "permille" and the table .motor. with rated
motor = {rated_torque = 2.0} => counts_per_turn in the table .motor. need
motor = {rated_torque = 2.0, rated_current = 2.0, counts_per_turn = 9}
    => rated_current needs kt beside it
columns.angle = "0x6063" => row 4 has no column '0x6063'; it has 'Time', 'Position actual value
"""


@mistakes(RECORDERS)
def test_a_mistake_about_a_recorder_is_one_clear_line(tmp_path, wrong, words):
    own = changed(copy.deepcopy(DRIVE), wrong)
    assert_not_loaded(words, tmp_path, "drive_recorder", content=recorder(), **own)


DRIVE_FILES = {
    "empty": (b"", "none of its first 200 rows names a column 'Time'"),
    "no rows": (b"\r\n".join(recorder().split(b"\r\n")[:5]), "has no rows of numbers"),
    "a word": (recorder().replace(b"\n2,0000;", b"\n2,x;"), "row 7: column 'Time' holds '2,x'"),
    "twice": (recorder().replace(b"606Ch", b"606Ch;16#6064"), "2 columns are '0x6064'; name one"),
    "a hole": (recorder().replace(b"\n2,0000;", b"\n2,0000;;"), "row 7"),
    "back": (recorder().replace(b"\n2,0000;", b"\n0,0000;"), "row 7: time must increase"),
}


@pytest.mark.parametrize("content, words", DRIVE_FILES.values(), ids=DRIVE_FILES)
def test_a_damaged_recorder_s_file_is_one_clear_line(tmp_path, content, words):
    assert_not_loaded(words, tmp_path, "drive_recorder", content=content, **DRIVE)


# --- UR RTDE --------------------------------------------------------------------------------------


@few
@given(st.sampled_from(" ,"), st.data())
def test_an_rtde_recording_gives_the_motion_back(tmp_path, separator, data):
    order = data.draw(st.permutations(rtde().split(b"\n")[0].decode().split()))
    own = {"joints": [1], "velocity": True}
    moments = load(tmp_path, "rtde", content=rtde(separator, order), reader=own)
    found = moments.recordings[0]
    assert_array_equal(found.angle.value[:, 0], ANGLE)
    assert_array_equal(found.velocity.value[:, 0], SPEED)
    assert_array_equal(found.torque.value[:, 0], TORQUE)
    assert moments.torque_at == "command"  # the controller's model, no measurement
    motor = {"kt": 0.1, "gear": 101.0}
    currents = load(tmp_path, "rtde", reader=own, units={"torque": "A"}, motor=motor)
    assert_allclose(currents.recordings[0].torque.value[:, 0], 10.1 * 4.0 * TORQUE)
    assert currents.torque_at == "motor"


MISTAKES = """
reader = {joints = [7]} => has no column 'actual_q_7'
reader = {joints = [1]}; units = {torque = "A"} => needs the table .motor.
columns = 3 => columns
"""


@mistakes(MISTAKES)
def test_a_mistake_about_rtde_is_one_clear_line(tmp_path, wrong, words):
    assert_not_loaded(words, tmp_path, "rtde", content=rtde(), **changes(wrong))


# --- LeRobot --------------------------------------------------------------------------------------


@pytest.mark.parametrize("fixed, names", [(True, ELEMENTS), (False, {"motors": ELEMENTS})])
def test_episodes_of_lerobot_are_recordings_with_features_by_name(tmp_path, fixed, names):
    lerobot(tmp_path, fixed, names)
    found = load(tmp_path, "lerobot", "data/*/*.parquet", **LEROBOT).recordings
    assert [r.name for r in found] == [f"data/chunk-000/file-000/episode_{k}" for k in range(3)]
    for recording, part in zip(found, PARTS, strict=True):
        time = TIME[part] - TIME[part][0]
        assert_allclose(recording.angle.time, time, atol=1e-7)
        assert_allclose(recording.angle.value[:, 0], ANGLE[part], atol=1e-6)
        assert_array_equal(recording.torque.value[:, 0], TORQUE[part])
        target = recording.covariates["target"].value[:, 0]  # in the unit of the file
        assert_allclose(target, np.degrees(ANGLE[part]) + 1.0, atol=1e-4)
    one = load(
        *(tmp_path, "lerobot", "data/*/*.parquet"), **{**LEROBOT, "reader": {"episodes": [1]}}
    )
    assert [r.name for r in one.recordings] == ["data/chunk-000/file-000/episode_1"]


def test_normalised_angles_of_lerobot_are_angles_by_their_range(tmp_path):
    low, high = -70.0, 110.0
    lerobot(tmp_path, angle=(np.degrees(ANGLE) - low) / (high - low) * 200.0 - 100.0)
    own = {**LEROBOT, "reader": {"range": {"shoulder_lift.pos": [low, high]}}}
    found = load(tmp_path, "lerobot", "data/*/*.parquet", **own).recordings
    for recording, part in zip(found, PARTS, strict=True):
        assert_allclose(recording.angle.value[:, 0], ANGLE[part], atol=1e-6)


EPISODES = r"""
units = {} => units.angle of observation.* must be stated: .*-100 to 100
columns.angle = "observation.state[shoulder_lift]" => has no 'shoulder_lift'; did you mean
columns.angle = "observation.stat[shoulder_lift.pos]" => has no feature 'observation.stat'
columns.angle = "observation.state[7]" => 'observation.state\[7\]' holds no numbers
columns.angle = "observation.state" => 'observation.state' holds no numbers
columns.angle = "episode_index[0]" => 'episode_index\[0\]' holds no numbers
reader = {range = {elbow = [0, 1]}} => range: .*elbow
reader = {range = {"shoulder_lift.pos" = [1.0, 1.0]}} => 'shoulder_lift.pos' goes from 1 to 1
reader = {episodes = [9]} => needs at least one recording
"""


@mistakes(EPISODES)
def test_a_mistake_about_lerobot_is_one_clear_line(tmp_path, wrong, words):
    lerobot(tmp_path)
    own = changed(copy.deepcopy(LEROBOT), wrong)
    assert_not_loaded(words, tmp_path, "lerobot", "data/*/*.parquet", **own)


@pytest.mark.parametrize("content", [b"", b"[]", b'{"features": 3}', b'{"features": {"a": 1}}'])
def test_a_damaged_info_of_lerobot_is_one_clear_line(tmp_path, content):
    lerobot(tmp_path)
    (tmp_path / "meta/info.json").write_bytes(content)
    arguments = (tmp_path, "lerobot", "data/*/*.parquet")
    assert_not_loaded(
        r"info\.json does not describe features; copy it again", *arguments, **LEROBOT
    )
    (tmp_path / "meta/info.json").unlink()
    (tmp_path / "meta").rmdir()
    assert_not_loaded("no folder above has meta/info.json", *arguments, **LEROBOT)


# --- The pages that explain them ------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["drive_recorder", "lerobot", "rtde"])
def test_the_example_of_a_format_is_a_valid_dataset_toml(kind):
    text = (ROOT / "data/README.md").read_text().partition(f"**`{kind}`**")[2]
    example = tomllib.loads(text.partition("```toml\n")[2].partition("```")[0])
    own = {"name": "rig", "mechanism": PENDULUM, "recordings": {"patterns": ["*"]}}
    toml = check_dataset_toml({**own, **example}, "README")
    assert toml.reader.kind == kind and toml.columns is not None
