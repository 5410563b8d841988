"""Tasks and their folder: what is done stays, what is stale goes, and any stop can be resumed."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from functools import partial

import pandas as pd
import pytest
from fixtures.forked import contents
from fixtures.mistakes import changes
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.shared import shared
from fixtures.tiny_pendulums import (
    FEW,
    compare_into,
    recordings,
    stamps,
    timeless,
    write_dataset,
    write_suite,
)
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.comparison.results import COLUMNS, load_results, reduction
from frictionid.evaluation import Split, make_folds
from frictionid.outputs import replace_files

SLOW = """
import os
from dataclasses import dataclass
from time import sleep
from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction.laws import CoulombViscous
from frictionid import Identifier

@dataclass(frozen=True)
class Slow(Identifier):
    patient: bool = True
    def fit(self, problem, weights, seed):
        sleep(float(os.environ.get("PATIENCE", 0)) * self.patient)
        return LeastSquares(CoulombViscous()).fit(problem, weights, seed)

@dataclass(frozen=True)
class Counted(Identifier):
    draws: bool
    @property
    def seeded(self):
        return self.draws
    def fit(self, problem, weights, seed):
        with open(os.environ["CALLS"], "a") as file:
            print(seed, file=file)
        return LeastSquares(CoulombViscous()).fit(problem, weights, seed)
