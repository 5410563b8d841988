"""What the report says of learned against textbook friction, and of physics against none."""

from __future__ import annotations

import numpy as np
import pytest
from fixtures import result_folders as made

from frictionid.report.families import families

SIZES = {"made": 1.0, "swingup": 3.0}  # held-out motion, and recordings that no fit has seen
WOBBLE = np.array([-0.002, 0.001, 0.002, -0.001])


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


def found(folder, dataset, *tasks):
    """Findings on the families, on one of the data sets."""
    data = made.section(written(folder, *tasks)).data
    return families(next(own for own in data if own.dataset == dataset))


def excess(exceptions):
    """How much larger the errors of exceptions are than the reference's, by their labels."""
    return {c.model.label: c.value / c.other_value - 1 for c in exceptions.contrasts}


TEXTBOOK = model("stribeck", "stribeck", 0.10), model("viscous", "coulomb_viscous", 0.15)
BOX = model("blind", "state_mlp", 0.2)


@pytest.mark.parametrize("dataset", ["made", "swingup"])
@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("beaten", [False, True])
def test_all_four_outcomes_are_found(tmp_path, dataset, far, beaten):
    learned = model("mlp", "mlp", 0.109), model("lstm", "lstm", 0.15 if far else 0.05)
    box = BOX if not beaten else model("blind", "state_mlp", 0.12)
    own = found(tmp_path, dataset, *TEXTBOOK, *learned, box)
    assert own.learned.reference.label == "stribeck" and own.learned.total == 2
    assert own.learned.error == pytest.approx(0.05 * SIZES[dataset])
    assert excess(own.learned) == pytest.approx({"lstm": 0.5} if far else {})
    lost = {"viscous": 0.25, **({"lstm": 0.25} if far else {})} if beaten else {}
    assert own.beaten.reference.label == "blind" and own.beaten.total == 4
    assert excess(own.beaten) == pytest.approx(lost)


def test_what_the_folds_cannot_tell_is_said_on_held_out_motion_alone(tmp_path, monkeypatch):
    made.undraw(monkeypatch)
    for wobble, clear in ((0, True), (60, False)):
        folder = written(tmp_path / str(wobble), *TEXTBOOK, model("mlp", "mlp", 0.12, wobble))
        said = (made.built(folder) / "summary.md").read_text()
        assert ("`mlp` (+20 %, not clearly: " in said) == (not clear)
        assert ("not: `mlp` (+20 %: " in said) == clear  # with the difference over the folds
        assert said.count("`mlp` (+20 %)") == 1  # without, where there are none


def test_models_that_diverge_are_neither_near_nor_better(tmp_path):
    own = found(tmp_path, "swingup", *TEXTBOOK, model("mlp", "mlp", float("inf")), BOX)
    assert [c.model.label for c in own.learned.contrasts] == ["mlp"]
    assert [c.model.label for c in own.beaten.contrasts] == ["mlp"] and own.beaten.total == 3


def test_an_identifier_counts_by_the_recipe_that_suits_it(tmp_path):
    other = model("mlp", "mlp", 0.4)
    other["fit"] = "study"
    own = found(tmp_path, "made", *TEXTBOOK, model("mlp", "mlp", 0.1), other)
    assert own.learned.total == 1 and not own.learned.contrasts


def test_nothing_is_found_without_both_sides(tmp_path):
    textbook = found(tmp_path / "a", "made", *TEXTBOOK)
    learned = found(tmp_path / "b", "made", model("mlp", "mlp", 0.1))
    assert textbook.learned is textbook.beaten is learned.learned is learned.beaten is None
    both = found(tmp_path / "c", "made", *TEXTBOOK, BOX)
    assert both.learned is None and both.beaten.total == 2


def test_the_page_says_it_for_both_data_sets(tmp_path, monkeypatch):
    made.undraw(monkeypatch)
    folder = made.built(written(tmp_path, *TEXTBOOK, model("lstm", "lstm", 0.3), BOX))
    said = made.findings(folder)
    for where in ("held out", "on swingup"):
        assert (
            f"Learned friction after 0.5 s, {where}: 0 of 1 models within 10 % of the best" in said
        )
        assert f"Physics with friction after 0.5 s, {where}: 2 of 3 models better than" in said
    assert said.count("not: lstm (+200 %)") == 1 and said.count("not: lstm (+200 %: 0.") == 1
