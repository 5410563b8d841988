"""Tables as labs write them: amperes, degrees, semicolons, decimal commas, single names."""

import io

import numpy as np
import pandas as pd
import pytest
from fixtures.dataset_files import assert_same, described, load, load_single, motion
from fixtures.refusals import assert_one_line, assert_refused
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.data.readers.column_toml import SPELLINGS, UNITS, unit_named
from frictionid.deploy.watch import chunks_of

TIME = np.arange(12) / 50.0
ANGLE, CURRENT = 90.0 * np.sin(3.0 * TIME), 2.0 * np.cos(5.0 * TIME)  # [deg], [A]


def one_joint(**changes):
    """A data set of one driven joint, its columns named without lists."""
    own = {
        "mechanism": {"kind": "pendulum"},
        "columns": {"time": "time", "angle": "q", "torque": "i"},
        "recordings": {"patterns": "*.csv"},
    }
    return described(**{**own, **changes})


def text(separator=",", comma=False, header="time{0}q{0}i"):
    """The table, its cells separated by a mark, with decimal points or commas."""
    lines = [header.format(separator)]
    for row in zip(TIME, ANGLE, CURRENT, strict=True):
        line = separator.join(repr(float(value)) for value in row)
        lines.append(line.replace(".", ",") if comma else line)
    return "\n".join(lines).encode()


def test_amperes_become_torques_at_the_joint_by_constant_and_gear(tmp_path):
    document = one_joint(
        units={"angle": "degrees", "torque": "A"},
        motor={"kt": 0.05, "gear": -6.0},
        sigma={"torque": 0.1},
    )
    recording = load_single(tmp_path, document, a_csv=text())
    assert_allclose(recording.angle.value[:, 0], np.radians(ANGLE))
    assert_allclose(recording.torque.value[:, 0], 0.05 * -6.0 * CURRENT)
    assert_allclose(recording.torque.sigma, [0.1 * 0.05 * 6.0])


@pytest.mark.parametrize("code", ["cp1252", "utf-16", "utf-8-sig"])
def test_what_excel_saves_is_read_whatever_its_code_page(tmp_path, code):
    document = one_joint(columns={"time": "time", "angle": "q [°]", "torque": "i"})
    content = text(";", comma=True, header="time{0}q [°]{0}i").decode()
    recording = load_single(tmp_path, document, a_csv=content.encode(code))
    assert_array_equal(recording.angle.value[:, 0], ANGLE)


def test_columns_that_count_the_other_way_round_are_turned(tmp_path):
    document = described(columns__velocity=["w1", "w2"], sigma__angle=0.1, sigma__torque=0.2)
    (tmp_path / "as_given").mkdir()
    given = load_single(tmp_path / "as_given", document)
    document["signs"] = {"angle": [1, -1], "torque": -1}
    turned = load_single(tmp_path, document)
    assert_array_equal(turned.angle.value, given.angle.value * [1, -1])
    assert_array_equal(turned.velocity.value, given.velocity.value * [1, -1])
    assert_array_equal(turned.torque.value, -given.torque.value)
    assert_array_equal(turned.angle.sigma, given.angle.sigma)
    assert_array_equal(turned.torque.sigma, given.torque.sigma)


def test_deviations_of_turned_angles_stay_positive(tmp_path):
    columns = {**motion(), "s1": np.full(9, 0.1), "s2": np.full(9, 0.2)}
    document = described(columns__sigma=["s1", "s2"], signs={"angle": [1, -1]})
    recording = load_single(tmp_path, document, a_csv=columns)
    assert_allclose(recording.angle.sigma, np.tile([0.1, 0.2], (9, 1)))


@pytest.mark.parametrize("separator, comma", [(";", False), (";", True), ("\t", True)])
def test_other_separators_and_decimal_commas_hold_the_same_numbers(tmp_path, separator, comma):
    (tmp_path / "plain").mkdir()
    (tmp_path / "other").mkdir()
    document = one_joint()
    plain = load_single(tmp_path / "plain", document, a_csv=text())
    other = load_single(tmp_path / "other", document, a_csv=text(separator, comma))
    assert_same(plain, other)


