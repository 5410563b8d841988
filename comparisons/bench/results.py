"""What `make bench` writes: the table as CSV and Markdown, and for the terminal."""

from __future__ import annotations

import os
import platform
import subprocess
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

import pandas as pd
from measure import Row
from rich.markup import escape
from rich.table import Table
from samples import ROOT

PACKAGES = (
    "numpy",
    "scipy",
    "numba",
    "torch",
    "pysindy",
    "opencv-python-headless",
    "mujoco",
    "pin",
)
HEAD = ("what", "beside", "ours", "peer", "peer / ours", "asked for", "error: ours, peer")


def machine() -> list[str]:
    """The machine, what is installed, and the state of the code, a line each."""
    versions = [f"Python {platform.python_version()}"]
    for name in PACKAGES:
        try:
            versions.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            versions.append(f"{name} not installed")
    load = ", ".join(f"{x:.1f}" for x in os.getloadavg())
    return [
        f"{_processor()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}",
        ", ".join(versions),
        f"frictionid {_commit()}; load of the last 1, 5, 15 minutes at the end: {load}",
    ]


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    facts = dict(line.split(":", 1) for line in lines if ":" in line)
    facts = {k.strip(): v.strip() for k, v in facts.items()}
    family = (facts.get(k, "?") for k in ("cpu family", "model"))
    return "{} (family {}, model {})".format(facts.get("model name", platform.machine()), *family)


def _commit() -> str:
    command = ["git", "describe", "--always", "--dirty"]
    try:
        found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return metadata.version("frictionid")
    return found.stdout.strip()


def frame(rows: Sequence[Row]) -> pd.DataFrame:
    """All figures, one row for each case."""
    return pd.DataFrame(
        {
            "what": r.case.name,
            "ours": r.case.ours.what,
            "peer": r.case.peer.what,
            "ours_s": r.ours,
            "peer_s": r.peer,
            "clock": r.case.clock,
            "ratio": r.ratio,
            "ratio_least": r.ratios.min(),
            "ratio_most": r.ratios.max(),
            "ratio_by_processor": r.by_processor,
            "rounds": len(r.ratios),
            "bar": r.case.bar,
            "with_imports_and_first_call": r.case.once,
            "ours_first_call_s": r.first,
            "ours_imports_s": r.imports,
            "error": r.case.error,
            "ours_error": r.ours_error,
            "peer_error": r.peer_error,
            "error_bar": r.case.error_bar,
            "holds": r.holds,
        }
        for r in rows
    )


def cells(row: Row) -> tuple[str, ...]:
    """Cells of a row as a person reads them."""
    case = row.case
    spread = f" ({row.ratios.min():.3g} to {row.ratios.max():.3g})" if len(row.ratios) > 1 else ""
    both = "" if case.clock == "processor" else f"; of processors {row.by_processor:.3g}"
    errors = " / ".join("-" if e != e else f"{e:.2g}" for e in (row.ours_error, row.peer_error))
    return (
        case.name,
        case.peer.what,
        seconds(row.ours) + _more(row),
        seconds(row.peer),
        f"{row.ratio:.3g}{spread}{both}",
        _asked(row),
        f"{errors} {case.error}" if case.error else "",
    )


def _more(row: Row) -> str:
    """What comes before or with the first call, where it shows."""
    parts = {"imports": row.imports, "first call": row.first}
    shown = [f"{name} {seconds(t)}" for name, t in parts.items() if t > 0.1 * row.ours and t > 0.02]
    return f" (+ {', '.join(shown)})" if shown else ""


def _asked(row: Row) -> str:
    case = row.case
    parts = [] if case.bar is None else [f">= {case.bar:g}"]
    parts += [] if case.error_bar is None else [f"error <= {case.error_bar:g} of its"]
    said = {None: "", True: ": holds", False: ": missed"}
    return ", ".join(parts) + said[row.holds]


def seconds(time: float) -> str:
    """A time in a unit that suits.

    >>> seconds(0.0123), seconds(2.5)
    ('12 ms', '2.5 s')
    """
    if time < 1e-3:
        return f"{1e6 * time:.3g} us"
    return f"{1e3 * time:.3g} ms" if time < 1.0 else f"{time:.3g} s"


def terminal(rows: Sequence[Row]) -> Table:
    """The table for the terminal."""
    table = Table(*HEAD, title="frictionid beside others, one thread unless said otherwise")
    for row in rows:
        table.add_row(*map(escape, cells(row)))
    return table


def markdown(rows: Sequence[Row], notes: Sequence[str]) -> str:
    """The table as Markdown, with the machine."""
    lines = ["| " + " | ".join(HEAD) + " |", "|" + " --- |" * len(HEAD)]
    lines += ["| " + " | ".join(cells(row)) + " |" for row in rows]
    return "\n".join([*lines, "", *(f"- {note}" for note in notes), ""])
