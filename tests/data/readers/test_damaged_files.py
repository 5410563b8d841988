"""Every mistake in the files of readers is one clear line; what chance brings: test_damage."""

import json
import math

import numpy as np
import pytest
from fixtures.dataset_files import described, load, load_single
from fixtures.mistakes import changes, mistakes
from fixtures.own_reader import read_by
from fixtures.reader_files import (
    MARKERS,
    MOTOR,
    bam_bytes,
    bam_log,
    emps_variables,
    marker_csv,
    mat_bytes,
)
from fixtures.refusals import assert_refused
from fixtures.tiny_pendulums import changed

from frictionid.data.readers.formats.bam import read as read_bam
from frictionid.data.readers.formats.markers import read as read_markers


def assert_file_refused(read, path, content, given_settings, words):
    """Check that a file is refused with some words."""
    path.write_bytes(content)
    with assert_refused(words):
        read(path, given_settings)


# --- Settings and [reader] -----------------------------------------------------------------------


READERS = r"""
kind = "bamm" => kind = 'bamm' is unknown; did you mean 'bam'
kind = "bam"; Kt = 1.0 => \[reader\]: unknown key 'Kt'.*'kt'
kind = "bam"; kt = 1.0 => \[reader\]: the key 'R' is missing
kind = "bam"; kt = -1.0; R = 1.0 => kt: .*greater than 0, not -1.0
kind = "no_such_module:read" => cannot be imported
kind = "my_readers:reed" => cannot be imported
kind = "my_readers:OWN_NUMBER" => cannot be imported|is no function
kind = "my_readers:broken" => a\.log: the reader .* failed \(KeyError
kind = "my_readers:wrong" => must return a Recording, not int
rate = 3.0 => 'reader.kind' is missing
"""


@mistakes(READERS)
def test_a_mistake_in_reader_is_one_clear_line(tmp_path, wrong, words):
    with assert_refused(words):
        read_by(tmp_path, changes(wrong))


def test_reader_and_columns_exclude_each_other(tmp_path):
    with assert_refused(r"\[columns\] and \[reader\] exclude each other"):
        load(tmp_path, described(reader={"kind": "bam"}))
    with assert_refused("'columns' is missing; add it, or a "):
        load(tmp_path, described(columns=None))


def test_the_noise_must_fit_the_joints_of_the_reader(tmp_path):
    reader = {"kind": "my_readers:read", "scale": 1.0, "rate": 1.0}
    with assert_refused(r"sigma\.angle has 2 numbers for 1 joints"):
        read_by(tmp_path, reader, {"sigma": {"angle": [0.1, 0.1]}})


SETTINGS = """
time = => give either time .* or rate
rate = 3.0 => give either time .* or rate
y = ["y0", "y1"] => x names 3 columns and y 2
x = ["x0", "x1", "y0"] => name a column twice
x = ["x0"]; y = ["y0"] => \\[reader\\]: x: .*at least 2
x = ["x0", "x1", "x9"] => has no column 'x9'
header = false => has no column 'x0'; it has '1', '2'
pivot = "flying" => 'moving' or 'fixed', not 'flying'
"""


@mistakes(SETTINGS)
def test_a_mistake_in_the_settings_of_markers_is_one_clear_line(tmp_path, wrong, words):
    merged = changed({**MARKERS}, wrong)
    assert_file_refused(read_markers, tmp_path / "a.csv", marker_csv()[0], merged, words)


# --- Files ---------------------------------------------------------------------------------------


def entry(at, **changes):
    """Content of a log with one entry changed; None deletes."""
    log = bam_log()
    log["entries"][at] = {k: v for k, v in {**log["entries"][at], **changes}.items() if v != "gone"}
    return json.dumps(log).encode()


LOGS = {
    "junk": (b"\x00\xff{", "is no JSON"),
    "deep": (b"[" * 100000, "is no JSON"),
    "a list": (b"[]", "has no list of entries"),
    "no entries": (b'{"mass": 1}', "has no list of entries"),
    "few entries": (bam_bytes(entries=[{}]), "1 entries"),
    "no mass": (bam_bytes(mass=None), "mass is missing"),
    "text": (bam_bytes(kp="32"), "kp is '32', which is no number"),
    "negative": (bam_bytes(length=-1), "length must be positive"),
    "huge": (bam_bytes(kp=10**400), "kp is too large"),
    "infinite": (bam_bytes(kp=math.inf), "kp is too large"),
    "beyond": (bam_bytes(length=1e200), "length is too large"),
    "no arm": (bam_bytes(arm_mass=math.nan), "arm_mass must be positive, not nan"),
    "entry": (bam_bytes(entries=[1, 2, 3]), "entry 0 .* is no object"),
    "no position": (entry(4, position="gone"), "entry 4 .*position is missing"),
    "nan": (entry(5, position=float("nan")), "entry 5 .*'position' is empty or nan"),
    "back in time": (entry(7, timestamp=0.0), "entry 7 .*time must increase"),
}


