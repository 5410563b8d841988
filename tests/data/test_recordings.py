"""Data sets: what is read is what was measured, in SI units, and no impossible recording exists."""

import gzip
import hashlib
import tomllib

import numpy as np
import pytest
import tomli_w
from fixtures.dataset_files import (
    OTHERS,
    assert_same,
    csv_bytes,
    described,
    load,
    load_single,
    motion,
    parquet_bytes,
    write,
)
from fixtures.paths import ROOT
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.readers.column_toml import CURRENTS, UNITS
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.dataset_toml import check_dataset_toml
from frictionid.data.recordings import Dataset, Recording, TrueMotion
from frictionid.data.signals import Signal, holds, sample
from frictionid.mechanics import unit_inertia

# --- What is read is what was measured -----------------------------------------------------------


def test_values_arrive_unchanged_in_si(tmp_path):
    columns = motion()
    dataset = load(tmp_path)
    (recording,) = dataset.recordings
    assert (dataset.name, recording.name) == ("rig", "a")
    assert_array_equal(recording.angle.time, columns["time"])
    assert_array_equal(recording.angle.value.T, [columns["q1"], columns["q2"]])
    # the first joint has no motor
    assert_array_equal(recording.torque.value.T, [np.zeros(9), columns["u2"]])
    assert (recording.angle.hold, recording.torque.hold) == ("linear", "previous")


def test_the_descriptions_tables_are_kept_as_they_stand(tmp_path):
    document = described(truth={"law": "stribeck", "theta": [1, 2.5]}, licence="MIT")
    dataset = load(tmp_path, document)
    assert dataset.mechanism.table == document["mechanism"]
    assert dataset.truth == document["truth"]
    assert dataset.origin == {"licence": "MIT"}
    content = (tmp_path / "a.csv").read_bytes()
    assert dataset.hashes == {"a.csv": hashlib.sha256(content).hexdigest()}


def test_folder_and_file_name_the_same_data_set(tmp_path):
    by_folder = load(tmp_path)
    by_file = load_dataset(str(tmp_path / "dataset.toml"))
    assert by_folder.hashes == by_file.hashes
    assert_same(by_folder.recordings[0], by_file.recordings[0])


def test_csv_gzip_and_parquet_hold_the_same_numbers(tmp_path):
    columns = motion(50)
    text = csv_bytes(columns)
    tables = {"a_csv": text, "b_csv_gz": gzip.compress(text), "c_parquet": parquet_bytes(columns)}
    document = described(recordings__patterns=["*.csv", "*.gz", "*.parquet"])
    dataset = load(tmp_path, document, **tables)
    assert [recording.name for recording in dataset.recordings] == ["a", "b", "c"]
    first, *others = dataset.recordings
    for recording in others:
        assert_same(recording, first)


def test_integers_of_a_parquet_file_are_numbers(tmp_path):
    columns = {"time": [0, 1, 2], "q1": [1, 2, 3], "q2": [0, 0, 1], "u2": [5, 6, 7]}
    dataset = load(tmp_path, described(recordings__patterns=["*.parquet"]), a_parquet=columns)
    assert_array_equal(dataset.recordings[0].torque.value[:, 1], [5.0, 6.0, 7.0])


@pytest.mark.parametrize(
    "quantity, unit", [(key, unit) for key, units in UNITS.items() for unit in units]
)
def test_every_unit_describes_the_same_motion(tmp_path, quantity, unit):
    columns, scale = motion(), UNITS[quantity][unit]
    names = {"time": ["time"], "angle": ["q1", "q2"], "velocity": ["w1", "w2"], "torque": ["u2"]}
    in_unit = columns | {name: columns[name] / scale for name in names[quantity]}
    document = described(columns__velocity=["w1", "w2"], mechanism__parameters={})
    reference = load_single(tmp_path, document, a_csv=columns)
    document["units"] = {quantity: unit}
    if unit in CURRENTS:
        document["motor"] = {"kt": 1.0}
    slides = unit_inertia(("m", "m")) if unit in ("m", "mm", "m/s", "mm/s", "N") else None
    written = write(tmp_path, document, a_csv=in_unit)
    recording = load_dataset(written, mechanism=slides).recordings[0]
    assert_same(recording, reference, rtol=1e-12, atol=1e-15)


