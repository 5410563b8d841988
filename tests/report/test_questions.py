"""The main question in the report: families of models, answers that follow the numbers."""

import numpy as np
import pytest
from fixtures import result_folders as made

from frictionid.report.candidates import family, family_table
from frictionid.report.figures.curves import friction_curves
from frictionid.report.figures.style import styles
from frictionid.report.verdict import verdict_of
from frictionid.report.write import loose

NOISE = np.array([-0.002, 0.001, 0.002, -0.001])


def model(name, kind, rollout, *, box=False, role="fitted", noise=NOISE):
    scored = {d: made.rows(0.1, rollout * size, noise=noise) for d, size in SIZES.items()}
    task = made.task(name, scored=scored, role=role)
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
    return made.section(folder, tasks, about)


def answers(section):
    return made.answers(verdict_of(section))


@pytest.mark.parametrize(
    "hybrid, noise, beats",
    [
        (0.01, NOISE, "yes"),
        (0.1, NOISE, "no"),
        (0.9, NOISE, "no"),
        (0.0375, -2 * NOISE, "undecided"),  # the folds cannot tell
    ],
)
def test_the_answer_follows_the_numbers(tmp_path, hybrid, noise, beats):
    found = answers(compared(tmp_path, hybrid, noise=noise))
    assert (found["hybrids"], found["physics"]) == (beats, "yes")


def test_each_model_has_its_family_and_each_column_of_the_table_its_best(tmp_path):
    section = compared(tmp_path, 0.01)
    assert {model.label: family(model) for model in section.models} == {
        "textbook": "physics",
        "learned": "hybrid",
        "blind": "black box",
        "nothing": "physics",
    }
    table = family_table(section)
    names = [line.cells[1].text for line in table.lines]
    assert names == ["nothing", "textbook", "learned", "blind"]
    best = [line.cells[1].text for line in table.lines if line.cells[2].best]
    assert best == ["learned"]
    assert len(table.columns) == 2 + 4  # two horizons on two data sets


def test_without_a_black_box_nothing_is_asked(tmp_path):
    made.write(tmp_path, [model("textbook", "stribeck", 0.1), model("learned", "mlp", 0.1)])
    section = made.section(tmp_path)
    assert family_table(section) is None and answers(section)["physics"] == "not_evaluated"


def test_the_page_asks_and_answers(tmp_path):
    section = compared(tmp_path, 0.0399, noise=-NOISE)
    page = made.words(made.undrawn(tmp_path))
    assert "Physics, hybrids and black boxes" in page
    for question in verdict_of(section).questions:
        assert f"{question.question} {question.answer.replace('_', ' ')} {question.reason}" in page


def test_a_black_box_has_neither_a_curve_nor_loose_parameters(tmp_path):
    section = compared(tmp_path, 0.01)
    blind = next(model for model in section.models if model.label == "blind")
    assert loose(blind) == 0 and not np.isfinite(blind.curves).any()
    pictures = friction_curves(section, styles(section.models))
    shown = [axis.get_title() for axis in pictures[0].axes]
    assert "learned" in shown and "blind" not in shown
