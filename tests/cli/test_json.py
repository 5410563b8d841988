"""--json: one JSON document on the standard output, and nothing else there."""

import json

import pytest
from fixtures.command_line import run_command
from fixtures.tiny_pendulums import write_dataset, write_suite


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("json")
    write_dataset(folder / "tiny")
    one = [("identifiers", [{"kind": "none"}, {"kind": "coulomb_viscous"}]), ("horizons", [0.3])]
    write_suite(folder, [*one, ("recipes", [{"name": "integral"}])])
    return folder


FIT = ("fit", "tiny", "--identifier", "coulomb_viscous", "--out", "model.json")
COMMANDS = {
    "check": (("check", "tiny"), lambda d: d["dataset"] == "tiny"),
    "fit": (FIT, lambda d: d["law"]["kind"] == "coulomb_viscous"),
    "evaluate": (
        ("evaluate", "model.json", "tiny", "--horizons", 0.3, "--out", "scores.csv"),
        lambda d: {row["score"] for row in d} >= {"rollout_angle", "one_step_integral"},
    ),
    "compare": (
        ("compare", "suite.toml", "--out", "result", "--jobs", 1),
        lambda d: "coulomb_viscous" in d["datasets"][0]["verdict"],
    ),
    "data list": (("data", "list"), lambda d: d["emps"]["files"] > 0),
}


@pytest.mark.parametrize(("arguments", "holds"), COMMANDS.values(), ids=COMMANDS)
def test_a_script_reads_what_a_command_prints(monkeypatch, capsys, place, arguments, holds):
    if arguments[0] == "evaluate":
        run_command(monkeypatch, capsys, place, *FIT, "--replace")
    code, out, _ = run_command(monkeypatch, capsys, place, *arguments, "--json")
    assert code in (0, 1) and holds(json.loads(out))
