"""What the report says of learned against textbook friction, and of physics against none."""

from __future__ import annotations

import numpy as np
import pytest
from fixtures import result_folders as made

from frictionid.report import build, write
from frictionid.report.learned_text import learned_findings
from frictionid.report.load import gather
from frictionid.report.text import matter

SIZES = {"made": 1.0, "swingup": 3.0}  # held-out motion, and recordings that no fit has seen
WOBBLE = np.array([-0.002, 0.001, 0.002, -0.001])
HELD, SEEN = "On held-out motion after 0.5 s", "There, after 0.5 s,"


def model(name, kind, rollout, wobble=0.0):
    scored = {
        "made": made.rows(0.1, rollout, noise=wobble * WOBBLE),
        "swingup": [r for r in made.rows(0.1, 3.0 * rollout) if r[0] == "all"],
    }
    task = made.task(name, scored, motions=False)
    task["model"]["law"] = {"kind": kind}
    if kind == "state_mlp":
        task["model"]["mechanism"] = "unit"
        task["curves"] = np.full_like(task["curves"], np.nan)
    return task


def written(folder, *tasks):
    none = made.task("none", {d: made.rows(0.5, 9.0) for d in SIZES}, role="none", motions=False)
    about = {d: made.about(tests=None if d == "made" else "made") for d in SIZES}
    return made.write(folder, [none, *tasks], about)


def told(folder, dataset, *tasks):
    evidence = gather(written(folder, *tasks))
    section = evidence.sections[0]
    return learned_findings(matter(section, dataset, evidence.horizons, evidence.about[dataset]))


TEXTBOOK = model("stribeck", "stribeck", 0.10), model("viscous", "coulomb_viscous", 0.15)
BOX = model("blind", "state_mlp", 0.2)


@pytest.mark.parametrize(("dataset", "where"), [("made", HELD), ("swingup", SEEN)])
@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("beaten", [False, True])
def test_all_four_outcomes_are_said(tmp_path, dataset, where, far, beaten):
    learned = model("mlp", "mlp", 0.109), model("lstm", "lstm", 0.15 if far else 0.05)
    box = BOX if not beaten else model("blind", "state_mlp", 0.12)
    within, against = told(tmp_path, dataset, *TEXTBOOK, *learned, box)
    size = 0.05 * SIZES[dataset]
    assert within.startswith(where) and f"`stribeck` ({size:.2g}" in within.replace("0.050", "0.05")
    if far:
        assert "1 of 2 models with learned friction are within 10 %" in within
        assert "`lstm` (+50 %" in within and within.endswith("is not.") and "`mlp`" not in within
    else:
        assert "every model with learned friction is within 10 %" in within
    assert against.startswith(where) and "`blind`" in against
    if not beaten:
        assert "physics with friction beats every black box" in against
        return
    assert "does not always beat the best black box" in against
    lost = ["`viscous` (+25 %", *(["`lstm` (+25 %"] if far else [])]
    assert f"{4 - len(lost)} of 4 such models do, " in against
    assert all(name in against for name in lost) and "`mlp`" not in against


def test_what_the_folds_cannot_tell_is_said_on_held_out_motion_alone(tmp_path):
    unsure = "not told apart by the folds"
    for wobble, dataset, known in ((0, "made", True), (60, "made", False), (60, "swingup", True)):
        learned = model("mlp", "mlp", 0.12, wobble)
        (within,) = told(tmp_path / f"{wobble}{dataset}", dataset, *TEXTBOOK, learned)
        assert "`mlp` (+20 %" in within and (unsure not in within) == known


def test_models_that_diverge_are_neither_near_nor_better(tmp_path):
    lost = model("mlp", "mlp", float("inf"))
    within, against = told(tmp_path, "swingup", *TEXTBOOK, lost, BOX)
    assert "learned friction, `mlp` (not finite), is not within 10 % of" in within
    assert "2 of 3 such models do, `mlp` (not finite) does not" in against


def test_an_identifier_counts_by_the_recipe_that_suits_it(tmp_path):
    other = model("mlp", "mlp", 0.4)
    other["fit"] = "study"
    (within,) = told(tmp_path, "made", *TEXTBOOK, model("mlp", "mlp", 0.1), other)
    assert "`mlp` (integral), the model with learned friction, is within 10 %" in within


def test_nothing_is_said_without_both_sides(tmp_path):
    assert told(tmp_path / "a", "made", *TEXTBOOK) == []
    assert told(tmp_path / "b", "made", model("mlp", "mlp", 0.1)) == []
    assert len(told(tmp_path / "c", "made", *TEXTBOOK, BOX)) == 1


def test_the_page_says_it_for_both_data_sets(tmp_path, monkeypatch):
    monkeypatch.setattr(write, "_drawn", lambda *_: ())
    written(tmp_path, *TEXTBOOK, model("lstm", "lstm", 0.3), BOX)
    build(tmp_path)
    page = (tmp_path / "summary.md").read_text()
    for where in (HELD, SEEN):
        assert (
            f"{where} the model with learned friction, `lstm` (+200 %), is not within 10 %" in page
        )
        assert f"{where} physics with friction does not always beat" in page
