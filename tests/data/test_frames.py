"""Data sets from frames and arrays: the same as from a dataset.toml; each mistake is one line."""

import numpy as np
import pandas as pd
import pytest
from fixtures.dataset_files import assert_same
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset

RIG = {"kind": "acrobot"}
TIME = np.linspace(10.0, 12.0, 41)
FRAME = pd.DataFrame(
    {
        "t": 1e3 * TIME,
        "q1": 50 * np.cos(TIME),
        "q2": 0.4 * np.sin(TIME),
        "w1": 10 * np.sin(TIME),
        "w2": np.cos(TIME),
        "i2": 100 * np.sign(np.sin(9 * TIME)),
        "warm": 20.0 + TIME,
    }
)
SAID = {
    "time": "t",
    "angle": ["q1", "q2"],
    "velocity": ["w1", "w2"],
    "torque": [None, "i2"],
    "units": {"time": "ms", "angle": "deg", "velocity": "deg/s", "torque": "mA"},
    "signs": {"torque": [1, -1]},
    "motor": {"kt": 0.02, "gear": 6},
    "hold": "linear",
    "sigma": {"angle": [0.1, 0.2], "torque": 3.0},
    "covariates": {"temperature": "warm"},
    "parameters": {"run1": {"m1": 0.4}},
}
TOML = """
name = "data"
[mechanism]
kind = "acrobot"
[columns]
time = "t"
angle = ["q1", "q2"]
velocity = ["w1", "w2"]
torque = ["", "i2"]
[columns.covariates]
temperature = "warm"
[units]
time = "ms"
angle = "deg"
velocity = "deg/s"
torque = "mA"
[signs]
torque = [1, -1]
[motor]
kt = 0.02
gear = 6.0
[hold]
torque = "linear"
[sigma]
angle = [0.1, 0.2]
torque = 3.0
[recordings]
patterns = ["run1.csv"]
[recordings.parameters]
"run1.csv" = {m1 = 0.4}
"""


def assert_same_sets(one, other):
    assert [r.name for r in one.recordings] == [r.name for r in other.recordings]
    for a, b in zip(one.recordings, other.recordings, strict=True):
        assert_same(a, b)


def read(frames=FRAME, **said):
    return Dataset.from_frames(frames, RIG, **{"time": "t", "angle": ["q1", "q2"], **said})


def test_frames_are_read_as_the_tables_of_a_dataset_toml(tmp_path):
    (tmp_path / "dataset.toml").write_text(TOML)
    FRAME.to_csv(tmp_path / "run1.csv", index=False)  # shortest digits that give the same numbers
    assert_same_sets(read({"run1": FRAME}, **SAID), load_dataset(tmp_path))


def test_joints_may_have_units_of_their_own():
    table = FRAME.assign(q2=np.degrees(FRAME.q2), w2=np.degrees(FRAME.w2))
    alike = read(table, units="deg", sigma=0.1)
    own = read(units=["deg", "rad"], sigma=[0.1, np.radians(0.1)])
    (a,), (b,) = alike.recordings, own.recordings
    assert_allclose(a.angle.value, b.angle.value, rtol=1e-14)
    assert_allclose(a.angle.sigma, b.angle.sigma, rtol=1e-14)


def test_a_unit_of_the_angles_is_that_of_the_velocities_per_second():
    one, each = (
        read(velocity=["w1", "w2"], units=units)
        for units in ("deg", {"angle": "deg", "velocity": "deg/s"})
    )
    assert_same_sets(one, each)


def test_arrays_and_frames_are_the_same_data():
    torque = np.column_stack([np.zeros(41), FRAME.i2])
    arrays = {"time": FRAME.t, "angle": FRAME[["q1", "q2"]].to_numpy(), "torque": torque}
    units = {"time": "ms", "angle": "deg", "torque": "mN m"}
    one = Dataset.from_arrays({"run1": arrays}, RIG, units=units, hold="linear", sigma=0.1)
    said = {key: SAID[key] for key in ("torque", "hold")}
    assert_same_sets(one, read({"run1": FRAME}, **said, units=units, sigma=0.1))


