"""--json: one JSON document on the standard output, and nothing else there."""

import json
import shutil

import pytest
from fixtures.damage_own_data import TUTORIAL, swing
from fixtures.damage_targets import small
from fixtures.result_folders import leave_blank
from fixtures.shared import shared

from frictionid.__main__ import main

COMMANDS = {
    "check": ("check tiny", lambda d: d["dataset"] == "tiny"),
    "fit": (
        "fit tiny --identifier coulomb_viscous --out fitted.json",
        lambda d: d["law"]["kind"] == "coulomb_viscous",
    ),
    "evaluate": (
        "evaluate model.json tiny --horizons 0.1 --out scores.csv",
        lambda d: {row["score"] for row in d} >= {"rollout_angle", "one_step_integral"},
    ),
    "compare": (
        "compare suite.toml --out result --jobs 1",
        lambda d: "coulomb_viscous" in d["datasets"][0]["verdict"],
    ),
    "data list": ("data list", lambda d: d["emps"]["files"] > 0),
}


@shared
def inputs(shared_path):
    """Own tables, a mechanism file, a film, a model, and a suite with a search."""
    small(shared_path)
    (shared_path / "arm").mkdir()
    for i in range(2):
        swing(i).to_csv(shared_path / f"arm/run{i}.csv", index=False)
    text = (TUTORIAL / "simulated.toml").read_text().replace("samples = 720", "samples = 40")
    (shared_path / "sim.toml").write_text(text)
    for name in ("camera.toml", "rig.toml"):
        shutil.copy(TUTORIAL / name, shared_path)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(shared_path)
        for line in (
            "simulate sim.toml --out set",
            "render set --camera camera.toml --out films",
            "fit tiny --identifier none --out model.json",
        ):
            patch.setattr("sys.argv", ["frictionid", "-q", *line.split()])
            assert main() == 0
    return shared_path


MACHINE = "--mechanism pendulum --set mass=0.5 --set length=0.3 --kt 0.5"
LIMITS = "--limits torque=1,velocity=20 --effort 6 --length 1 --recordings 1"
MADE = {
    "simulate": (
        "simulate sim.toml --out made",
        lambda d: d["samples"] == 40 and d["recordings"] == ["run"],
    ),
    "predict": (
        "predict model.json tiny --horizon 0.1 --out p.csv",
        lambda d: 0 < d["predictions"] < d["lines"],
    ),
    "init": (
        f"init arm {MACHINE}",
        lambda d: d["dataset"]["mechanism"]["kind"] == "pendulum" and d["suite"]["identifiers"],
    ),
    "suggest": (
        f"suggest --mechanism rig.toml {LIMITS} --out u.csv",
        lambda d: d["parameters"][0]["friction_alone"]["error"] > 0 and len(d["recordings"]) == 1,
    ),
    "track": (
        "track films/run.mov --out q.csv",
        lambda d: d["frames"] == d["states"]["found"] == 40 and 0 < d["sigma"][0] < 0.01,
    ),
    "track --setup": (
        "track films/run.mov --setup --rig proposed.toml",
        lambda d: {m["name"] for m in d["markers"]} and d["written"] == ["proposed.toml"],
    ),
    "tune": (
        "tune suite.toml --out tuned --jobs 1",
        lambda d: 0.01 <= d["studies"][0]["settings"]["width"] <= 0.1,
    ),
}


@pytest.mark.parametrize("name", [*COMMANDS, *MADE])
def test_a_script_reads_what_a_command_prints(inputs, monkeypatch, name, run):
    leave_blank(monkeypatch)
    arguments, holds = (COMMANDS | MADE)[name]
    code, out, err = run(inputs, arguments, "--json")
    assert code in (0, 1), err
    document = json.loads(out)
    assert holds(document), document
    if name in MADE:
        assert code == 0 and document["written"]
        assert all((inputs / file).exists() for file in document["written"])
