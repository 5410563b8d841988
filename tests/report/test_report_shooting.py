"""Results of shooting in the report: the document's numbers, and no digits that are not known."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from fixtures import result_folders as made
from fixtures.driven_pendulum import LEVEL, driven_pendulum
from fixtures.shared import shared

from frictionid.comparison.cross_validate import Benchmark
from frictionid.comparison.tasks import Task
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.parameters import DelayBlock, FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import Settings, Shooting, refine
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.friction.laws import Stribeck as StribeckLaw
from frictionid.friction.provenance import Provenance
from frictionid.mechanics import mechanism_of
from frictionid.report import show_refined
from frictionid.report.figures.curves import curve_bands
from frictionid.report.figures.fits import STRONG, fit_correlation
from frictionid.report.figures.style import measured, styles
from frictionid.report.shooting_results import interval_table

PENDULUM = {"kind": "pendulum", "parameters": {"mass": 0.3, "length": 0.2}}
HEAVIER = {"mass": 0.33}
DELAY, COULOMB = 0.01, LEVEL


def late_and_heavy():
    """Recordings of a pendulum that is heavier than its nominal mechanism, its torque late."""
    return driven_pendulum(120, 4, HEAVIER, delay=DELAY)


@shared
def computed(tmp_path_factory):
    """A report of a fit that the library has made, of a law with parameters that the data lack."""
    folder, dataset = tmp_path_factory.mktemp("computed"), late_and_heavy()
    folds = make_folds(dataset.recordings, Split(count=2))
    blocks = (FrictionBlock(), InertiaBlock(), DelayBlock())
    recipe = Shooting(blocks=blocks, settings=Settings(windows=(0.33,), iterations=8))
    benchmark = Benchmark(dataset, folds, Protocol((0.25,)))
    tasks = [Task(benchmark, "stribeck", LeastSquares(StribeckLaw()), recipe, 0)]
    return made.undrawn(made.computed(folder, tasks, 2))


@shared
def numbers(computed):
    return pd.read_csv(computed / "tables/shooting--pendulum--stribeck.csv")


@shared
def document(computed):
    (path,) = (computed / "tasks").glob("*.json")
    return json.loads(path.read_text())["refined"]


def folder_of(tmp_path, refined):
    """A result folder with one fit by shooting."""
    return made.write(tmp_path, [made.task("law", curve=0.1, refined=refined)])


def page(tmp_path, refined):
    """What the page says of such a fit."""
    return made.words(made.blank(folder_of(tmp_path, refined)))


# --- Numbers -----------------------------------------------------------------------------------


def test_numbers_are_those_of_the_fit(numbers, document):
    for line, entry in zip(numbers.to_dict("records"), document["parameters"], strict=True):
        assert entry["name"].startswith(line["parameter"])
        assert line["value"] == pytest.approx(entry["value"], rel=1e-8)
        for level in (90, 95):
            ends = [float(end) for end in entry[f"interval_{level}"]]
            assert [line[f"low_{level}"], line[f"high_{level}"]] == pytest.approx(ends, rel=1e-8)
        assert line["identified"] == entry["identified"]


def test_nominal_and_true_values_stand_beside(numbers):
    mechanism = mechanism_of(PENDULUM)
    nominal, true = (mechanism.base(mechanism.nominal(p)) for p in ({}, HEAVIER))
    inertia = numbers[numbers["block"] == "inertia"]
    assert inertia["nominal"].to_numpy() == pytest.approx(nominal, rel=1e-8)
    assert inertia["true"].to_numpy() == pytest.approx(true, rel=1e-8)
    lines = numbers.set_index("parameter")
    assert lines.loc["torque delay", "true"] == DELAY and lines.loc["torque delay", "nominal"] == 0
    assert lines.loc["coulomb", "true"] == COULOMB and np.isnan(lines.loc["coulomb", "nominal"])
    # without a peak its width is any
    assert lines.loc["peak", "true"] == 0 and np.isnan(lines.loc["stribeck_velocity", "true"])


def test_numbers_of_given_models_stand_beside(computed):
    section = made.section(computed)
    (model,), data = section.models, section.description
    own = {"coulomb": {"value": 0.5, "unit": "N m"}, "other": {"value": 7.0, "unit": "1"}}
    document = {"joints": [own], "parameters": HEAVIER}
    mechanism = mechanism_of(PENDULUM)
    base = mechanism.base(mechanism.nominal(HEAVIER))
    given = replace(
        model,
        label="M1",
        role="given",
        provenance=Provenance(),
        document=document,
        base=dict(zip(mechanism.base_names, map(float, base), strict=True)),
    )
    other = replace(given, label="M2", document={"joints": [{}]}, base={})
    table = interval_table(model, "pendulum", data, [given, other])
    assert [column.name for column in table.columns if column.name.startswith("M")] == ["M1"]
    beside = {line.cells[1].text: line.cells[-1].text for line in table.lines}
    for name, value in zip(mechanism.base_names, base, strict=True):
        assert float(beside[name]) == pytest.approx(value, rel=0.01)
    assert float(beside["coulomb"]) == 0.5
    assert beside["viscous"] == beside["torque delay"] == "–"


def test_the_page_says_what_the_machine_is(computed):
    text = made.words(computed)
    late_by = re.search(r"Torque delay: ([\d.]+) ms \(([\d.]+) to ([\d.]+)\); the .* later", text)
    value, low, high = map(float, late_by.groups())
    assert low <= value <= high and abs(value - 1e3 * DELAY) < 2
    heavier = re.search(r"gravity by \+([\d.]+) %", text)
    assert float(heavier[1]) == pytest.approx(10, abs=2)


def test_the_count_of_covered_truths_is_that_of_the_numbers(computed, numbers):
    known = numbers[numbers["identified"] & numbers["true"].notna()]
    inside = (known["low_95"] <= known["true"]) & (known["true"] <= known["high_95"])
    words = f"hold {inside.sum()} of the {len(known)} that are known"
    assert words in made.words(computed)


def test_all_that_was_fitted_is_counted(computed, numbers):
    table = pd.read_csv(computed / "tables/summary--pendulum.csv")
    long = pd.read_csv(computed / "scores.csv")
    assert table["n_parameters"].item() == len(numbers)
    assert long[long["score"] == "n_parameters"]["value"].item() == len(numbers)


def test_what_is_not_identified_has_no_digits(computed, numbers):
    loose = numbers[~numbers["identified"]]
    assert len(loose)
    for name in ("shooting--pendulum--stribeck", "parameters--pendulum"):
        for kind, mark in (("md", "|"), ("tex", "&")):
            text = (computed / f"tables/{name}.{kind}").read_text().replace("\\_", "_")
            assert "^2" not in text.replace("$^2$", "")
            for line in loose.itertuples():
                (row,) = (x for x in text.splitlines() if f" {line.parameter} {mark}" in x)
                assert any(words in row for words in ("not identified", "at its bound", "held at"))
                digits = re.findall(r"[\d.]+", row.replace(line.parameter, ""))
                assert all(len(d.replace(".", "").lstrip("0")) < 4 for d in digits), row


def test_the_terminal_says_the_same(document, computed, capsys):
    show_refined(made.estimates(document))
    printed = capsys.readouterr().out
    (sentence,) = re.findall(r"Torque delay: .* later than logged\.", printed)
    assert sentence in made.words(computed)
    for entry in document["parameters"]:
        assert entry["name"] in printed


def test_windows_are_told_by_recording_and_time(tmp_path):
    places = [
        {"recording": f"run_{i % 3}", "begin": 0.5 * i, "end": 0.5 * i + 0.3, "size": 1.0 + i}
        for i in range(14)
    ]
    refined = made.shot()
    text = page(tmp_path, {**refined, "left_out": places[:2], "unexplained": places[2:]})
    assert "Windows left out: 2 of 50" in text and "Windows not explained: 12 of 50" in text
    table = pd.read_csv(tmp_path / "tables/windows--made--law.csv")
    assert len(table) == len(places)
    for place in places:
        own = table[(table["recording"] == place["recording"])]
        own = own[np.isclose(own["begin_s"], place["begin"])]
        assert own["residual"].item() == pytest.approx(place["size"])
        row = f"{place['recording']} {place['begin']:.2f} {place['end']:.2f}"
        assert row in text


# --- The page ----------------------------------------------------------------------------------


def test_the_law_that_predicts_best_stands_there_and_others_are_linked(tmp_path):
    refined = made.shot()
    tasks = [
        made.task(name, 0.3, error, curve=0.1, refined=refined)
        for name, error in (("poor", 0.9), ("good", 0.1))
    ]
    made.blank(tmp_path, tasks)
    text = made.words(tmp_path)
    assert "What good identifies" in text and "What poor identifies" not in text
    assert re.search(r"poor: converged after \d+ iterations, 1 of 1 parameters identified", text)
    places = re.findall(r'href="([^"#:]+)"', (tmp_path / "index.html").read_text())
    assert "tables/shooting--made--poor.md" in places
    assert [place for place in places if not (tmp_path / place).exists()] == []


def test_warnings_of_the_fit_itself_are_shown(tmp_path):
    assert "It is made up." in page(tmp_path, made.shot(warnings=["It is made up."]))


# --- Pictures ----------------------------------------------------------------------------------


def test_strong_correlations_have_a_frame_and_all_parameters_a_name(tmp_path):
    names = ["coulomb", "viscous", "peak", "stribeck_velocity"]
    pair = [made.parameter("friction", n, 1.0, 0.1, joint=j) for j in (0, 1) for n in names]
    pair += [made.parameter("inertia", "gravity_1", 1.0, 0.1)]
    rng = np.random.default_rng(3)
    r = np.corrcoef(rng.standard_normal((3, 9)) * rng.uniform(0.2, 1, 9), rowvar=False)
    r[2], r[:, 2] = np.nan, np.nan
    section = made.section(folder_of(tmp_path, made.shot(pair, correlation=r)))
    refined = section.models[0].refined
    axis = fit_correlation(refined, section.description.joints).axes[0]
    framed = sum(patch.get_edgecolor()[:3] != (1, 1, 1) for patch in axis.patches)
    assert framed == (np.abs(np.nan_to_num(r[np.tril_indices(9, -1)])) > STRONG).sum() > 0
    shown = {label.get_text() for label in (*axis.get_xticklabels(), *axis.get_yticklabels())}
    assert shown == {*names, "gravity_1"}
    groups = [text.get_text() for text in axis.texts if "joint" in text.get_text()]
    assert groups == ["friction\njoint 1", "friction\njoint 2"]


def test_many_parameters_have_a_picture_and_a_short_table(tmp_path):
    many = [made.parameter("friction", f"number {k}", 1.0, 0.1, joint=k % 2) for k in range(60)]
    many.sort(key=lambda entry: entry["joint"])
    text = page(tmp_path, made.shot(many))
    assert text.count("30 numbers") == 2
    assert len(pd.read_csv(tmp_path / "tables/shooting--made--law.csv")) == 60
    assert (tmp_path / "figures/correlation--made--law.svg").exists()


@pytest.mark.parametrize("seed", range(5))
def test_what_was_not_measured_is_grey_and_nothing_else(seed):
    rng = np.random.default_rng(seed)
    w = rng.uniform(*np.sort(rng.uniform(-6, 6, 2)), 30)
    counts, edges = np.histogram(w, 60, (-4, 4))
    data = made.description(1, measured=[[w.min()], [w.max()]], density=counts[None])
    v = np.linspace(-6, 6, 977)
    bins = np.clip(np.searchsorted(edges, v) - 1, 0, 59)
    empty = (counts[bins] == 0) & (np.abs(v) < 4)
    outside = (v < w.min()) | (v > w.max())
    assert (measured(v, data, 0) == ~(outside | empty)).mean() > 0.995


def test_bands_are_as_wide_as_the_document_says(tmp_path):
    refined = made.shot()
    section = made.section(folder_of(tmp_path, refined))
    (model,) = section.models
    (picture,) = curve_bands(section, styles([model]))
    curve, near = picture.axes[0], picture.axes[1]
    for axis, scale in ((curve, 1.0), (near, 1e3)):
        heights = [np.ptp(path.vertices[:, 1]) for c in axis.collections for path in c.get_paths()]
        offset = 0.0 if axis is near else np.ptp(model.refined.bands.curve[:, 0])
        assert heights == pytest.approx([0.04 * scale + offset, 0.02 * scale + offset], rel=1e-6)


def test_odd_names_and_missing_numbers_are_drawn_and_written(tmp_path):
    odd = made.parameter("friction", "a_b$|^2", float("inf"), float("inf"), joint=0)
    ends = [0.0, float("inf")]
    odd |= {"at_bound": True, "value": 0.0, "interval_90": ends, "interval_95": ends}
    refined = made.shot([odd, made.parameter("bias", "torque bias", 0.0, 0.1, joint=1)])
    refined["correlation"] = [[float("nan")] * 2, [float("nan"), 1.0]]
    assert "at its bound" in made.words(made.undrawn(folder_of(tmp_path, refined)))
    assert (tmp_path / "figures/correlation--made--law.svg").stat().st_size > 1000


def test_recordings_with_masses_of_their_own_have_nominal_values_of_their_own():
    dataset = late_and_heavy()
    heavy = tuple(replace(r, parameters=HEAVIER) for r in dataset.recordings)
    start = Friction(CoulombViscous(), [[COULOMB, 0.002]])
    blocks = (FrictionBlock(), InertiaBlock())
    found = {}
    for name, own in (("table", dataset), ("own", replace(dataset, recordings=heavy))):
        result = refine(start, own, blocks, Settings(windows=(0.33,), iterations=3))
        estimates = result.estimates(own, np.linspace(-4, 4, 5)[:, None])
        found[name] = [e for e in estimates.parameters if e.block == "inertia"]
    mechanism = mechanism_of(PENDULUM)
    for k, (table, own) in enumerate(zip(found["table"], found["own"], strict=True)):
        true = float(mechanism.base(mechanism.nominal(HEAVIER))[k])
        assert own.nominal == pytest.approx(true, rel=1e-12)
        # the motion says the same, whatever is nominal
        assert own.value == pytest.approx(table.value, rel=1e-3)
        assert own.low < own.value < own.high
