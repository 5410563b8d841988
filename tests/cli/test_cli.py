"""The command line: light to start, honest in its exit codes, and each command end to end."""

import json
import re
import subprocess
import sys
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.paths import ROOT
from fixtures.refusals import assert_one_line
from fixtures.shared import shared
from fixtures.tiny_pendulums import FEW, RATE, TRUTH, compare_into, write_dataset, write_suite
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.comparison.result_folder import lock
from frictionid.comparison.results import COLUMNS
from frictionid.comparison.suite import identifier_named
from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.evaluation import Protocol, prepare, score_model
from frictionid.files import read_json
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY, checked_fit, training_problem
from frictionid.friction.model_files import load_model

COMMANDS = ("compare", "fit", "evaluate", "report", "simulate")


@shared
def place(shared_path):
    """A folder with the data set `tiny` and two models of it."""
    write_dataset(shared_path / "tiny", changes=FEW)
    return shared_path


@pytest.fixture
def call(place, run):
    """Call the command line in the folder; gives exit code, output and complaint."""
    return partial(run, place)


# --- Help ----------------------------------------------------------------------------------------

LIGHT = """
import sys
from frictionid.__main__ import main
for command in ([], ["compare"], ["fit"], ["evaluate"], ["report"], ["simulate"]):
    sys.argv = ["frictionid", *command, "--help"]
    assert main() == 0, command
sys.argv = ["frictionid", "--version"]
assert main() == 0
heavy = {"numpy", "scipy", "sympy", "pandas", "torch", "joblib", "matplotlib", "sklearn"}
heavy |= {"pyarrow", "pysindy", "cv2"}
print("heavy:", sorted(heavy & set(sys.modules)))
import frictionid.report
assert "matplotlib" not in sys.modules
"""


def test_help_of_everything_imports_nothing_heavy():
    found = subprocess.run(
        [sys.executable, "-c", LIGHT], capture_output=True, text=True, check=True
    )
    assert found.stdout.endswith("heavy: []\n")
    for command in COMMANDS:
        assert f"frictionid {command}" in found.stdout
    assert found.stderr == ""


def test_without_a_command_the_help_is_shown(call):
    code, out, err = call()
    assert code == 0 and err == ""
    assert all(command in out for command in (*COMMANDS, "--install-completion"))
    assert call("--help") == (code, out, err)


def test_the_version_is_that_of_the_package(call):
    assert call("--version") == (0, f"frictionid {version('frictionid')}\n", "")


# --- fit, then evaluate --------------------------------------------------------------------------


def assert_scores(table, friction, data, **protocol):
    """Check a table against the scores of a model."""
    scores, *_ = score_model(friction, prepare(data, Protocol(horizons=(0.1, 0.3), **protocol)))
    table = table[~table["score"].str.startswith("torque_left_")]  # of no model
    assert_allclose(table["value"], scores["value"], rtol=1e-8)
    assert table["score"].tolist() == scores["score"].tolist()


def test_what_fit_writes_is_what_evaluate_reads(place, call):
    code, out, err = call("fit tiny --identifier stribeck --by one_step --out models/fitted.json")
    assert (code, err) == (0, "")
    assert "stribeck, one-step fit" in out and "N m s/rad" in out
    assert out.endswith("written to models/fitted.json\n")
    data = load_dataset(place / "tiny")
    # the rows of a comparison, so that both find the same model in all data
    problem = training_problem(data, plant_of(data), INTEGRAL, history=Protocol.history)
    weights = np.ones((1, len(problem.r)))
    expected = checked_fit(identifier_named("stribeck", {}), problem, weights, 0)
    found = load_model(place / "models/fitted.json")
    assert_array_equal(found.theta, expected.theta[0])
    source = json.loads((place / "models/fitted.json").read_text())["provenance"]
    assert source["dataset"] == "tiny" and source["data"] == dict(data.hashes)
    assert source["seed"] == 0 and "integral" in source["recipe"]

    code, out, err = call("evaluate models/fitted.json tiny --horizons 0.3,0.1 --out scores.csv")
    assert (code, err) == (0, "") and out.endswith("written to scores.csv\n")
    table = pd.read_csv(place / "scores.csv", dtype={"fold": str, "joint": str})
    assert tuple(table.columns) == COLUMNS
    assert set(table["fold"]) == {"all"} and set(table["fit"]) == {"given"}
    assert set(table["identifier"]) == {"fitted"} and set(table["dataset"]) == {"tiny"}
    assert_scores(table, found, data)
    tables = len(data.hashes)
    assert f"fitted was fitted to {tables} of the {tables} files of 'tiny'" in " ".join(out.split())
    assert "states of a kinematic filter" in out

    code, out, _ = call(
        "evaluate models/fitted.json tiny --horizons 0.3,0.1 --initial-states model --out model.csv"
    )
    assert code == 0 and "states that each model estimates" in out
    assert_scores(pd.read_csv(place / "model.csv"), found, data, initial_states="model")


