"""The table behind a verdict: error against complexity, and how each model stands."""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.evaluation.complexity import information_criteria
from frictionid.evaluation.reference_model import CERTAIN
from frictionid.evaluation.statistics import REGION
from frictionid.files import plain

from .candidates import Candidate
from .numbers import NOTHING, decimals, factor, fixed, percent, seconds, signed
from .questions import QUESTIONS
from .sections import Model
from .tables import Cell, Column, Table, by_columns
from .verdict import KINDS, RECOMMENDED, Verdict

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
        cells = [signed(v, 1) for v in differences]
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


FORMAT = "frictionid verdict 1"


def verdict_json(verdicts: Sequence[Verdict]) -> str:
    """Text of verdict.json: all data sets that were fitted; null for what is not finite."""
    document = {
        "format": FORMAT,
        "rule": {"region": REGION, "probability": CERTAIN},
        "datasets": [
            {
                **verdict._asdict(),
                "candidates": list(map(_candidate, verdict.candidates)),
            }
            for verdict in verdicts
        ],
    }
    document = plain(document, infinity=None)
    return json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)


def _candidate(candidate: Candidate) -> dict[str, Any]:
    model, fields = candidate.model, dict(vars(candidate))
    del fields["model"], fields["errors"]
    names = {key: getattr(model, key) for key in ("name", "identifier", "recipe", "role")}
    return {**names, "implausible": candidate.implausible, **fields}


# --- What scripts may require ---------------------------------------------------------------------


def check_requirement(requirement: str) -> None:
    """Check a requirement before anything is computed: a kind of verdict, or QUESTION=ANSWER.

    Raises
    ------
    InputError
        Where it is neither.
    """
    question, equals, _ = requirement.partition("=")
    allowed = QUESTIONS if equals else KINDS
    if question not in allowed:
        rule = "no question" if equals else "no kind of verdict, nor QUESTION=ANSWER"
        raise InputError(f"--require {requirement}: is {rule}; {nearest(question, allowed)}")


def unmet(verdicts: Sequence[Verdict], requirement: str) -> list[str]:
    """What the verdicts say instead of a requirement, a line for each data set that does not meet.

    Every data set that was fitted has to meet it. A recommended model meets "recommended" even
    where it is the simplest one.
    """
    check_requirement(requirement)
    name, equals, wanted = requirement.partition("=")
    out = []
    for verdict in verdicts:
        if equals:
            answer = next(q.answer for q in verdict.questions if q.name == name)
            met = answer == wanted
        else:
            answer = verdict.kind
            met = answer == name or (name == RECOMMENDED and verdict.recommended is not None)
        if not met:
            out.append(f"{verdict.dataset}: {name if equals else 'verdict'} is {answer}")
    return out
