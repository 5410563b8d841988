"""Tables of models: how they stand against each other, and their parameters."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.comparison.kind_descriptions import meaning, summary
from frictionid.errors import InputError
from frictionid.evaluation.predicted_motion import jackknife_width
from frictionid.evaluation.statistics import FEWEST, information_criteria
from frictionid.friction import Law
from frictionid.friction.model_files import LAWS, read_model

from .candidates import Candidate
from .numbers import (
    MINUS,
    NOTHING,
    decimals,
    digits,
    either,
    factor,
    fixed,
    interval,
    mark_of,
    percent,
    rounded,
    seconds,
    short,
    signed,
)
from .sections import ANY, Model, Section, SummaryData, rollout
from .tables import Cell, Column, Table, by_columns, line, table_of, text_columns
from .verdict import Verdict

DAGGER = "†"
_SAME = 1e-3  # of the number of residuals
COLUMNS = (
    "model effective_parameters error times low high measured worse standing aic bic implausible"
).split()


def verdict_numbers(verdict: Verdict) -> pd.DataFrame:
    """A line for each candidate of the recipe, from the simplest on: complexity, error, loss.

    times, low, high : by which factor it is farther off than the reference, with the 80 % interval;
        measured : the ratio of both errors; worse : probability that it is practically worse
    aic, bic : of fits by shooting to the same residuals, NaN of others
    """
    criteria = shooting_criteria(verdict.compared)
    nothing, lines = float("nan"), []
    for candidate in verdict.compared:
        against, tested = candidate.loss, 5 * [nothing]
        if against is not None:
            tested = [*against.factor[:3], against.measured.value, against.factor.worse]
        described = (candidate.name, candidate.complexity, candidate.error)
        aic, bic = criteria.get(candidate.model, (nothing, nothing))
        failed = "; ".join(verdict.failed.get(candidate.model, ()))
        lines.append((*described, *tested, candidate.standing, aic, bic, failed))
    return pd.DataFrame(lines, columns=COLUMNS)


def shooting_criteria(candidates: Sequence[Candidate]) -> Mapping[Model, tuple[float, float]]:
    """Information criteria of fits by shooting; none where they do not fit the same residuals.

    They compare likelihoods of the same data. Fits that leave out different windows, that found
    windows which they do not explain, or that fit torques, have none.
    """
    shot = {}
    for candidate in candidates:
        refined = candidate.model.refined
        if refined and refined.residuals and not refined.unexplained:
            shot[candidate.model] = refined.residuals
    counts = [residuals.counts for residuals in shot.values()]
    if len(counts) < 2 or np.ptp(counts, axis=0).max() > _SAME * np.max(counts):
        return {}
    return {
        model: information_criteria(r.squares, r.counts, r.parameters, r.clusters)
        for model, r in shot.items()
    }


def verdict_table(verdict: Verdict, numbers: pd.DataFrame) -> Table:
    """The table of these numbers; columns that say nothing are left out."""
    torque = np.isnan(verdict.horizon)
    at = "torque left" if torque else f"{seconds(verdict.horizon)} ahead"
    errors, counts = (numbers[name] for name in ("error", "effective_parameters"))
    parts: list[tuple[Column, Iterable[str]]] = [
        (Column("model", words=True), numbers["model"]),
        (Column("effective parameters"), [fixed(v, int(abs(v - round(v)) > 0.05)) for v in counts]),
        (Column(at, "error", verdict.unit), [fixed(v, decimals(errors)) for v in errors]),
        (Column("times as far off [80 %]", "implied"), numbers.apply(_effect, axis=1)),
        (Column("times as far off", "measured"), map(factor, numbers["measured"])),
        (Column("worse", "probability"), map(percent, numbers["worse"])),
        (Column("standing", words=True), numbers["standing"]),
    ]
    for name in ("aic", "bic") if numbers["aic"].notna().any() else ():
        differences = numbers[name] - numbers[name].min()
        cells = list(map(signed, differences))
        parts.append((Column(name.upper(), "less the lowest"), cells))
    if (numbers["implausible"] != "").any():
        implausible = numbers["implausible"].replace("", NOTHING)
        parts.append((Column("implausible", words=True), implausible))
    best = [model == verdict.recommended for model in numbers["model"]]
    shown = [(column, list(map(Cell, texts, best))) for column, texts in parts]
    by = f" by recipe {verdict.recipe}" if verdict.recipe else ""
    caption = (
        f"{verdict.dataset}: error against complexity of the models{by}, median of predictions of "
        f"{verdict.recordings} recordings, held out in {verdict.folds} folds. Times as far off, "
        "against the best model: implied by the distance of both predictions, and measured. "
        "Practically worse: by more than a tenth. Effective parameters: trace of the hat matrix; "
        "of shooting and of a calibration those that the data determine; of networks all weights."
    )
    return by_columns(caption, f"verdict-{verdict.dataset}", shown)


def marked(table: Table, verdict: Verdict) -> Table:
    """A table in which the names of models that are not plausible carry a dagger."""
    names = {model.name for model in verdict.failed}
    if not any(cell.text in names for row in table.lines for cell in row.cells):
        return table

    def mark(cell: Cell) -> Cell:
        return cell._replace(text=f"{cell.text} {DAGGER}") if cell.text in names else cell

    lines = tuple(row._replace(cells=tuple(map(mark, row.cells))) for row in table.lines)
    caption = f"{table.caption} {DAGGER} Not plausible, see the summary."
    return table._replace(lines=lines, caption=caption)


def _effect(row: pd.Series) -> str:
    """A factor with its interval."""
    if not np.isfinite(row["times"]):
        return NOTHING
    middle, low, high = (factor(row[name]) for name in ("times", "low", "high"))
    return f"{middle} [{low}, {high}]" if row["low"] < row["high"] else middle


# --- Parameters of all models ---------------------------------------------------------------------

DIGITS = 4  # significant, of the largest of a line
PARAMETER_COLUMNS = (
    "identifier recipe role joint parameter unit mean sd all_data identified".split()
)


def parameter_numbers(section: Section) -> pd.DataFrame:
    """Numbers of every parameter of every model, one line each.

    Columns: identifier, recipe, role, joint, parameter, unit, mean, sd (over the folds), all_data,
    identified (by shooting; else nothing).
    """
    lines = [line for model in section.models for line in _numbers(model)]
    return pd.DataFrame(lines, columns=PARAMETER_COLUMNS)


def _numbers(model: Model) -> Iterator[tuple[Any, ...]]:
    read = [e for e in model.estimates if e.block == "friction"]
    identified = {(e.joint, e.parameter): e.identified for e in read}
    sparse = bool(model.provenance.equation)
    fitted = model.role == "fitted"
    for j, name, unit, value, folds in _each(model):
        if sparse and value == 0 and not folds.any():
            continue
        mean = float(folds.mean()) if fitted else float("nan")
        sd = float(folds.std(ddof=1)) if fitted and len(folds) > 1 else float("nan")
        head = (model.label, model.recipe, model.role, j + 1, name, unit)
        yield (*head, mean, sd, value, identified.get((j, name)))


def _each(model: Model) -> Iterator[tuple[int, str, str, float, Array]]:
    """Joint, name, unit and value of each parameter, NaN where none is known, and those (F,)."""
    for j, parameters in enumerate(model.document.get("joints", ())):
        for i, (name, number) in enumerate(parameters.items()):
            value = float("nan") if number["value"] is None else float(number["value"])
            yield j, name, number["unit"], value, model.theta[:, j, i]


def parameter_table(section: Section, frame: pd.DataFrame) -> Table:
    """Table of the parameters of `parameter_numbers`, recipes side by side."""
    recipes = [recipe for recipe in section.recipes if recipe in set(frame["recipe"])]
    heads = text_columns("identifier", "joint", "parameter", "unit")
    for recipe in recipes:
        group = f"{recipe} recipe"
        heads += [Column("mean ± sd of folds", group), Column("all data", group)]
    fixed_numbers = [ANY] if (frame["recipe"] == ANY).any() else []
    heads += ["given"] * len(fixed_numbers)
    order = ["identifier", "role", "joint", "parameter", "unit"]
    lines = []
    for key, rows in frame.groupby(order, sort=False):
        name, role, joint, parameter, unit = map(str, key)
        cells = [name, section.description.joints[int(joint) - 1], parameter, unit]
        lines.append(line([*cells, *_values(rows, [*recipes, *fixed_numbers])], f"{role} {name}"))
    caption = (
        f"{section.dataset}: parameters of the fitted models, mean and standard deviation over the "
        "folds and the value from all data; given: numbers that no fit has changed."
    )
    if (frame["identified"].map(str) == "False").any():
        caption += " Not identified (shooting): at a bound, or standard error too large."
    return table_of(heads, lines, caption, f"parameters-{section.dataset}")


def _values(rows: pd.DataFrame, recipes: Sequence[str]) -> list[str | Cell]:
    """Cells of one parameter: two for each recipe, and one for a given value."""
    sizes = rows[["mean", "all_data"]].to_numpy(dtype=float)
    sizes = np.abs(sizes[np.isfinite(sizes) & (sizes != 0)])
    places = int(np.clip(DIGITS - 1 - np.floor(np.log10(sizes.max())), 0, 9)) if sizes.size else 0
    cells: list[str | Cell] = []
    for recipe in recipes:
        numbers = rows[rows["recipe"] == recipe]
        if numbers.empty:
            cells += [NOTHING] * (1 if recipe == ANY else 2)
            continue
        mean, sd, value = numbers[["mean", "sd", "all_data"]].to_numpy(dtype=float)[0]
        if str(numbers["identified"].iloc[0]) == "False":
            cells += [_coarse(mean, sd), Cell("not identified", mark="unknown")]
            continue
        if recipe != ANY:
            cells.append(f"{fixed(mean, places)} ± {fixed(sd, places)}" if mean or sd else "0")
        cells.append(fixed(value, places) if value else "0")
    return cells


def _coarse(mean: float, sd: float) -> str:
    """Mean and deviation of a parameter that is not identified, with two digits at the most.

    >>> _coarse(0.0017721, 0.0011), _coarse(30.0, 0.0)
    ('0.0018 ± 0.0011', '30 ± 0')
    """
    return " ± ".join(f"{float(f'{value:.2g}'):g}" for value in (mean, sd))


# --- The model of a verdict -----------------------------------------------------------------------


NEAR = 1e-6  # of a bound, in units of its size


def equation_of(model: Model) -> str:
    """Equation of a model's law in words and symbols, "" where its law is not one of ours."""
    table = model.document.get("law", {})
    law = LAWS.get(str(table.get("kind", "")))
    if law is None:
        return ""
    family = [summary(part) for part in law.__mro__ if issubclass(part, Law)]
    equations = [text for text in family if text.startswith("Tf")]
    switched = [
        f"{field.name} = {meaning(law, field.name)}."
        for field in fields(law)
        if isinstance(field.default, bool) and table.get(field.name, field.default) != field.default
    ]
    words = dict.fromkeys([family[0], *equations[:1], *switched])
    return " ".join(words).replace("`", "")


