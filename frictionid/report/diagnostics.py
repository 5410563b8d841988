"""A verdict on data, for people in the terminal and for programs as JSON."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from frictionid.check import Verdict
from frictionid.check.facts import ClockFacts
from frictionid.check.questions import answer_of
from frictionid.check.regression import Estimate
from frictionid.files import plain
from frictionid.report.console import console
from frictionid.report.numbers import NOTHING, either
from frictionid.report.tables import Column, Line, Table, for_terminal, line, text_columns

COLOURS = {"good": "green", "doubtful": "yellow", "unusable": "red"}


def show_verdict(verdict: Verdict) -> None:
    """Print a verdict: in colour in a terminal, as plain text into a pipe."""
    out = console()
    for part in (_headline, _joints, _findings, _questions, _estimate, _friction, _next):
        part(verdict, out)


def as_json(verdict: Verdict) -> str:
    """All of a verdict as JSON text; SI units, null for what is infinite or unknown."""
    fields = {
        f.name: plain(getattr(verdict, f.name), infinity=None)
        for f in dataclasses.fields(verdict)
        if f.name != "regression"
    }
    del fields["estimate"]["residual"]
    return json.dumps(fields, indent=1, allow_nan=False)


def _units(verdict: Verdict) -> tuple[str, str]:
    mechanism = verdict.regression.measured.dataset.mechanism
    return either(mechanism.position_units), either(mechanism.torque_units)


def _headline(verdict: Verdict, console: Any) -> None:
    from rich.text import Text

    clock = verdict.clock
    line = Text(verdict.dataset, style="bold").append(": ", "")
    line.append(verdict.level, f"bold {COLOURS[verdict.level]}")
    plural = "recording" if clock.recordings == 1 else "recordings"
    line.append(
        f"   {clock.recordings} {plural}, {clock.duration:.0f} s at {_rates(clock)} Hz, jitter "
        f"{100 * clock.jitter:.1f} %, {clock.dropped} samples dropped, {clock.gaps} gaps"
    )
    if clock.gaps:
        line.append(f" (longest {clock.longest_gap:.2g} s)")
    line.append(f", {verdict.passive:.0f} s of free decay")
    console.print(line)


def _rates(clock: ClockFacts) -> str:
    """Sampling rate, or the range of the rates where they differ."""
    if clock.fastest < 1.2 * clock.slowest:
        return f"{clock.rate:.4g}"
    return f"{clock.slowest:.4g} to {clock.fastest:.4g}"


def _joints(verdict: Verdict, console: Any) -> None:
    angle, torque = _units(verdict)
    names = (f"q range [{angle}]", "w 95 %", "w top", "forward", "rest", "turns")
    columns = [*text_columns("joint"), *map(Column, names)]
    columns += [Column(f"u RMS [{torque}]"), Column("u top")]
    columns += [Column(name, "noise") for name in ("q", "w", "u")]
    columns += [Column(name, "step") for name in ("q", "u")]
    lines = []
    for j in verdict.joints:
        ranges = [f"{value:.3g}" for value in (j.range, j.fast, j.top)]
        shares = [f"{100 * share:.0f} %" for share in (j.forward, j.at_rest)]
        torques = [f"{value:.2g}" for value in (j.torque, j.torque_top)]
        noise = [f"{j.angle_noise:.2g}", f"{j.velocity_noise:.2g}", f"{j.torque_noise:.1g}"]
        steps = [f"{step:.1g}" if step else NOTHING for step in (j.angle_step, j.torque_step)]
        lines.append(
            line([str(j.joint), *ranges, *shares, str(j.reversals), *torques, *noise, *steps])
        )
    _print(console, columns, lines)


def _print(console: Any, columns: Sequence[Column], lines: Sequence[Line]) -> None:
    for text in for_terminal(Table("", "", tuple(columns), tuple(lines))):
        console.print(text, soft_wrap=True)


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

    colours = {True: "green", False: "red", None: "yellow"}
    table = _plain_table()
    for question in verdict.questions:
        table.add_row(
            Text(answer_of(question.passed), colours[question.passed]),
            question.question,
            question.words,
        )
    for entry in verdict.identifiable:
        table.add_row(
            Text(answer_of(entry.possible), colours[entry.possible]),
            f"identifiable: {entry.what}",
            entry.reason,
        )
    console.print(table)


def _published(verdict: Verdict) -> dict[str, float]:
    """Parameters of the published model, by their names; none where there is no such model."""
    model = verdict.published
    return dict(zip(model.names, model.published, strict=True)) if model else {}


def _estimate(verdict: Verdict, console: Any) -> None:
    published = _published(verdict)
    columns = [*text_columns("least squares"), Column("estimate"), Column("nominal")]
    columns += [Column("published")] if published else []
    lines = []
    for name, nominal in zip(verdict.estimate.names, verdict.nominal, strict=False):
        cells = [name, _with_error(verdict.estimate, name), f"{nominal:.4g}"]
        lines.append(line([*cells, *([f"{published[name]:.4g}"] if published else [])]))
    _print(console, columns, lines)


def _friction(verdict: Verdict, console: Any) -> None:
    mechanism, published = verdict.regression.measured.dataset.mechanism, _published(verdict)
    torque = either(mechanism.torque_units)
    pairs = zip(mechanism.torque_units, mechanism.position_units, strict=True)
    viscous = either([f"{force} s/{position}" for force, position in pairs])
    units = {"coulomb": torque, "viscous": viscous, "offset": torque}
    columns = [
        *text_columns("joint"),
        *(Column(f"{name} [{unit}]") for name, unit in units.items()),
    ]
    lines = []
    parts = [name for name, _ in mechanism.coupled]
    for part in [*(str(joint.joint) for joint in verdict.joints), *parts]:
        cells = [part]
        for key in (f"{name}_{part}" for name in units):
            if key not in verdict.estimate.names:
                cells.append(NOTHING)  # a part that turns with several joints has no offset
                continue
            also = f" (published {published[key]:.3g})" if key in published else ""
            cells.append(_with_error(verdict.estimate, key) + also)
        lines.append(line(cells))
    _print(console, columns, lines)


def _with_error(estimate: Estimate, name: str) -> str:
    value, error = estimate.at(name)
    return f"{value:.4g} +- {error:.1g}" if np.isfinite(error) else "not identified"


def _next(verdict: Verdict, console: Any) -> None:
    from rich.text import Text

    for advice in verdict.next:
        console.print(Text("next: ", "bold").append(advice, ""))


def _plain_table() -> Any:
    from rich.table import Table

    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 1))
    for _ in range(3):
        table.add_column()
    return table
