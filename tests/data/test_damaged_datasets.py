"""Every mistake in a data set is one clear line.

What chance brings to every kind of file: tests/test_damage.py.
"""

import gzip
from contextlib import nullcontext

import numpy as np
import pytest
from fixtures.dataset_files import (
    COLUMNS,
    csv_bytes,
    described,
    load,
    load_single,
    motion,
    parquet_bytes,
    write,
)
from fixtures.mistakes import mistakes
from fixtures.refusals import assert_refused
from fixtures.tiny_pendulums import changed

from frictionid.data.readers.dataset import load_dataset

# --- Mistakes in dataset.toml --------------------------------------------------------------------


MISTAKES = r"""
colums = {} => unknown key 'colums'; did you mean 'columns'
columns.angel = ["q1"] => columns: unknown key 'angel'; .*'angle'
recordings =; name =; columns = => the keys 'name', 'columns' and 'recordings' are missing; add them
columns.time =; columns.torque = => 'columns\.time' and 'columns\.torque' are missing
columns.angle = "q1" => torque names 2 columns and angle names 1
units.torque = "A" => needs the table \[motor\]: add it with kt .* gear
motor.kt = 0.1 => \[motor\] needs currents, but units.torque = "N m"
units.torque = "A"; motor.gear = 2.0 => the key 'motor.kt' is missing; add it
units.torque = "A"; motor.kt = [0.1, 0.0] => motor\.kt: .* a zero
motor.gear = 3.0 => changes nothing
motor = {gear = 3.0, coupling = [[1.0, 0.0], [1.0, 1.0]], angle = "motor"} => exclude each other
motor = {coupling = [[2.0]], torque = "motor"} => coupling is of 1 motors, and there are 2
motor = {coupling = [[1.0, 1.0], [2.0, 2.0]], torque = "motor"} => square matrix with an inverse
signs.angle = 2 => signs\.angle.* 1 or -1, not 2
signs.torque = [1, 1, -1] => signs\.torque has 3 numbers for 2
units.torque = "A"; motor.kt = [0.1, 0.1, 0.1] => motor\.kt has 3 numbers for 2 joints \(q1, q2\)
mechanism.kind = => 'mechanism\.kind' is missing; .* such as urdf = "arm\.urdf"
mechanism.parameters = {m4 = true} => m4: .*number, not True
units.angle = "grad" => unknown unit 'grad'; known: 'rad', 'mrad', 'deg'
columns.angle = ["q1", ""] => only torque may have
columns.angle = ["q1", "q1"] => column 'q1' is named twice
sigma.angle = [0.1, 0.1, 0.1] => sigma.angle has 3 numbers for 2
recordings.start = 2.0; recordings.stop = 1.0 => before stop
recordings.start = 99.0 => 'a'.*no sample lies between start = 99 and.*it lasts
recordings.stop = 0.001 => 'a': angle needs at least 2 samples
recordings.patterns = ["*.csv", "b*"] => patterns: 'b\*' matches no file
recordings.patterns = [""] => '' is no relative pattern
recordings.patterns = ["/*"] => '/\*' is no relative pattern
recordings.patterns = ["../*"] => leaves the folder
recordings.patterns = ["*"] => dataset\.toml: tables end with \.csv
recordings.parameters = {"c.csv" = {}} => 'c.csv' is no file.*'a.csv'
sha256 = {"A.csv" = "0000000000000000000000000000000000000000000000000000000000000000"}
    => sha256: 'A.csv' is no file.*'a.csv'
"""


@mistakes(MISTAKES)
def test_a_mistake_in_the_description_is_one_clear_line(tmp_path, wrong, words):
    with assert_refused(words):
        load(tmp_path, changed(described(), wrong))


def test_a_missing_description_or_folder_is_refused(tmp_path):
    with assert_refused(r"nowhere does not exist; name a folder"):
        load_dataset(tmp_path / "nowhere")
    with assert_refused(r"dataset\.toml does not exist"):
        load_dataset(tmp_path)
    with assert_refused("folder of its tables, .*nowhere, does not exist"):
        load_dataset(write(tmp_path), data=tmp_path / "nowhere")


def test_two_tables_of_one_name_are_refused(tmp_path):
    text = csv_bytes(motion())
    document = described(recordings__patterns=["a.*"])
    with assert_refused("two recordings are called 'a'"):
        load(tmp_path, document, a_csv=text, a_csv_gz=gzip.compress(text))


# --- Mistakes in tables --------------------------------------------------------------------------


def table(*rows):
    return "\n".join(["time,q1,q2,u2", *rows]).encode()


