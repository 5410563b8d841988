"""The report: its numbers are those of the scores, whatever the names, lost values and gaps."""

import io
import json
import re
import shutil

import matplotlib
import matplotlib.image
import numpy as np
import pandas as pd
import pytest
from fixtures import result_folders as made
from fixtures import tiny_pendulums as tiny
from fixtures.refusals import assert_refused
from fixtures.shared import shared
from markdown_it import MarkdownIt

from frictionid.comparison.cross_validate import Benchmark
from frictionid.comparison.results import load_results
from frictionid.comparison.tasks import Task
from frictionid.evaluation import Protocol, Split, make_folds, true_friction
from frictionid.fitting.identifiers import Frictionless, LeastSquares, Published
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY
from frictionid.friction.laws import CoulombViscous
from frictionid.report import show
from frictionid.report.exhibits import exhibits_of, names_of
from frictionid.report.figures.style import drawing, rendered
from frictionid.report.sections import sections_of
from frictionid.report.verdict import verdict_of

ODD = ("_hidden", "a|b", "$x_1$", "100 % & #{1}~^\\", "*bold* `code` [x](y)", "日本", "x" * 90)


@shared
def bare(tmp_path_factory):
    """A report with pictures, without rollouts or examples; settings of Matplotlib stay."""
    task = made.task("a", horizons=(), motions=False)
    folder, before = tmp_path_factory.mktemp("bare"), dict(matplotlib.rcParams)
    made.built(folder, [task])
    assert dict(matplotlib.rcParams) == before
    return folder


@shared
def computed(tmp_path_factory):
    """A report of results that the library has computed, of one joint."""
    folder = tmp_path_factory.mktemp("computed")
    dataset = tiny.dataset()
    folds = make_folds(dataset.recordings, Split(count=3))
    benchmark = Benchmark(
        dataset, folds, Protocol((0.1, 0.5), every=0.5), (tiny.dataset(name="new"),)
    )
    parts = {
        "none": Frictionless(),
        "coulomb_viscous": LeastSquares(CoulombViscous()),
        "truth": Published(true_friction(dataset.truth)),
    }
    tasks = [
        Task(benchmark, name, identifier, recipe, 0)
        for recipe in (STUDY, INTEGRAL)
        for name, identifier in parts.items()
    ]
    return made.blank(made.computed(folder, tasks, 3))


def summary(folder):
    """Cells of the table of a data set."""
    return made.grid((folder / "tables/summary--made.md").read_text())


# --- The same results, the same files ----------------------------------------------------------


@pytest.mark.parametrize("name", ["typical", "bare"])
def test_a_report_made_elsewhere_has_the_same_bytes(name, tmp_path, request):
    first, moved = request.getfixturevalue(name), tmp_path / "moved"
    build = made.blank if name == "typical" else made.built
    shutil.copytree(first / "tasks", moved / "tasks")
    for file in ("provenance.json", "datasets.json"):
        shutil.copy(first / file, moved)
    assert made.contents(build(moved)) == made.contents(first)


def test_a_folder_without_results_is_the_users_mistake(tmp_path):
    with assert_refused(re.escape(str(tmp_path))):
        load_results(tmp_path)
    shutil.rmtree(made.typical(tmp_path) / "tasks")
    with assert_refused(re.escape(str(tmp_path))):
        load_results(tmp_path)


def test_unfinished_tasks_are_told(tmp_path):
    made.typical(tmp_path)
    (tmp_path / "tasks/task03.json").unlink()
    made.undrawn(tmp_path)
    assert "Unfinished: 1 of 6 tasks" in (tmp_path / "summary.md").read_text()


# --- Numbers -----------------------------------------------------------------------------------


@pytest.mark.parametrize("dataset", ["tiny", "new"])
def test_numbers_of_the_tables_are_those_of_the_scores(dataset, computed):
    long = pd.read_csv(computed / "scores.csv", dtype={"fold": str, "joint": str})
    long = long[(long["dataset"] == dataset) & (long["joint"] == "all")]
    table = pd.read_csv(computed / f"tables/summary--{dataset}.csv")
    assert list(table["identifier"]) == ["none", *["coulomb_viscous"] * 2, "truth"]
    for line in table.to_dict("records"):
        recipe = "study" if pd.isna(line["recipe"]) else line["recipe"]
        own = long[(long["identifier"] == line["identifier"]) & (long["fit"] == recipe)]
        step = own[(own["score"] == "one_step_euler") & (own["statistic"] == "mean")]
        each = step[step["fold"] != "all"]["value"]
        expected = each.mean() if len(each) else step["value"].item()
        assert line["one_step_euler_mean"] == pytest.approx(expected, rel=1e-8)
        assert pd.isna(line["one_step_euler_mean_sd"]) == (dataset == "new")
        last = own[(own["score"] == "rollout_angle") & (own["horizon_s"] == 0.5)]
        pooled = last[last["fold"] == "all"].set_index("statistic")["value"]
        for name in ("median", "q90", "diverged"):
            assert line[f"rollout_angle_{name}_0.5s"] == pytest.approx(pooled[name], rel=1e-8)


