"""A result folder loses nothing: neither finished tasks, nor what a user brought or changed."""

import json
import os
import shutil

import pytest
from fixtures.forked import contents
from fixtures.refusals import assert_refused
from fixtures.shared import shared
from fixtures.tiny_pendulums import FEW, QUICK, compare_into, timeless, write_dataset, write_suite

from frictionid.check import check
from frictionid.comparison.results import load_results
from frictionid.data.readers.dataset import load_dataset


@shared
def whole(shared_path):
    """A folder with a suite, and its finished comparison."""
    write_dataset(shared_path / "tiny", changes=FEW)
    file = write_suite(shared_path, QUICK + '; identifiers = [{kind = "none"}]', "lone.toml")
    compare_into(file, shared_path / "out")
    return shared_path


@pytest.fixture
def finished(whole, tmp_path):
    """A suite and the folder of its finished comparison."""
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    return tmp_path / "lone.toml", tmp_path / "out"


def fail(*_):
    raise RuntimeError


def test_what_check_says_of_the_data_stays_with_the_results(whole):
    about = json.loads((whole / "out/datasets.json").read_text())["tiny"]
    found = check(load_dataset(whole / "tiny"))
    assert about["check"]["level"] == found.level
    assert [own["text"] for own in about["check"]["findings"]] == [f.text for f in found.findings]


@pytest.mark.parametrize("resume", [False, True])
def test_a_comparison_that_fails_leaves_the_earlier_result(finished, resume):
    file, out = finished
    (out / "tasks/mine.json").write_text("mine")
    before = contents(out, ".lock")
    other = '; identifiers = [{kind = "coulomb_viscous", name = "new"}]'
    write_suite(file.parent, QUICK + other, file.name)
    with pytest.MonkeyPatch.context() as patch, pytest.raises(RuntimeError):
        patch.setattr("frictionid.comparison.tasks.run", fail)
        compare_into(file, out, resume)
    assert before.items() <= contents(out, ".lock").items()


def test_results_of_another_suite_need_replace(finished):
    file, out = finished
    before = contents(out, ".lock")
    other = write_suite(file.parent, QUICK + '; name = "other"', "other.toml")
    for resume in (False, True):
        with assert_refused("holds the results of suite 'small': choose another"):
            compare_into(other, out, resume)
        assert contents(out, ".lock") == before
    compare_into(other, out, replace=True)
    assert load_results(out).provenance["suite"] == "other"


def test_finished_tasks_of_an_interrupted_comparison_need_resume_or_replace(finished):
    file, out = finished
    new = out / "unfinished"
    shutil.move(out / "tasks", new / "tasks")
    for name in ("provenance.json", "datasets.json"):
        shutil.move(out / name, new / name)
    assert set(load_results(out).scores["identifier"]) == {"none", "truth"}
    before, kept = contents(out, ".lock"), contents(new / "tasks")
    with assert_refused(r"holds 2 finished tasks .* with --resume, or begin anew"):
        compare_into(file, out)
    assert contents(out, ".lock") == before
    compare_into(file, out, resume=True)
    assert not new.exists()
    assert contents(out / "tasks") == kept


def test_a_task_that_was_changed_is_noticed(finished):
    file, out = finished
    path = out / "tasks/tiny--none--integral--seed0.json"
    before = path.read_text()
    document = json.loads(before)
    document["rows"]["tiny"][0][5] *= 0.5
    path.write_text(json.dumps(document))
    with assert_refused(r"seed0\.json: was changed since it was written: make"):
        load_results(out)
    compare_into(file, out, resume=True)
    assert timeless(path.read_text()) == timeless(before)


def test_tasks_behind_a_link_are_left_alone(finished, tmp_path):
    file, out = finished
    shutil.move(out / "tasks", tmp_path / "elsewhere")
    (out / "tasks").symlink_to(tmp_path / "elsewhere")
    before = contents(tmp_path / "elsewhere")
    for resume in (False, True):
        with assert_refused("tasks is a link, which is left alone: remove it"):
            compare_into(file, out, resume, replace=True)
    assert contents(tmp_path / "elsewhere") == before


def test_a_report_that_was_edited_is_noticed_before_anything_is_fitted(finished, monkeypatch):
    file, out = finished
    (out / "scores.csv").write_text("mine")
    monkeypatch.setattr("frictionid.comparison.tasks.run", None)
    with assert_refused(r"scores\.csv was changed"):
        compare_into(file, out)


@pytest.mark.parametrize("after", range(4))
def test_a_kill_while_results_are_moved_into_place_loses_nothing(finished, monkeypatch, after):
    file, out = finished
    moves, real = [], os.replace

    def killed(source, target):
        moves.append(target)
        if "unfinished" in str(source) and "unfinished" not in str(target):
            if len([m for m in moves if "unfinished" not in str(m)]) > after:
                raise KeyboardInterrupt
        real(source, target)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(os, "replace", killed)
        compare_into(file, out)
    assert set(load_results(out).scores["identifier"]) == {"none", "truth"}
    done = contents(out / "tasks") | contents(out / "unfinished/tasks")
    compare_into(file, out, resume=True)
    assert not (out / "unfinished").exists()
    assert contents(out / "tasks") == done