def test_settings_of_fit_reach_the_identifier_and_the_recipe(place, call):
    code, out, _ = call(
        "fit tiny --identifier stribeck --out other.json --recipe study --seed 3",
        *("--set", "symmetric=false", "--set", "width = 0.05", "--set", "shape=arctan"),
        *("--sample-time", 2 / RATE),
    )
    assert code == 0 and "stribeck, one-step fit to 'tiny'" in out
    model = json.loads((place / "other.json").read_text())
    source = model["provenance"]
    assert source["seed"] == 3 and source["sample_time"] == 2 / RATE
    assert source["recipe"] == repr(STUDY)
    settings = {"width": 0.05, "shape": "arctan", "symmetric": False}
    assert model["law"] == {"kind": "stribeck", **settings}


def test_a_model_with_a_law_of_ones_own_is_evaluated_with_its_class(place, call):
    text = (ROOT / "comparisons/own_friction.py").read_text(encoding="utf-8")
    (place / "my_friction.py").write_text(text, encoding="utf-8")
    call("fit tiny --identifier my_friction:quadratic --by one_step --out own.json")
    call("fit tiny --identifier quadratic --by one_step --out built_in.json")
    assert read_json(place / "own.json")["law"] == {"kind": "Quadratic", "width": 0.02}
    evaluate = "evaluate own.json built_in.json tiny --horizons 0.3 --replace --out scores.csv"
    assert_one_line(call(evaluate), "law 'Quadratic' is unknown", "--law module:Class")
    said = "'my_friction:quadratic' does not subclass frictionid.friction.Law"
    assert_one_line(call(f"{evaluate} --law my_friction:quadratic"), said)
    code, _, err = call(f"{evaluate} --law my_friction:Quadratic")
    assert (code, err) == (0, "")
    table = pd.read_csv(place / "scores.csv")
    own, built_in = (table[table["identifier"] == name].value for name in ("own", "built_in"))
    assert_allclose(own, built_in, rtol=1e-5)


def test_evaluate_counts_the_parameters_that_compare_counts(place, call):
    """Those that shooting freed beside friction, too."""
    shooting = {"name": "shooting", "by": "shooting", "free": ["friction", "inertia"]}
    shooting |= {"windows": [0.2], "iterations": 3}
    others = changes(
        'horizons = [0.3]; folds.count = 2; identifiers = [{kind = "coulomb_viscous"}]'
    )
    file = write_suite(place, {"recipes": [shooting], **others}, "counted.toml")
    compare_into(file, place / "counted")
    model = "counted/models/tiny--coulomb_viscous--shooting--seed0.json"
    assert call(f"evaluate {model} tiny --horizons 0.3 --out counted.csv")[0] == 0
    compared = pd.read_csv(place / "counted/scores.csv")
    compared = compared[compared["identifier"] == "coulomb_viscous"]
    counts = [
        t.loc[t["score"] == "n_parameters", "value"].tolist()
        for t in (compared, pd.read_csv(place / "counted.csv"))
    ]
    assert counts == [[4.0], [4.0]]  # two of friction, inertia and gravity


def test_report_makes_tables_anew_and_fits_nothing(place, call, monkeypatch):
    from frictionid import report

    made = []
    monkeypatch.setattr(report, "build", lambda results, **_: made.append(results))
    monkeypatch.setattr(report, "show", made.append)
    (place / "empty").mkdir()
    compare_into(write_suite(place, 'identifiers = [{kind = "none"}]'), place / "made")
    words = {"nowhere": "/provenance.json: no such file"}
    for folder in ("nowhere", "tiny", "empty"):
        expected = words.get(folder, " holds no comparison; name a folder that compare wrote")
        assert_one_line(call("report", folder), f"frictionid: {folder}{expected}")
    assert not made and not (place / "nowhere").exists() and not list((place / "empty").iterdir())
    with lock(place / "made"):
        assert_one_line(call("report made"), "another comparison is writing there")
    assert call("report made")[0] == 0
    assert [results.folder for results in made] == [Path("made")] * 2


def test_models_of_one_name_are_distinguished_by_their_folders(place, call):
    for folder in ("a", "b"):
        call("fit tiny --identifier none --out", f"{folder}/model.json")
    assert call("evaluate a/model.json b/model.json tiny --horizons 0.1 --out both.csv")[0] == 0
    assert set(pd.read_csv(place / "both.csv")["identifier"]) == {"a/model.json", "b/model.json"}
    twice = call("evaluate a/model.json a/model.json tiny --out twice.csv")
    assert_one_line(twice, "named twice")
    assert not (place / "twice.csv").exists()


