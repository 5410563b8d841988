"""Whatever is wrong with what a user gives: one line, exit code 2, nothing written."""

import json
import re

import numpy as np
import pytest
from fixtures.mistakes import mistakes
from fixtures.shared import shared
from fixtures.tiny_pendulums import write_dataset, write_suite
from hypothesis import given
from hypothesis import strategies as st

from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.friction.model_files import load_model, model_document

MODEL = model_document(
    Friction(CoulombViscous(), [[0.02, 0.001]], {"mass": 0.3}, {"source": "test"})
)
BARE = {**json.loads(json.dumps(MODEL, default=lambda array: array.tolist())), "joints": None}
BARE.pop("joints")


def model(**changes):
    """Text of a model file with changes; None deletes a key."""
    document = {**BARE, **changes}
    return json.dumps({k: v for k, v in document.items() if v is not None})


FILES = {
    "good.json": model(),
    "no_format.json": model(format=None),
    "law_shape.json": model(law={"kind": "coulomb_viscous", "shape": "step"}),
    "other_law.json": model(law={"kind": "stribeck"}),
    "endless.json": model(theta=[[float("inf"), 0.0]]),
    "batch.json": model(theta=[[[0.1, 0.2]], [[0.1, 0.2]]], shape=[2, 1, 2]),
    "joints.json": model(theta=[[0.1, 0.2], [0.1, 0.2]], shape=[2, 2]),
    "parameter.json": model(parameters={"m4": 0.1}),
    "deep.json": "[" * 100_000,
    "folder.json": None,
}


@shared
def place(shared_path):
    write_dataset(shared_path / "tiny")
    write_dataset(shared_path / "other", name="other")
    write_dataset(shared_path / "away", changes='collection = "pendulums"')
    write_suite(shared_path)
    write_suite(shared_path, "horizons = [9.0]", "long.toml")
    write_suite(shared_path, 'datasets = [{path = "tiny"}, {path = "other"}]', "two.toml")
    write_suite(shared_path, 'datasets.0.path = "away"', "away.toml")
    write_suite(shared_path, 'identifiers.0.kind = "nonn"', "unknown.toml")
    gap = 'folds = {count = 80, kind = "blocks"}; horizons = [0.3]'
    write_suite(shared_path, gap, "blocks.toml")
    for name, text in FILES.items():
        if text is None:
            (shared_path / name).mkdir()
        else:
            (shared_path / name).write_text(text)
    return shared_path


@pytest.fixture
def complaint(place, monkeypatch, run):
    """The line that a call of the command line ends with, which writes nothing."""
    monkeypatch.delenv("FRICTIONID_DATA", raising=False)

    def call(line):
        before = {path: path.stat().st_mtime_ns for path in place.rglob("*")}
        code, out, err = run(place, line)
        assert code == 2 and out == ""
        assert err.startswith("frictionid: ") and err.count("\n") == 1 and "Traceback" not in err
        assert {path: path.stat().st_mtime_ns for path in place.rglob("*")} == before
        return err.removeprefix("frictionid: ").strip()

    return call


# --- Suites --------------------------------------------------------------------------------------

SUITES = r"""
tiny                        => tiny is a folder without suite\.toml; name a suite
tiny/dataset.toml           => describes a data set; name a suite
good.json                   => good\.json is no TOML
unknown.toml                => unknown\.toml: identifier 'nonn': .*mean 'none'\?
long.toml                   => no recording holds 9\.15 s .*: choose other horizons
blocks.toml                 => no fold holds out 0\.3 s .*shorter horizons or fewer
two.toml --data .           => --data names the folder of one.*FRICTIONID_DATA
away.toml                   => --data FOLDER, or set FRICTIONID_DATA
away.toml --data nowhere    => nowhere, does not exist
suite.toml --out tiny       => tiny: holds no comparison but '00.csv'
suite.toml --out good.json  => good\.json: cannot be written \(
suite.toml --out good.json/x => cannot be written .*--out
suite.toml --out /proc/x    => /proc/x: cannot be written \(
"""


@mistakes(SUITES)
def test_compare(complaint, wrong, words):
    assert re.search(words, complaint(f"compare {wrong}"))


def test_a_suite_is_no_data_set_and_a_data_set_no_result(complaint):
    assert "suite.toml is a suite; name a data set" in complaint("quick suite.toml")
    assert "tiny holds no comparison" in complaint("report tiny")


def test_compare_finds_nothing_where_the_collections_are(complaint, place, monkeypatch):
    monkeypatch.setenv("FRICTIONID_DATA", str(place / "nowhere"))
    assert "nowhere/pendulums, does not exist" in complaint("compare away.toml")


# --- Models --------------------------------------------------------------------------------------