def test_units_are_what_they_are_called(tmp_path):
    columns = motion() | {"q1": np.full(9, 180.0), "u2": np.full(9, 250.0), "w1": np.full(9, 60.0)}
    units = {"angle": "deg", "torque": "mN m", "velocity": "rpm"}
    document = described(units=units, columns__velocity=["w1", "w2"])
    recording = load_single(tmp_path, document, a_csv=columns)
    assert_allclose(recording.angle.value[:, 0], np.pi)
    assert_allclose(recording.torque.value[:, 1], 0.25)
    assert_allclose(recording.velocity.value[:, 0], 2 * np.pi)


def test_without_any_motor_the_torque_is_zero_on_the_clock_of_the_angles(tmp_path):
    document = described(
        columns__torque=["", ""], columns__time={"angle": "time", "torque": "there_is_none"}
    )
    recording = load_single(tmp_path, document)
    assert_array_equal(recording.torque.time, recording.angle.time)
    assert_array_equal(recording.torque.value, 0.0)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_two_clocks_stand_in_one_table(tmp_path, ending):
    """Seven samples of the camera beside ten of the drive; empty cells fill the shorter ones."""
    camera, drive = motion(7, seed=1), motion(10, seed=2)
    columns = {"t_camera": camera["time"], "q1": camera["q1"], "q2": camera["q2"]}
    columns = {name: [*column, None, None, None] for name, column in columns.items()}
    columns |= {"t_drive": drive["time"], "u2": drive["u2"]}
    content = csv_bytes(columns) if ending == "csv" else parquet_bytes(columns)
    document = described(
        columns__time={"angle": "t_camera", "torque": "t_drive"},
        recordings__patterns=[f"*.{ending}"],
    )
    recording = load_single(tmp_path, document, **{f"a_{ending}": content})
    assert_array_equal(recording.angle.time, camera["time"])
    assert_array_equal(recording.angle.value[:, 1], camera["q2"])
    assert_array_equal(recording.torque.time, drive["time"])
    assert_array_equal(recording.torque.value[:, 1], drive["u2"])


def test_velocity_truth_and_covariates_are_read_where_they_are_named(tmp_path):
    columns = motion()
    recording = load_single(tmp_path, described(**OTHERS, sigma={"angle": 0.1}))
    assert_array_equal(recording.velocity.value[:, 0], columns["w1"])
    assert_array_equal(recording.truth.angle.value[:, 0], columns["q2"])
    assert_array_equal(recording.truth.velocity.value[:, 1], columns["w1"])
    assert recording.truth.angle.sigma is None
    assert_array_equal(recording.covariates["temperature"].value[:, 0], columns["temp"])


def test_a_file_is_read_once_and_keeps_its_own_parameters(tmp_path):
    document = described(
        recordings__patterns=["b*.csv", "*.csv"], recordings__parameters={"b.csv": {"m4": 0}}
    )
    dataset = load(tmp_path, document, b_csv=motion(), a_csv=motion(5))
    parameters = {recording.name: dict(recording.parameters) for recording in dataset.recordings}
    assert list(parameters) == ["a", "b"] and parameters == {"a": {}, "b": {"m4": 0.0}}


def test_tables_in_folders_keep_the_folder_in_their_name(tmp_path):
    (tmp_path / "monday").mkdir()
    (tmp_path / "monday/01.csv").write_bytes(csv_bytes(motion()))
    dataset = load(tmp_path, described(recordings__patterns=["*/*.csv"]))
    assert dataset.recordings[0].name == "monday/01"
    assert set(dataset.hashes) == {"monday/01.csv"}


