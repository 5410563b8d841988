"""A verdict of `check`: for people in the terminal, as JSON for programs, and in pictures."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.check import Verdict
from frictionid.check.questions import answer_of
from frictionid.check.regression import one_way
from frictionid.files import finite_json, plain, write_bytes
from frictionid.mechanics import Mechanism

from .figures import style
from .numbers import NOTHING, either
from .tables import Column, Table, table_of, text_columns
from .terminal import console, say

COLOURS = {"good": "green", "doubtful": "yellow", "unusable": "red"}
ANSWERS = {True: "green", False: "red", None: "yellow"}


def show_verdict(verdict: Verdict) -> None:
    """Print a verdict: in colour in a terminal, as plain text into a pipe."""
    from rich.table import Table as Grid
    from rich.text import Text

    out = console()
    level = (verdict.level, f"bold {COLOURS[verdict.level]}")
    out.print(Text.assemble((verdict.dataset, "bold"), ": ", level, _clock(verdict)))
    say(_joints(verdict))
    for finding in verdict.findings:
        mark = "note" if finding.level == "good" else finding.level
        remedy = (f" -> {finding.remedy}" if finding.remedy else "", "dim")
        out.print(Text.assemble((f"{mark}: ", COLOURS[finding.level]), finding.text, remedy))
    if verdict.findings:
        out.print()
    grid = Grid(box=None, show_header=False, pad_edge=False, padding=(0, 1))
    rows = [(q.passed, q.question, q.words) for q in verdict.questions]
    rows += [(e.possible, f"identifiable: {e.what}", e.reason) for e in verdict.identifiable]
    for passed, question, words in rows:
        grid.add_row(Text(answer_of(passed), ANSWERS[passed]), question, words)
    out.print(grid)
    say(_estimate(verdict), _friction(verdict))
    for advice in verdict.next:
        out.print(Text.assemble(("next: ", "bold"), advice))


def as_json(verdict: Verdict) -> str:
    """All of a verdict as JSON text; SI units, null for what is infinite or unknown."""
    fields = {name: value for name, value in vars(verdict).items() if name != "regression"}
    document = plain(fields, infinity=None)
    del document["estimate"]["residual"]
    return finite_json(document)


def _mechanism(verdict: Verdict) -> Mechanism:
    return verdict.regression.measured.dataset.mechanism


def _clock(verdict: Verdict) -> str:
    """Length, rate and gaps of the recordings."""
    clock = verdict.clock
    several, gaps = ("s" * (count != 1) for count in (clock.recordings, clock.gaps))
    rates = f"{clock.slowest:.4g} to {clock.fastest:.4g}"
    if clock.fastest < 1.2 * clock.slowest:
        rates = f"{clock.rate:.4g}"
    longest = f" (longest {clock.longest_gap:.2g} s)" if clock.gaps else ""
    return (
        f"   {clock.recordings} recording{several}, {clock.duration:.0f} s at {rates} Hz, jitter "
        f"{100 * clock.jitter:.1f} %, {clock.dropped} samples dropped, {clock.gaps} gap{gaps}"
        f"{longest}, {verdict.passive:.0f} s of free decay"
    )


def _joints(verdict: Verdict) -> Table:
    """Motion, torque, noise and steps of each joint."""
    mechanism = _mechanism(verdict)
    angle, torque = either(mechanism.position_units), either(mechanism.torque_units)
    heads = [*text_columns("joint"), f"q range [{angle}]", "w 95 %", "w top", "forward", "rest"]
    heads += ["turns", f"u RMS [{torque}]", "u top"]
    heads += [Column(name, "noise") for name in "qwu"] + [Column(name, "step") for name in "qu"]
    rows = [
        [
            str(j.joint) if name.endswith(str(j.joint)) else f"{j.joint}, {name}",
            *(f"{value:.3g}" for value in (j.range, j.fast, j.top)),
            *(f"{100 * share:.0f} %" for share in (j.forward, j.at_rest)),
            str(j.reversals),
            *(f"{v:.2g}" for v in (j.torque, j.torque_top, j.angle_noise, j.velocity_noise)),
            f"{j.torque_noise:.1g}",
            *(f"{step:.1g}" if step else NOTHING for step in (j.angle_step, j.torque_step)),
        ]
        for j, name in zip(verdict.joints, mechanism.joints, strict=True)
    ]
    return table_of(heads, rows)


def _estimate(verdict: Verdict) -> Table:
    """Base parameters by least squares, beside nominal ones."""
    rows = [
        [name, _with_error(verdict, name), f"{nominal:.4g}"]
        for name, nominal in zip(verdict.estimate.names, verdict.nominal, strict=False)
    ]
    return table_of([*text_columns("least squares"), "estimate", "nominal"], rows)


def _friction(verdict: Verdict) -> Table:
    """Friction of joints, and of parts that turn with several, by least squares."""
    mechanism = _mechanism(verdict)
    torque = either(mechanism.torque_units)
    pairs = zip(mechanism.torque_units, mechanism.position_units, strict=True)
    viscous = either([f"{force} s/{position}" for force, position in pairs])
    units = {"coulomb": torque, "viscous": viscous, "offset": torque}
    rows = []
    coupled = [name for name, _ in mechanism.coupled]
    for part in [*(str(joint.joint) for joint in verdict.joints), *coupled]:
        rows.append([part])
        for key in (f"{name}_{part}" for name in units):
            has_one = key in verdict.estimate.names  # a part of several joints has no offset
            rows[-1].append(_with_error(verdict, key) if has_one else NOTHING)
    return table_of([*text_columns("joint"), *(f"{n} [{u}]" for n, u in units.items())], rows)


def _with_error(verdict: Verdict, name: str) -> str:
    value, error = verdict.estimate.at(name)
    return f"{value:.4g} +- {error:.1g}" if np.isfinite(error) else "not identified"


# --- Pictures: where the joints have been, what moved them, friction before any fit ---------------

MOVING, RESTING = style.COLOURS[:2]
RECORDINGS = 3  # shown over time
ABREAST = 3  # joints side by side
_ZERO: Mapping[str, Any] = {"color": style.PALE, "linewidth": 0.6, "zorder": 0}


def picture_paths(folder: Path) -> list[Path]:
    """Paths of the pictures: coverage, motion and residual torque (PNG)."""
    return [folder / f"{name}.png" for name in PICTURES]


def write_pictures(verdict: Verdict, folder: Path) -> list[Path]:
    """Paths of the pictures written, see `picture_paths`."""
    paths = picture_paths(folder)
    for path, draw in zip(paths, PICTURES.values(), strict=True):
        write_bytes(path, style.png(partial(draw, verdict)))
    return paths


def _coverage(verdict: Verdict) -> Any:
    """The (q, w) plane of each joint, rest marked."""
    units = _mechanism(verdict).position_units
    picture, panels = style.panel_grid(len(verdict.joints), ABREAST, 2.4, 0.35)
    states = [m.states for m in verdict.regression.measured.motions]
    q, w = np.concatenate([s.q for s in states]), np.concatenate([s.w for s in states])
    size = float(np.clip(2e4 / len(q), 0.3, 4.0))
    for j, axes in enumerate(panels):
        fact = verdict.joints[j]
        still = np.abs(w[:, j]) < fact.rest_speed
        for which, colour in ((~still, MOVING), (still, RESTING)):
            axes.scatter(q[which, j], w[which, j], s=size, color=colour, lw=0, rasterized=True)
        axes.axhline(0.0, **_ZERO)
        axes.set_title(f"joint {j + 1}: {100 * fact.at_rest:.0f} % of the time at rest", loc="left")
        axes.set(xlabel=f"q{j + 1} [{units[j]}]", ylabel=f"w{j + 1} [{units[j]}/s]")
    style.key_above(
        picture,
        {"moving": style.marker(MOVING), "at rest, or too slow to tell": style.marker(RESTING)},
    )
    return picture


def _motion(verdict: Verdict) -> Any:
    """Angles, velocities and torques over time, of the recordings that move most."""
    measured, mechanism = verdict.regression.measured, _mechanism(verdict)
    slides = set(mechanism.position_units) == {"m"}
    shown = [(measured.dataset.recordings[i], measured.motions[i].states) for i in _chosen(verdict)]

    def draw(axis: Any, row: int, column: int) -> None:
        recording, states = shown[column]
        torque, start = recording.torque, states.time[0]
        time = torque.time if row == 2 else states.time
        held = "steps-post" if row == 2 and torque.hold == "previous" else "default"
        axis.set_prop_cycle(color=style.COLOURS)
        values = (states.q, states.w, torque.value)[row]
        axis.plot(time - start, values, linewidth=0.8, drawstyle=held)
        axis.set_xlim(0.0, states.time[-1] - start)

    labels = (
        f"{'position' if slides else 'angle'} [{either(mechanism.position_units)}]",
        f"velocity [{either(mechanism.velocity_units)}]",
        f"{'force' if slides else 'torque'} [{either(mechanism.torque_units)}]",
    )
    titles = [style.plain(recording.name.rsplit("/", 1)[-1]) for recording, _ in shown]
    lines = (style.line(style.COLOURS[j % 6], linewidth=1.0) for j in range(mechanism.n))
    key = {f"joint {j}": line for j, line in enumerate(lines, 1)}
    return style.panels(draw, labels, titles, key, "time [s]", 1.35, sharex="col", sharey="row")


def _chosen(verdict: Verdict) -> list[int]:
    """Recordings to show: those in which the joints are fastest for them, in their own order."""
    square = np.stack([np.mean(m.states.w**2, 0) for m in verdict.regression.measured.motions])
    speed = np.mean(square / np.maximum(square.mean(0), 1e-300), axis=1)
    return sorted(np.argsort(-speed)[:RECORDINGS].tolist())


def _residual(verdict: Verdict) -> Any:
    """Torque that the nominal mechanism leaves to friction, against velocity, and least squares."""
    rows = verdict.regression.rows
    mechanism = _mechanism(verdict)
    picture, panels = style.panel_grid(len(verdict.joints), ABREAST, 2.4, 0.35)
    for j, axes in enumerate(panels):
        axes.axhline(0.0, **_ZERO)
        axes.axvline(0.0, **_ZERO)
        axes.set_xlabel(f"w{j + 1} [{mechanism.velocity_units[j]}]")
        axes.set_ylabel(f"residual torque [{mechanism.torque_units[j]}]")
        axes.set_title(f"joint {j + 1}", loc="left")
        if one_way(rows, j).any():
            _least_squares(axes, verdict, j)
        else:
            axes.text(0.5, 0.5, "hardly moves", transform=axes.transAxes, ha="center")
    style.key_above(
        picture,
        {
            "nominal mechanism, before any fit": style.marker(MOVING),
            "least squares": style.line(RESTING),
        },
    )
    return picture


def _least_squares(axes: Any, verdict: Verdict, j: int) -> None:
    rows, torque = verdict.regression.rows, verdict.regression.torque
    nb = len(verdict.nominal)
    use = one_way(rows, j)
    w = rows.w[use, j]
    left = torque[use, j] - rows.regressor[use, j] @ verdict.nominal
    size = float(np.clip(6e3 / len(w), 1.0, 4.0))
    axes.scatter(w, left, s=size, color=MOVING, alpha=0.4, linewidths=0, rasterized=True)
    low, high = np.quantile(left, [0.005, 0.995])
    margin = 0.3 * (high - low) + 1e-9 * max(abs(low), abs(high), 1.0)
    axes.set_ylim(low - margin, high + margin)
    coulomb, viscous, offset = verdict.estimate.value[nb + 3 * j : nb + 3 * j + 3]
    for side in (-1.0, 1.0):
        ends = np.array([0.0, np.abs(w).max()]) * side
        axes.plot(ends, coulomb * side + viscous * ends + offset, color=RESTING)


PICTURES: Mapping[str, Callable[[Verdict], Any]] = {
    "coverage": _coverage,
    "motion": _motion,
    "residual": _residual,
}
