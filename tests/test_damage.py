"""Damaged inputs end in one line and nothing is lost; tests/damage.py tries many more of them."""

import subprocess
import sys

from fixtures.paths import ROOT


def test_damaged_inputs_end_in_one_line_and_lose_nothing(tmp_path):
    command = [sys.executable, ROOT / "tests" / "damage.py", "--count", "15", "--first", "123456"]
    ran = subprocess.run([*command, "--jobs", "1"], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "0 inputs with faults" in ran.stdout and not list(tmp_path.iterdir())