def test_blanks_in_header_and_cells_and_blank_lines_do_no_harm(tmp_path):
    plain = b"time,q1,q2,u2\n0.0,1,2,3\n0.1,4,5,6\n"
    blanks = b"\xef\xbb\xbftime, q1 ,q2,u2\r\n\r\n0.0, 1,2 ,3\r\n0.1,4,5, 6\r\n\r\n"
    assert_same(load_single(tmp_path, a_csv=plain), load_single(tmp_path, a_csv=blanks))


# --- Spans ---------------------------------------------------------------------------------------


def test_start_and_stop_count_from_the_first_sample(tmp_path):
    columns = motion(40)
    begin = columns["time"][0]
    recording = load_single(
        tmp_path, described(recordings__start=0.1, recordings__stop=0.3), a_csv=columns
    )
    inside = (columns["time"] >= begin + 0.1) & (columns["time"] <= begin + 0.3)
    assert 2 < inside.sum() < 40
    for signal in (recording.angle, recording.torque):
        assert_array_equal(signal.time, columns["time"][inside])


@pytest.mark.parametrize("hold", ["linear", "previous"])
def test_a_span_does_not_change_the_torque_inside_it(tmp_path, hold):
    """The slow clock of the torque has no sample at the ends of the span."""
    time = np.linspace(0.0, 1.0, 41)
    columns = {"t": time, "q1": np.sin(time), "q2": np.cos(time)}
    columns |= {"t_drive": np.linspace(0.0, 2.0, 41), "u2": time**2}
    document = described(columns__time={"angle": "t", "torque": "t_drive"}, hold={"torque": hold})
    whole = load_single(tmp_path, document, a_csv=columns)
    document["recordings"] |= {"start": 0.33, "stop": 0.71}
    part = load_single(tmp_path, document, a_csv=columns)
    assert len(part.torque.time) < len(whole.torque.time)
    inside = np.linspace(part.angle.time[0], part.angle.time[-1], 100)
    assert_allclose(sample(part.torque, inside), sample(whole.torque, inside))


def test_a_span_cuts_velocity_truth_and_covariates_alike(tmp_path):
    recording = load_single(tmp_path, described(**OTHERS, recordings__stop=0.05))
    truth, others = recording.truth, (recording.velocity, recording.covariates["temperature"])
    for signal in (*others, truth.angle, truth.velocity):
        assert_array_equal(signal.time, recording.angle.time)


# --- Where the tables are ------------------------------------------------------------------------


def test_a_collection_is_found_by_folder_and_by_variable(tmp_path, monkeypatch):
    described_in, tables = tmp_path / "here", tmp_path / "there/arms"
    described_in.mkdir()
    tables.mkdir(parents=True)
    (tables / "a.csv").write_bytes(csv_bytes(motion()))
    (described_in / "dataset.toml").write_text(tomli_w.dumps(described(collection="arms")))
    monkeypatch.delenv("FRICTIONID_DATA", raising=False)
    with assert_refused("'arms'.*--data FOLDER.*FRICTIONID_DATA"):
        load_dataset(described_in)
    by_folder = load_dataset(described_in, data=tables)
    monkeypatch.setenv("FRICTIONID_DATA", str(tmp_path / "there"))
    assert load_dataset(described_in).hashes == by_folder.hashes
    monkeypatch.setenv("FRICTIONID_DATA", str(tmp_path / "elsewhere"))
    with assert_refused("elsewhere.arms, does not exist"):
        load_dataset(described_in)


def test_a_hash_is_compared_and_both_are_printed(tmp_path):
    content = csv_bytes(motion())
    found, other = (hashlib.sha256(text).hexdigest() for text in (content, b""))
    assert (
        load(tmp_path, described(sha256={"a.csv": found}), a_csv=content).hashes["a.csv"] == found
    )
    with assert_refused(rf"a\.csv.*{found}.*{other}"):
        load(tmp_path, described(sha256={"a.csv": other}), a_csv=content)


