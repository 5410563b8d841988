"""`frictionid warm` leaves a fit and a check nothing to compile."""

import os
import subprocess
import sys

from fixtures.paths import ROOT

from frictionid.api.warm import warm_up

JOINT = """
from frictionid.progress import compiling
from frictionid.api.warm import _joint
names = []
with compiling(names.append):
    _joint()
print(names)
"""


def test_what_is_warm_is_not_compiled_again():
    steps = []
    warm_up(steps.append)
    assert steps == ["a joint", "an arm"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    run = [sys.executable, "-c", JOINT]
    assert subprocess.check_output(run, env=environment, text=True) == "[]\n"
