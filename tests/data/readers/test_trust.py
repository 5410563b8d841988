"""Data sets from others are data: what they name runs only where the user trusts them."""

import sys

import numpy as np
import pytest
import tomli_w
from fixtures.dataset_files import csv_bytes, described
from fixtures.mistakes import changes, mistakes
from fixtures.own_reader import read_by
from fixtures.refusals import assert_one_line, assert_refused

from frictionid.data.readers import dataset
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.formats.bam import read as read_bam
from frictionid.mechanics import pendulum

EVIL = """
from pathlib import Path

Path(__file__).with_name("imported").touch()

def read(path, settings):
    Path(__file__).with_name("run").touch()
"""
KINDS = ("evil:read", "runpy:run_path", "joblib:load", "subprocess:Popen", "os:system")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("line", ["check .", "fit . --identifier none --out m"])
def test_a_data_set_runs_no_code(tmp_path, kind, line, run):
    (tmp_path / "evil.py").write_text(EVIL)
    with assert_refused("is code, which runs with your rights"):
        read_by(tmp_path, {"kind": kind}, trust=False)
    before = {path.name for path in tmp_path.iterdir()}
    assert_one_line(run(tmp_path, line), f"{kind!r} is code", "give --trust")
    assert {path.name for path in tmp_path.iterdir()} == before
    assert "evil" not in sys.modules


def test_a_reader_that_is_trusted_runs(tmp_path, run):
    read_by(tmp_path, {"kind": "my_readers:read", "scale": 0.01, "rate": 10.0})
    code, _, err = run(tmp_path, "check . --trust")
    assert "is code" not in err and code in (0, 1, 2)


def test_an_installed_package_offers_readers_by_name(tmp_path, monkeypatch):
    class Point:
        name = "mylab"

        def load(self):
            return read_bam

    monkeypatch.setattr(dataset, "entry_points", lambda **_: [Point()])
    assert dataset.reader_of("bam", tmp_path) is read_bam
    with assert_refused(r"the reader 'mylab' failed|a\.log"):
        read_by(tmp_path, {"kind": "mylab"}, trust=False)


OWN = """
from pathlib import Path

from frictionid.mechanics import pendulum

Path(__file__).with_name("imported").touch()

def heavy(driven=True):
    return pendulum(driven, mass=3.0, length=0.5)

def broken():
    raise RuntimeError("no such machine")

number = 3
"""


def write_own(folder, kind, **options):
    (folder / "own_arm.py").write_text(OWN)
    sys.modules.pop("own_arm", None)
    time = np.linspace(0.0, 1.0, 21)
    table = {"time": time, "q1": np.cos(3 * time), "u1": np.sin(time)}
    (folder / "a.csv").write_bytes(csv_bytes(table))
    document = described(mechanism={"kind": kind, "parameters": {"length": 0.25}, **options})
    document["columns"] = {"time": "time", "angle": "q1", "torque": "u1"}
    (folder / "dataset.toml").write_text(tomli_w.dumps(document))
    return folder


@pytest.mark.parametrize("kind", ["own_arm:heavy", "subprocess:Popen"])
def test_a_mechanism_of_a_data_set_runs_only_where_it_is_trusted(tmp_path, kind):
    with assert_refused(r"dataset\.toml: .*is code, .*give --trust"):
        load_dataset(write_own(tmp_path, kind))
    assert not (tmp_path / "imported").exists()


def test_a_trusted_mechanism_has_the_options_and_parameters_of_its_table(tmp_path):
    data = load_dataset(write_own(tmp_path, "own_arm:heavy", driven=False), trust=True)
    assert data.mechanism.nominal() == pendulum(mass=3.0, length=0.25).nominal()
    assert data.mechanism.driven == (False,)
    assert data.mechanism.table == {
        "kind": "own_arm:heavy",
        "driven": False,
        "parameters": {"mass": 3.0, "length": 0.25},
    }


def test_a_mechanism_may_be_given_in_place_of_the_one_that_is_named(tmp_path):
    own = pendulum(mass=2.0, length=1.0)
    data = load_dataset(write_own(tmp_path, "own_arm:heavy"), mechanism=own)
    assert data.mechanism == pendulum(mass=2.0, length=0.25)
    assert not (tmp_path / "imported").exists()


MISTAKES = """
kind = "own_arm:broken" => 'own_arm:broken' failed, RuntimeError: no such machine
kind = "own_arm:number" => 'own_arm:number' is no function that gives a mechanism
kind = "own_arm:Path" => 'own_arm:Path' must give a mechanism, not a
kind = "own_arm:heavy"; drivn = true => no option 'drivn'; did you mean 'driven'
kind = "own_arm:lost" => 'own_arm:lost' cannot be imported
"""


@mistakes(MISTAKES)
def test_a_mechanism_of_ones_own_that_does_not_work_is_one_line(tmp_path, wrong, words):
    with assert_refused(words) as caught:
        load_dataset(write_own(tmp_path, **changes(wrong)), trust=True)
    assert "dataset.toml" in str(caught.value)