@pytest.mark.parametrize("content, words", LOGS.values(), ids=LOGS)
def test_a_damaged_log_is_one_clear_line(tmp_path, content, words):
    assert_file_refused(read_bam, tmp_path / "a.json", content, MOTOR, words)


def test_a_log_without_the_asked_phase_is_refused(tmp_path):
    for passive, phase in ((0, "passive"), (60, "driven")):
        asked = {**MOTOR, "phase": phase}
        assert_file_refused(
            read_bam, tmp_path / "a.json", bam_bytes(passive=passive), asked, f"0 {phase} pha"
        )


CARRIAGE = described(
    mechanism={"kind": "linear_axis", "parameters": {"mass": 1.0}},
    columns={"time": "t", "angle": "qm", "torque": "vir"},
    recordings={"patterns": ["a.mat"]},
)


def read_carriage(path, _):
    """The recording of a MAT table at `path`."""
    recording = load_single(path.parent, CARRIAGE, a_mat=path.read_bytes())
    return recording


CARRIAGES = {
    "junk": (b"junk", "is no whole MAT file"),
    "empty": (b"", "is no whole MAT file"),
    "no angle": (mat_bytes({"t": [0.0, 1.0]}), "has no column 'qm'"),
    "cut off": (mat_bytes(emps_variables())[:-40], "is no whole MAT file"),
    "version 7.3": (b"MATLAB 7.3".ljust(124) + b"\x00\x02IM", "version 7.3; save it again"),
    "lengths": (mat_bytes(emps_variables(qm=np.ones(3))), "columns differ in length .*'qm' 3"),
    "text": (mat_bytes(emps_variables(qm="abc")), "'qm' holds no real numbers"),
    "complex": (mat_bytes(emps_variables(qm=np.ones(50) * 1j)), "'qm' holds no real numbers"),
    "matrix": (mat_bytes(emps_variables(qm=np.ones((50, 2)))), r"name one of them, as qm\(:,1\)"),
    "time": (mat_bytes(emps_variables(t=np.zeros(50))), "row 2: time must increase: 't' is 0"),
    "nan": (mat_bytes(emps_variables(vir=np.full(50, np.nan))), "row 1: 'vir' is empty or nan"),
}


@pytest.mark.parametrize("content, words", CARRIAGES.values(), ids=CARRIAGES)
def test_a_damaged_mat_file_is_one_clear_line(tmp_path, content, words):
    assert_file_refused(read_carriage, tmp_path / "a.mat", content, {}, words)


NAMES = r"""
q[2]   => names no column; write q
q(:,3) => there is no 'q\(:,3\)', it has 2 columns
q.x    => has no column 'q.x'
log.x  => has no column 'log.x'; it has 'y'
"""


@mistakes(NAMES)
def test_a_wrong_name_of_a_mat_column_is_one_clear_line(tmp_path, wrong, words):
    content = mat_bytes({"t": np.arange(5.0), "q": np.ones((5, 2)), "log": {"y": 1.0}})
    names = {"time": "t", "angle": [wrong], "torque": [""]}
    document = described(recordings__patterns=["*.mat"], columns=names)
    with assert_refused(words):
        load(tmp_path, document, a_mat=content)


BARE = {"x": ["2", "4", "6"], "y": ["1", "3", "5"], "header": False, "rate": 400.0}
TABLES = """
1,2,3,4,5,6 / 1,2 => row 2: 2 cells where the first line has 6
a,b,c,d,e,f => row 1: .*header = true
1,2,3,4,5,6 / 2,3,4,,6,7 => row 2: '4' is empty or nan
1,2,3,4,5,6 / 1,2,1,2,5,6 => row 2: two neighbouring markers coincide
1,2,3,4,5,6 / 1,inf,1,2,5,6 => row 2: '2' is inf
"""


@mistakes(TABLES)
def test_a_damaged_table_of_markers_is_one_clear_line(tmp_path, wrong, words):
    content = (wrong.replace(" / ", "\n") + "\n").encode()
    assert_file_refused(read_markers, tmp_path / "0.csv", content, BARE, words)


@pytest.mark.parametrize("content, words", [(b"", "is empty"), (b"\x81", "is no CSV text")])
def test_what_is_no_table_of_markers_is_refused(tmp_path, content, words):
    assert_file_refused(read_markers, tmp_path / "0.csv", content, BARE, words)


def test_unreadable_files_are_named(tmp_path):
    for read, given_settings in ((read_bam, MOTOR), (read_markers, BARE)):
        with assert_refused("cannot be read"):
            read(tmp_path / "nowhere.csv", given_settings)
    assert_file_refused(
        read_markers, tmp_path / "0.csv.gz", b"1,2\n", BARE, "is no whole gzip file"
    )
