"""The report in words and in the terminal: what it says of the numbers, and how it is shown."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fixtures import result_folders as made
from markdown_it import MarkdownIt

from frictionid.comparison.results import model_scores, scores
from frictionid.report import build, show, show_scores, write
from frictionid.report.figures.style import looks
from frictionid.report.load import Key, gather
from frictionid.report.paired import differences, paired
from frictionid.report.tables import escape_latex, latex, markdown
from frictionid.report.warnings_text import astray, loose

LAST = Key("rollout_angle", "median", 1.0)


@pytest.fixture(autouse=True, scope="module")
def undrawn():
    """Builds leave out the pictures, which take longest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "_drawn", lambda *_: ())
        yield


@pytest.fixture(scope="module")
def typical(tmp_path_factory):
    """A report of a folder made by hand."""
    folder = made.typical(tmp_path_factory.mktemp("typical"))
    build(folder)
    return folder


def grid(text):
    """Cells of the first table of a Markdown text, as a browser shows them."""
    html = MarkdownIt().enable("table").render(text)
    lines = re.findall(r"<tr>(.*?)</tr>", html.partition("</table>")[0], re.DOTALL)
    return [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", line) for line in lines]


# --- Words -------------------------------------------------------------------------------------


def words(folder):
    """What the page says before its tables."""
    build(folder)
    return before_tables(folder)


def before_tables(folder):
    """What a page says before its tables, without the marks of code."""
    return (folder / "summary.md").read_text().partition("\n## ")[0].replace("`", "")


def test_the_page_says_what_the_numbers_support(typical):
    said = before_tables(typical)
    assert "stribeck (integral) predicts best" in said
    assert "0.050 rad after 0.5 s and 0.10 rad after 1 s, 9.0 and 9.0 times smaller" in said
    assert "Of 2 fitted models, 1 score below the euler loss (0.350 rad/s)" in said
    assert "a lower one-step loss is no evidence of truer friction" in said
    assert "stribeck (study), which predicts clearly worse" in said
    assert "With the recipe integral the error of the friction curves is 4.0 times smaller" in said
    assert "On other, which no fit has seen, stribeck (integral) predicts best" in said
    assert "after 1 s paper is 0.30 rad off and stribeck (integral) 0.10 rad" in said


NEAR = [0.02, -0.03, 0.025, -0.02]  # scatter of a difference of 0.01 that it hides


@pytest.mark.parametrize(
    ("noise", "expected", "sign"),
    [
        (None, "a is better than every other fitted model by more than two standard errors", "+"),
        (NEAR, "a cannot be told apart from b: within two standard errors", "≈"),
        ([np.inf] * 4, "a cannot be compared fold by fold with b", "–"),
    ],
)
def test_differences_are_weighed_against_the_scatter_of_the_folds(noise, expected, sign, tmp_path):
    first = made.task("a", {"made": made.rows(0.3, 0.2)})
    second = made.task("b", {"made": made.rows(0.31, 0.21, noise=noise)})
    folder = made.write(tmp_path, [first, second])
    assert expected in words(folder)
    table = differences(gather(folder).sections[0], made.HORIZONS, "rad")
    assert table.lines[1].cells[-1].text.startswith(sign)


def test_a_fold_that_is_not_finite_is_not_averaged_away(tmp_path):
    lost = made.rows(0.3, 0.2, noise=[0.0, np.inf, 0.0, 0.0])
    tasks = [made.task("a", {"made": lost}), made.task("b", {"made": made.rows(0.3, 0.2)})]
    section = gather(made.write(tmp_path, tasks)).sections[0]
    pair = paired(*section.entries, "made", LAST)
    assert np.isnan(pair.mean)
    assert pair.clear is None


def test_friction_that_makes_things_worse_is_told(tmp_path):
    tasks = [
        made.task("none", {"made": made.rows(0.3, 0.1)}, role="none"),
        made.task("bad", {"made": made.rows(0.4, 0.2)}),
    ]
    assert "2.0 and 2.0 times larger than without friction" in words(made.write(tmp_path, tasks))


@pytest.mark.parametrize(("unit", "far"), [("rad", "1 rad"), ("m", "a quarter of the travel")])
def test_predictions_that_diverged_are_told_with_the_limit_of_their_unit(unit, far, tmp_path):
    tasks = [made.task("wild", {"made": made.rows(0.3, 0.9)})]
    folder = made.write(tmp_path, tasks, {"made": {**made.about(), "angle_unit": unit}})
    assert f"off by more than {far}, which medians hide: on made up to 100 %" in words(folder)
    assert f"share further off than {far})" in (folder / "summary.md").read_text()


def test_curves_and_parameters_that_wander_are_told(tmp_path):
    stray = made.task("stray", {"made": made.rows(0.3, 0.2)})
    stray["curves"][-1] *= 1.5
    vague = made.task("vague", {"made": made.rows(0.3, 0.2)}, spread=2.0)
    steady = made.task("steady", {"made": made.rows(0.3, 0.2)})
    folder = made.write(tmp_path, [stray, vague, steady])
    entries = {entry.label: entry for entry in gather(folder).sections[0].entries}
    assert [name for name, entry in entries.items() if astray(entry)] == ["stray"]
    assert [name for name, entry in entries.items() if loose(entry)] == ["vague"]
    said = words(folder)
    assert "it may have found another minimum: on made stray" in said
    assert "not determined one by one, even where the curve is: on made vague" in said


def test_shuffled_folds_are_told(tmp_path):
    settings = {"every": 0.25, "folds": {"count": 4, "kind": "shuffled"}}
    task = made.task("a", {"made": made.rows(0.3, 0.2)})
    assert "have neighbours in the training set" in words(
        made.write(tmp_path, [task], settings=settings)
    )


# --- Terminal and looks ------------------------------------------------------------------------


def test_the_last_line_shown_is_the_path(typical, capsys, monkeypatch):
    monkeypatch.chdir(typical.parent)
    show(Path(typical.name))
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == str(typical.resolve() / "summary.md")
    assert Path(lines[-1]).exists()


def test_in_a_terminal_the_path_can_be_clicked(typical, capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    show(typical)
    last = capsys.readouterr().out.rstrip("\n").splitlines()[-1]
    path = typical.resolve() / "summary.md"
    assert re.fullmatch(rf"\x1b]8;[^;]*;{re.escape(path.as_uri())}\x1b\\.*\x1b]8;;\x1b\\", last)
    assert re.sub(r"\x1b](?:[^\x1b]*)\x1b\\", "", last) == str(path)


@pytest.mark.parametrize("width", [80, 100, 120])
def test_tables_fit_the_terminal(width, typical, capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", str(width))
    show(typical)
    *shown, _ = capsys.readouterr().out.splitlines()
    plain = [re.sub(r"\x1b\[[0-9;]*m", "", line) for line in shown]
    assert max(map(len, plain)) <= width
    heads = [line for line in plain if "identifier" in line]
    assert all("1 s" in line for line in heads)
    assert ("0.1 s" in heads[0]) == (width > 100)


def test_given_models_are_shown_in_short(capsys):
    rows = {"mine": made.rows(0.3, 0.2, curve=0.1), "theirs": made.rows(0.5, np.inf, curve=0.2)}
    show_scores(model_scores("rig", {k: [r for r in v if r[0] == "all"] for k, v in rows.items()}))
    text = capsys.readouterr().out
    assert re.search(r"mine +0\.300 +0\.300 +0\.020 .* 0\.20 \(0\.40, 0 %\) +10 +10 +4", text)
    assert re.search(r"theirs +0\.500 .*∞ \(∞, 100 %\)", text)


def test_colours_belong_to_identifiers(typical, tmp_path):
    of_all = looks(e for s in gather(typical).sections for e in s.entries)
    assert set(of_all) == {"none", "stribeck", "paper", "truth"}
    many = [made.task(f"m{i}", {"made": made.rows(0.1, 0.1)}) for i in range(12)]
    own = looks(gather(made.write(tmp_path, many)).sections[0].entries)
    assert len({(look.colour, str(look.line)) for look in own.values()}) == 12


def test_tables_agree_in_every_form(typical):
    section = gather(typical).sections[0]
    table = differences(section, made.HORIZONS, "rad")
    cells = [[cell.text for cell in line.cells] for line in table.lines]
    shown = [[re.sub("</?strong>", "", c) for c in line] for line in grid(markdown(table))[1:]]
    assert shown == cells
    assert all(escape_latex(text) in latex(table) for line in cells for text in line)


def test_scores_of_the_folder_are_those_of_its_tasks(typical):
    table = pd.read_csv(typical / "scores.csv")
    assert np.allclose(table["value"], scores(typical)["value"], equal_nan=True, rtol=1e-8)
