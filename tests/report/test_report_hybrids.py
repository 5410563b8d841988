"""The main question in the report: families of models, answers that follow the numbers."""

from __future__ import annotations

import numpy as np
import pytest
from fixtures import result_folders as made

from frictionid.report.families import families, family, family_table
from frictionid.report.figures.curves import friction_curves
from frictionid.report.figures.style import styles
from frictionid.report.reliability import loose

NOISE = np.array([-0.002, 0.001, 0.002, -0.001])


def model(name, kind, rollout, *, box=False, role="fitted", noise=NOISE):
    scored = {d: made.rows(0.1, rollout * size, noise=noise) for d, size in SIZES.items()}
    task = made.task(name, scored, role=role)
    task["model"]["law"] = {"kind": kind}
    if box:
        task["model"]["mechanism"] = "unit"
        task["curves"] = np.full_like(task["curves"], np.nan)
    return task


SIZES = {"made": 1.0, "far": 3.0}


def compared(folder, hybrid, *, noise=NOISE):
    """Section of a textbook model, a hybrid, a black box and no friction."""
    tasks = [
        model("textbook", "stribeck", 0.04),
        model("learned", "mlp", hybrid, noise=noise),
        model("blind", "state_mlp", 0.2, box=True),
        model("nothing", "none", 0.5, role="none"),
    ]
    about = {name: made.about(tests=None if name == "made" else "made") for name in SIZES}
    return made.section(made.write(folder, tasks, about))


@pytest.mark.parametrize(
    ("hybrid", "beats"), [(0.01, (True, True)), (0.1, (False, True)), (0.9, (False, False))]
)
def test_the_answer_follows_the_numbers(tmp_path, hybrid, beats):
    section = compared(tmp_path, hybrid)
    assert len(section.data) == 2
    for data in section.data:
        found = families(data)
        over = (found.versus_physics, found.versus_box)
        assert [c.model.label for c in over] == ["learned"] * 2
        assert [c.other.label for c in over] == ["textbook", "blind"]
        assert tuple(c.value < c.other_value for c in over) == beats


def test_what_the_folds_cannot_tell_is_said(tmp_path):
    alike = families(compared(tmp_path / "alike", 0.0399).fitted)
    assert alike.versus_physics.pair.clear  # all folds have the same noise
    apart = compared(tmp_path / "apart", 0.0399, noise=-NOISE)
    assert families(apart.fitted).versus_physics.pair.clear is False
    assert families(apart.fitted).versus_box.pair.clear
    lost = families(compared(tmp_path / "nothing", float("nan")).fitted)
    assert lost.versus_physics is None


def test_each_model_has_its_family(tmp_path):
    assert {model.label: family(model) for model in compared(tmp_path, 0.01).models} == {
        "textbook": "physics",
        "learned": "hybrid",
        "blind": "black box",
        "nothing": "physics",
    }


def test_the_table_has_every_model_and_the_best_of_each_column(tmp_path):
    table = family_table(compared(tmp_path, 0.01))
    names = [line.cells[1].text for line in table.lines]
    assert names == ["nothing", "textbook", "learned", "blind"]
    best = [line.cells[1].text for line in table.lines if line.cells[2].best]
    assert best == ["learned"]
    assert len(table.columns) == 2 + 4  # two horizons on two data sets


def test_without_a_black_box_nothing_is_asked(tmp_path):
    made.write(tmp_path, [model("textbook", "stribeck", 0.1), model("learned", "mlp", 0.1)])
    section = made.section(tmp_path)
    assert family_table(section) is None and families(section.fitted).versus_physics is None


def test_the_page_asks_and_answers(tmp_path, monkeypatch):
    made.undraw(monkeypatch)
    compared(tmp_path, 0.0399, noise=-NOISE)
    page = (made.built(tmp_path) / "summary.md").read_text()
    assert "### Physics, hybrids and black boxes" in page
    answer = "Best hybrid after 0.5 s, held out: `learned`, 0.020 rad. Against the best textbook"
    assert f"{answer} physics, `textbook`, 0.020 rad: not clearly better (" in page
    assert "black box, `blind`, 0.10 rad: clearly better (" in page
    assert "on `far`: `learned`, 0.060 rad. Against the best textbook physics" in page


def test_a_black_box_has_neither_a_curve_nor_loose_parameters(tmp_path):
    section = compared(tmp_path, 0.01)
    blind = next(model for model in section.models if model.label == "blind")
    assert loose(blind) == 0 and not np.isfinite(blind.curves).any()
    pictures = friction_curves(section, styles(section.models))
    shown = [axis.get_title() for axis in pictures[0].axes]
    assert "learned" in shown and "blind" not in shown
