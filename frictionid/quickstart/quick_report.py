"""A first verdict: in words and as a picture, for people, and for programs as JSON."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.check import Verdict
from frictionid.check.findings import percent
from frictionid.comparison.kind_descriptions import summary
from frictionid.errors import InputError
from frictionid.evaluation.reference_model import Loss
from frictionid.evaluation.statistics import FEWEST
from frictionid.files import finite_json
from frictionid.fitting.fit import UNEXPLAINED
from frictionid.fitting.shooting.refine import NOT_FREE
from frictionid.friction import Friction, Law
from frictionid.friction.laws import Sum
from frictionid.friction.laws.levels import LOAD, LOSS
from frictionid.friction.provenance import Estimate, Estimates
from frictionid.mechanics import Mechanism
from frictionid.pictures import as_html, drawn
from frictionid.report.candidates import Measure
from frictionid.report.diagnostics import COLOURS as LEVEL_COLOURS
from frictionid.report.figures.style import (
    DARK,
    GREY,
    PLAIN,
    Styles,
    key_above,
    panel_grid,
    pens,
    plain_logarithm,
    velocity_axis,
)
from frictionid.report.figures.style import line as key_line
from frictionid.report.numbers import NOTHING, added, factor, norm_unit, short, with_levels
from frictionid.report.shooting_results import MANY, shooting_results
from frictionid.report.tables import Table, table_of, text_columns
from frictionid.report.terminal import Shown, console, parameter_table, say, show_torque_left
from frictionid.report.verdict import times

_BY_NOISE = 1.5  # times what noise leaves of the torque: right laws leave 0.7 to 1.0


@dataclass(frozen=True)
class Candidate:
    """A law on held-out motion.

    error : median error after the horizon [rad], or share of the torque left, of all folds
    by_fold : (F,) the same in each fold
    curves : (F + 1, V, n) [N m] friction of the folds and, last, of all data
    standing : against the best law, see `frictionid.evaluation.reference_model.Choice`; "" where
        too few folds hold out motion
    loss : against it, None of itself
    lacks : whether it counts as worse as it lacks a parameter that the data identify
    refined : what its fit to all data estimated
    torque : what it leaves of each joint's torque, see `frictionid.evaluation.torque_left`
    """

    name: str
    parameters: int
    error: float
    by_fold: Array
    curves: Array
    standing: str = ""
    loss: Loss | None = None
    lacks: bool = False
    refined: Estimates | None = None
    torque: pd.DataFrame = field(default_factory=pd.DataFrame)


@dataclass(frozen=True, eq=False, repr=False)
class Quick(Shown):
    """A first verdict, which prints itself at the prompt and in a notebook.

    Attributes
    ----------
    check : Verdict
    seconds : float [s] of motion that were compared, all where that takes no more than a minute
    horizon : float [s], after which errors are compared, NaN where the torque left is
    free : blocks that the chosen law's fit to all data kept free
    folds : number of folds that hold out motion
    candidates : tuple of Candidate, by their number of parameters; empty for unusable data
    chosen : Candidate or None, what the rule chooses
    friction : Friction or None, the chosen law fitted to all data
    refined : what that fit estimated
    velocity : array, shape (V, n), at which curves stand
    not_fitted : tuple of str, which laws could not be fitted, and why
    """

    check: Verdict
    seconds: float = 0.0
    horizon: float = 0.0
    free: tuple[str, ...] = ("friction",)
    folds: int = 0
    candidates: tuple[Candidate, ...] = ()
    chosen: Candidate | None = None
    friction: Friction | None = None
    refined: Estimates | None = None
    velocity: Array | None = None
    not_fitted: tuple[str, ...] = ()

    def show(self) -> None:
        show_check(self.check)
        show_laws(self)

    def _repr_html_(self) -> str:
        return super()._repr_html_() + ("" if self.chosen is None else as_html(self.plot()))

    @property
    def measure(self) -> Measure:
        """What laws are compared by."""
        return Measure(self.horizon, norm_unit(_mechanism(self).position_units))

    @property
    def frame(self) -> pd.DataFrame:
        """The laws on held-out motion: name, parameters, error [rad] or torque left, standing."""
        rows = [(c.name, c.parameters, c.error, c.standing or "undecided") for c in self.candidates]
        return pd.DataFrame(rows, columns=["name", "parameters", "error", "standing"])

    def plot(self) -> Any:
        """Friction by all laws and their errors, as a Matplotlib figure.

        Raises
        ------
        InputError
            Where the data are unusable.
        """
        if self.chosen is None:
            raise InputError("plot: the data are unusable, nothing was fitted")
        return drawn(partial(quick_figure, self))


def show_check(check: Verdict) -> None:
    """Print the begin of a first verdict: what the check says of the data."""
    from rich.text import Text

    head = Text(check.dataset, style="bold").append(": the data are ", "")
    console().print(head.append(check.level, f"bold {LEVEL_COLOURS[check.level]}"))
    for finding in check.findings:
        say(f"  {finding.text}" + (f" -> {finding.remedy}" if finding.remedy else ""))
    say("")


def show_laws(result: Quick) -> None:
    """Print the rest of a first verdict: the laws, which one, and its parameters."""
    if result.chosen is None:
        say("No law was fitted: correct the data first.")
        return
    say(_table(result), *(f"not fitted: {text}" for text in result.not_fitted), *verdict(result))
    if result.measure.is_torque:
        say("")
        show_torque_left({result.chosen.name: result.chosen.torque}, _mechanism(result).joints)
    if result.refined:
        say("", *_parameters(with_levels(result.refined)), *against_nominal(result.refined))
    say(*(f"next: {advice}" for advice in result.check.next))


def _parameters(read: Sequence[Estimate]) -> list[Table | str]:
    """The table of the parameters, and in a sentence inertial ones that are too many for it."""
    inertial = [e for e in read if e.block == "inertia"]
    if len(inertial) <= MANY:
        return [parameter_table(read)]
    count = sum(e.identified for e in inertial)
    said = f"{len(inertial)} inertial parameters, {count} of them identified: see `frictionid fit`."
    return [parameter_table([e for e in read if e.block != "inertia"]), said]


def against_nominal(refined: Estimates) -> list[str]:
    """A sentence on the base parameters whose 95 % intervals do not hold their nominal values."""
    differing = shooting_results(refined, None)["differing"]
    each = (f"{name} by {first} ({low} to {high})" for name, (first, low, high) in differing)
    return [f"Differing from the nominal values: {', '.join(each)}."] if differing else []


def _equations(law: Law) -> str:
    """The torque of a law in words, of a sum that of its parts.

    >>> _equations(Sum(("stribeck", "spring"))).partition(", and ")[2]
    'Tf = stiffness q + preload, of a cable or a spring'
    """
    parts = law.parts if isinstance(law, Sum) else (law,)
    return ", and ".join(summary(type(part)).rstrip(".") for part in parts)


def _torque_left(frame: pd.DataFrame) -> list[str]:
    """A sentence on the torque that a law leaves of all joints, where noise does not leave it."""
    total = frame[frame.joint == "all"]
    return [
        f"It leaves {percent(left)} of the torque, noise of the angles at most {percent(noise)}: "
        "something acts that this law does not have."
        for left, noise in zip(total.left, total.noise, strict=True)
        if left > _BY_NOISE * noise
    ]


def verdict(result: Quick) -> list[str]:
    """The verdict in sentences; none for unusable data."""
    if result.chosen is None or result.friction is None:
        return []
    chosen, measure, best = result.chosen, result.measure, best_of(result)
    median = "" if measure.is_torque else " (median)"
    out = [
        f"Verdict: {chosen.name}, {_equations(result.friction.law)}.",
        f"It {measure.words(chosen.error)} on held-out motion{median}, "
        f"{measure.size(_without(result).error)} without friction.",
    ]
    out += () if measure.is_torque else _torque_left(chosen.torque)
    warnings = result.refined.warnings if result.refined else ()
    out += (words for words in warnings if words.startswith(NOT_FREE) or UNEXPLAINED in words)
    if result.folds < FEWEST:
        return [*out, "Too little motion was held out to compare laws: it has the smallest error."]
    if best is not chosen and chosen.loss is not None:
        words = f"{times(chosen.loss.factor)} times as"
        richer = chosen.parameters > best.parameters
        but = ", but has a parameter that these data identify" if richer else ""
        out.append(
            f"{best.name} leaves least; {chosen.name} {words} much (80 %){but}."
            if measure.is_torque
            else f"{best.name} predicts best; {chosen.name} is {words} far off (80 %){but}."
        )
    if min(c.error for c in result.candidates) < best.error:
        out.append(
            "The table has medians over all motion; the rule weighs all recordings alike, or all "
            "folds of fewer than three."
        )
    unsure = [c for c in result.candidates if c.standing == "undecided"]
    if simpler := [c.name for c in unsure if 0 < c.parameters < chosen.parameters]:
        out.append(f"These data cannot tell whether {', '.join(simpler)} would do.")
    farther = [c for c in result.candidates if _is_worse(c) and not c.lacks]
    worse = [c.name if c.parameters else "no friction" for c in farther]
    out.append(
        f"Practically worse than {best.name}: {', '.join(worse)}."
        if worse
        else f"No other law is practically worse than {best.name}."
    )
    if lacking := ", ".join(c.name for c in result.candidates if c.lacks):
        out.append(
            f"Errors do not tell {lacking} from it; a parameter that these data identify does."
        )
    near = [c for c in result.candidates if c is not chosen and not _is_worse(c)]
    others = {c.name: c.refined for c in near if c.refined}
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
        "not_fitted": result.not_fitted,
        "chosen": result.chosen and result.chosen.name,
        "verdict": verdict(result),
        "fit": result.refined.document() if result.refined else {},
    }
    return finite_json(document)


def _table(result: Quick) -> Table:
    measure = result.measure
    rows = []
    for c in result.candidates:
        mark = f"{c.name} *" if c is result.chosen else c.name
        error = measure.size(c.error) if measure.is_torque else short(c.error)
        rows.append([mark, str(c.parameters), error, _times_best(c)])
    head = "torque left" if measure.is_torque else measure.of_what
    return table_of([*text_columns("law"), "parameters", head, "times the best (80 %)"], rows)


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


_HIGH = 1.25  # of the largest friction shown


def quick_figure(result: Quick) -> Any:
    """For each joint or part friction over velocity, each fold thin; then the folds' errors."""
    laws, mechanism = [c.name for c in result.candidates if c.parameters], _mechanism(result)
    styles: Styles = {**PLAIN, **dict(zip(laws, pens(), strict=False))}
    parts = len(mechanism.friction_names)
    picture, panels = panel_grid(parts + 1, 3, 2.7, 0.4)
    for part, axes in enumerate(panels[:parts]):
        _friction(axes, result, part, styles)
    _errors(panels[parts], result, styles)
    key = {
        f"{c.name}: the verdict" if c is result.chosen else c.name: key_line(*styles[c.name])
        for c in result.candidates
        if c.parameters
    }
    read = (e for c in result.candidates if c.refined for e in c.refined.parameters)
    loaded = not {e.parameter for e in read}.isdisjoint({LOAD.name, LOSS.name})
    fold = "each fold; all without load" if loaded else "each fold"
    key_above(picture, {**key, fold: key_line(GREY, linewidth=0.5)})
    return picture