def horizons_of(data: SummaryData, model: Model) -> list[dict[str, float]]:
    """Errors of a model after each horizon at which it was scored.

    seconds : the horizon [s]; median, q90, diverged : errors, and the share that diverged
    """
    statistics = ("median", "q90", "diverged")
    errors = [
        {"seconds": h, **{name: data.value(model, rollout(h, name)) for name in statistics}}
        for h in data.horizons
    ]
    return [horizon for horizon in errors if np.isfinite(horizon["median"])]


ParameterRow = tuple[str, str, tuple[Cell | None, ...]]  # name, unit, value at each joint or None


def parameter_rows(model: Model, data: SummaryData) -> list[ParameterRow]:
    """Friction parameters, one for each row; none of networks and of models without friction.

    Without those that were not fitted at any joint, such as terms that a sparse sum does not have.

    Intervals are those of shooting or, for other fits, of the jackknife over the folds.
    """
    joints = model.document.get("joints", ())
    values = _shot(model) if model.refined is not None else _fitted(model)
    rows = []
    for name in dict.fromkeys(name for parameters in joints for name in parameters):
        units = [parameters[name]["unit"] for parameters in joints if name in parameters]
        each = tuple(values.get((j, name)) for j in range(len(data.description.joints)))
        if any(each):
            rows.append((name, either(units).replace("^2", "²"), each))
    return rows


