"""Results of shooting as facts: the machine and its sensors, and what is not identified."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from frictionid.fitting.parameter_block import IDEAL
from frictionid.friction.provenance import Estimate, Estimates

from .numbers import (
    MINUS,
    NOTHING,
    change,
    digits,
    estimate_frame,
    interval_text,
    mark_of,
    names_of,
    span,
    value_text,
)
from .sections import DataDescription, Model
from .tables import Cell, Line, Table, line, render, table_of, text_columns

LATE = ("delay", "target_delay")
LIKE_DELAY = ("viscous", "lag")  # friction parameters that a late torque styles like


def shooting_results(refined: Estimates, data: DataDescription | None) -> dict[str, Any]:
    """What a fit by shooting tells beside friction, and what limits it, for the templates.

    data : knows true values

    calibration : identified parameters of sensors and motors, see `_calibration`
    nominal : number of identified base parameters with a nominal value
    differing : names of those whose interval does not hold it, with the `change`
    with_truth, missed : number of identified parameters with a known true value; those names whose
        interval does not hold it
    delay_fixed : friction parameters that hold the share of a delay that was not free
    delay_explains : those that a delay within its interval explains entirely
    refined : what was estimated, for windows, iterations and warnings of the fit itself
    """
    read = refined.parameters
    identified = [e for e in read if e.identified]
    order = (*IDEAL, "actuator")
    sensors = sorted(
        (e for e in identified if e.block in order), key=lambda e: order.index(e.block)
    )
    inertia = [e for e in identified if e.block == "inertia" and e.nominal]
    differing = [e for e in inertia if not e.holds(e.nominal or 0.0)]
    differing.sort(key=lambda e: -abs(e.value / (e.nominal or 1.0) - 1.0))
    true = {e: value for e in identified if (value := true_value(e, data)) is not None}
    return {
        "calibration": list(map(_calibration, sensors)),
        "nominal": len(inertia),
        "differing": [(e.name, change(e)) for e in differing],
        "with_truth": len(true),
        "missed": names_of(e for e, value in true.items() if not e.holds(value)),
        "not_identified": [e for e in read if not e.identified],
        "delay_fixed": delay_fixed(refined),
        "delay_explains": delay_explains(refined),
        "priors": names_of(e for e in read if e.prior is not None),
        "refined": refined,
    }


def _calibration(e: Estimate) -> dict[str, Any]:
    """An identified parameter of a sensor or motor.

    text : value with its 95 % interval, delays in ms
    side : 1 above the ideal value, -1 below it, 0 where the interval holds it
    change : `change` from the nominal value, or None
    """
    ideal, late = IDEAL.get(e.block), e.block in LATE
    return {
        "block": e.block,
        "name": e.name,
        "unit": "ms" if late else "" if e.block == "gain" else e.unit,
        "text": span(e, 1e3 if late else 1.0),
        "side": 0 if ideal is None or e.holds(ideal) else int(np.sign(e.value - ideal)),
        "nominal": e.nominal,
        "change": change(e) if e.block == "actuator" and e.nominal else None,
    }


def shooting_words(refined: Estimates, data: DataDescription | None = None) -> tuple[str, str]:
    """What makes a fit by shooting doubtful, and what it tells beside friction, as text."""
    context = {"found": shooting_results(refined, data)}
    head, findings = (
        render(f"shooting_{part}.j2", context, markup=False).strip()
        for part in ("head", "terminal")
    )
    return head, findings


def _like_delay(read: Sequence[Estimate]) -> list[Estimate]:
    """Friction parameters that a late torque styles like."""
    friction = [e for e in read if e.block == "friction"]
    return [e for e in friction if e.parameter.partition("_")[0] in LIKE_DELAY]


def delay_fixed(refined: Estimates) -> tuple[str, ...]:
    """Friction parameters that hold a delay's share, where a motor pulls and no delay was free."""
    offered = {e.block for e in refined.parameters} | {dropped.block for dropped in refined.dropped}
    fixed = refined.driven and offered.isdisjoint(LATE)
    return names_of(_like_delay(refined.parameters)) if fixed else ()


def delay_explains(refined: Estimates) -> tuple[str, ...]:
    """Friction parameters that a delay within its own 95 % interval explains entirely.

    Such a delay moves a parameter by up to |r| t s, r their correlation, s the parameter's standard
    error and t the quantile of Student's distribution: is that its whole value, nothing is left.
    """
    read = refined.parameters
    delays = [i for i, e in enumerate(read) if e.block in LATE]
    if not delays:
        return ()
    correlation = refined.square(refined.correlation)[delays[0]]
    r = dict(zip(read, np.abs(correlation), strict=True))
    quantile = float(stdtrit(refined.freedom, 0.975))
    return names_of(
        e
        for e in _like_delay(read)
        if np.isfinite(e.error) and r[e] * quantile * e.error >= abs(e.value)
    )


MANY = 20  # parameters of one group that a table shows one by one
OWN = ("friction", "inertia")  # blocks that stand under their names, the rest is the calibration's
SIZES = ("inertia", "actuator")  # blocks whose nominal value is a size, not an ideal


def groups(read: Sequence[Estimate], joints: Sequence[str]) -> Iterator[tuple[str, list[Estimate]]]:
    """Estimates of each group, in order: friction of a joint, inertia, or the calibration."""

    def group(e: Estimate) -> str:
        if e.block not in OWN:
            return "calibration"
        return e.block if e.joint is None or len(joints) == 1 else f"{e.block}, {joints[e.joint]}"

    return ((name, list(members)) for name, members in groupby(read, key=group))


