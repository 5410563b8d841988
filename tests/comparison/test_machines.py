"""The table of machines: one rule for their suites, and what a row says."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fixtures import tiny_pendulums as tiny

import machines


def test_suites_follow_one_rule():
    few, many = tiny.dataset(recordings=tiny.recordings()[:4]), tiny.dataset()
    files = {"path": "tiny"}
    suites = [machines.suite_of(machines.Machine("tiny"), data, files) for data in (few, many)]
    assert [suite.folds.kind for suite in suites] == ["blocks", "recordings"]
    assert suites[0].document()["recipes"] == suites[1].document()["recipes"]
    kinds = {i.kind: i.recipes for i in suites[1].identifiers}
    assert kinds["motor_load"] is kinds["sindy"] is None and kinds["lstm"] == ["calibrated"]
    arm = machines.suite_of(machines.Machine("tiny", held=True), many, files)
    assert [recipe.name for recipe in arm.recipes] == ["integral", "inverse_dynamics"]


def test_what_tests_a_machine_is_not_fitted(tmp_path, monkeypatch):
    monkeypatch.setattr(machines, "REPORT", tmp_path)
    for machine in machines.MACHINES.values():
        files = machines.datasets(machine)
        paths = [Path(path, "dataset.toml") for path in (files["path"], *files["tests"])]
        fitted, *unseen = (tomllib.loads(path.read_text())["recordings"] for path in paths)
        for test in unseen:
            parts = fitted.get("stop", 0.0) == test.get("start", np.inf)
            assert parts or not {*fitted["patterns"]} & {*test["patterns"]}


def write(folder, chosen, errors):
    """A result folder with errors on one test by (identifier, recipe)."""
    folder.mkdir(parents=True)
    named = [
        {"name": name if name == "none" else f"{name} ({recipe})", "identifier": name}
        for name, recipe in errors
    ]
    verdict = {
        "recommended": chosen,
        "provisional": chosen,
        "questions": [{"name": "beyond_coulomb_viscous", "answer": "cannot_tell"}],
        "candidates": [entry for entry in named if entry["identifier"] != "truth"],
    }
    (folder / "timings.csv").write_text("part,seconds\nfit,4.5\nscore,2.5\n")
    (folder / "verdict.json").write_text(json.dumps({"datasets": [verdict]}))
    rows = [
        ("rig_test", *name, "all", "rollout_angle", "median", 0.5, "all", error)
        for name, error in errors.items()
    ]
    columns = ("dataset", "identifier", "fit", "fold", "score", "statistic", "horizon_s", "joint")
    pd.DataFrame(rows, columns=[*columns, "value"]).to_csv(folder / "scores.csv", index=False)


def test_a_regret_is_over_the_best_fitted_model_on_the_test(tmp_path, monkeypatch):
    monkeypatch.setattr(machines, "REPORT", tmp_path)
    errors = {
        ("stribeck", "shooting"): 0.03,
        ("mlp", "calibrated"): 0.02,
        ("book", "calibrated"): 0.01,
        ("truth", "calibrated"): 0.001,
        ("lstm", "calibrated"): np.inf,
        ("none", "calibrated"): 0.04,
    }
    write(tmp_path / "rig", "stribeck (shooting)", errors)
    (row,) = machines.rows_of(machines.Machine("rig", ("rig_test",), ("book",)))
    assert (row.judged, row.best, row.needs) == ("rig_test", "mlp (calibrated)", "cannot tell")
    assert (row.over, row.regret) == pytest.approx((3.0, 1.5))
    last = machines.table_of([row]).splitlines()
    assert "| 3.00 | mlp (calibrated) | 1.50 | cannot tell | 7 s |" in last[2]
    write(tmp_path / "idle", "none", errors)
    (row,) = machines.rows_of(machines.Machine("idle", ("rig_test",)))
    assert row.chosen == "none" and row.regret == pytest.approx(4.0)
