"""Methods of fitting, and what they fit: one data set in every fold and as a whole, made once."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from frictionid.arrays import Array
from frictionid.data.plants import Calibration, stack_calibrations
from frictionid.errors import InputError
from frictionid.evaluation import (
    CalibratedView,
    Folds,
    Prepared,
    calibrated_views,
    training_of,
    without_physics,
)
from frictionid.fitting.fit import Fit
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.one_step.recipe import Recipe
from frictionid.fitting.one_step.residual import Problem
from frictionid.fitting.shooting import CalibratedRecipe
from frictionid.fitting.shooting.recipe import PARTS, ShootingData, part_of_calibration
from frictionid.fitting.shooting.sample_intervals import Intervals, intervals_of
from frictionid.mechanics import Mechanism

from .processes import side_by_side


class Method(Protocol):
    """A way of fitting: `Recipe`, `Shooting`, `InverseDynamics`, `CalibratedRecipe`, or one's own.

    steps : the one-step recipe that a fit uses or begins with, and others whose problems it needs
    needs_intervals : whether a fit needs the intervals of the measured angles
    calibrated : the recipe on corrected data that a fit is or begins with, or None
    scheme : "euler", "integral", "shooting" or "inverse dynamics"
    corrects : parts of the calibration that correct the data
    """

    @property
    def name(self) -> str: ...
    @property
    def steps(self) -> tuple[Recipe, ...]: ...
    @property
    def needs_intervals(self) -> bool: ...
    @property
    def calibrated(self) -> CalibratedRecipe | None: ...
    @property
    def scheme(self) -> str: ...
    @property
    def corrects(self) -> tuple[str, ...]: ...

    def fit(self, identifier: Identifier, data: ShootingData, seed: int) -> Fit:
        """The identifier's friction of all folds and of all data; InputError where that fails."""
        ...


def check_method(method: Method, identifier: Identifier) -> None:
    """Refuse identifiers that use no mechanism where a method needs one."""
    if method.needs_intervals and not identifier.uses_mechanism:
        raise InputError(
            f"recipe {method.name!r}: shooting needs the physics that a black box lacks: give it "
            'recipes = ["integral"], or another one-step recipe'
        )


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """One data set as recipes fit it; mappings are by the names of the recipes.

    problems : one-step problems
    weights : (F + 1, K), positive for the rows that train each of the F folds and, last, for all
    measured : intervals of the measured angles, and their weights (F + 1, L)
    calibrations : (F + 1,), of all folds and of all data
    determined : how many of their parameters all data determine
    views : the data corrected by each of these calibrations
    """

    prepared: Prepared
    problems: Mapping[str, Problem]
    weights: Mapping[str, Array]
    measured: tuple[Intervals, Array] | None = None
    calibrations: Mapping[str, Calibration] = field(default_factory=dict)
    determined: Mapping[str, int] = field(default_factory=dict)
    views: Mapping[str, tuple[CalibratedView, ...]] = field(default_factory=dict)

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism whose friction is fitted."""
        return self.prepared.plant.mechanism

    @property
    def intervals(self) -> Intervals:
        """Intervals of the measured angles, for recipes that need them."""
        assert self.measured is not None
        return self.measured[0]

    @property
    def interval_weights(self) -> Array:
        """Weights of these intervals, of those that train each fold and, last, of all."""
        assert self.measured is not None
        return self.measured[1]

    def without_mechanism(self, recipe: Recipe) -> Problem:
        """The problem of a recipe for joints of unit inertia; no stiction mask."""
        return training_of(without_physics(self.prepared), replace(recipe, velocity_threshold=0.0))

    def corrected(self, recipe: CalibratedRecipe) -> Iterator[tuple[Array, Problem]]:
        """Folds that share a calibration, and the problem on the data that it corrects."""
        for folds, data in self.views[recipe.name]:
            yield folds, training_of(data, recipe.step)


def training_set(
    prepared: Prepared, recipes: Sequence[Method], folds: Folds | None = None, jobs: int = 1
) -> TrainingSet:
    """What the recipes fit of a data set, in each fold, if any, and as a whole.

    jobs : number of folds that are calibrated side by side

    Raises
    ------
    InputError
        Where a fold leaves nothing to train on, or recordings are too short.
    """
    steps = {step.name: step for recipe in recipes for step in recipe.steps}
    problems = {name: training_of(prepared, step) for name, step in steps.items()}
    weights = {name: _weights(prepared, folds, problem) for name, problem in problems.items()}
    data = TrainingSet(prepared, problems, weights)
    if any(recipe.needs_intervals for recipe in recipes):
        intervals = intervals_of(prepared.dataset, states=prepared.smoothed)
        data = replace(data, measured=(intervals, _training(folds, intervals)))
    return _calibrated(data, recipes, folds, jobs)


def _calibrated(
    data: TrainingSet, recipes: Sequence[Method], folds: Folds | None, jobs: int
) -> TrainingSet:
    """The training set with the calibrations of the recipes; equal ones are estimated once."""
    estimated: dict[str, tuple[Calibration, tuple[str, ...]]] = {}
    calibrations, determined = {}, {}
    for recipe in {r.name: r for r in (recipe.calibrated for recipe in recipes) if r}.values():
        key = repr(recipe.calibrator)
        if key not in estimated:
            estimated[key] = _of_folds(data, recipe.calibrator, folds, jobs)
        calibration, blocks = estimated[key]
        calibrations[recipe.name] = part_of_calibration(calibration, recipe.corrects)
        determined[recipe.name] = sum(
            block not in PARTS or block in recipe.corrects for block in blocks
        )
    views = {
        name: calibrated_views(data.prepared, calibration, len(data.interval_weights))
        for name, calibration in calibrations.items()
    }
    return replace(data, calibrations=calibrations, determined=determined, views=views)


def _of_folds(
    data: TrainingSet, recipe: CalibratedRecipe, folds: Folds | None, jobs: int
) -> tuple[Calibration, tuple[str, ...]]:
    """Calibrations (F + 1,), and the blocks of the parameters that all data determine.

    All folds have that of all data where they leave no windows to shoot at.
    """
    count = len(data.interval_weights)
    whole = folds is not None and not folds.contiguous
    rows = [-1] if whole else range(-1, count - 1)
    calls = [(data, fold) for fold in rows]
    by_call = dict(side_by_side(recipe.calibrate, calls, jobs))
    each = [by_call[i] for i in range(len(calls))]
    last, blocks = each[0]
    others = [last] * (count - 1) if whole else [calibration for calibration, _ in each[1:]]
    return stack_calibrations([*others, last]), blocks


def _training(folds: Folds | None, rows: Problem | Intervals) -> Array:
    """Weights (F + 1, K) of rows: of those that train each fold and, last, of all."""
    all_rows = np.ones((1, len(rows.dt)))
    if folds is None:
        return all_rows
    return np.concatenate([folds.training(rows.recording, rows.time, rows.dt), all_rows])


def _weights(prepared: Prepared, folds: Folds | None, problem: Problem) -> Array:
    weights = _training(folds, problem)
    if not weights.any(axis=1).all():
        raise InputError(
            f"data set {prepared.dataset.name!r}: fold {np.argmin(weights.any(axis=1))} leaves "
            "nothing to train on: choose a smaller folds.gap, fewer folds or a shorter history"
        )
    return weights
