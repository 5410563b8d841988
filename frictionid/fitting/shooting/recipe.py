"""Recipes that shoot: for friction itself, or for a calibration that corrects the data.

With a `CalibratedRecipe` shooting fits, in each training fold, a friction that is nobody's
candidate together with the calibration. The data are corrected by that calibration, and any
identifier fits its one-step problem on them: all families have the same one. A model with memory
then cannot mistake a torque delay or a missing inertia for friction.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.data.plants import Calibration, stack_calibrations, with_calibrated_servos
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError, NoFitError
from frictionid.friction import Friction
from frictionid.friction.coordinates import with_units_of

from ..fit import Fit
from ..identifier import Identifier
from ..one_step.recipe import INTEGRAL, Recipe, TrainingData, checked, checked_fit, one_step_fit
from ..one_step.residual import Problem
from ..parameter_block import ParameterBlock
from .refine import fit_as_begun, fit_blocks
from .sample_intervals import Intervals
from .servo import has_actuator
from .settings import DEFAULT_BLOCKS, Settings

# Parts of a calibration that may correct the data, under the names of the blocks that free them.
PARTS = ("inertia", "delay", "gain", "bias", "offset")
_BLOCKS = (*PARTS, "target_delay", "backlash", "envelope")


@dataclass(frozen=True, eq=False)
class KnownCalibration:
    """Base parameters and what else of sensors and servos another fit found, but for motors.

    `errors` are the names of the parameters that it determined, with their standard errors. What a
    fit does not free stays as it is; free parameters have these as priors.
    """

    calibration: Calibration
    errors: tuple[tuple[str, float], ...] = ()

    def on(self, dataset: Dataset) -> Calibration:
        """The calibration, checked to be of the data set's mechanism."""
        mechanism, base = dataset.mechanism, self.calibration.base
        sizes = (self.calibration.gain.shape[-1], None if base is None else base.shape[-1])
        if sizes[0] != mechanism.n or sizes[1] not in (None, len(mechanism.base_names)):
            raise InputError(
                f"data set {dataset.name!r}: the calibration is of {sizes[0]} joints with "
                f"{sizes[1]} base parameters, {mechanism.kind} has {mechanism.n} and "
                f"{len(mechanism.base_names)}: name a model of the same machine"
            )
        return self.calibration


def known_calibration(friction: Friction, name: str) -> KnownCalibration:
    """Calibration of a fitted friction, its standard errors from the result of shooting.

    Raises
    ------
    InputError
        Where the friction has none; `name` says whose.
    """
    if friction.calibration is None:
        raise InputError(
            f"{name} has no calibration: fit it by shooting with inertia, delay or gain free"
        )
    refined = friction.provenance.refined
    errors = tuple(
        (e.name, e.error)
        for e in (() if refined is None else refined.parameters)
        if e.block in _BLOCKS and e.identified and np.isfinite(e.error)
    )
    return KnownCalibration(friction.calibration, errors)


class ShootingData(TrainingData, Protocol):
    """What shooting and calibrated recipes fit: intervals of measured angles, corrected data.

    `interval_weights` (F + 1, K) are positive where a fold may use an interval; the last row is
    that of all data. `calibrations` (F + 1,) of all folds and of all data are by the names of their
    recipes, with only the parts that these use; of their parameters as many are `determined`.
    """

    @property
    def intervals(self) -> Intervals: ...
    @property
    def interval_weights(self) -> Array: ...
    @property
    def calibrations(self) -> Mapping[str, Calibration]: ...
    @property
    def determined(self) -> Mapping[str, int]: ...

    def corrected(self, recipe: CalibratedRecipe) -> Iterable[tuple[Array, Problem]]:
        """Folds that share a calibration, with the problem on the data that it corrects.

        All data, the last fold, are in the last one.
        """
        ...


