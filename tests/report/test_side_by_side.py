"""Two results side by side: comparable by their hashes, and what changed is what was changed."""

import json
import shutil

import pytest
from fixtures import result_folders as made
from fixtures.refusals import assert_one_line, assert_refused

from frictionid.api.comparison import load_comparison
from frictionid.comparison.result_folder import write_sealed
from frictionid.comparison.results import load_results
from frictionid.report.side_by_side import Change, side_by_side

NOISE = (0.01, -0.01, 0.02, -0.02)


def written(folder, error=0.2, **changes):
    tasks = [
        made.task("none", 0.5, 0.9, noise=NOISE, role="none"),
        made.task("law", 0.3, error, noise=NOISE),
    ]
    return made.write(folder, tasks, **changes)


def compared(a, b):
    return side_by_side(load_results(a), load_results(b))


def test_a_result_beside_itself_has_not_changed(tmp_path):
    found = compared(written(tmp_path / "a"), written(tmp_path / "b"))
    assert found.comparable
    assert found.settings == found.versions == found.parameters == found.missing == ()
    assert {score.standing for score in found.scores} == {"equivalent"}
    assert all(score.before == score.after for score in found.scores)


@pytest.mark.parametrize("key, other", [("data", {"a.csv": "11"}), ("folds", "11")])
def test_other_hashes_cannot_be_compared_fold_by_fold(tmp_path, key, other):
    found = compared(written(tmp_path / "a"), written(tmp_path / "b", **{key: {"made": other}}))
    assert found.datasets == {"made": {"data": key != "data", "folds": key != "folds"}}
    assert not found.comparable
    assert {score.standing for score in found.scores} == {""}


@pytest.mark.parametrize(
    "error, standing", [(0.1, "better"), (0.204, "equivalent"), (0.4, "worse")]
)
def test_scores_are_judged_by_the_rule_of_the_verdict(tmp_path, error, standing):
    found = compared(written(tmp_path / "a"), written(tmp_path / "b", error))
    own = {(s.model, s.horizon): s for s in found.scores}
    assert own["none", 1.0].standing == "equivalent"
    score = own["law", 1.0]
    assert (score.before, score.after, score.standing) == pytest.approx((0.2, error, standing))


def test_a_task_that_was_changed_is_told_in_one_line(tmp_path, run):
    written(tmp_path / "a")
    file = written(tmp_path / "b") / "tasks/task01.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"curves": [[[0.1, 0.1], [0.1]]]}))
    for arguments in (("a", "b"), ("b", "a"), ("b",)):
        words = "b/tasks/task01.json: was changed since it was written"
        assert_one_line(run(tmp_path, "report", *arguments), words)


def test_what_was_changed_is_named_and_nothing_else(tmp_path):
    a = written(tmp_path / "a")
    settings = {"every": 0.5, "folds": {"count": 4, "kind": "recordings"}}
    b = written(tmp_path / "b", settings=settings, versions={"frictionid": "1"})
    path = b / "tasks/task01.json"
    task = json.loads(path.read_text())
    task["model"]["joints"][1]["coulomb"]["value"] = 0.2
    write_sealed(path, task)
    found = compared(a, b)
    assert found.settings == (Change("every", 0.25, 0.5),)
    assert found.versions == (Change("frictionid", "0", "1"),)
    assert found.parameters == (Change("made, law: coulomb of joint 2 [N m]", 0.1, 0.2),)
    (b / "tasks/task00.json").unlink()
    assert compared(a, b).missing == (Change("made", "none", None),)


def test_results_on_other_data_sets_are_refused_in_one_line(tmp_path):
    a = written(tmp_path / "a")
    task = made.task("law", dataset="else")
    b = made.write(tmp_path / "b", [task])
    with assert_refused(r"no fitted data set in common \(made and else\)"):
        compared(a, b)
    shutil.rmtree(b / "tasks")
    with assert_refused("holds no finished task"):
        load_comparison(a).against(load_comparison(b))


def test_the_command_says_it_and_writes_nothing(tmp_path, run):
    written(tmp_path / "a")
    written(tmp_path / "b", 0.4)
    before = sorted(path for path in tmp_path.rglob("*") if path.suffix != ".lock")
    code, out, _ = run(tmp_path, "report a b")
    assert code == 0 and "made: same data and same folds" in out and "+100.0 %" in out
    code, out, _ = run(tmp_path, "report a b --json")
    assert code == 0 and json.loads(out)["comparable"] is True
    assert sorted(path for path in tmp_path.rglob("*") if path.suffix != ".lock") == before
    for more in (("b", "--replace"), ("nowhere",)):
        assert_one_line(run(tmp_path, "report a", *more))