def true_value(e: Estimate, data: DataDescription | None) -> float | None:
    """Value by the simulation, None where it is not known; a sensor's is that of all joints."""
    value = None if data is None else data.true_parameters.get(e.block)
    if isinstance(value, Mapping):
        value = value.get(e.parameter)
        value = value[e.joint] if isinstance(value, list) and e.joint is not None else value
    return None if value is None else float(value)


def interval_numbers(model: Model, data: DataDescription) -> pd.DataFrame:
    """Every parameter in numbers, one line each: identifier, recipe, and all of `estimate_frame`.

    Beside the values stand the true ones, as far as they are known.
    """
    frame = estimate_frame(model.estimates, data.joints)
    frame["true"] = np.array([true_value(e, data) for e in model.estimates], dtype=float)
    frame.insert(0, "identifier", model.label)
    frame.insert(1, "recipe", model.recipe)
    return frame


def interval_table(
    model: Model, dataset: str, data: DataDescription, fixed: Sequence[Model]
) -> Table:
    """Table of the parameters with intervals, beside their nominal and true values.

    fixed : models with fixed numbers, whose parameters of the same name stand beside
    """
    read = model.estimates
    numbers = {m.label: given_numbers(m, read) for m in fixed}
    beside = {name: values for name, values in numbers.items() if values}
    nominal = any(e.nominal is not None and e.block in SIZES for e in read)
    true = {e: true_value(e, data) for e in read}
    is_simulated = any(value is not None for value in true.values())
    heads = [*text_columns("block", "parameter", "unit"), "value", "95 % interval"]
    heads += ["nominal", "against nominal"] if nominal else []
    heads += [*["true"] * is_simulated, *beside]
    lines: list[Line] = []
    for name, members in groups(read, data.joints):
        if len(members) > MANY:
            count = f"{sum(e.identified for e in members)} identified"
            words = [name, f"{len(members)} numbers", NOTHING, count]
            lines.append(line([*words, *[NOTHING] * (len(heads) - len(words))], name))
            continue
        for i, e in enumerate(members):
            cells = [Cell(name if i == 0 else ""), *_cells(e, nominal)]
            cells += [_beside(true[e], e)] * is_simulated
            cells += [_beside(values.get(e.name), e) for values in beside.values()]
            lines.append(line(cells, name))
    label = f"shooting-{dataset}-{model.label}-{model.recipe}"
    refined = model.refined or Estimates()
    among = "recordings" if refined.clusters <= data.recordings else "stretches of time"
    caption = (
        f"{dataset}: parameters of {model.label} by {model.scheme} (recipe {model.recipe}), from "
        f"all data; 95 % intervals from the scatter between {refined.clusters} {among} "
        f"(t distribution, {refined.freedom} degrees of freedom). "
        f"{'Converged' if refined.settled else 'Not converged'} after {refined.iterations} "
        "iterations."
    )
    caption += " Nominal: by the data set's mechanism and log." * nominal
    return table_of(heads, lines, caption, label)


def given_numbers(model: Model, read: Sequence[Estimate]) -> dict[str, float]:
    """A given model's own numbers for these parameters, by their names with the joint's."""
    out = dict(model.base or {})
    joints = model.document["joints"]
    for e in read:
        parameters = joints[e.joint] if e.block == "friction" and e.joint is not None else {}
        value = parameters.get(e.parameter, {}).get("value")
        if value is not None:
            out[e.name] = float(value)
    return {e.name: out[e.name] for e in read if e.name in out}


def _cells(e: Estimate, nominal: bool) -> list[str | Cell]:
    """Cells of a parameter behind its group's name."""
    name = e.parameter if e.block in OWN else e.name
    cells = [value_text(e), interval_text(e)]
    if nominal:
        shown = e.identified and e.nominal and e.block in SIZES
        cells += [_beside(e.nominal, e), change(e)[0] if shown else NOTHING]
    value, *others = (cell.replace("-", MINUS) for cell in cells)
    return [name, e.unit.replace("^2", "²"), Cell(value, mark=mark_of(e)), *others]


def _beside(value: float | None, e: Estimate) -> str:
    """A number as it stands beside the estimate, with as many digits."""
    if value is None:
        return NOTHING
    text = f"{value:g}" if value == round(value) else digits(value, e.error)
    return text.replace("-", MINUS)


def window_numbers(refined: Estimates) -> pd.DataFrame:
    """Windows that do not count or are not explained, by recording and time.

    Columns: recording, begin_s, end_s, residual (in units of the noise), state.
    """
    columns = ["recording", "begin_s", "end_s", "residual", "state"]
    lines = [(*segment, "left out") for segment in refined.left_out]
    lines += [(*segment, "not explained") for segment in refined.unexplained]
    return pd.DataFrame(lines, columns=columns).sort_values(["recording", "begin_s"])


def window_table(model: Model, dataset: str, frame: pd.DataFrame) -> Table:
    """Table of the windows of `window_numbers`."""
    heads = [*text_columns("recording"), "from [s]", "to [s]", "residual [noise]"]
    rows = [
        (str(name), f"{begin:.2f}", f"{end:.2f}", f"{size:.1f}", str(state))
        for name, begin, end, size, state in frame.itertuples(index=False)
    ]
    caption = (
        f"{dataset}: windows of {model.label} (recipe {model.recipe}) that were left out, as their "
        "prediction jumps with their initial state, or are not explained, with residuals of three "
        "times the angle noise and more."
    )
    label = f"windows-{dataset}-{model.label}-{model.recipe}"
    return table_of([*heads, *text_columns("state")], rows, caption, label)
