"""The report in words and in the terminal: what it says of the numbers, and how it is shown."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fixtures import result_folders as made

from frictionid.comparison.results import load_results, model_scores
from frictionid.evaluation import score_frame
from frictionid.report import show, show_scores
from frictionid.report.figures.style import styles
from frictionid.report.model_tables import equation_of
from frictionid.report.sections import rollout
from frictionid.report.summary_table import summary_of, summary_table
from frictionid.report.tables import escape_latex, latex, markdown, table_of, text_columns
from frictionid.report.terminal import say
from frictionid.report.verdict import verdict_of
from frictionid.report.write import astray, loose

# --- Words -------------------------------------------------------------------------------------


def test_the_page_says_what_the_numbers_support(typical):
    said = made.words(typical)
    assert "0.1 s: 0.010 (9 of 10: 0.020), 0.5 s: 0.050 (9 of 10: 0.10) rad. Held-out" in said
    assert re.search(r"none is 9\.\d+ times \(80 %: .* to .*\) as far off as stribeck; geo", said)
    assert re.search(r"paper is 3\.\d+ times \(80 %: .* to .*\) as far off as stribeck; geo", said)
    assert "stribeck (integral) is 5.0 % off the true curve at most" in said


def test_a_fold_that_is_not_finite_is_not_averaged_away(tmp_path):
    lost = made.task("a", noise=[0.0, np.inf, 0.0, 0.0])
    section = made.section(tmp_path, [lost, made.task("b")])
    pair = section.fitted.paired(*section.models, rollout(1.0))
    assert np.isnan(pair.mean)
    assert pair.clear is None


def test_friction_that_makes_things_worse_is_told(tmp_path):
    tasks = [made.task("none", 0.3, 0.1, role="none"), made.task("bad", 0.4, 0.2)]
    verdict = verdict_of(made.section(tmp_path, tasks))
    assert verdict.recommended == "none"
    assert made.answers(verdict)["friction"] == "no"


@pytest.mark.parametrize(
    "unit, far", [("rad", "a quarter of the travel or 1 rad"), ("m", "a quarter of the travel")]
)
def test_predictions_that_diverged_are_told_with_the_limit_of_their_unit(unit, far, tmp_path):
    tasks = [made.task("wild", 0.3, 0.9)]
    about = {**made.about(), "position_units": [unit] * 2}
    folder = made.undrawn(tmp_path, tasks, {"made": about})
    said = f"on made after 1 s (further off than {far}, which medians hide): up to 100 %"
    assert said in made.words(folder)
    assert f"share further off than {far})" in (folder / "summary.md").read_text()


def test_curves_and_parameters_that_wander_are_told(tmp_path):
    stray = made.task("stray")
    stray["curves"][-1] *= 1.5
    vague = made.task("vague", spread=2.0)
    steady = made.task("steady")
    folder = made.undrawn(tmp_path, [stray, vague, steady])
    models = made.section(folder).models
    assert [model.label for model in models if astray(model)] == ["stray"]
    assert [model.label for model in models if loose(model)] == ["vague"]
    said = made.words(folder)
    assert "on made, perhaps another minimum: stray." in said
    assert "on made (not determined one by one, even where the curve is): vague" in said


def test_shuffled_folds_are_told(tmp_path):
    settings = {"every": 0.25, "folds": {"count": 4, "kind": "shuffled"}}
    task = made.task("a")
    folder = made.undrawn(tmp_path, [task], settings=settings)
    assert "Shuffled folds on made: held-out samples have neighbours" in made.words(folder)


# --- Terminal and styles ------------------------------------------------------------------------


def test_in_a_terminal_the_path_can_be_clicked(typical, capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.chdir(typical.parent)
    show(load_results(Path(typical.name)))
    last = capsys.readouterr().out.rstrip("\n").splitlines()[-1]
    path = typical.resolve() / "index.html"
    assert re.fullmatch(rf"\x1b]8;[^;]*;{re.escape(path.as_uri())}\x1b\\.*\x1b]8;;\x1b\\", last)
    assert re.sub(r"\x1b](?:[^\x1b]*)\x1b\\", "", last) == str(path)


@pytest.fixture
def lines_of(monkeypatch, capsys):
    """Lines that a function prints, without colours: in a terminal of a width, or into a pipe."""

    def lines(width, terminal, show, *parts):
        monkeypatch.setenv("FORCE_COLOR", "1" if terminal else "")
        monkeypatch.setenv("COLUMNS", str(width))
        show(*parts)
        return re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out).splitlines()

    return lines


@pytest.mark.parametrize("width", [80, 100, 120])
def test_tables_fit_the_terminal(width, typical, lines_of):
    *plain, _ = lines_of(width, True, show, load_results(typical))
    assert max(map(len, plain)) <= width
    heads = [line for line in plain if "identifier" in line]
    assert all("1 s" in line for line in heads)
    assert ("0.1 s" in heads[0]) == (width > 100)


@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_wraps_sentences_between_words_and_no_line_of_a_table(terminal, lines_of):
    text, wide = "  " + "measured friction " * 9, "joint_of_a_long_name " * 5
    lines = lines_of(80, terminal, say, text, table_of(text_columns(wide), [[wide]]))
    sentence, table = lines[:-4], lines[-4:]
    assert [line.strip() for line in table[0::2]] == [wide.strip(), wide.strip()]
    assert (max(map(len, sentence)) <= 80) == terminal
    assert " ".join(sentence).split() == text.split()


@pytest.mark.parametrize("terminal, parts", [(True, 2), (False, 1)])
def test_a_wide_table_stands_in_parts_below_each_other_in_a_terminal(terminal, parts, lines_of):
    numbers = [f"a number of the name {k}" for k in range(6)]
    table = table_of([*text_columns("joint"), *numbers], [["knee", *"123456"], ["hip", *"abcdef"]])
    lines = lines_of(80, terminal, say, table)
    assert (max(map(len, lines)) <= 80) == terminal
    rows = [line.split() for line in lines]
    for name, cells in (("knee", "123456"), ("hip", "abcdef")):
        own = [row[1:] for row in rows if row[0] == name]
        assert len(own) == parts and "".join(map("".join, own)) == cells
    heads = " ".join(line.split(maxsplit=1)[1] for line in lines if "joint" in line)
    assert re.findall(r"name (\d)", heads) == list("012345")


def test_given_models_are_shown_in_short(capsys):
    rows = {"mine": made.rows(0.3, 0.2, curve=0.1), "theirs": made.rows(0.5, np.inf, curve=0.2)}
    frames = {k: score_frame(r for r in v if r[0] == "all") for k, v in rows.items()}
    show_scores(model_scores("rig", frames))
    text = capsys.readouterr().out
    assert re.search(r"mine +0\.300 +0\.300 +0\.020 .* 0\.20 \(0\.40, 0 %\) +10 +10 +4", text)
    assert re.search(r"theirs +0\.500 .*∞ \(∞, 100 %\)", text)


def test_colours_belong_to_identifiers(typical, tmp_path):
    of_all = styles(made.section(typical).models)
    assert set(of_all) == {"none", "stribeck", "paper", "truth"}
    many = [made.task(f"m{i}", 0.1, 0.1) for i in range(12)]
    own = styles(made.section(tmp_path, many).models)
    assert len({(style.colour, str(style.line)) for style in own.values()}) == 12


def test_tables_agree_in_every_form(typical):
    table = summary_table(summary_of(made.section(typical).fitted), "")
    cells = [[cell.text for cell in line.cells] for line in table.lines]
    shown = [[re.sub("</?strong>", "", c) for c in line] for line in made.grid(markdown(table))[1:]]
    assert shown == cells
    assert all(escape_latex(text) in latex(table) for line in cells for text in line)


def test_notes_of_a_model_are_code_and_no_html(tmp_path):
    task = made.task("sindy", motions=False)
    task["model"]["provenance"] = {"equation": ["<img src=x onerror=alert(1)> `code` | x"]}
    folder = made.undrawn(tmp_path, [task])
    html = (folder / "index.html").read_text()
    assert "<img src=x" not in html and "<code>&lt;img src=x onerror=alert(1)&gt;" in html


@pytest.mark.parametrize(
    "law, words",
    [
        ({"kind": "stribeck"}, "+ viscous w."),
        ({"kind": "stribeck", "symmetric": False}, "symmetric = false gives each direction"),
        ({"kind": "motor_load", "squared": True}, "squared = true adds rise u^2"),
    ],
)
def test_the_equation_says_which_switches_of_its_law_are_on(law, words):
    model = SimpleNamespace(document={"law": law})
    assert equation_of(model).count(words) == 1
    assert ("= true" in equation_of(model) or "= false" in equation_of(model)) == (len(law) > 1)
