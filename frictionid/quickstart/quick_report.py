"""A first verdict in words and as a picture, for people, and for programs as JSON."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from frictionid.comparison.kind_descriptions import summary
from frictionid.comparison.registry import IDENTIFIERS
from frictionid.evaluation.reference_model import FEWEST
from frictionid.files import plain
from frictionid.mechanics import Mechanism
from frictionid.report.console import console, say
from frictionid.report.diagnostics import COLOURS as LEVEL_COLOURS
from frictionid.report.estimates import added
from frictionid.report.figures.style import (
    COLOURS,
    DARK,
    GREY,
    drawing,
    key_above,
    panel_grid,
    plain_logarithm,
    rendered,
    velocity_axis,
)
from frictionid.report.figures.style import line as key_line
from frictionid.report.numbers import NOTHING, factor, norm_unit, short
from frictionid.report.tables import Table, table_of, text_columns
from frictionid.report.terminal import parameter_table
from frictionid.report.verdict import times

from .quick import Candidate, Quick


def show_quick(result: Quick) -> None:
    """Print a first verdict: what the check result, the laws, which one, and its parameters."""
    from rich.text import Text

    out = console()
    check = result.check
    head = Text(check.dataset, style="bold").append(": the data are ", "")
    out.print(head.append(check.level, f"bold {LEVEL_COLOURS[check.level]}"))
    for finding in check.findings:
        say(f"  {finding.text}" + (f" -> {finding.remedy}" if finding.remedy else ""))
    say("")
    if result.chosen is None:
        say("No law was fitted: correct the data first.")
        return
    say(_table(result), *verdict(result))
    if result.refined:
        say("", parameter_table(result.refined.parameters))
    say(*(f"next: {advice}" for advice in check.next))


def verdict(result: Quick) -> list[str]:
    """The verdict in sentences; none for unusable data."""
    if result.chosen is None:
        return []
    chosen, unit, best = result.chosen, _unit(result), best_of(result)
    out = [
        f"Verdict: {chosen.name}, {summary(IDENTIFIERS[chosen.name].parts[-1])}",
        f"It is {short(chosen.error)} {unit} off after {result.horizon:g} s on held-out motion "
        f"(median), {short(_without(result).error)} {unit} without friction.",
    ]
    if result.folds < FEWEST:
        return [*out, "Too little motion was held out to compare laws: it has the smallest error."]
    if best is not chosen and chosen.loss is not None:
        words = times(chosen.loss.factor)
        out.append(f"{best.name} predicts best; {chosen.name} is {words} times as far off (80 %).")
    unsure = [c for c in result.candidates if c.standing == "undecided"]
    if simpler := [c.name for c in unsure if 0 < c.parameters < chosen.parameters]:
        out.append(f"These data cannot tell whether {', '.join(simpler)} would do.")
    worse = [c.name if c.parameters else "no friction" for c in result.candidates if _is_worse(c)]
    out.append(
        f"Practically worse than {best.name}: {', '.join(worse)}."
        if worse
        else f"No other law is practically worse than {best.name}."
    )
    if lacking := ", ".join(c.name for c in result.candidates if c.lacks):
        out.append(
            f"Errors do not tell {lacking} from it; a parameter that these data identify does."
        )
    others = {c.name: c.refined for c in result.candidates if c.refined and c is not chosen}
    if result.refined and (sentence := added(result.refined, others)):
        out.append(sentence)
    if not _is_worse(_without(result)):
        out.append(
            "No friction at all is not shown to be practically worse on these data: record more "
            "motion."
        )
    if len(result.free) > 1:
        out.append(f"Free beside friction: {', '.join(result.free[1:])}.")
    return out


def quick_json(result: Quick) -> str:
    """A first verdict as JSON text; SI units, null for what is infinite or unknown."""
    check = result.check
    document = {
        "dataset": check.dataset,
        "level": check.level,
        "findings": check.findings,
        "seconds": result.seconds,
        "horizon": result.horizon,
        "free": result.free,
        "candidates": [
            {
                "name": c.name,
                "parameters": c.parameters,
                "error": c.error,
                "by_fold": c.by_fold,
                "standing": c.standing,
                "times_best": c.loss and c.loss.factor[:3],
            }
            for c in result.candidates
        ],
        "chosen": result.chosen and result.chosen.name,
        "verdict": verdict(result),
        "fit": result.refined.document() if result.refined else {},
    }
    return json.dumps(plain(document, infinity=None), indent=1, allow_nan=False)


def _table(result: Quick) -> Table:
    error = f"error after {result.horizon:g} s [{_unit(result)}]"
    rows = []
    for c in result.candidates:
        mark = f"{c.name} *" if c is result.chosen else c.name
        rows.append([mark, str(c.parameters), short(c.error), _times_best(c)])
    return table_of([*text_columns("law"), "parameters", error, "times the best (80 %)"], rows)


def best_of(result: Quick) -> Candidate:
    """The law of the lowest mean error over the folds, or overall where nothing is shown."""
    first = [c for c in result.candidates if c.standing == "best"]
    return first[0] if first else min(result.candidates, key=lambda c: c.error)


def _times_best(c: Candidate) -> str:
    if c.loss is None:
        return c.standing if c.standing == "best" else NOTHING
    return f"{factor(c.loss.factor.value)} ({times(c.loss.factor)})"


def _is_worse(c: Candidate) -> bool:
    return c.standing in ("worse", "diverged")


def _without(result: Quick) -> Candidate:
    return next(c for c in result.candidates if not c.parameters)


def _mechanism(result: Quick) -> Mechanism:
    return result.check.regression.measured.dataset.mechanism


def _unit(result: Quick) -> str:
    return norm_unit(_mechanism(result).position_units)


_HIGH = 1.25  # of the largest friction shown


def quick_picture(result: Quick) -> bytes:
    """PNG of `quick_figure`."""
    with drawing():
        return rendered(quick_figure(result), ("png",))["png"]


def quick_figure(result: Quick) -> Any:
    """For each joint friction over velocity, each fold thin; then the errors of the folds."""
    laws, mechanism = [c.name for c in result.candidates if c.parameters], _mechanism(result)
    colours = {"none": GREY, **dict(zip(laws, COLOURS, strict=False))}
    joints = len(mechanism.joints)
    picture, panels = panel_grid(joints + 1, 3, 2.7, 0.4)
    for joint, axes in enumerate(panels[:joints]):
        _friction(axes, result, joint, colours)
    _errors(panels[joints], result, colours)
    key = {_label(c, result): key_line(colours[c.name]) for c in result.candidates if c.parameters}
    key_above(picture, {**key, "each fold": key_line(GREY, linewidth=0.5)})
    return picture


def _label(c: Candidate, result: Quick) -> str:
    return f"{c.name}: the verdict" if c is result.chosen else c.name


def _friction(axes: Any, result: Quick, joint: int, colours: dict[str, str]) -> None:
    assert result.velocity is not None
    mechanism, w = _mechanism(result), result.velocity[:, joint]
    high = 0.0
    for c in result.candidates:
        if not c.parameters:
            continue
        folds, overall = c.curves[:-1, :, joint], c.curves[-1, :, joint]
        axes.plot(w, folds.T, color=colours[c.name], linewidth=0.4, alpha=0.5)
        width, order = (1.8, 4) if c is result.chosen else (1.0, 3)
        axes.plot(w, overall, color=colours[c.name], linewidth=width, zorder=order)
        high = max(high, float(np.abs(overall).max()))
    end = _HIGH * high or 1.0
    velocity_axis(axes, w, (-end, end))
    axes.set_title(mechanism.joints[joint], loc="left")
    axes.set_xlabel(f"velocity [{mechanism.velocity_units[joint]}]")
    axes.set_ylabel(f"friction [{mechanism.torque_units[joint]}]")


def _errors(axes: Any, result: Quick, colours: dict[str, str]) -> None:
    for place, c in enumerate(result.candidates):
        offsets = np.linspace(-0.15, 0.15, len(c.by_fold))
        axes.plot(place + offsets, c.by_fold, "o", color=colours[c.name], markersize=3, alpha=0.5)
        axes.plot([place - 0.3, place + 0.3], 2 * [c.error], color=colours[c.name], linewidth=2)
    plain_logarithm(axes)
    axes.set_xticks(range(len(result.candidates)), [c.name for c in result.candidates], rotation=20)
    axes.set_title(f"after {result.horizon:g} s, held out; dots: folds", loc="left", color=DARK)
    axes.set_ylabel(f"error [{_unit(result)}]")
