"""A comparison ends with its verdict, and prints all numbers as JSON where a script asks."""

import json

from fixtures import result_folders as made
from fixtures.command_line import run_command

from frictionid.comparison.results import load_results
from frictionid.report import results_json, show
from frictionid.report.terminal import verdict


def test_the_last_words_are_the_verdict_and_the_path(tmp_path, capsys):
    results = load_results(made.typical(tmp_path / "made"))
    show(results)
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].endswith("summary.md") and lines[-2] == ""
    assert lines[-3].startswith("- Ranking after 1 s, paired over 4 folds: stribeck (integral)")
    assert lines[-4].startswith("- Best prediction after 1 s, held out: stribeck (integral)")
    assert lines[-4].endswith("best given model paper, 0.30 rad.")


def test_the_verdict_is_that_of_the_page(tmp_path):
    folder = made.typical(tmp_path / "made")
    section = made.section(folder)
    assert verdict(section)
    for line in verdict(section).splitlines():
        assert line in made.findings(made.built(folder))


def test_scripts_get_the_summary_as_json(tmp_path, monkeypatch, capsys):
    folder = made.typical(tmp_path / "made")
    code, out, err = run_command(monkeypatch, capsys, tmp_path, "report", "made", "--json")
    assert (code, err) == (0, "")
    document = json.loads(out)
    assert document == json.loads(results_json(load_results(folder))) | {"folder": "made"}
    held_out, unseen = document["datasets"]
    assert held_out["verdict"] == verdict(made.section(folder)) and unseen["verdict"] == ""
    best = next(m for m in held_out["models"] if m["recipe"] == "integral")
    assert best["rollout_angle_median_1s"] == 0.1
