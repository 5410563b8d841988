"""A wrong path is refused before anything heavy is imported."""

import json
import os
import re
import signal
import subprocess
import sys

import pytest
from fixtures.mistakes import rows
from fixtures.shared import shared

HEAVY = ("pandas", "scipy", "sympy", "torch", "sklearn", "joblib", "cv2", "matplotlib")
WRONG = """
check nowhere   => nowhere does not exist; name a folder with a dataset.toml
check table.csv => table.csv has no dataset.toml; write one with frictionid init table.csv
check .         => . has no dataset.toml; write one with frictionid init .
fit nowhere --identifier stribeck --out m.json => nowhere does not exist
compare acrobat.toml => acrobat.toml: no such suite; did you mean acrobot.toml?
tune nothing.toml    => nothing.toml: no such suite
evaluate no.json nowhere --out s.csv      => no.json: no such file
evaluate acrobot.toml nowhere --out s.csv => nowhere does not exist
report nowhere  => nowhere/provenance.json: no such file
suggest --mechanism no.toml --limits torque=1 --out u.csv => no.toml: no such file
simulate no.toml --out out                => no.toml: no such file
render nowhere --camera no.toml --out out => nowhere does not exist
align no.csv table.csv --out out          => no.csv: no such file
"""
CALL = """
import json, sys
from frictionid.__main__ import main
for line in json.loads(sys.argv[1]):
    sys.argv = ["frictionid", *line.split()]
    assert main() == 2, line
print([name for name in json.loads(sys.argv_heavy) if name in sys.modules])
"""


@shared
def refused(shared_path):
    """What the wrong calls complain about, one line each, and the heavy modules imported."""
    (shared_path / "table.csv").write_text("time,q\n0,1\n")
    (shared_path / "acrobot.toml").write_text("")
    code = CALL.replace("sys.argv_heavy", repr(json.dumps(HEAVY)))
    found = subprocess.run(
        [sys.executable, "-c", code, json.dumps([line for line, _ in rows(WRONG)])],
        capture_output=True,
        text=True,
        check=True,
        cwd=shared_path,
    )
    assert {path.name for path in shared_path.iterdir()} == {"table.csv", "acrobot.toml"}
    return found


def test_each_wrong_path_is_one_line(refused):
    lines = refused.stderr.splitlines()
    for line, (_, words) in zip(lines, rows(WRONG), strict=True):
        assert line.startswith("frictionid: ") and words in line


PIPES = """
evaluate pipe acrobot_clean --out s.csv
export weights.json --to python --out f.py
compare pipe
check pipe
check robot
report result
simulate pipe --out out
monitor acrobot_clean --baseline pipe
track pipe --setup --out angles.csv
align pipe pipe --out out
"""
ROBOT = """name = "robot"
[mechanism]
urdf = "pipe"
[columns]
time = "t"
angle = ["q"]
torque = ["u"]
[recordings]
patterns = ["*.csv"]
"""
NETWORK = """
{"format": "frictionid model 1", "law": {"kind": "mlp"}, "joints": [{}],
"theta": {"file": "pipe.safetensors", "sha256": ""}, "shape": [1, 1]}
"""


@pytest.fixture
def pipes(tmp_path):
    """A folder with a pipe in the place of each file that commands read."""
    for place in ("pipe", "pipe.safetensors", "robot/pipe", "result/provenance.json"):
        (tmp_path / place).parent.mkdir(exist_ok=True)
        os.mkfifo(tmp_path / place)
    (tmp_path / "robot/dataset.toml").write_text(ROBOT)
    (tmp_path / "robot/run.csv").write_text("t,q,u\n0,0,0\n0.01,0,0\n0.02,0,0\n")
    (tmp_path / "weights.json").write_text(NETWORK)
    return tmp_path


@pytest.mark.parametrize("arguments", PIPES.strip().splitlines())
def test_a_pipe_in_the_place_of_a_file_is_refused_at_once(arguments, pipes, run):
    signal.alarm(30)
    try:
        code, out, err = run(pipes, arguments)
    finally:
        signal.alarm(0)
    assert (code, out) == (2, "") and "is no JSON" not in err
    assert re.match("frictionid: .*is no regular file but a pipe", err)


def test_nothing_heavy_was_imported(refused):
    assert refused.stdout == "[]\n"
