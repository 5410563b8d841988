"""A verdict on data, for people in the terminal and for programs as JSON."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np

from frictionid.check import Verdict
from frictionid.check.regression import Estimate
from frictionid.mechanics import mechanism_of

WIDTH = 120  # columns, where the output is no terminal
COLOURS = {"good": "green", "doubtful": "yellow", "unusable": "red"}


def show_verdict(verdict: Verdict) -> None:
    """Print a verdict: in colour in a terminal, as plain text into a pipe."""
    from rich.console import Console

    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=WIDTH)
    for part in (_headline, _joints, _findings, _questions, _estimate, _friction, _next):
        part(verdict, console)


def as_json(verdict: Verdict) -> str:
    """All of a verdict as JSON text; SI units, null for what is infinite or unknown."""
    fields = {
        f.name: _plain(getattr(verdict, f.name))
        for f in dataclasses.fields(verdict)
        if f.name != "regression"
    }
    del fields["estimate"]["residual"]
    return json.dumps(fields, indent=1, allow_nan=False)


def _plain(value: Any) -> Any:
    """Dataclasses and named tuples as objects, arrays as lists."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if hasattr(value, "_asdict"):
        return {key: _plain(entry) for key, entry in value._asdict().items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _units(verdict: Verdict) -> tuple[str, str]:
    description = mechanism_of(verdict.regression.measured.dataset.mechanism).description
    return description.angle_unit, description.torque_unit


def _headline(verdict: Verdict, console: Any) -> None:
    from rich.text import Text

    clock = verdict.clock
    line = Text(verdict.dataset, style="bold").append(": ", "")
    line.append(verdict.level, f"bold {COLOURS[verdict.level]}")
    plural = "recording" if clock.recordings == 1 else "recordings"
    line.append(
        f"   {clock.recordings} {plural}, {clock.duration:.0f} s at {clock.rate:.4g} Hz, jitter "
        f"{100 * clock.jitter:.1f} %, {clock.dropped} samples dropped, {clock.gaps} gaps"
    )
    if clock.gaps:
        line.append(f" (longest {clock.longest_gap:.2g} s)")
    line.append(f", {verdict.passive:.0f} s of free decay")
    console.print(line)


def _joints(verdict: Verdict, console: Any) -> None:
    angle, torque = _units(verdict)
    head = [
        "joint", f"q range [{angle}]", "w 95 %", "w top", "forward", "rest", "turns",
        f"u RMS [{torque}]", "u top", "noise q", "of w", "of u", "step q", "of u",
    ]  # fmt: skip
    table = _table(head)
    for j in verdict.joints:
        table.add_row(
            str(j.joint),
            f"{j.range:.3g}",
            f"{j.fast:.3g}",
            f"{j.top:.3g}",
            f"{100 * j.forward:.0f} %",
            f"{100 * j.rest:.0f} %",
            str(j.reversals),
            f"{j.torque:.2g}",
            f"{j.torque_top:.2g}",
            f"{j.angle_noise:.2g}",
            f"{j.velocity_noise:.2g}",
            f"{j.torque_noise:.1g}",
            f"{j.angle_step:.1g}" if j.angle_step else "-",
            f"{j.torque_step:.1g}" if j.torque_step else "-",
        )
    console.print(table)


def _findings(verdict: Verdict, console: Any) -> None:
    from rich.text import Text

    for finding in verdict.findings:
        mark = "note" if finding.level == "good" else finding.level
        line = Text(f"{mark}: ", style=COLOURS[finding.level]).append(finding.text, "")
        if finding.remedy:
            line.append(f" -> {finding.remedy}", "dim")
        console.print(line)
    if verdict.findings:
        console.print()


def _questions(verdict: Verdict, console: Any) -> None:
    from rich.text import Text

    marks = {True: ("yes", "green"), False: ("NO", "red"), None: ("?", "yellow")}
    table = _plain_table()
    for question in verdict.questions:
        table.add_row(Text(*marks[question.passed]), question.question, question.words)
    for entry in verdict.identifiable:
        table.add_row(Text(*marks[entry.possible]), f"identifiable: {entry.what}", entry.reason)
    console.print(table)


def _estimate(verdict: Verdict, console: Any) -> None:
    estimate, model = verdict.estimate, verdict.published
    theirs = dict(zip(model.names, model.published, strict=True)) if model else {}
    head = ["least squares", "estimate", "nominal", *(["published"] if theirs else [])]
    table = _table(head)
    for name, nominal in zip(estimate.names, verdict.nominal, strict=False):
        cells = [name, _with_error(estimate, name), f"{nominal:.4g}"]
        table.add_row(*cells, *([f"{theirs[name]:.4g}"] if theirs else []))
    console.print(table)


def _friction(verdict: Verdict, console: Any) -> None:
    angle, torque = _units(verdict)
    names = ("coulomb", "viscous", "offset")
    units = (torque, f"{torque} s/{angle}", torque)
    table = _table(["joint", *(f"{n} [{u}]" for n, u in zip(names, units, strict=True))])
    model = verdict.published
    theirs = dict(zip(model.names, model.published, strict=True)) if model else {}
    for joint in verdict.joints:
        cells = []
        for name in names:
            key = f"{name}_{joint.joint}"
            also = f" (published {theirs[key]:.3g})" if key in theirs else ""
            cells.append(_with_error(verdict.estimate, key) + also)
        table.add_row(str(joint.joint), *cells)
    console.print(table)


def _with_error(estimate: Estimate, name: str) -> str:
    value, error = estimate.at(name)
    return f"{value:.4g} +- {error:.1g}" if np.isfinite(error) else "not identified"


def _next(verdict: Verdict, console: Any) -> None:
    from rich.text import Text

    for advice in verdict.next:
        console.print(Text("next: ", "bold").append(advice, ""))


def _table(head: list[str]) -> Any:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 0))
    for i, name in enumerate(head):
        table.add_column(Text(name), justify="left" if i == 0 else "right", no_wrap=True)
    return table


def _plain_table() -> Any:
    from rich.table import Table

    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 1))
    for _ in range(3):
        table.add_column()
    return table