def _friction(axes: Any, result: Quick, part: int, styles: Styles) -> None:
    assert result.velocity is not None
    mechanism, w = _mechanism(result), result.velocity[:, part]
    high = 0.0
    for c in result.candidates:
        if not c.parameters:
            continue
        folds, overall = c.curves[:-1, :, part], c.curves[-1, :, part]
        colour, dashes = styles[c.name]
        axes.plot(w, folds.T, color=colour, linewidth=0.4, alpha=0.5)
        width, order = (1.8, 4) if c is result.chosen else (1.0, 3)
        axes.plot(w, overall, color=colour, linestyle=dashes, linewidth=width, zorder=order)
        high = max(high, float(np.abs(overall).max()))
    end = _HIGH * high or 1.0
    velocity_axis(axes, w, (-end, end))
    axes.set_title(mechanism.friction_names[part], loc="left")
    axes.set_xlabel(f"velocity [{mechanism.friction_units[part]}/s]")
    axes.set_ylabel(f"friction [{mechanism.friction_torque_units[part]}]")


def _errors(axes: Any, result: Quick, styles: Styles) -> None:
    across = axes.get_xaxis_transform()
    for place, c in enumerate(result.candidates):
        offsets, colour = np.linspace(-0.15, 0.15, len(c.by_fold)), styles[c.name].colour
        error, *folds = result.measure.shown(np.append(c.error, c.by_fold))
        axes.plot(place + offsets, folds, "o", color=colour, markersize=3, alpha=0.5)
        axes.plot([place - 0.3, place + 0.3], 2 * [error], color=colour, linewidth=2)
        text = f"{factor(c.loss.factor.value)} ×" if c.loss else c.standing
        axes.text(place, 0.93, text, transform=across, ha="center", fontsize=7)
    axes.margins(y=0.2)  # for what is written there
    plain_logarithm(axes)
    names = [c.name for c in result.candidates]
    axes.set_xticks(range(len(names)), names, rotation=20, ha="right")
    axes.set_title("held out; dots: folds; ×: times the best", loc="left", color=DARK)
    axes.set_ylabel(result.measure.of_what)
