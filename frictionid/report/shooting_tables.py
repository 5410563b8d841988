"""Tables of shooting: parameters with intervals, and windows that do not count."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

import pandas as pd

from frictionid.report.estimates import (
    Estimate,
    digits,
    estimates,
    interval,
    mark_of,
    value_text,
)
from frictionid.report.numbers import MINUS, NOTHING
from frictionid.report.sections import DataDescription, Model
from frictionid.report.tables import Cell, Column, Line, Table, line, text_columns

MANY = 20  # parameters of one group that a table shows one by one
OWN = ("friction", "inertia")  # blocks that stand under their names, the rest is the calibration's
SIZES = ("inertia", "actuator")  # blocks whose nominal value is a size, not an ideal
NONE = {"parameters": ()}  # result document of a model that was not fitted by shooting
SEEN = {"left_out": "left out", "unexplained": "not explained"}


def groups(read: Sequence[Estimate], joints: Sequence[str]) -> Iterator[tuple[str, list[Estimate]]]:
    """Estimates of each group, in order: friction of a joint, inertia, or the calibration."""

    def group(e: Estimate) -> str:
        if e.block not in OWN:
            return "calibration"
        return e.block if e.joint is None or len(joints) == 1 else f"{e.block}, {joints[e.joint]}"

    return ((name, list(own)) for name, own in groupby(read, key=group))


def interval_numbers(model: Model, data: DataDescription) -> pd.DataFrame:
    """Every parameter in numbers, one line each.

    Columns: identifier, recipe, block, joint, parameter, unit, value, error, low_90, high_90,
    low_95, high_95, identified, at_bound, nominal, true.
    """
    lines = [
        {
            "identifier": model.label,
            "recipe": model.recipe,
            "block": e.block,
            "joint": "" if e.joint is None else data.joints[e.joint],
            **{key: getattr(e, key) for key in ("parameter", "unit", "value", "error")},
            **{"low_90": e.inner[0], "high_90": e.inner[1], "low_95": e.low, "high_95": e.high},
            **{"identified": e.identified, "at_bound": e.at_bound},
            **{"nominal": e.nominal, "true": e.true},
        }
        for e in estimates(model.refined or NONE, data)
    ]
    return pd.DataFrame(lines).astype({"nominal": float, "true": float})


def interval_table(
    model: Model, dataset: str, data: DataDescription, given: Sequence[Model] = ()
) -> Table:
    """Table of the parameters with intervals, beside their nominal and true values.

    given : models with fixed numbers, whose parameters of the same name stand beside
    """
    read = estimates(model.refined or NONE, data)
    numbers = {m.label: given_numbers(m, read) for m in given}
    beside = {name: own for name, own in numbers.items() if own}
    nominal = any(e.nominal is not None and e.block in SIZES for e in read)
    true = any(e.true is not None for e in read)
    heads = [*text_columns("block", "parameter", "unit"), Column("value"), Column("95 % interval")]
    heads += [Column("nominal"), Column("against nominal")] if nominal else []
    heads += [Column("true")] if true else []
    heads += [Column(name) for name in beside]
    lines: list[Line] = []
    for name, own in groups(read, data.joints):
        if len(own) > MANY:
            known = f"{sum(e.identified for e in own)} identified"
            words = [name, f"{len(own)} numbers", NOTHING, known]
            lines.append(line([*words, *[NOTHING] * (len(heads) - len(words))], name))
            continue
        for i, e in enumerate(own):
            cells = [Cell(name if i == 0 else ""), *_cells(e, nominal)]
            cells += [_beside(e.true, e)] * true
            cells += [_beside(values.get(e.name), e) for values in beside.values()]
            lines.append(line(cells, name))
    label = f"shooting-{dataset}-{model.label}-{model.recipe}"
    return Table(_caption(model, dataset, data, nominal), label, tuple(heads), tuple(lines))


def given_numbers(model: Model, read: Sequence[Estimate]) -> dict[str, float]:
    """A given model's own numbers for these parameters, by their names with the joint's."""
    out = dict(model.base or {})
    joints = model.document["joints"]
    for e in read:
        known = joints[e.joint] if e.block == "friction" and e.joint is not None else {}
        value = known.get(e.parameter, {}).get("value")
        if value is not None:
            out[e.name] = float(value)
    return {e.name: out[e.name] for e in read if e.name in out}


def _cells(e: Estimate, nominal: bool) -> list[str | Cell]:
    """Cells of a parameter behind its group's name."""
    name = e.parameter if e.block in OWN else e.name
    cells = [value_text(e), interval(e.low, e.high, e.error)]
    if nominal:
        change = f"{e.change()[0]} %" if e.identified and e.nominal and e.block in SIZES else ""
        cells += [_beside(e.nominal, e), change or NOTHING]
    value, *others = (cell.replace("-", MINUS) for cell in cells)
    return [name, e.unit.replace("^2", "²"), Cell(value, mark=mark_of(e)), *others]


def _beside(value: float | None, e: Estimate) -> str:
    """A number as it stands beside the estimate, with as many digits."""
    if value is None:
        return NOTHING
    text = f"{value:g}" if value == round(value) else digits(value, e.error)
    return text.replace("-", MINUS)


def _caption(model: Model, dataset: str, data: DataDescription, nominal: bool) -> str:
    document = model.refined or {}
    clusters = document["clusters"]
    among = "recordings" if clusters <= data.recordings else "stretches of time"
    text = (
        f"{dataset}: parameters of {model.label} by {model.scheme} (recipe {model.recipe}), from "
        f"all data; 95 % intervals from the scatter between {clusters} {among} (t distribution, "
        f"{document['freedom']} degrees of freedom). "
        + ("Converged" if document["settled"] else "Not converged")
        + f" after {document['iterations']} iterations."
    )
    return f"{text} Nominal: by the data set's mechanism and log." if nominal else text


def window_numbers(document: Mapping[str, Sequence[Mapping[str, float]]]) -> pd.DataFrame:
    """Windows that do not count or are not explained, by recording and time.

    Columns: recording, begin_s, end_s, residual (in units of the noise), state.
    """
    columns = ["recording", "begin_s", "end_s", "residual", "state"]
    lines = [
        (p["recording"], float(p["begin"]), float(p["end"]), float(p["size"]), state)
        for key, state in SEEN.items()
        for p in document.get(key, ())
    ]
    return pd.DataFrame(lines, columns=columns).sort_values(["recording", "begin_s"])


def window_table(model: Model, dataset: str, frame: pd.DataFrame) -> Table:
    """Table of the windows of `window_numbers`."""
    heads = [
        *text_columns("recording"),
        Column("from [s]"),
        Column("to [s]"),
        Column("residual [noise]"),
    ]
    lines = [
        line((str(name), f"{begin:.2f}", f"{end:.2f}", f"{size:.1f}", str(state)))
        for name, begin, end, size, state in frame.itertuples(index=False)
    ]
    caption = (
        f"{dataset}: windows of {model.label} (recipe {model.recipe}) that were left out, as their "
        "prediction jumps with their initial state, or are not explained, with residuals of three "
        "times the angle noise and more."
    )
    label = f"windows-{dataset}-{model.label}-{model.recipe}"
    return Table(caption, label, (*heads, *text_columns("state")), tuple(lines))