def test_printed_numbers_are_those_of_the_table(typical):
    head, *lines = summary(typical)
    assert [line[:2] for line in lines] == [
        ["none", "–"],
        ["stribeck", "study"],
        ["stribeck", "integral"],
        ["paper", "–"],
        ["truth", "–"],
    ]
    best = dict(zip(head, lines[2], strict=True))
    assert best["rollout 1 s [rad]"] == "<strong>0.100 (0.20, 0 %)</strong>"
    assert best["curve error joint 2 [%]"] == "<strong>5.0</strong>"
    assert best["one step euler mean [rad/s]"] == "0.400 ± 0.018"
    worst = dict(zip(head, lines[0], strict=True))
    assert worst["rollout 1 s [rad]"] == "0.900 (1.8, 100 %)"


def test_parameters_are_those_of_the_models(computed):
    table = pd.read_csv(computed / "tables/parameters--tiny.csv")
    model = next(m for m in made.section(computed).models if m.recipe == "integral")
    own = table[(table["recipe"] == "integral") & (table["parameter"] == "coulomb")]
    assert own["mean"].item() == pytest.approx(model.theta[:, 0, 0].mean(), rel=1e-8)
    assert own["all_data"].item() == pytest.approx(
        model.document["joints"][0]["coulomb"]["value"], rel=1e-8
    )
    assert own["unit"].item() == "N m"
    assert set(table[table["identifier"] == "truth"]["parameter"]) > {"viscous", "peak_positive"}


def test_smooth_friction_without_a_true_calibration_has_the_truth_of_friction_only(computed):
    true = json.loads((computed / "datasets.json").read_text())["tiny"]["true_parameters"]
    assert set(true) == {"friction"} and true["friction"]["coulomb"] == [0.03]


def test_seeds_that_change_nothing_are_one_line_and_others_are_named(tmp_path):
    same = [made.task("a", 0.1, 0.1, seed=s, role="given") for s in (0, 1)]
    differ = [made.task("b", 0.1, 0.1, seed=s) for s in (0, 1)]
    made.undrawn(tmp_path, same + differ)
    names = [line[0] for line in summary(tmp_path)[1:]]
    assert names == ["b, seed 0", "b, seed 1", "a"]


def test_data_that_test_two_fits_have_a_table_for_each(tmp_path):
    scored = [{name: made.rows(0.1, 0.1), "other": made.rows(0.2, 0.2)} for name in ("x", "y")]
    tasks = [made.task("a", scored=own, dataset=next(iter(own))) for own in scored]
    made.undrawn(tmp_path, tasks)
    names = {path.name for path in (tmp_path / "tables").glob("summary*.md")}
    ends = ("x", "y", "other-fitted-on-x", "other-fitted-on-y")
    assert names == {f"summary--{end}.md" for end in ends}


# --- Lost values and gaps ----------------------------------------------------------------------


def test_infinite_scores_are_shown_and_never_best_or_averaged(tmp_path):
    wild = made.task("wild", np.inf, np.inf, curve=np.inf)
    wild["curves"] = np.full_like(wild["curves"], np.nan)
    for motion in wild["motions"]:
        motion["predicted"] = np.where(motion["predicted"] > 0.5, np.inf, np.nan)
    tame = made.task("tame", curve=0.1)
    also = made.task("also", 0.4, 0.3, curve=0.2)
    made.built(tmp_path, [wild, tame, also])
    _, *lines = summary(tmp_path)
    assert lines[0][0] == "wild"
    assert lines[0][2:8] == ["∞", "∞", *["∞ (∞, 100 %)"] * 3, "∞"]
    assert "<strong>" not in "".join(lines[0])
    page = made.words(tmp_path)
    assert "Infinite errors on made" in page and "Use tame, 0.10 rad off after 0.5 s" in page


@pytest.mark.parametrize("horizons", [(), (0.1,), (0.1, 0.5)])
def test_missing_horizons_leave_a_gap(horizons, tmp_path, capsys):
    build = made.built if len(horizons) == 1 else made.blank  # pictures have the gap once
    short = made.task("short", horizons=horizons, curve=0.1)
    long = made.task("long", curve=0.1)
    build(tmp_path, [short, long])
    head, first, second = summary(tmp_path)
    last = head.index("rollout 1 s [rad]")
    assert (first[last], second[last] == "–") == ("–", False)
    show(load_results(tmp_path))
    assert "–" in capsys.readouterr().out


