"""What the scores of a data set support, as facts, with their statistical significance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from frictionid.evaluation.statistics import Pair
from frictionid.report.sections import (
    EULER,
    INTEGRAL,
    RIVALS,
    Model,
    Section,
    SummaryData,
    rollout,
)
from frictionid.report.summary_table import TRUE_START


@dataclass(frozen=True)
class Contrast:
    """Scores of two models in one column, and their difference paired over the folds."""

    model: Model
    value: float
    other: Model
    other_value: float
    pair: Pair

    @property
    def ratio(self) -> float:
        """How many times larger the other model's score is; infinite where it is not finite."""
        if not np.isfinite(self.other_value) or not self.value > 0:
            return float("inf")
        return self.other_value / self.value

    @property
    def excess(self) -> float:
        """Share by which the score lies above the other model's, negative below it."""
        return self.value / self.other_value - 1.0 if self.other_value > 0 else float("inf")


@dataclass(frozen=True)
class Prediction:
    """The fitted or given model that predicts best after a horizon [s]; None where none is finite.

    without : against no friction; rival : against the best given model where the best one was
        fitted, against the best fitted one where it was given
    """

    horizon: float
    best: Model | None
    error: float
    without: Contrast | None
    rival: Contrast | None


@dataclass(frozen=True)
class BelowTruth:
    """Fitted models whose one-step loss is below that of the true friction.

    losses : scheme, the truth's loss and the number of models below it
    worst : the one of them with the largest curve errors, or None
    """

    fitted: int
    losses: tuple[tuple[str, float, int], ...]
    worst: Model | None


@dataclass(frozen=True)
class RecipeGain:
    """How many times smaller errors are with the best recipe than with another one.

    cases : number of identifiers and joints that both have; smaller : in how many of them
    """

    recipe: str
    other: str
    median: float
    low: float
    high: float
    smaller: int
    cases: int


def contrast(data: SummaryData, model: Model | None, other: Model | None, column: str) -> Contrast:
    """Contrast of two models."""
    assert model is not None and other is not None
    pair = data.paired(model, other, column)
    return Contrast(model, data.value(model, column), other, data.value(other, column), pair)


def contrasted(
    data: SummaryData, model: Model | None, other: Model | None, column: str
) -> Contrast | None:
    """Contrast of two models; None where one of them is missing."""
    return contrast(data, model, other, column) if model and other else None


def predictions(data: SummaryData) -> list[Prediction]:
    """The best fitted or given model at each reported horizon."""
    none = next(iter(data.of_role("none")), None)
    out = []
    for horizon in data.reported if data.of_role(*RIVALS) else ():
        column = rollout(horizon)
        best = data.best(data.of_role(*RIVALS), column)
        other = [role for role in RIVALS if best and role != best.role]
        rivals = (none, data.best(data.of_role(*other), column))
        error = data.value(best, column) if best else float("inf")
        out.append(
            Prediction(horizon, best, error, *(contrasted(data, best, r, column) for r in rivals))
        )
    return out


def best_predictor(data: SummaryData) -> Model | None:
    """The fitted model that predicts best at the longest reported horizon."""
    return data.best(data.of_role("fitted"), last_rollout(data)) if data.reported else None


def last_rollout(data: SummaryData) -> str:
    """Column of the median rollout error at the longest reported horizon."""
    return rollout(data.reported[-1])


def truth_contrast(data: SummaryData) -> Contrast | None:
    """The true friction against the best predictor, at the longest reported horizon."""
    truth, first = next(iter(data.of_role("truth")), None), best_predictor(data)
    return contrasted(data, truth, first, last_rollout(data)) if data.reported else None


def true_start_contrast(data: SummaryData) -> Contrast | None:
    """The two fitted models that predict best from true states; only the model's error remains."""
    if not data.reported:
        return None
    column, fitted = rollout(data.reported[-1], score=TRUE_START), data.of_role("fitted")
    first = data.best(fitted, column)
    second = data.best([model for model in fitted if model is not first], column)
    return contrasted(data, first, second, column)


def loss_contrast(data: SummaryData) -> Contrast | None:
    """The fitted model of the lowest one-step loss against the best predictor, in prediction."""
    fitted = data.of_role("fitted")
    lowest, first = data.best(fitted, EULER), best_predictor(data)
    if len(fitted) < 2 or not data.reported:
        return None
    return contrasted(data, lowest, first, last_rollout(data))


def closest_curves(data: SummaryData) -> Model | None:
    """The fitted model of the smallest mean curve error; None where no true curve is known."""
    known = [(mean_curve_error(data, model), model) for model in data.of_role("fitted")]
    finite = [pair for pair in known if np.isfinite(pair[0])]
    return min(finite, key=lambda pair: pair[0])[1] if finite else None


def mean_curve_error(data: SummaryData, model: Model) -> float:
    """Mean over the joints of a model's curve errors; NaN where no true curve is known."""
    errors = data.curve_errors(model)
    return float(np.mean(errors)) if errors else float("nan")


def below_truth(data: SummaryData) -> BelowTruth | None:
    """Fitted models that score below the truth, one step ahead; None where either is missing."""
    truth, fitted = data.of_role("truth"), data.of_role("fitted")
    if not truth or not fitted:
        return None
    losses, below = [], []
    for scheme, column in (("euler", EULER), ("integral", INTEGRAL)):
        own = data.value(truth[0], column)
        found = [model for model in fitted if data.value(model, column) < own]
        losses.append((scheme, own, len(found)))
        below += found
    worst = max(below, key=lambda model: mean_curve_error(data, model), default=None)
    return BelowTruth(len(fitted), tuple(losses), worst)


def recipe_gains(section: Section) -> list[RecipeGain]:
    """How much smaller errors are with the best recipe than with each other one.

    Errors are those of the curves where the true ones are known, else of the last prediction.
    """
    errors = {recipe: _errors(section.fitted, recipe) for recipe in section.recipes}
    common = set.intersection(*(set(own) for own in errors.values()))
    good = [
        case
        for case in errors[section.recipes[0]]
        if case in common
        and all(np.isfinite(own[case]) and own[case] > 0 for own in errors.values())
    ]
    if len(errors) < 2 or not good:
        return []
    logs = {recipe: np.log([own[case] for case in good]) for recipe, own in errors.items()}
    first = min(logs, key=lambda recipe: float(logs[recipe].mean()))
    return [
        _gain(first, other, np.exp(logs[other] - logs[first])) for other in logs if other != first
    ]


def _gain(recipe: str, other: str, ratios: Sequence[float]) -> RecipeGain:
    middle, low, high = (float(f(ratios)) for f in (np.median, np.min, np.max))
    smaller = int(np.sum(np.asarray(ratios) > 1))
    return RecipeGain(recipe, other, middle, low, high, smaller, len(ratios))


def _errors(data: SummaryData, recipe: str) -> dict[tuple[str, int], float]:
    """Errors of each model fitted by a recipe, by its label and joint."""
    out: dict[tuple[str, int], float] = {}
    for model in data.of_role("fitted"):
        errors = data.curve_errors(model)
        if not errors and data.reported:
            errors = [data.value(model, last_rollout(data))]
        if model.recipe == recipe:
            out |= {(model.label, joint): error for joint, error in enumerate(errors)}
    return out
