"""Damaged inputs end in one line and nothing is lost; tests/damage.py tries many more of them."""

import subprocess
import sys
import tomllib

from fixtures.damage_targets import recordings
from fixtures.paths import ROOT

from frictionid.data.readers.formats import READERS

DAMAGE = [sys.executable, ROOT / "tests/damage.py", "--jobs", "1", "--first", "123456"]


def test_damaged_inputs_end_in_one_line_and_lose_nothing(tmp_path):
    ran = subprocess.run([*DAMAGE, "--count", "15"], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "0 inputs with faults" in ran.stdout and not list(tmp_path.iterdir())


def test_every_reader_takes_damaged_files_without_a_traceback(tmp_path):
    """Forty of each here; `make damage ARGS="--readers --count 1000"` takes a thousand of each."""
    named, count = set(), 40
    targets = list(recordings(tmp_path / "whole"))
    for target in targets:
        document = tomllib.loads((target.folder / "dataset.toml").read_text())
        named.add(document.get("reader", {}).get("kind"))
    assert named == {None, *READERS}
    command = [*DAMAGE, "--readers", "--count", str(count)]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert f"{count * len(targets)} damaged inputs" in ran.stdout
    assert "0 inputs with faults" in ran.stdout
