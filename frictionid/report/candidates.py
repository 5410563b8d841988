"""Candidates of a verdict: models that can be recommended, and how they stand fold by fold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.evaluation.statistics import (
    CERTAIN,
    REGION,
    Choice,
    CorrelatedTest,
    correlated_test,
)
from frictionid.report.memory import has_memory
from frictionid.report.numbers import decimals, fixed
from frictionid.report.plausibility import FAILED, Check, checks_of
from frictionid.report.sections import Model, Section, SummaryData, rollout
from frictionid.report.tables import Cell, Column, Table, line, text_columns

EFFECTIVE = "effective_parameters_count"  # column
CANDIDATES = ("none", "fitted", "given")  # roles of models that can be recommended


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model that can be recommended, and how it stands.

    Attributes
    ----------
    model : its line of the tables
    errors : (F,) median error of its predictions in each fold, infinite where one is missing
    complexity : effective number of parameters, infinite where it is not known
    checks : whether it is physically plausible
    standing : "best", "adequate", "undecided", "worse" or "diverged", against the best one; see
        `frictionid.evaluation.statistics.Standing`
    against_best, against_provisional : tests of its errors less those of the best model and of the
        simplest adequate one; None where an error is not finite
    """

    model: Model
    errors: Array
    complexity: float
    checks: tuple[Check, ...] = ()
    standing: str = ""
    against_best: CorrelatedTest | None = None
    against_provisional: CorrelatedTest | None = None

    @property
    def name(self) -> str:
        """Name of the model as it stands in the tables."""
        return self.model.name

    @property
    def implausible(self) -> tuple[str, ...]:
        """What is physically wrong with it, one clause for each check that it fails."""
        return tuple(check.statement for check in self.checks if check.outcome == FAILED)

    @property
    def error(self) -> float:
        """Mean over the folds of its errors; infinite where one is not finite, NaN of none."""
        return float(self.errors.mean()) if len(self.errors) else float("nan")

    @property
    def is_finite(self) -> bool:
        """Whether its error is finite in every fold."""
        return bool(len(self.errors) and np.isfinite(self.errors).all())


@dataclass(frozen=True, eq=False)
class Contrast:
    """The best candidates of two groups, and whether the second one predicts better.

    Attributes
    ----------
    first, second : lowest mean errors of each group
    test : errors of the first less those of the second; the region is 10 % of the lower one's error
    """

    first: Candidate
    second: Candidate
    test: CorrelatedTest

    @property
    def answer(self) -> str:
        """Whether the first one is practically worse: "yes", "no" or "undecided"."""
        if self.test.above >= CERTAIN:
            return "yes"
        return "no" if self.test.above <= 1 - CERTAIN else "undecided"

    @property
    def effect(self) -> float:
        """By which share of its error the second one is better; negative where it is worse."""
        return self.test.mean / self.second.error


def candidates_of(data: SummaryData, column: str) -> list[Candidate]:
    """All models of a data set that can be recommended, with their checks, as in the tables.

    Given numbers that were fitted to these recordings are none: nothing is held out of them.

    column : of the score that is compared
    """
    models = [model for model in data.of_role(*CANDIDATES) if not _has_seen(model, data)]
    candidates = [
        Candidate(model, errors, complexity_of(data, model))
        for model, errors in zip(models, _fold_errors(data, models, column), strict=True)
    ]
    static = [c for c in candidates if not has_memory(c.model)]
    controls = {
        c.model: (best.first.name, best.test)
        for c in candidates
        if c not in static and (best := contrast(static, [c])) is not None
    }
    return [replace(c, checks=checks_of(c.model, data, controls.get(c.model))) for c in candidates]


def _has_seen(model: Model, data: SummaryData) -> bool:
    """Whether a given model's file says that it was fitted to files of the data set."""
    hashes = set(model.provenance.data.values())
    return model.role == "given" and bool(hashes & data.description.hashes)


def complexity_of(data: SummaryData, model: Model) -> float:
    """Effective number of parameters, else their number; infinite where neither is known."""
    if model.role == "none":
        return 0.0
    counts = [data.value(model, name) for name in (EFFECTIVE, "n_parameters")]
    return next((count for count in counts if np.isfinite(count)), float("inf"))


def _fold_errors(data: SummaryData, models: Sequence[Model], column: str) -> Array:
    """A score of each model in each fold (M, F); infinite where it is missing."""
    each = [data.of_folds(model, column) for model in models]
    folds = max(map(len, each), default=0)
    whole = [errors if len(errors) == folds else np.full(folds, np.inf) for errors in each]
    return np.where(np.isnan(whole), np.inf, whole) if whole else np.empty((0, 0))


def judged_by(choice: Choice, candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """The candidates with how they stand, from the simplest to the most complex."""
    reference = None if choice.adequate is None else candidates[choice.adequate]
    out = []
    for candidate, (standing, test) in zip(candidates, choice.standings, strict=True):
        other = None if reference is None else _test(candidate, reference, choice.region)
        out.append(
            replace(candidate, standing=standing, against_best=test, against_provisional=other)
        )
    return tuple(sorted(out, key=lambda c: (c.complexity, c.error)))


def contrast(first: Sequence[Candidate], second: Sequence[Candidate]) -> Contrast | None:
    """The best of a group against the best of another; None where one has no finite candidate."""
    groups = [[c for c in group if c.is_finite] for group in (first, second)]
    if not all(groups):
        return None
    a, b = (min(group, key=lambda c: c.error) for group in groups)
    test = _test(a, b, REGION * min(a.error, b.error))
    return test and Contrast(a, b, test)


def _test(first: Candidate, second: Candidate, region: float) -> CorrelatedTest | None:
    if len(first.errors) < 2 or not (first.is_finite and second.is_finite):
        return None
    return correlated_test(first.errors - second.errors, region)


FAMILIES = {
    "physics": "physics with textbook friction",
    "hybrid": "physics with learned friction",
    "black box": "no physics",
}
# laws whose form was learned, by their names in model files
LEARNED = (
    *("mlp", "window_mlp", "lstm", "ensemble", "TorchModule", "library", "table"),
    "spline",
)


def family(model: Model) -> str:
    """Family of a model; "" for fixed numbers and the truth."""
    if model.role not in ("none", "fitted"):
        return ""
    if model.document.get("mechanism"):
        return "black box"
    return "hybrid" if model.document.get("law", {}).get("kind", "") in LEARNED else "physics"


def family_table(section: Section) -> Table | None:
    """Median rollout errors of all models by family; None where a family is missing."""
    models = [(name, m) for name in FAMILIES for m in section.models if family(m) == name]
    places = [(data, h) for data in section.data for h in data.reported]
    if {name for name, _ in models} != set(FAMILIES) or not places:
        return None
    values = np.array([[data.value(m, rollout(h)) for data, h in places] for _, m in models])
    lowest = np.where(np.isfinite(values), values, np.inf).min(axis=0)
    digits = [decimals(column) for column in values.T]
    lines = [
        line(
            [FAMILIES[name], model.name, *map(Cell, map(fixed, row, digits), row == lowest)],
            name,
        )
        for (name, model), row in zip(models, values, strict=True)
    ]
    columns = [Column(f"{d.dataset}, {h:g} s", unit=d.description.angle_unit) for d, h in places]
    return Table(
        f"Median {section.description.coordinate} error of predictions by what a model knows: on "
        f"held-out motion of {section.dataset}, and on data that no fit has seen.",
        f"question-{section.dataset}",
        (*text_columns("what it knows", "model"), *columns),
        tuple(lines),
    )