def test_a_model_with_its_own_mechanism_is_evaluated_with_it(place, call):
    columns = {name: {"value": values[0]} for name, values in TRUTH.items() if name != "kind"}
    document = {
        "format": "frictionid model 1",
        "law": {"kind": "stribeck", "symmetric": False},
        "joints": [columns],
    }
    for name, own in (("right", {}), ("heavy", {"mass": 0.4})):
        text = json.dumps({**document, "parameters": own})
        (place / f"{name}.json").write_text(text)
    call("evaluate right.json heavy.json tiny --horizons 0.3 --out own.csv")
    table = pd.read_csv(place / "own.csv")
    table = table[(table["statistic"] == "median") & (table["joint"] == "all")]
    value = table.set_index(["identifier", "score"])["value"]
    for score in ("rollout_angle", "one_step_integral"):
        assert value["heavy", score] > 3 * value["right", score]


def test_tables_elsewhere_are_named_by_data(place, call, tmp_path):
    tables = write_dataset(tmp_path / "tables")
    apart = write_dataset(place / "apart", changes='collection = "pendulums"')
    for table in apart.glob("*.csv"):
        table.unlink()
    for command in (
        "fit apart --identifier none --out apart.json --data",
        "evaluate apart.json apart --out apart.csv --horizons 0.1 --data",
    ):
        assert call(command, tables)[0] == 0


# --- Exit codes ----------------------------------------------------------------------------------

MISUSED = """
compair                        => No such command 'compair'
compare suite.toml --job 2     => No such option: --job
compare                        => Missing argument 'suite'
compare suite.toml --jobs -1   => '--jobs'.*greater than or equal
compare suite.toml --jobs 1.5  => '--jobs'.*integer
fit tiny --seed -1 --identifier none => '--seed'
fit tiny --identifier none     => Missing option '--out'
"""


@mistakes(MISUSED)
def test_misuse_is_one_line_and_exit_code_2(call, wrong, words):
    command = "" if "compair" in wrong else f" {wrong.split()[0]}"
    outcome = call(wrong)
    assert_one_line(outcome, f"(see frictionid{command} --help)")
    assert re.match(f"frictionid: .*{words}", outcome[2])


def test_ctrl_c_while_reading_is_130(place, call, monkeypatch):
    from frictionid.comparison import suite

    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(suite, "load_dataset", stop)
    write_suite(place)
    code, out, err = call("compare suite.toml --out none")
    assert (code, out) == (130, "")
    assert err == "frictionid: interrupted; what is done stays in none: finish it with --resume\n"
    assert not (place / "none").exists()


def test_a_defect_of_the_program_is_not_hidden(call, monkeypatch):
    from frictionid.comparison import suite

    def fail(*_):
        raise RuntimeError("a defect")

    monkeypatch.setattr(suite, "load_suite", fail)
    with pytest.raises(RuntimeError, match="a defect"):
        call("compare suite.toml")


@pytest.mark.parametrize("out", ["tiny/dataset.toml", "tiny/00.csv"])
def test_fit_never_writes_over_its_data(place, call, out):
    before = (place / out).read_bytes()
    for words in ((), ("--replace",)):
        outcome = call("fit tiny --identifier none --out", out, *words)
        assert_one_line(outcome, "belongs to what is read and is not overwritten")
    assert (place / out).read_bytes() == before


def test_a_numerical_width_is_said_to_change_nothing(place, call):
    texts, thetas = [], []
    for width in ("--set width=0.3", "", "--set width=0.01"):
        line = f"fit tiny --identifier coulomb_viscous --by one_step --replace --out w.json {width}"
        texts.append(call(line)[1])
        thetas.append(read_json(place / "w.json")["theta"])
    assert ["changes nothing" in text for text in texts] == [False, False, True]
    assert "width = 0.01 rad/s changes nothing" in texts[2] and thetas[1] == thetas[2]


def test_a_model_is_written_over_with_replace_only(place, call):
    (place / "mine.json").write_text("mine")
    for command in ("fit tiny --identifier none", "evaluate mine.json tiny"):
        assert_one_line(call(f"{command} --out mine.json"), "mine.json")
        assert (place / "mine.json").read_text() == "mine"
    call("fit tiny --identifier none --out mine.json --replace")
    assert read_json(place / "mine.json")["law"]["kind"] == "none"
    outcome = call("fit tiny --identifier none --out mine.safetensors")
    assert_one_line(outcome, "a model file is JSON, .safetensors are weights")