ROWS = r"""
0,1,2,3 / 1,1,2 => row 3: 3 cells where the first line has 4
0,1,"2,3 / 1,1,2,3" / 2,1,2,3 => row 2: a quote is left open
0,1,2,3 / 1,1,2,"3 => no CSV text.*unexpected end
0,1,2,3 / 1,1,abc,3 => row 3: column 'q2' holds 'abc', which is no number
0,0,1,1,2,5,3,0 => row 2: 8 cells .* need semicolons
0,1,2,3 / 1,1,,3 => row 3: 'q2' is empty or nan
0,1,2,3 / 1,1,2, => row 3: 'u2' is empty .*repair or delete it \(a gap\); empty angles are gaps
0,1,2,3 / ,1,2,3 => row 3: 'time' is empty or nan
0,1,2,3 /  / 1,nan,2,3 => row 4: 'q1' is empty or nan
0,1,2,3 / 1,1,2,-inf => row 3: 'u2' is -inf
0,1,2,3 / 2,1,2,3 / 1,1,2,3 => row 4: time must increase: .*1 after 2
0,1,2,3 / 0,1,2,3 => row 3: time must increase: 'time' is 0 after 0
0,1,2,3 => angle needs at least 2 samples
"""
DAMAGES = {
    b"": r"a\.csv is empty",
    table(): "has no rows",
    bytes(range(256)): "no CSV text in UTF-8",
    b"0,1,2,3\n1,1,2,3\n": "no column 'time'; it has '0', '1'",
    b"time|q1|q2|u2\n0|1|2|3\n": r"no column 'time'; it has 'time\|q1\|q2\|u2'",
    b"time,q1,q1,q2,u2\n0,1,2,3,4\n": "2 columns called 'q1'",
    b"time;q1;q2;u2\n1.000,5;1;2;3\n": "row 2: column 'time' holds '1.000,5'",
}


def assert_table_refused(folder, content, words):
    with assert_refused(words) as caught:
        load(folder, a_csv=content)
    assert "a.csv" in str(caught.value) or "'a'" in str(caught.value)


@pytest.mark.parametrize("content, words", DAMAGES.items())
def test_a_damaged_table_is_one_clear_line(tmp_path, content, words):
    assert_table_refused(tmp_path, content, words)


@mistakes(ROWS)
def test_a_damaged_row_is_one_clear_line(tmp_path, wrong, words):
    assert_table_refused(tmp_path, table(*wrong.split(" / ")), words)


def test_rows_whose_time_does_not_increase_are_counted_and_all_listed_ones_may_go(tmp_path):
    times = [0, 1, 1, 2, 2, 2, 3, 1, 4]
    rows = [f"{time},1,2,3" for time in times]
    with assert_refused("row 4: time.* 1 after 1 .4 such rows: 4, 6, 7, 9.; del"):
        load(tmp_path, a_csv=table(*rows))
    kept = [row for k, row in enumerate(rows) if k + 2 not in (4, 6, 7, 9)]
    recording = load_single(tmp_path, a_csv=table(*kept))
    assert recording.angle.time.tolist() == [0, 1, 2, 3, 4]
    with assert_refused(r"\(18 such rows: 3, 4, 5, 6, 7, \.\.\.\)"):
        load(tmp_path, a_csv=table(*(19 * rows[:1])))


@pytest.mark.parametrize(
    "name, content, words",
    [
        ("a_csv_gz", csv_bytes(motion()), r"a\.csv\.gz is no whole gzip file"),
        ("a_csv_gz", gzip.compress(csv_bytes(motion()))[:-9], "no whole gzip file"),
        ("a_parquet", b"PAR1 and so on", r"a\.parquet is no whole Parquet file"),
        ("a_parquet", parquet_bytes(motion()).replace(b"temp", b"te\x80p"), "no whole.*utf-8"),
        ("a_parquet", parquet_bytes(motion())[:-20], "no whole Parquet file"),
        ("a_parquet", {"time": [0.0, 1.0]}, "has no column 'q1'; it has 'time'"),
        ("a_parquet", motion(1) | {"q1": ["x"]}, "column 'q1' holds no numbers"),
        ("a_parquet", motion(1) | {"q1": [[1.0]]}, "column 'q1' holds no numbers"),
        ("a_parquet", motion(3) | {"time": [0, 1, 1]}, "row 4: time must increase"),
    ],
)
def test_a_damaged_gzip_or_parquet_file_is_one_clear_line(tmp_path, name, content, words):
    with assert_refused(words):
        load(tmp_path, described(recordings__patterns=["a.*"]), **{name: content})


def test_clocks_must_run_in_the_same_time(tmp_path):
    document = described(columns__time={"angle": "time", "torque": "t_drive"})
    columns = motion() | {"t_drive": motion()["time"] + 1.7e9}
    with assert_refused("share no moment; both clocks must count"):
        load(tmp_path, document, a_csv=columns)
    with assert_refused("the column 't_drive' is empty"):
        load(tmp_path, document, a_csv=columns | {"t_drive": [None] * 9})


def test_a_number_too_large_for_its_unit_is_refused(tmp_path):
    columns = motion() | {"q1": np.full(9, 1e308)}
    with assert_refused("row 2: 'q1' is 1e.308, which no sensor reports"):
        load(tmp_path, described(units={"angle": "rev"}), a_csv=columns)


@pytest.mark.parametrize("column", COLUMNS)
def test_a_table_is_refused_without_a_column_that_is_read(tmp_path, column):
    columns = {name: values for name, values in motion().items() if name != column}
    needed = column in ("time", "q1", "q2", "u2")
    with assert_refused(f"no column '{column}'") if needed else nullcontext():
        load(tmp_path, a_csv=columns)
