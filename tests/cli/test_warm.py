"""Loops that are compiled say so; `frictionid warm` leaves a fit and a check nothing to compile."""

import os
import subprocess
import sys

from fixtures.paths import ROOT

FIRST = """
import sys, time
from frictionid.progress import compiling
from frictionid.api.warm import _joint, warm_up
names, steps = [], []
with compiling(names.append):
    warm_up(steps.append) if sys.argv[1] == "warm" else _joint()
print(steps, sorted(names))
"""


def test_what_is_warm_is_not_compiled_again(tmp_path):
    def run(what):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            [sys.executable, "-c", FIRST, what],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout

    first = run("warm")
    assert first.startswith("['a joint', 'an arm']") and "'smoothed'" in first
    assert run("joint") == "[] []\n"
