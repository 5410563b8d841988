"""A comparison ends with its verdict, and prints all numbers as JSON where a script asks."""

import json

from fixtures import result_folders as made
from fixtures.command_line import run_command

from frictionid.comparison.results import load_results
from frictionid.report import results_json, show
from frictionid.report.summary_table import summary_of, summary_table
from frictionid.report.terminal import verdict
from frictionid.report.verdict_table import difference_table


def test_the_last_words_are_the_verdict_and_the_path(tmp_path, capsys):
    results = load_results(made.typical(tmp_path / "made"))
    show(results)
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].endswith("index.html") and lines[-2] == ""
    assert lines[-3].startswith("- Record next: ")
    assert lines[-4].startswith("- Main doubt: ")
    assert lines[-5].startswith("- Use stribeck (integral), 0.050 rad off after 0.5 s")


def test_the_verdict_is_that_of_the_page_and_of_the_summary(tmp_path, monkeypatch):
    made.leave_blank(monkeypatch)
    folder = made.built(made.typical(tmp_path / "made"))
    section = made.section(folder)
    assert verdict(section)
    for line in verdict(section).splitlines():
        assert line in (folder / "summary.md").read_text()
        assert line.removeprefix("- ").partition(": ")[2] in made.words(folder)


def test_scripts_get_the_summary_as_json(tmp_path, monkeypatch, capsys):
    made.leave_blank(monkeypatch)
    folder = made.typical(tmp_path / "made")
    code, out, err = run_command(monkeypatch, capsys, tmp_path, "report", "made", "--json")
    assert (code, err) == (0, "")
    document = json.loads(out)
    assert document == json.loads(results_json(load_results(folder))) | {"folder": "made"}
    held_out, unseen = document["datasets"]
    assert held_out["verdict"] == verdict(made.section(folder)) and unseen["verdict"] == ""
    best = next(m for m in held_out["models"] if m["recipe"] == "integral")
    assert best["rollout_angle_median_1s"] == 0.1


def test_given_models_are_ranked_with_the_fitted_ones(tmp_path):
    tasks = [
        made.task("none", {"made": made.rows(0.3, 0.9)}, role="none"),
        made.task("ours", {"made": made.rows(0.3, 0.3)}),
        made.task("paper", {"made": made.rows(0.3, 0.2)}, role="given"),
    ]
    section = made.section(made.write(tmp_path, tasks))
    assert "Use paper, 0.10 rad off after 0.5 s; 2 of 2 other models are" in verdict(section)
    table = summary_table(summary_of(section.fitted), "")
    bold = {line.cells[0].text: any(cell.best for cell in line.cells) for line in table.lines}
    assert bold == {"none": False, "ours": True, "paper": True}  # one step ahead they are level
    first = difference_table(section.fitted).lines
    assert [line.cells[-1].text for line in first][-1] == "best"