MODELS = r"""
no_format.json => is no model file, "format" must be "frictionid model 1"
law_shape.json => law 'coulomb_viscous': .*'step'
other_law.json => theta must have shape \(\.\.\., joints, 4\).*got \(1, 2\)
endless.json   => theta must be finite
batch.json     => data set 'tiny' has 1 joints, the model's theta has shape \(2, 1, 2\)
joints.json    => data set 'tiny' has 1 joints, the model's theta has shape \(2, 2\)
parameter.json => pendulum has no parameter 'm4'
deep.json      => is no JSON
folder.json    => cannot be read
"""


@mistakes(MODELS)
def test_evaluate_names_the_model_that_is_wrong(complaint, wrong, words):
    line = complaint(f"evaluate good.json {wrong} tiny --horizons 0.1 --out x.csv")
    assert re.match(f"{wrong}: .*{words}", line)


EVALUATE = r"""
tiny --horizons 0.1                 => needs at least one model file and, last, a data set
good.json good.json --horizons 0.1  => TOML .* a model stands before the data
good.json tiny --horizons ''        => --horizons '' must be positive seconds
good.json tiny --horizons 0.1,x     => must be positive seconds with commas
good.json tiny --horizons 0.1,      => must be positive seconds with commas
good.json tiny --horizons -0.1      => horizons\[0\]: .* greater than 0, not -0\.1
good.json tiny --horizons 0         => horizons\[0\]: .* greater than 0, not 0\.0
good.json tiny --horizons nan       => --horizons 'nan' must be positive seconds
good.json tiny --horizons inf       => --horizons 'inf' must be positive seconds
good.json tiny --horizons 0.1,9     => no recording holds .* a rollout of 9 s
good.json tiny --horizons 0.001     => sampled finely enough .* 0\.001 s
good.json tiny --horizons 0.1 --sample-time 0  => sample_time: .* greater than 0, not 0\.0
good.json tiny --horizons 0.1 --sample-time 99 => lower sample_time
"""


@mistakes(EVALUATE)
def test_evaluate(complaint, wrong, words):
    assert re.search(words, complaint(f"evaluate {wrong} --out x.csv"))


@pytest.mark.parametrize("out", ["good.json/x.csv", "tiny", "/proc/x.csv"])
@pytest.mark.parametrize("command", ["evaluate good.json", "fit --identifier none"])
def test_where_nothing_can_be_written(complaint, command, out):
    line = complaint(f"{command} tiny --out {out}")
    words = "tiny is a folder: name a file in it" if out == "tiny" else f"{out}: cannot be written"
    assert line.startswith(words)


# --- Fits ----------------------------------------------------------------------------------------

FIT = r"""
--identifier stribek      => kind = 'stribek' is unknown; did you mean
--identifier ''           => kind = '' is unknown; known: 'none'
--identifier nowhere:Mine => 'nowhere:Mine' is neither in a module beside
--identifier published    => the key 'file' is missing
--identifier published --set file=missing.json => missing\.json: no such file
--identifier published --set file=joints.json  => theta of shape \(2, 2\)
--identifier stribeck --set symmetric       => --set 'symmetric' must be key=value, e.g. --set
--identifier stribeck --set =false          => --set '=false' must be key=value
--identifier stribeck --set symetric=false  => unknown setting 'symetric'; did you mean
--identifier stribeck --set symmetric=no => symmetric: it should be a valid boolean, not 'no'
--identifier stribeck --set symmetric=0     => symmetric: it should be a valid boolean, not 0
--identifier stribeck --set width=0         => width = 0.0 rad/s must be positive
--identifier stribeck --set width=nan       => width: it should be a finite number, not nan
--identifier stribeck --set kind=none       => --set kind: is no setting
--identifier stribeck --recipe integrl      => recipe 'integrl' is unknown; did you mean 'integral'
--identifier stribeck --recipe ''           => recipe '' is unknown; known: 'study', 'integral'
--identifier stribeck --sample-time -1      => sample_time: .* greater than 0, not -1\.0
--identifier stribeck --sample-time 99      => lower sample_time
"""


@mistakes(FIT)
def test_fit(complaint, wrong, words):
    assert re.search(words, complaint(f"fit tiny {wrong} --out x.json"))


@pytest.mark.parametrize("width", ["9" * 5000, "1\ny=2", "[" * 3000])
def test_what_is_no_number(complaint, width):
    line = f"fit tiny --identifier stribeck --out x.json --set 'width={width}'"
    assert "width: it should be a valid number" in complaint(line)


# --- Whatever chance brings ----------------------------------------------------------------------

TEXT = model().encode()


@given(
    where=st.integers(0, len(TEXT)),
    length=st.integers(0, 20),
    instead=st.one_of(st.binary(max_size=4), st.sampled_from([b"null", b"{}", b"[]", b"1e999"])),
)
def test_any_damage_to_a_model_is_taken_or_refused(place, where, length, instead):
    file = place / "damaged.json"
    file.write_bytes(TEXT[:where] + instead + TEXT[where + length :])
    try:
        friction = load_model(file)
    except InputError as error:
        assert str(error).startswith(f"{file}: ")
    else:
        assert np.isfinite(friction.theta).all()
    finally:
        file.unlink()
