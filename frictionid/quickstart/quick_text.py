"""A first verdict in words, for people in the terminal and for programs as JSON."""

from __future__ import annotations

import json

import numpy as np

from frictionid.comparison.kind_descriptions import summary
from frictionid.comparison.registry import IDENTIFIERS
from frictionid.evaluation.statistics import FEWEST, CorrelatedTest
from frictionid.files import plain
from frictionid.quickstart.quick import Candidate, Quick
from frictionid.report.console import console
from frictionid.report.diagnostics import COLOURS
from frictionid.report.estimates import estimates
from frictionid.report.numbers import NOTHING, norm_unit, short
from frictionid.report.tables import Column, Table, for_terminal, line, text_columns
from frictionid.report.terminal import parameter_table


def show_quick(found: Quick) -> None:
    """Print a first verdict: what the check found, the laws, which one, and its parameters."""
    from rich.text import Text

    out = console()
    check = found.check
    head = Text(check.dataset, style="bold").append(": the data are ", "")
    out.print(head.append(check.level, f"bold {COLOURS[check.level]}"))
    for finding in check.findings:
        remedy = f" -> {finding.remedy}" if finding.remedy else ""
        out.print(f"  {finding.text}{remedy}", markup=False, soft_wrap=True)
    out.print()
    if found.chosen is None:
        out.print("No law was fitted: correct the data first.", markup=False)
        return
    for text in for_terminal(_table(found)):
        out.print(text, soft_wrap=True)
    for sentence in verdict(found):
        out.print(sentence, markup=False, soft_wrap=True)
    if found.refined:
        out.print()
        for text in for_terminal(parameter_table(estimates(found.refined))):
            out.print(text, soft_wrap=True)
    for advice in check.next:
        out.print(f"next: {advice}", markup=False, soft_wrap=True)


def verdict(found: Quick) -> list[str]:
    """The verdict in sentences; none for unusable data."""
    if found.chosen is None:
        return []
    chosen, unit, best = found.chosen, _unit(found), best_of(found)
    out = [
        f"Verdict: {chosen.name}, {summary(IDENTIFIERS[chosen.name].parts[-1])}",
        f"It is {short(chosen.error)} {unit} off after {found.horizon:g} s on held-out motion "
        f"(median), {short(_without(found).error)} {unit} without friction.",
    ]
    if found.folds < FEWEST:
        return [*out, "Too little motion was held out to compare laws: it has the smallest error."]
    if best is not chosen:
        out.append(
            f"{best.name} predicts best fold by fold, but {chosen.name} is not shown to be "
            "practically worse and has fewer parameters."
        )
    worse = [c.name for c in found.candidates if _is_worse(c)]
    if worse:
        out.append(f"Practically worse than {best.name}: {', '.join(worse)}.")
    if not _is_worse(_without(found)):
        out.append(
            "No friction at all is not shown to be practically worse on these data: record more "
            "motion."
        )
    if len(found.free) > 1:
        out.append(f"Free beside friction: {', '.join(found.free[1:])}.")
    return out


def quick_json(found: Quick) -> str:
    """A first verdict as JSON text; SI units, null for what is infinite or unknown."""
    check = found.check
    document = {
        "dataset": check.dataset,
        "level": check.level,
        "findings": check.findings,
        "seconds": found.seconds,
        "horizon": found.horizon,
        "free": found.free,
        "candidates": [
            {
                "name": c.name,
                "parameters": c.parameters,
                "error": c.error,
                "by_fold": c.by_fold,
                "standing": c.standing and c.standing.standing,
                "times_best": c.standing and c.standing.test and times_best(c.standing.test),
            }
            for c in found.candidates
        ],
        "chosen": found.chosen and found.chosen.name,
        "verdict": verdict(found),
        "fit": found.refined,
    }
    return json.dumps(plain(document, infinity=None), indent=1, allow_nan=False)


def _table(found: Quick) -> Table:
    columns = [
        *text_columns("law"),
        Column("parameters"),
        Column(f"error after {found.horizon:g} s [{_unit(found)}]"),
        Column("times the best (95 %)"),
    ]
    lines = []
    for c in found.candidates:
        mark = f"{c.name} *" if c is found.chosen else c.name
        lines.append(line([mark, str(c.parameters), short(c.error), _times_best(c)]))
    return Table("", "", tuple(columns), tuple(lines))


def best_of(found: Quick) -> Candidate:
    """The law of the lowest mean error over the folds, or overall where nothing is shown."""
    first = [c for c in found.candidates if c.standing and c.standing.standing == "best"]
    return first[0] if first else min(found.candidates, key=lambda c: c.error)


def times_best(test: CorrelatedTest) -> tuple[float, float, float]:
    """Error as a multiple of the best law's, geometric mean over the folds, and 95 % interval."""
    mean, low, high = np.exp((test.mean, test.low, test.high)).tolist()
    return mean, low, high


def _times_best(c: Candidate) -> str:
    if c.standing is None or c.standing.test is None:
        return NOTHING
    if c.standing.standing == "best":
        return "best"
    mean, low, high = (short(value) for value in times_best(c.standing.test))
    return f"{mean} ({low} to {high})"


def _is_worse(c: Candidate) -> bool:
    return c.standing is not None and c.standing.standing in ("worse", "diverged")


def _without(found: Quick) -> Candidate:
    return next(c for c in found.candidates if not c.parameters)


def _unit(found: Quick) -> str:
    mechanism = found.check.regression.measured.dataset.mechanism
    return norm_unit(mechanism.position_units)
