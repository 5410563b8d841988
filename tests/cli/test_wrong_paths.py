"""A wrong path is refused before anything heavy is imported."""

import json
import subprocess
import sys

import pytest

HEAVY = ("pandas", "scipy", "sympy", "torch", "sklearn", "joblib", "cv2", "matplotlib")
WRONG = {
    "check nowhere": "nowhere does not exist; name a folder with a dataset.toml",
    "check table.csv": "table.csv has no dataset.toml; write one with frictionid init table.csv",
    "check .": ". has no dataset.toml; write one with frictionid init .",
    "fit nowhere --identifier stribeck --out m.json": "nowhere does not exist",
    "compare acrobat.toml": "acrobat.toml: no such suite; did you mean acrobot.toml?",
    "tune nothing.toml": "nothing.toml: no such suite",
    "evaluate no.json nowhere --out s.csv": "no.json: no such file",
    "evaluate acrobot.toml nowhere --out s.csv": "nowhere does not exist",
    "report nowhere": "nowhere/provenance.json: no such file",
    "suggest --mechanism no.toml --limits torque=1 --out u.csv": "no.toml: no such file",
    "simulate no.toml --out out": "no.toml: no such file",
    "render nowhere --camera no.toml --out out": "nowhere does not exist",
    "align no.csv table.csv --out out": "no.csv: no such file",
}
CALL = """
import json, sys
from frictionid.__main__ import main
for line in json.loads(sys.argv[1]):
    sys.argv = ["frictionid", *line.split()]
    assert main() == 2, line
print([name for name in json.loads(sys.argv_heavy) if name in sys.modules])
"""


@pytest.fixture(scope="module")
def refused(tmp_path_factory):
    """What the wrong calls complain about, one line each, and the heavy modules imported."""
    folder = tmp_path_factory.mktemp("wrong")
    (folder / "table.csv").write_text("time,q\n0,1\n")
    (folder / "acrobot.toml").write_text("")
    code = CALL.replace("sys.argv_heavy", repr(json.dumps(HEAVY)))
    found = subprocess.run(
        [sys.executable, "-c", code, json.dumps(list(WRONG))],
        capture_output=True,
        text=True,
        check=True,
        cwd=folder,
    )
    assert {path.name for path in folder.iterdir()} == {"table.csv", "acrobot.toml"}
    return found


def test_each_wrong_path_is_one_line(refused):
    lines = refused.stderr.splitlines()
    assert len(lines) == len(WRONG)
    for line, words in zip(lines, WRONG.values(), strict=True):
        assert line.startswith("frictionid: ") and words in line


def test_nothing_heavy_was_imported(refused):
    assert refused.stdout == "[]\n"