"""
SUITE = """
recipes = [{name = "integral"}]
horizons = [0.05, 0.1]
"""
SLOW_ONES = """
identifiers = [{kind = "none"}, {kind = "slow_part:Slow", name = "a", patient = false}, \
{kind = "slow_part:Slow", name = "b"}, \
{kind = "slow_part:Slow", name = "c", patient = false}, {kind = "slow_part:Slow", name = "d"}]
"""


@shared
def place(shared_path):
    """A folder with a suite of slow tasks, and what it gives when nothing interrupts it."""
    (shared_path / "slow_part.py").write_text(SLOW)
    write_dataset(shared_path / "tiny", changes=FEW)
    write_suite(shared_path, SUITE + SLOW_ONES)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [*sys.path, str(shared_path)])
        compare(shared_path / "suite.toml", shared_path / "whole")
        yield shared_path


def compare(file, folder, resume=False, replace=False):
    compare_into(file, folder, resume, replace=replace)
    return stamps(folder)


@pytest.fixture
def command(place, run):
    """What `frictionid compare` into a folder comes to, in this process."""
    return partial(run, place, "compare suite.toml --trust --out")


def started(folder, out, finished):
    """A comparison in a process group of its own, once it has finished some tasks."""
    # a shell's background jobs ignore the interrupt, and what they start inherits that
    call = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from frictionid.__main__ import main; sys.exit(main())"
    )
    words = ["compare", "suite.toml", "--trust", "--jobs", "2", "--out", out]
    process = subprocess.Popen(
        [sys.executable, "-c", call, *words],
        cwd=folder,
        env={**os.environ, "PATIENCE": "30"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 60
    while len(list((folder / out / "unfinished/tasks").glob("[!.]*.json"))) < finished:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return process


def group_is_gone(group):
    """Whether no process of a group is left, after a little patience."""
    for _ in range(60):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


# --- Stopped and resumed -------------------------------------------------------------------------


def test_ctrl_c_ends_at_once_and_resume_finishes_with_the_same_bytes(place, command):
    process = started(place, "stopped", 2)
    # meanwhile nobody else can write there, and the first comparison does not notice
    said = "stopped: another comparison is writing there: wait for it, or choose another --out\n"
    assert_one_line(command("stopped"), f"frictionid: {said}")
    before = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)  # what a terminal does
    out, err = process.communicate(timeout=20)
    assert time.monotonic() - before < 5  # no running task is waited for
    assert process.returncode == 130
    *done, last = err.splitlines()
    assert all(" of 6 done: tiny: " in line for line in done)
    assert last == "frictionid: interrupted; what is done stays in stopped: finish it with --resume"
    assert out == "" and group_is_gone(process.pid)
    done = stamps(place / "stopped/unfinished")
    assert 2 <= len(done) < 6
    after = compare(place / "suite.toml", place / "stopped", resume=True)
    assert_same_results(place / "stopped", place / "whole")
    assert {name: after[name] for name in done} == done  # what was done has not been done again


def test_cancelled_tasks_give_no_warning():
    code = (
        "import time; from frictionid.comparison.processes import side_by_side; "
        "found = side_by_side(time.sleep, [(t,) for t in (0, 0.5, 0.5, 0.5)], 2); "
        "next(found); found.close()"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_killed_comparison_leaves_nothing_behind_and_is_resumed(place):
    process = started(place, "killed", 2)
    done = stamps(place / "killed/unfinished")
    os.kill(process.pid, signal.SIGKILL)  # the workers are not told
    process.communicate(timeout=20)
    assert process.returncode == -signal.SIGKILL
    assert group_is_gone(process.pid)
    # what a kill in the middle of writing leaves, and a file that was damaged since
    half = ".frictionid-ab12cd34.json"
    for part in ("", "tasks", "unfinished/tasks", "../new"):
        (place / "killed" / part).mkdir(exist_ok=True)
        (place / "killed" / part / half).write_text('{"digest": ')
    first = sorted(done)[0]
    (place / "killed/unfinished/tasks" / first).write_text('{"digest": "')
    after = compare(place / "suite.toml", place / "killed", resume=True)
    assert_same_results(place / "killed", place / "whole")
    assert after[first] != done[first]
    assert {n: t for n, t in after.items() if n in done and n != first} == {
        n: t for n, t in done.items() if n != first
    }
    compare(place / "suite.toml", place / "new")  # killed before it had written anything
    for name in ("killed", "new"):
        assert not [path for path in (place / name).rglob(".*") if path.name != ".lock"]


def assert_same_results(folder, other):
    """Equal bytes of everything that is no time, in folders of the same files."""
    names = sorted(str(p.relative_to(other)) for p in other.rglob("*") if p.is_file())
    assert sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()) == names
    for name in ("scores.csv", "provenance.json", "datasets.json"):
        assert (folder / name).read_bytes() == (other / name).read_bytes()
    for path in (other / "models").glob("*.json"):
        assert (folder / "models" / path.name).read_bytes() == path.read_bytes()
    for path in (other / "tasks").glob("*.json"):
        other_text = (folder / "tasks" / path.name).read_text()
        assert timeless(other_text) == timeless(path.read_text())


def test_without_resume_everything_is_made_anew(place):
    file = write_suite(place, SUITE, "quick.toml")
    out = place / "quick"
    runs = []
    for resume in (False, True, False):
        runs.append((compare(file, out, resume), (out / "scores.csv").read_bytes()))
    assert runs[0] == runs[1]
    assert runs[2][1] == runs[0][1]
    assert all(runs[2][0][name] != stamp for name, stamp in runs[0][0].items())


@pytest.mark.parametrize("seeded", [False, True])
def test_unseeded_identifiers_are_fitted_once_for_all_seeds(place, seeded, tmp_path, monkeypatch):
    own = {"kind": "slow_part:Counted", "draws": seeded}
    given = {"horizons": [0.05, 0.1], "seeds": [0, 1, 2], "identifiers": [own]}
    file = write_suite(place, given, "seeds.toml")
    monkeypatch.setenv("CALLS", str(tmp_path / "calls"))
    out = place / f"seeds-{seeded}"
    done = compare(file, out)
    assert sum("Counted" in name for name in done) == 6
    fits = (tmp_path / "calls").read_text().split()
    assert fits == (["0"] * 2 if not seeded else ["0", "1", "2"] * 2)
    table = pd.read_csv(out / "scores.csv")
    assert set(table["seed"]) == {0, 1, 2}


def test_results_of_tasks_that_left_the_suite_stay_and_are_not_reported(place):
    file = write_suite(place, SUITE, "quick.toml")
    out = place / "shrunk"
    compare(file, out)
    before = contents(out / "tasks")
    (out / "models/mine.json").write_text("mine")
    write_suite(place, SUITE + 'identifiers = [{kind = "none"}]; seeds = [1]', "quick.toml")
    wanted = {f"tiny--{name}--integral--seed1.json" for name in ("none", "truth")}
    assert set(compare(file, out, resume=True)) == {*wanted, *before}
    assert before.items() <= contents(out / "tasks").items()
    assert {path.name for path in (out / "models").iterdir()} == {*wanted, "mine.json"}
    assert set(compare(file, out, replace=True)) == wanted | set(before)
    assert set(pd.read_csv(out / "scores.csv")["identifier"]) == {"none", "truth"}


def test_a_data_set_that_changed_is_compared_anew(place):
    other = 'identifiers = [{kind = "none"}]; datasets.0.path = "mine"'
    file = write_suite(place, SUITE + other, "mine.toml")
    write_dataset(place / "mine", changes=FEW)
    first = compare(file, place / "changed")
    toml = place / "mine/dataset.toml"
    toml.write_text(toml.read_text().replace("mass = 0.2", "mass = 0.21"))
    second = compare(file, place / "changed", resume=True)
    assert first.keys() == second.keys()
    assert all(second[name] != first[name] for name in first)


# --- What a folder holds -------------------------------------------------------------------------


def test_scores_have_the_documented_columns_and_one_row_for_each_key(place):
    table = pd.read_csv(place / "whole/scores.csv", dtype={"fold": str, "joint": str})
    assert tuple(table.columns) == COLUMNS
    assert COLUMNS[:11] == tuple(
        "suite dataset identifier fit fold score statistic horizon_s joint value unit".split()
    )
    keys = list(COLUMNS[:9]) + ["seed"]
    assert not table.duplicated(keys).any()
    assert set(table["suite"]) == {"small"} and set(table["dataset"]) == {"tiny"}
    assert set(table["identifier"]) == {"none", "a", "b", "c", "d", "truth"}
    assert set(table["fit"]) == {"integral"} and set(table["fold"]) == {"0", "1", "2", "all"}
    assert set(table["score"]) == {
        *("one_step_euler", "one_step_integral", "rollout_angle", "rollout_angle_truth"),
        *("curve_error", "n_parameters", "effective_parameters", "dissipated_energy"),
        *("torque_left", "torque_left_nominal", "torque_left_noise", "torque_measured"),
    }
    statistics = "mean rms median q90 diverged count ratio share"
    assert set(table["statistic"]) == set(statistics.split())
    assert set(table["horizon_s"].dropna()) == {0.05, 0.1}
    assert set(table["unit"]) == {"rad/s", "rad", "N m", "1"}
    assert table["value"].notna().all()
    # the same numbers as in the tasks' files, to nine digits
    full = load_results(place / "whole").scores
    assert_allclose(table["value"], full["value"], rtol=1e-8)
    # identifiers that differ only in their patience find the same
    parts = [table[table["identifier"] == name]["value"].to_numpy() for name in "abcd"]
    for part in parts[1:]:
        assert_array_equal(part, parts[0])


def test_provenance_is_complete(place):
    document = json.loads((place / "whole/provenance.json").read_text())
    assert document["suite"] == "small"
    assert set(document["versions"]) >= {"python", "frictionid", "numpy", "scipy", "sympy", "torch"}
    hashes = {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in (place / "tiny").glob("0[0-3].csv")
    }
    assert document["data"] == {"tiny": hashes}
    assert document["folds"] == {"tiny": make_folds(recordings()[:4], Split(count=3)).hash}
    settings = document["settings"]
    assert settings["horizons"] == [0.05, 0.1] and settings["every"] == 0.25
    assert settings["folds"] == {"count": 3, "kind": None, "gap": 0.25, "seed": 0}
    assert settings["seeds"] == [0] and settings["recipes"][0]["name"] == "integral"
    given = [{k: v for k, v in e.items() if v is not None} for e in settings["identifiers"]]
    assert given == changes(SLOW_ONES)["identifiers"]
    assert len(document["tasks"]) == 6
    assert {p.name for p in (place / "whole/tasks").iterdir()} == set(document["tasks"])
    for task in load_results(place / "whole").tasks:
        assert "identifier" in task["settings"] and "recipe" in task["settings"]
        assert len(task["digest"]) == 64


def test_models_say_where_they_come_from(place):
    model = json.loads((place / "whole/models/tiny--a--integral--seed0.json").read_text())
    source = model["provenance"]
    assert (source["dataset"], source["identifier"], source["fit"]) == ("tiny", "a", "integral")
    assert "Slow" in source["settings"]["identifier"]
    assert model["joints"][0]["coulomb"]["unit"] == "N m"


def test_timings_stand_apart(place):
    table = pd.read_csv(place / "whole/timings.csv")
    assert list(table.columns) == ["dataset", "identifier", "fit", "seed", "part", "seconds"]
    assert len(table) == 6 * 3 and (table["seconds"] >= 0).all()
    assert set(table["part"]) == {"prepare", "fit", "score"}


def test_tables_show_the_finished_tasks(place, tmp_path):
    for path in [*(place / "whole").rglob("*.json"), place / "whole/SHA256SUMS"]:
        copy = tmp_path / path.relative_to(place / "whole")
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(path.read_bytes())
    (tmp_path / "tasks/tiny--a--integral--seed0.json").unlink()
    (tmp_path / "models/old.json").write_text("{}")
    results = load_results(tmp_path)
    replace_files(tmp_path, reduction(results))
    assert set(results.scores["identifier"]) == {"none", "b", "c", "d", "truth"}
    assert {path.name for path in (tmp_path / "models").iterdir()} == {
        "old.json",  # is not ours
        *(f"tiny--{name}--integral--seed0.json" for name in ("none", "b", "c", "d", "truth")),
    }
    for path in (tmp_path / "tasks").iterdir():
        path.unlink()
    with assert_refused("holds no finished task: run frictionid compare first"):
        load_results(tmp_path)


# --- Folders that are none -----------------------------------------------------------------------


def test_a_folder_with_something_else_in_it_is_left_alone(command, tmp_path):
    (tmp_path / "tasks").mkdir()
    (tmp_path / "tasks/mine.json").write_text("{}")
    assert_one_line(command(tmp_path), "holds no comparison but 'tasks': choose another --out\n")
    assert (tmp_path / "tasks/mine.json").read_text() == "{}"
    assert not (tmp_path / "provenance.json").exists()


@pytest.mark.parametrize("out", ["slow_part.py", "slow_part.py/deeper", "/proc/frictionid"])
def test_a_folder_that_cannot_be_written_is_one_line(command, out):
    words = f"frictionid: {out}: cannot be written (", "choose another --out\n"
    assert_one_line(command(out), *words)