def test_without_rollouts_or_examples_the_rest_is_there(bare):
    names = {f"{name}--made.{kind}" for name in ("one_step", "curves") for kind in ("pdf", "svg")}
    assert {path.name for path in (bare / "figures").iterdir()} == names
    assert "Parameters with intervals" not in made.words(bare)
    for path in (bare / "figures").iterdir():
        assert path.read_bytes().startswith(b"%PDF" if path.suffix == ".pdf" else b"<?xml")


def test_without_truth_no_curve_error_is_shown(tmp_path):
    task = made.task("a")
    made.blank(tmp_path, [task], {"made": made.about(truth=False)})
    assert "curve error" not in " ".join(summary(tmp_path)[0])
    assert not list((tmp_path / "figures").glob("tradeoff*"))
    assert "no truth is known" in made.words(tmp_path)


@pytest.mark.parametrize("role", ["none", "given", "truth"])
def test_a_comparison_without_a_fit_is_reported_too(role, tmp_path):
    task = made.task("a", curve=0.1, role=role)
    made.blank(tmp_path, [task])
    assert verdict_of(made.section(tmp_path)).sentence in made.words(tmp_path)


# --- Names -------------------------------------------------------------------------------------


@shared
def odd(tmp_path_factory):
    """A report in which everything has an odd name."""
    folder = tmp_path_factory.mktemp("odd")
    tasks = [made.task(name, curve=0.1, dataset="my|rig", fit="$fit_") for name in ODD]
    return made.blank(folder, tasks, title="A *title* | <b>")


def test_odd_names_stand_in_markdown_as_they_are(odd):
    cells = made.grid((odd / "tables/summary--my-rig.md").read_text())
    assert {len(line) for line in cells} == {len(cells[0])}
    named = [re.sub("&(amp|lt|gt);", lambda m: {"amp": "&"}[m[1]], line[0]) for line in cells[1:]]
    assert named == list(ODD)
    html = MarkdownIt().enable("table").render((odd / "summary.md").read_text())
    assert "<h1>A *title* | &lt;b&gt;</h1>" in html


def test_odd_names_are_escaped_in_latex(odd):
    text = (odd / "tables/summary--my-rig.tex").read_text()
    body = text.partition(r"\begin{tabular}")[2]
    plain = re.sub(r"\\(?:[&%$#_{}]|text\w+\{\}|pm\b)", "", body)
    assert not re.search(r"[%#~^]", plain)
    assert len({line.count("&") for line in plain.splitlines() if line.endswith(r"\\")}) <= 2
    assert r"\label{tab:summary-my-rig}" in text
    assert not re.search(r"^[*\[]", text, re.MULTILINE)  # \\ would take it for its own


def test_every_figure_is_drawn_whatever_the_names(odd, computed):
    for folder in (odd, computed):
        pictures = list(pictures_of(folder))
        assert len(pictures) >= 4
        for picture in pictures:
            with drawing():
                shot = io.BytesIO(rendered(picture.figure, ["png"])["png"])
            image = matplotlib.image.imread(shot)[..., :3]
            assert image.shape[1] in (1440, 1120)  # of a page, of half a screen
            drawn = (image < 0.9).any(axis=-1)
            halves = [half.mean() for half in np.array_split(drawn, 2, axis=1)]
            assert min(halves) > 0.005, picture.stem
            for kind in ("pdf", "svg"):
                assert (folder / f"figures/{picture.stem}.{kind}").exists()


def pictures_of(folder):
    """All pictures of a report."""
    sections = sections_of(load_results(folder))
    names = names_of(sections)
    with drawing():
        for section in sections:
            for data in section.data:
                yield from exhibits_of(section, data, names)[1]


def test_links_of_the_page_lead_somewhere(typical):
    places = re.findall(r"\]\(([^)]+)\)", (typical / "summary.md").read_text())
    places += re.findall(r'href="([^"#:]+)"', (typical / "index.html").read_text())
    assert len(places) > 20
    assert [place for place in places if not (typical / place).exists()] == []


def test_latex_groups_span_their_columns(typical):
    text = (typical / "tables/summary--made.tex").read_text()
    columns = re.search(r"\\begin{tabular}{([lr]+)}", text)[1]
    spans = [int(n) for n in re.findall(r"\\multicolumn{(\d+)}", text)]
    assert sum(spans) == len(columns)
    assert [r"\toprule" in text, text.count(r"\midrule"), r"\bottomrule" in text] == [True, 5, True]