def test_the_readmes_description_is_valid():
    """Only the layout: its tables are nowhere."""
    _, _, rest = (ROOT / "data/README.md").read_text().partition("```toml\n")
    text, end, _ = rest.partition("```")
    assert end
    assert len(check_dataset_toml(tomllib.loads(text), "README").columns.clocks) == 1


# --- Objects made without files ------------------------------------------------------------------


def still(samples=5, joints=2, **parts):
    return Signal(np.arange(float(samples)), np.zeros((samples, joints)))._replace(**parts)


def late(signal):
    return signal._replace(time=signal.time + 1e6)


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"angle": still(time=np.arange(4.0))}, r"shape \(T,\).*\(4,\) and \(5, 2\)"),
        ({"torque": still(value=np.zeros(5))}, r"torque: time must have shape"),
        ({"angle": still(0)}, "T, n > 0"),
        ({"torque": still(value=np.full((5, 2), np.nan))}, "torque, sample 0"),
        ({"velocity": still(time=np.zeros(5))}, "velocity, sample 1.*must increase"),
        ({"torque": still(hold="next")}, "torque: hold must be"),
        ({"torque": still(joints=1)}, "torque has 1 columns and angle has 2"),
        ({"truth": TrueMotion(still(), still(joints=3))}, "true velocity has 3 columns"),
        ({"covariates": {"temp": still(hold="?")}}, "covariate 'temp': hold"),
        ({"angle": still(sigma=np.zeros(2))}, "sigma must be positive"),
        ({"angle": still(sigma=1.0 - np.eye(5, 2, k=-3))}, "sample 3 .*sigma must be"),
        ({"angle": still(sigma=np.ones(3))}, r"shape \(5, 2\), not \(3,\)"),
        ({"parameters": {"m4": np.inf}}, "parameter 'm4' must be finite, not inf"),
        ({"torque": late(still())}, "share no moment"),
        ({"angle": late(still()), "torque": still(hold="linear")}, "share no moment"),
        ({"angle": still(1), "torque": still(1)}, "at least 2 samples"),
    ],
)
def test_an_impossible_recording_cannot_be_made(changes, words):
    with assert_refused(words) as caught:
        Recording(**({"name": "push", "angle": still(), "torque": still()} | changes))
    assert "'push'" in str(caught.value)


def test_a_held_torque_may_end_before_the_angles_begin():
    command = Signal(np.zeros(1), np.ones((1, 2)), "previous")
    recording = Recording("push", late(still()), command)
    assert recording.torque is command


def test_a_data_set_needs_recordings_of_one_mechanism():
    one = Recording("one", still(), still())
    with assert_refused("'rig' needs at least one recording"):
        Dataset("rig", {"kind": "pendulum"}, ())
    with assert_refused("two recordings are called 'one'"):
        Dataset("rig", {"kind": "pendulum"}, (one, one))
    other = Recording("other", still(joints=1), still(joints=1))
    with assert_refused("'other' has 1 joints, the first one has 2"):
        Dataset("rig", {"kind": "pendulum"}, (one, other))


def test_a_torque_is_held_where_nothing_is_stated():
    for stated, hold in ((None, "previous"), ("linear", "linear"), ("previous", "previous")):
        recording = Recording("push", still(), still(hold=stated))
        assert recording.torque.hold == hold
        assert not holds(recording.angle)


@pytest.mark.parametrize("span", [slice(0, 70), slice(30, None)])
def test_a_torque_that_ends_early_or_begins_late_is_refused_and_a_silent_one_is_not(span):
    """Nobody knows what the motor did there; a motor that did nothing at all did nothing there."""
    time = 5.0 + np.arange(100) * 0.01
    angle = Signal(time, np.sin(time)[:, None])
    push = Signal(time[span], np.cos(9 * time[span])[:, None], "previous")
    with assert_refused("the angles from 0 to 0.99 s: keep the common span by start and stop"):
        Recording("cut", angle, push)
    Recording("idle", angle, push._replace(value=0 * push.value))
    Recording("almost", angle, Signal(time[2:-3], np.cos(time[2:-3])[:, None]))