@dataclass(frozen=True)
class Shooting:
    """Friction refined by shooting, from the fit of a one-step recipe.

    blocks : what is free: friction, and the delay where a motor's torque is sampled
    settings : windows, noise, iterations
    start : the recipe whose friction it begins with, and of its calibration the parts that are
        free; where it has one, no shorter windows lead there
    held : calibration of another fit, held but for the blocks that are free, which it informs
    """

    name: str = "shooting"
    blocks: tuple[ParameterBlock, ...] = DEFAULT_BLOCKS
    settings: Settings = Settings()
    start: Recipe | CalibratedRecipe = INTEGRAL
    held: KnownCalibration | None = None
    needs_intervals: ClassVar[bool] = True
    scheme: ClassVar[str] = "shooting"
    corrects: ClassVar[tuple[str, ...]] = ()

    @property
    def steps(self) -> tuple[Recipe, ...]:
        """The one-step recipes whose problems a fit needs: those of the one that it begins with."""
        return self.start.steps

    @property
    def calibrated(self) -> CalibratedRecipe | None:
        """The calibrated recipe that a fit begins with, or None."""
        return self.start.calibrated

    def fit(self, identifier: Identifier, data: ShootingData, seed: int) -> Fit:
        """The identifier's friction of all folds and of all data, refined unless it is fixed."""
        if identifier.fixed:
            return self.start.fit(identifier, data, seed)
        first, _ = self.start.friction_of(identifier, data, seed)
        recipe = self
        if first.calibration is not None:
            freed = tuple(block.name for block in self.blocks)
            first = replace(first, calibration=part_of_calibration(first.calibration, freed))
            recipe = replace(self, settings=replace(self.settings, growing=False))
        return refine_folds(first, data.intervals, recipe, data.interval_weights)


def refine_folds(
    friction: Friction, intervals: Intervals, recipe: Shooting, training: Array
) -> Fit:
    """The fit to the last one of the folds, with the friction (F, n, P) of all of them.

    training : (F, K), the intervals that each fold may use; the last row is that of
        all data

    Each fold is fitted from its own one-step fit, so that nothing of it depends on the recordings
    that it holds out: neither its optimum, nor the way there. A fold whose fit fails keeps that.
    """
    blocks, starts = recipe.blocks, [friction[f] for f in range(len(training))]
    if recipe.held is not None:
        errors = recipe.held.errors  # the priors of what the other fit determined
        blocks = tuple(replace(b, deviations=errors) if b.name in _BLOCKS else b for b in blocks)
        held = recipe.held.on(intervals.dataset)
        starts = [replace(start, calibration=held) for start in starts]
        if not has_actuator(blocks):
            dataset = with_calibrated_servos(intervals.dataset, held)
            intervals = replace(intervals, dataset=dataset)
    results, failed = list[Fit](), list[str]()
    for fold, (start, use) in enumerate(zip(starts, training > 0, strict=True)):
        fitted = start, intervals, blocks, recipe.settings, use
        try:
            results.append(fit_blocks(*fitted))
        except NoFitError as error:
            if fold == len(training) - 1:
                raise
            results.append(fit_as_begun(*fitted))
            failed.append(f"fold {fold} keeps the fit that it began with: {error}")
    whole = with_folds(results)
    assert whole.diagnostics is not None
    warnings = *whole.diagnostics.warnings, *failed
    return replace(whole, diagnostics=replace(whole.diagnostics, warnings=warnings))


def with_folds(fits: Sequence[Fit]) -> Fit:
    """The last one of F fits, with the friction (F, n, P) of all of them and their calibrations."""
    frictions = [fit.friction for fit in fits]
    theta = namespace(frictions[-1].theta).stack([f.theta for f in frictions])
    calibrations = [f.calibration for f in frictions if f.calibration is not None]
    folds = replace(frictions[-1], theta=theta, calibration=stack_calibrations(calibrations))
    return replace(fits[-1], folds=folds)