def _shot(model: Model) -> dict[tuple[int, str], Cell]:
    """Estimates of shooting; one that data do not determine has no digits."""
    cells = {}
    for e in model.estimates:
        if e.joint is not None:
            mark = mark_of(e)
            shown = digits(e.value, e.error), interval(e.low, e.high, e.error)
            if mark:
                shown = f"{e.value:.2g}", "at its bound" if e.at_bound else "not identified"
            value, beside = (text.replace("-", MINUS) for text in shown)
            cells[e.joint, e.parameter] = Cell(value, mark=mark, interval=beside)
    return cells


def _fitted(model: Model) -> dict[tuple[int, str], Cell]:
    """Values from all data, with the jackknife's intervals where enough folds were fitted."""
    fitted, bounds, cells = model.role == "fitted", _bounds(model), {}
    for j, name, _, value, folds in _each(model):
        half = float(jackknife_width(folds)) if fitted and len(folds) >= FEWEST else 0.0
        if fitted and name in bounds and _near(value, bounds[name]):
            cell = Cell(f"{value:.3g}", mark="bound", interval="at its bound")
        elif np.isfinite(half) and half > 0:
            middle, low, high = (rounded(v, half / 2) for v in (value, value - half, value + half))
            cell = Cell(middle, interval=f"{low} to {high}")
        else:
            cell = Cell(short(value, 3).replace("-", MINUS))
        cells[j, name] = cell
    return cells


def _bounds(model: Model) -> dict[str, Array]:
    """Ends of each parameter's range by its name; nothing where the law is one's own."""
    try:
        law = read_model(model.document, model.name).law
    except (InputError, LookupError, TypeError, ValueError):
        return {}
    ends = np.asarray(law.bounds, dtype=float).reshape(-1, 2)
    return dict(zip(law.names, ends, strict=False))


def _near(value: float, ends: Array) -> bool:
    finite = ends[np.isfinite(ends)]
    return bool((np.abs(value - finite) <= NEAR * np.maximum(np.abs(finite), 1e-3)).any())
