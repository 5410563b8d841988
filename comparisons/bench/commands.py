"""Start of the commands beside a script's imports, and the default comparison."""

from __future__ import annotations

import subprocess
import sys
import tempfile

import typer.main
from case import Case, Part, Side

from frictionid.__main__ import app

SCRIPT = "import numpy, scipy.optimize, pandas, matplotlib.pyplot, torch"
MAIN = "from frictionid.__main__ import main; main()"


def names() -> list[str]:
    """Names of all commands."""
    return sorted(typer.main.get_command(app).commands)


def start() -> Part:
    """Each command until it has said what it is for."""
    script = Side("a script that imports NumPy ... PyTorch", lambda: _started(SCRIPT))
    cases = [
        Case(f"start of frictionid {name}", _command(name, "--help"), script, drawn=False)
        for name in names()
    ]
    listed = Case("start of frictionid laws, all listed", _command("laws"), script)
    return Part((*cases, listed), 2)


def _command(*arguments: str) -> Side:
    return Side(f"frictionid {' '.join(arguments)}", lambda: _started(MAIN, *arguments))


def _started(code: str, *arguments: str) -> float:
    subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True)
    return float("nan")


def comparison() -> Part:
    """The default comparison, which takes minutes, on two processes and on one."""
    own, peer = (
        Side(f"frictionid, {jobs} processes", lambda jobs=jobs: _compared(jobs))
        for jobs in ("2", "1")
    )
    return Part((Case("the default comparison", own, peer, once=True, clock="wall"),), 1)


def _compared(jobs: str) -> float:
    with tempfile.TemporaryDirectory() as folder:
        return _started(MAIN, "compare", "acrobot", "--jobs", jobs, "--out", f"{folder}/acrobot")