def test_a_semicolon_in_a_name_does_not_separate(tmp_path):
    document = one_joint(columns={"time": "time", "angle": "q;raw", "torque": "i"})
    recording = load_single(tmp_path, document, a_csv=text(header="time,q;raw,i"))
    assert_array_equal(recording.angle.value[:, 0], ANGLE)


@pytest.mark.parametrize("quantity", SPELLINGS)
def test_every_spelling_of_a_unit_names_a_known_one(quantity):
    for spelled, unit in SPELLINGS[quantity].items():
        assert unit_named(quantity, spelled) == unit in UNITS[quantity]
        assert spelled not in UNITS[quantity]


# --- Spreadsheets, and several runs in one table --------------------------------------------------


def excel(frame):
    content = io.BytesIO()
    frame.to_excel(content, index=False)
    return content.getvalue()


def test_a_spreadsheet_holds_the_numbers_of_a_text(tmp_path):
    frame = pd.DataFrame({"time": TIME, "q": ANGLE, "i": CURRENT})
    document = one_joint(recordings={"patterns": ["*.xlsx", "*.csv"]})
    (tmp_path / "a.xlsx").write_bytes(excel(frame))
    sheet, plain = load(tmp_path, document, b_csv=text()).recordings
    assert_allclose(sheet.angle.value, plain.angle.value, rtol=1e-14)
    (tmp_path / "a.xlsx").write_bytes(excel(frame)[:400])
    with assert_refused("is no whole Excel file"):
        load(tmp_path, document, b_csv=text())
    (tmp_path / "a.xlsx").write_bytes(excel(frame.assign(q=["x", *ANGLE[1:]])))
    with assert_refused("xlsx, row 2: column 'q' holds 'x', which is no numb"):
        load(tmp_path, document, b_csv=text())


RUNS = pd.DataFrame({"time": np.tile(TIME, 3), "q": np.tile(ANGLE, 3), "i": np.tile(CURRENT, 3)})
RUNS["run"] = np.repeat([1, 4, 2], len(TIME))


@pytest.mark.parametrize("column", ["time", "run"])
def test_runs_in_one_table_are_recordings(tmp_path, column):
    document = one_joint(recordings={"patterns": "*.csv", "split": column})
    content = RUNS.to_csv(index=False).encode()
    recordings = load(tmp_path, document, a_csv=content).recordings
    rig = fid.mechanisms.pendulum(mass=1.0, length=0.3)
    frame = fid.Dataset.from_frames(RUNS, rig, time="time", angle="q", torque="i", split=column)
    assert [r.name for r in recordings] == ["a-1", "a-2", "a-3"]
    for one, other in zip(recordings, frame.recordings, strict=True):
        assert_array_equal(one.angle.time, TIME)
        assert_array_equal(one.angle.value, other.angle.value)


def test_a_time_that_starts_again_says_how_to_split(tmp_path):
    with assert_refused("row 14: time must increase.* say split = 'time'"):
        load(tmp_path, one_joint(), a_csv=RUNS.to_csv(index=False).encode())
    with assert_refused("has no column 'rum'; did you mean 'run'?"):
        document = one_joint(recordings={"patterns": "*.csv", "split": "rum"})
        load(tmp_path, document, a_csv=RUNS.to_csv(index=False).encode())


def test_rows_without_times_have_a_rate(tmp_path, run):
    (tmp_path / "log").mkdir()
    time = np.arange(200) / 100.0
    frame = pd.DataFrame({"q": np.sin(5 * time), "u": 0.3 * np.cos(2 * time)})
    frame.to_csv(tmp_path / "log/a.csv", index=False)
    given = "init log --mechanism pendulum --set mass=1 --set length=0.3 --time".split()
    assert_one_line(run(tmp_path, *given, "0 Hz"), "has no column of numbers '0 Hz'")
    assert run(tmp_path, *given, "100 Hz")[0] == 0
    written = fid.load_dataset(tmp_path / "log")
    machine = fid.mechanisms.pendulum(mass=1.0, length=0.3)
    frames = fid.Dataset.from_frames(frame, machine, time="100 Hz", angle="q", torque="u")
    for dataset in (written, frames):
        assert_allclose(dataset.recordings[0].angle.time, time)
    with assert_refused("a stream needs a column of times"):
        chunks_of(tmp_path / "log", "q,u")