@dataclass(frozen=True)
class CalibratedRecipe:
    """A one-step recipe on data that a calibration corrects, estimated by shooting.

    step : what identifiers fit
    by : shooting that estimates the calibration, beside the friction of an identifier; without
        blocks, its calibration is held
    friction : that identifier
    use : parts of the calibration that correct the data, some of those that `by` frees
    """

    name: str
    step: Recipe
    by: Shooting
    friction: Identifier
    use: tuple[str, ...] = ("inertia", "delay")
    needs_intervals: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not self.use:
            raise InputError(f"recipe {self.name!r}: use must name a part of the calibration")
        for part in self.use:
            if part not in self._free:
                raise InputError(
                    f"recipe {self.name!r}: use = {part!r} must be one of "
                    f"{', '.join(self._free) or 'no part'}, which are free"
                )

    @property
    def _free(self) -> tuple[str, ...]:
        """Parts of the calibration that `by` frees, or all where it is known."""
        free = [block.name for block in self.by.blocks]
        return tuple(part for part in PARTS if part in free or self.by.held is not None)

    @property
    def steps(self) -> tuple[Recipe, ...]:
        """The one-step recipes whose problems a fit needs."""
        return (self.step, *self.by.start.steps)

    @property
    def calibrated(self) -> CalibratedRecipe:
        """The recipe itself."""
        return self

    @property
    def calibrator(self) -> CalibratedRecipe:
        """The recipe that estimates the calibration, the same for all that only use it otherwise.

        It uses all free parts.
        """
        return replace(self, name="calibration", step=INTEGRAL, use=self._free)

    @property
    def scheme(self) -> str:
        """Scheme of the one-step recipe."""
        return self.step.scheme

    @property
    def corrects(self) -> tuple[str, ...]:
        """Parts of the calibration that correct the data."""
        return self.use

    def calibrate(self, data: ShootingData, fold: int) -> tuple[Calibration, tuple[str, ...]]:
        """Calibration of one fold, of all data where it is -1.

        With the block of each of its parameters that the recordings of the fold determine; none of
        a calibration that is held.
        """
        if self.by.held is not None and not self.by.blocks:
            return self.by.held.on(data.intervals.dataset), ()
        fit = self.estimate(data, fold)
        parameters = zip(fit.covariance.parameters, fit.covariance.determined, strict=True)
        blocks = tuple(p.block for p, shown in parameters if shown and p.block != "friction")
        return fit.calibration, blocks

    def estimate(self, data: ShootingData, fold: int) -> Fit:
        """The fit of one fold that calibrates it, of all data where it is -1."""
        rows = slice(fold, fold + 1 or None)
        problem, weights = data.problems[self.by.start.name], data.weights[self.by.start.name]
        friction = self.friction.fit(problem, weights[rows], 0)
        return refine_folds(friction, data.intervals, self.by, data.interval_weights[rows])

    def friction_of(
        self, identifier: Identifier, data: ShootingData, seed: int
    ) -> tuple[Friction, Problem]:
        """The friction (F + 1, n, P) of the folds and of all data, and the problem of all data.

        Friction has the calibrations of the folds.

        Raises
        ------
        InputError
            Where the fit fails, or gives folds different laws.
        """
        weights, parts = data.weights[self.step.name], list(data.corrected(self))
        problems = {int(fold): problem for folds, problem in parts for fold in folds}
        each = [problems[fold] for fold in range(len(weights))]
        friction = identifier.fit_each(each, weights, seed)
        if friction is None:
            friction = _one_by_one(identifier, parts, weights, seed)
        friction = checked(friction, identifier, each[-1], weights)
        calibration = data.calibrations[self.name]
        return with_units_of(data.mechanism, replace(friction, calibration=calibration)), each[-1]

    def fit(self, identifier: Identifier, data: ShootingData, seed: int) -> Fit:
        """The identifier's friction of all folds and of all data, with their calibrations.

        Raises
        ------
        InputError
            Where the fit fails, or gives folds different laws.
        """
        if identifier.fixed:
            return self.step.fit(identifier, data, seed)
        friction, problem = self.friction_of(identifier, data, seed)
        fit = one_step_fit(friction, problem, data.weights[self.step.name][-1])
        return replace(fit, beside=data.determined[self.name])


def _one_by_one(
    identifier: Identifier, parts: Sequence[tuple[Array, Problem]], weights: Array, seed: int
) -> Friction:
    """Friction (F, n, P) of the folds of each problem, with the provenance of the last one."""
    each: dict[int, Friction] = {}
    for folds, problem in parts:
        fitted = checked_fit(identifier, problem, weights[folds], seed)
        each |= {int(fold): fitted[place] for place, fold in enumerate(folds)}
    frictions = [each[fold] for fold in range(len(weights))]
    last = frictions[-1]
    if any(friction.law != last.law for friction in frictions):
        raise InputError(
            f"{identifier!r} has another law in each fold: give it a recipe without calibration"
        )
    theta = np.stack([np.asarray(friction.theta) for friction in frictions])
    return replace(last, theta=theta, constraints=None)


def part_of_calibration(calibration: Calibration, use: tuple[str, ...]) -> Calibration:
    """The calibration with only some of its parts; the others are those of an ideal one."""
    ideal = Calibration.ideal(calibration.gain.shape[-1])
    kept = {
        part: getattr(calibration, part)
        if part in use
        else np.broadcast_to(getattr(ideal, part), getattr(calibration, part).shape)
        for part in PARTS[1:]
    }
    return replace(calibration, base=calibration.base if "inertia" in use else None, **kept)