def test_a_torque_may_have_a_clock_of_its_own():
    clock = np.linspace(9.9, 12.1, 200)
    u = np.column_stack([np.zeros(200), np.sin(clock)])
    q = FRAME[["q1", "q2"]].to_numpy()
    arrays = {"time": TIME, "angle": q, "torque_time": clock, "torque": u}
    (a,) = Dataset.from_arrays({"run1": arrays}, RIG).recordings
    assert_array_equal(a.torque.time, clock)
    assert_array_equal(a.torque.value, u)
    assert_array_equal(a.angle.time, TIME)


def test_the_index_may_be_the_time():
    indexed = FRAME.set_index(pd.to_datetime(FRAME.t, unit="ms"))
    (a,) = read(indexed, time=None).recordings
    assert_allclose(a.angle.time, TIME - TIME[0], atol=1e-9)


def test_further_frames_are_read_alike():
    first = read({"run1": FRAME}, **SAID)
    again = first.with_frames({"run1": FRAME})
    assert_same_sets(again, read({"run1": FRAME}, **{**SAID, "parameters": None}))
    assert again.hashes == first.hashes


def test_a_recording_is_found_by_its_name():
    data = read({"run1": FRAME, "run2": FRAME})
    assert data["run2"] is data.recordings[1]
    assert repr(data) == "Dataset('data': 2 recordings, 2 joints, 4000 s)"
    with assert_refused("has no recording 'run3'; did you mean 'run2'"):
        data["run3"]


TWICE = pd.concat([FRAME, FRAME[["q1"]]], axis=1)


@pytest.mark.parametrize(
    "frame, said, message",
    [
        (FRAME, {"angle": ["q1", "qq2"]}, "no column 'qq2'; did you mean 'q2'"),
        (TWICE, {}, "has 2 columns called 'q1'"),
        (FRAME.assign(q1="fast"), {}, "row 0: column 'q1' holds 'fast', .* convert the column"),
        (FRAME.assign(q1="0,5"), {}, "holds '0,5', .* with decimal=\",\""),
        (FRAME.iloc[::-1], {}, "row 1: time must increase: 't' is 11950 after 12000"),
        (
            FRAME,
            {"angle": ["q1", "q2", "w1"], "torque": None, "units": ["deg"] * 2},
            "angle has 2 units for 3 joints",
        ),
        (FRAME, {"units": {"angel": "deg"}}, "unknown key 'angel'; did you mean 'angle'"),
        (FRAME[:0], {}, "has no rows"),
        (np.eye(3), {}, "is a ndarray, not a table"),
        (FRAME, {"parameters": {"run7": {}}}, "no recording 'run7'"),
        (FRAME, {"angle": None}, "name the columns of the angles"),
    ],
)
def test_a_mistake_is_one_sentence(frame, said, message):
    with assert_refused(message):
        read({"run1": frame}, **{"torque": [None, "i2"], **said})


ARRAYS = {"time": TIME, "angle": np.zeros((41, 2))}


@pytest.mark.parametrize(
    "wrong, message",
    [
        ({"torqe": TIME}, "array 'torqe' is unknown; did you mean 'torque'"),
        ({"time": None}, "the array 'time' is missing"),
        ({"angle": np.zeros((40, 2))}, "angle has 40 samples and time 41"),
        ({"angle": np.zeros((41, 2, 1))}, "must have shape"),
        ({"angle": ["a"] * 41}, "must be an array of numbers"),
    ],
)
def test_a_wrong_array_is_one_sentence(wrong, message):
    with assert_refused(message):
        Dataset.from_arrays({"run1": {**ARRAYS, **wrong}}, RIG)


def test_data_that_were_files_know_no_frames():
    with assert_refused("was not read from frames"):
        Dataset.from_arrays({"run1": ARRAYS}, RIG).with_frames(FRAME)
