"""Physical checks: what fails is named in tables, in verdict.json and as a doubt."""

import json

import numpy as np
import pytest
from fixtures import result_folders as made

from frictionid.report.model_tables import (
    marked,
    parameter_numbers,
    parameter_table,
    verdict_numbers,
    verdict_table,
)
from frictionid.report.summary_table import summary_of, summary_table
from frictionid.report.tables import latex
from frictionid.report.verdict import verdict_json, verdict_of

GRID = made.about()["velocity"]


def task(name, error, *, size=4, turned=False, energy=None, loops=None, **changes):
    """A model, of which friction may drive the motion at high speeds."""
    document = made.task(name, 0.3, error, noise=[0.001, -0.001, 0.002, -0.002], **changes)
    scored = document["rows"]["made"]
    scored[-1][5] = float(size)
    if energy:
        values = {**dict(zip("0123", energy, strict=True)), "all": float(np.mean(energy))}
        ratio = ("dissipated_energy", "ratio", None, "all")
        scored += [[fold, *ratio, value, "1"] for fold, value in values.items()]
    if turned:
        curves = np.where(np.abs(GRID) > 3.0, -1.0, 1.0) * np.asarray(document["curves"])
        document["curves"] = curves
    return document | {"loops": loops or []}


def outcome(verdict, model, check):
    """Outcome of a check of a model."""
    return {c.name: c.outcome for c in verdict.candidate(model).checks}[check]


def test_friction_that_drives_the_motion_is_named_everywhere(tmp_path):
    own = made.section(tmp_path, [task("odd", 0.2, turned=True), task("good", 0.4)])
    verdict = verdict_of(own)
    assert outcome(verdict, "odd", "dissipation") == "failed"
    assert outcome(verdict, "good", "dissipation") == "passed"
    (cells,) = [
        [cell.text for cell in line.cells]
        for line in summary_table(summary_of(own.fitted, verdict.failed), "").lines
        if line.cells[0].text == "odd"
    ]
    assert "dissipation" in cells
    assert verdict_numbers(verdict).set_index("model").implausible["odd"] == "dissipation"
    assert "implausible" in [
        c.name for c in verdict_table(verdict, verdict_numbers(verdict)).columns
    ]
    (data,) = json.loads(verdict_json([verdict]))["datasets"]
    wrong = {c["name"]: c["implausible"] for c in data["candidates"]}
    assert wrong["good"] == [] and "drives the motion" in wrong["odd"][0]
    table = marked(parameter_table(own, parameter_numbers(own)), verdict)
    assert {line.cells[0].text for line in table.lines} == {"odd †", "good"}
    assert "† Not plausible" in table.caption and r"$\dagger$" in latex(table)


def test_without_failures_no_table_has_the_column(tmp_path):
    own = made.section(tmp_path, [task("a", 0.2), task("b", 0.4)])
    verdict = verdict_of(own)
    table = summary_table(summary_of(own.fitted, verdict.failed), "")
    assert "implausible" not in [column.name for column in table.columns]


def test_an_implausible_model_is_not_recommended_where_another_is_as_good(tmp_path):
    tasks = [task("odd", 0.2, turned=True), task("good", 0.203, size=9)]
    verdict = verdict_of(made.section(tmp_path, tasks))
    assert verdict.recommended == "good"
    assert "odd would do, but is implausible" in verdict.sentence


def test_an_implausible_model_without_a_rival_is_doubted(tmp_path):
    verdict = verdict_of(made.section(tmp_path, [task("odd", 0.2, turned=True)]))
    assert verdict.recommended == "odd"
    assert verdict.main_doubt.startswith("odd is not plausible: it drives the motion")
    assert made.answers(verdict)["dissipative"] == "no"


@pytest.mark.parametrize(
    "energy, expected",
    [
        ([1.01, 0.99, 1.02, 0.98], "passed"),
        ([0.71, 0.69, 0.72, 0.68], "failed"),
        ([0.1, 1.3, 0.2, 1.2], "noted"),  # the folds disagree
        ([0.7, 0.7, 0.7, 0.7], "noted"),  # whose scatter is not known
        (None, "not_evaluated"),
    ],
)
def test_friction_takes_the_energy_that_the_motion_implies(tmp_path, energy, expected):
    verdict = verdict_of(made.section(tmp_path, [task("a", 0.2, energy=energy)]))
    assert outcome(verdict, "a", "energy") == expected


def loop(width, joint=0):
    """A loop of the folds and of all data on motion that never reverses, open by a width."""
    phase = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    w = 3.0 + np.sin(phase)
    torque = 0.1 + 0.5 * width * np.sin(2 * phase)[None] + np.zeros((made.FOLDS + 1, 1))
    return {
        "joint": joint,
        "kind": "offset",
        "frequency": 1.0,
        "velocity": w,
        "torque": torque,
        "width": np.full(made.FOLDS + 1, width),
        "lag": np.full(made.FOLDS + 1, np.nan),
    }


@pytest.mark.parametrize(
    "width, control, expected, answer",
    [
        (0.05, 0.4, "passed", "yes"),  # the control is practically worse
        (0.05, 0.2, "failed", "no"),  # and here as good
        (0.0005, 0.4, "passed", "no"),  # there is none
    ],
)
def test_hysteresis_counts_against_the_control_without_memory(
    tmp_path, width, control, expected, answer
):
    tasks = [task("keeps", 0.2, loops=[loop(width)], size=9), task("plain", control)]
    verdict = verdict_of(made.section(tmp_path, tasks))
    assert outcome(verdict, "keeps", "hysteresis") == expected
    assert made.answers(verdict)["hysteresis"] == answer


def test_cycles_that_give_energy_fail(tmp_path):
    bad = loop(0.0005)
    bad["torque"] = -np.asarray(bad["torque"])
    verdict = verdict_of(made.section(tmp_path, [task("a", 0.2, loops=[bad]), task("b", 0.4)]))
    assert outcome(verdict, "a", "cycle_work") == "failed"


def test_extrapolation_and_break_away_are_read_from_the_folder(tmp_path):
    own = task("a", 0.2)
    curves = np.asarray(own["curves"])
    own["beyond"] = {
        "velocity": 1.5 * GRID,
        "curves": np.where(np.abs(GRID) > 3.0, -1.0, 1.0) * curves,
        "break_away": np.full((made.FOLDS + 1, 2, 2), -0.1),
    }
    verdict = verdict_of(made.section(tmp_path, [own]))
    assert outcome(verdict, "a", "extrapolation") == "failed"
    assert outcome(verdict, "a", "break_away") == "failed"
    assert outcome(verdict, "a", "dissipation") == "passed"
