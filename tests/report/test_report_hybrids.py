"""The main question in the report: families told apart, answers that follow the numbers."""

from __future__ import annotations

import numpy as np
import pytest
from fixtures import result_folders as made

from frictionid.report.figures.curves import friction_curves
from frictionid.report.figures.style import looks
from frictionid.report.hybrid_text import family, question
from frictionid.report.load import gather
from frictionid.report.summary import Part, summary
from frictionid.report.tables import Table
from frictionid.report.warnings_text import loose

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


def asked(folder, hybrid, *, noise=NOISE):
    tasks = [
        model("textbook", "stribeck", 0.04),
        model("learned", "mlp", hybrid, noise=noise),
        model("blind", "state_mlp", 0.2, box=True),
        model("nothing", "none", 0.5, role="none"),
    ]
    about = {name: made.about(tests=None if name == "made" else "made") for name in SIZES}
    made.write(folder, tasks, about)
    evidence = gather(folder)
    return evidence, question(evidence.sections[0], evidence.horizons, evidence.about)


@pytest.mark.parametrize(
    ("hybrid", "answer"),
    [
        (0.01, "beats both"),
        (0.1, "beats the black box, but not physics alone"),
        (0.9, "beats neither"),
    ],
)
def test_the_answer_follows_the_numbers(tmp_path, hybrid, answer):
    _, found = asked(tmp_path, hybrid)
    assert len(found.words) == 2  # one for each data set
    assert all(f": the hybrid {answer}" in sentence for sentence in found.words)
    assert "`learned`" in found.words[0] and "`blind`" in found.words[0]


def test_what_the_folds_cannot_tell_is_said(tmp_path):
    told = "though the folds hardly tell it from"
    _, found = asked(tmp_path / "alike", 0.0399)
    assert told not in found.words[0]  # all folds have the same noise
    _, found = asked(tmp_path / "apart", 0.0399, noise=-NOISE)
    assert f"{told} physics alone" in found.words[0]
    assert told not in found.words[1]  # data that only test have no folds
    _, found = asked(tmp_path / "nothing", float("nan"))
    assert found.words == ()


def test_each_model_has_its_family(tmp_path):
    evidence, _ = asked(tmp_path, 0.01)
    told = {entry.label: family(entry) for entry in evidence.sections[0].entries}
    assert told == {
        "textbook": "physics",
        "learned": "hybrid",
        "blind": "black box",
        "nothing": "physics",
    }


def test_the_table_has_every_model_and_the_best_of_each_column(tmp_path):
    _, found = asked(tmp_path, 0.01)
    names = [line.cells[1].text for line in found.table.lines]
    assert names == ["nothing", "textbook", "learned", "blind"]
    best = [line.cells[1].text for line in found.table.lines if line.cells[2].best]
    assert best == ["learned"]
    assert len(found.table.columns) == 2 + 4  # two horizons on two data sets


def test_without_a_black_box_nothing_is_asked(tmp_path):
    made.write(tmp_path, [model("textbook", "stribeck", 0.1), model("learned", "mlp", 0.1)])
    evidence = gather(tmp_path)
    assert question(evidence.sections[0], evidence.horizons, evidence.about) is None


def test_the_page_asks_and_answers(tmp_path):
    evidence, found = asked(tmp_path, 0.01)
    empty = Part(Table("", "", (), ()), ())
    page = summary(evidence, {("made", "made"): empty, ("made", "far"): empty})
    assert "### Do hybrids beat physics alone, and models without physics?" in page
    assert all(sentence in page for sentence in found.words)


def test_a_black_box_has_neither_a_curve_nor_loose_parameters(tmp_path):
    evidence, _ = asked(tmp_path, 0.01)
    section = evidence.sections[0]
    blind = next(entry for entry in section.entries if entry.label == "blind")
    assert loose(blind) == 0 and not np.isfinite(blind.curves).any()
    pictures = friction_curves(section, evidence.about["made"], looks(section.entries))
    shown = [axis.get_title() for axis in pictures[0].axes]
    assert "learned" in shown and "blind" not in shown
