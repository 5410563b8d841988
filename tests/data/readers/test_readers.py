"""Readers: what is read is what was measured, in SI units, with the signs of the mechanisms."""

import gzip
import json
import struct

import numpy as np
import pytest
import scipy.io
from fixtures.dataset_files import described, load_single, motion
from fixtures.own_reader import read_by
from fixtures.reader_files import MARKERS, MOTOR, bam_bytes, bam_log, column, marker_csv, mat_bytes
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.readers.formats.bam import read as read_bam
from frictionid.data.readers.formats.markers import read as read_markers
from frictionid.data.readers.mat import read_mat
from frictionid.data.readers.table import numeric_table
from frictionid.errors import InputError


def put(folder, name, content):
    path = folder / name
    path.write_bytes(content)
    return path


# --- MAT tables ----------------------------------------------------------------------------------


def test_mat_tables_hold_the_same_numbers_as_csv(tmp_path):
    columns = motion(30)
    document = described(
        columns__time="log.t",
        columns__angle=["log.q(:,1)", "log.q(:,2)"],
        columns__torque=["", "u2"],
        recordings__patterns=["*.mat"],
    )
    table = np.stack([columns["q1"], columns["q2"]], axis=1)
    content = mat_bytes({"log": {"t": columns["time"], "q": table}, "u2": columns["u2"]})
    recording = load_single(tmp_path, document, a_mat=content)
    assert recording.name == "a"
    assert_array_equal(recording.angle.time, columns["time"])
    assert_array_equal(recording.angle.value, table)
    assert_array_equal(recording.torque.value[:, 1], columns["u2"])


@pytest.mark.parametrize("compressed", [False, True])
def test_mat_variables_are_those_that_scipy_reads(tmp_path, compressed):
    rng = np.random.default_rng(1)
    kinds = ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"]
    variables = {f"x{k}": (100 * rng.random((5, 3))).astype(k) for k in kinds}
    variables |= {"cube": rng.random((2, 3, 4)), "one": 3.0, "none": np.zeros((0, 2))}
    variables |= {"text": "abc", "cell": np.array([1.0, "a"], dtype=object), "z": np.ones(3) * 1j}
    variables |= {"log": {"q": rng.random((4, 2)), "deep": {"t": np.arange(4.0)}}}
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, variables, do_compression=compressed)
    found, expected = read_mat(path.read_bytes(), "a.mat"), scipy.io.loadmat(path)
    for name in (*(f"x{k}" for k in kinds), "cube", "one", "none"):
        assert_array_equal(found[name], expected[name])
        assert found[name].dtype == expected[name].dtype
    assert (found["text"], found["cell"], found["z"]) == (None, None, None)
    assert_array_equal(found["log"]["deep"]["t"].ravel(), np.arange(4.0))
    assert_array_equal(found["log"]["q"], variables["log"]["q"])


def test_cells_and_objects_are_named_where_a_mat_file_has_no_numbers(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"runs": np.array([np.arange(3.0), np.arange(4.0)], dtype=object)})
    cells = path.read_bytes()
    parts = (6, 8, struct.pack("<II", 17, 0)), (1, 4, b"data"), (1, 4, b"MCOS")
    element = b"".join(struct.pack("<II", *tag) + text.ljust(8, b"\0") for *tag, text in parts)
    object_ = cells[:128] + struct.pack("<II", 14, len(element)) + element
    for content, name in ((cells, "runs"), (object_, "data")):
        with pytest.raises(InputError, match=f"a.mat: {name} holds no numbers; save arrays"):
            numeric_table(content, "a.mat")


# --- bam -----------------------------------------------------------------------------------------


def test_bam_load_is_a_signed_word_and_mass_and_length_are_the_logs(tmp_path):
    log = bam_log(mass=0.7, length=0.2)
    recording = read_bam(put(tmp_path, "a.json", json.dumps(log).encode()), MOTOR)
    word = column(log, "load")
    assert recording.parameters == {"mass": 0.7, "length": 0.2}
    load_ = recording.covariates["load"].value[:, 0]
    assert load_.min() < 0 and load_.max() <= 32767
    assert_array_equal(np.mod(load_, 65536), word)


def test_bam_phases_part_the_log_between_them(tmp_path):
    path = put(tmp_path, "a.json.gz", gzip.compress(bam_bytes()))
    parts = [read_bam(path, {**MOTOR, "phase": p, "offset": 0.1}) for p in ("driven", "passive")]
    whole = read_bam(path, MOTOR)
    time = np.concatenate([part.angle.time for part in parts])
    angle = np.concatenate([part.angle.value for part in parts])
    assert_array_equal(time, whole.angle.time)
    assert_allclose(angle, whole.angle.value + 0.1)
    assert np.all(parts[1].torque.value == 0.0)


def test_bam_arm_counts_as_a_rod(tmp_path):
    path = put(tmp_path, "a.json", bam_bytes(mass=1.0, length=0.5, arm_mass=0.3))
    p = read_bam(path, MOTOR).parameters
    assert p["mass"] * p["length"] == pytest.approx((1.0 + 0.3 / 2) * 0.5)
    inertia = p["mass"] * p["length"] ** 2 + p["inertia"]
    assert inertia == pytest.approx((1.0 + 0.3 / 3) * 0.5**2)


# --- the others ----------------------------------------------------------------------------------


def test_markers_give_the_angles_they_were_made_of(tmp_path):
    content, angles = marker_csv()
    recording = read_markers(put(tmp_path, "a.csv", content), MARKERS)
    assert_allclose(recording.angle.value, angles, atol=1e-9)
    assert_allclose(recording.angle.time, np.arange(40) * 0.01)
    assert np.all(recording.torque.value == 0.0)


def test_markers_are_the_same_with_y_upwards_mirrored_or_by_frame_rate(tmp_path):
    content, angles = marker_csv()
    path = put(tmp_path, "a.csv", content)
    rate = {k: v for k, v in MARKERS.items() if k != "time"} | {"rate": 100.0}
    assert_allclose(read_markers(path, rate).angle.value, angles, atol=1e-9)
    mirrored = read_markers(path, {**MARKERS, "mirrored": True})
    assert_allclose(mirrored.angle.value, -angles, atol=1e-9)
    up = read_markers(path, {**MARKERS, "y_points": "up"}).angle.value
    assert_allclose(np.cos(up[:, 0]), -np.cos(angles[:, 0]), atol=1e-9)


def test_rows_without_a_marker_can_be_dropped_and_keep_their_time(tmp_path):
    lines = marker_csv()[0].decode().splitlines()
    lines[6] = lines[6].rpartition(",")[0] + ","
    path = put(tmp_path, "a.csv", "\n".join(lines).encode())
    recording = read_markers(path, {**MARKERS, "missing": "drop"})
    assert_allclose(recording.angle.time, np.delete(np.arange(40) * 0.01, 5))


def test_texts_without_a_header_have_numbered_columns(tmp_path):
    document = described(
        columns={"time": "1", "angle": ["2", "4"], "torque": ["", ""], "header": False}
    )
    for name, separator in (("a_csv", b","), ("a_txt", b" ")):
        rows = b"0.0 0.7 9 3\n0.05 0.6 9 3\n\n0.1 0.5 nan 3\n"
        (tmp_path / name).mkdir()
        content = {name: rows.replace(b" ", separator)}
        document["recordings"]["patterns"] = [name.replace("_", ".")]
        recording = load_single(tmp_path / name, document, **content)
        assert recording.angle.value.T.tolist() == [[0.7, 0.6, 0.5], [3.0, 3.0, 3.0]]
        assert recording.angle.time.tolist() == [0.0, 0.05, 0.1] and recording.name == "a"
    numbers = {**MARKERS, "x": ["3", "5", "7"], "y": ["2", "4", "6"], "time": "1", "header": False}
    content, angles = marker_csv()
    path = put(tmp_path, "b.csv.gz", gzip.compress(content.partition(b"\n")[2]))
    assert_allclose(read_markers(path, numbers).angle.value, angles, atol=1e-9)


# --- [reader] in dataset.toml --------------------------------------------------------------------


def test_ones_own_reader_is_one_function(tmp_path):
    reader = {"kind": "my_readers:read", "scale": 0.5, "rate": 10.0}
    span = {"patterns": ["a.log"], "start": 0.1, "parameters": {"a.log": {"length": 0.3}}}
    dataset = read_by(tmp_path, reader, {"recordings": span, "sigma": {"angle": 0.01}})
    (recording,) = dataset.recordings
    assert recording.angle.value.ravel().tolist() == [1.0, 1.5, 2.0]
    assert recording.parameters == {"mass": 2.0, "length": 0.3}
    assert recording.angle.sigma.tolist() == [0.01]
    assert recording.name == "a.log"


def test_readers_are_named_in_the_description(tmp_path):
    reader = {"kind": "bam", **MOTOR, "phase": "passive"}
    dataset = read_by(tmp_path, reader, name="day_1.json.gz", content=gzip.compress(bam_bytes()))
    (recording,) = dataset.recordings
    assert recording.name == "day_1"
    assert len(recording.angle.time) == 20
    assert recording.parameters == {"mass": 0.49, "length": 0.1}
