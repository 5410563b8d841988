"""Shooting as a recipe: what is freed, where it begins, and the calibration of another fit."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.data.calibration import Calibration, stack_calibrations, with_calibrated_servos
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.friction import Friction

from ..fit import Fit
from ..identifier import Identifier
from ..one_step.formulation import INTEGRAL, Recipe, TrainingData
from ..one_step.residual import Problem
from ..parameters import ParameterBlock
from .refine import fit_blocks
from .sample_intervals import Intervals
from .servo import has_actuator
from .settings import DEFAULT_BLOCKS, Settings

_BLOCKS = ("inertia", "delay", "gain", "bias", "offset", "target_delay", "backlash", "envelope")


@dataclass(frozen=True, eq=False)
class KnownCalibration:
    """Base parameters and what else of sensors and servos another fit found, but for motors.

    `errors` are the names of the parameters that it determined, with their standard errors. What a
    fit does not free stays as it is; free parameters have these as priors.
    """

    calibration: Calibration
    errors: tuple[tuple[str, float], ...] = ()

    def on(self, dataset: Dataset) -> Calibration:
        """The calibration, checked to be of the data set's mechanism.

        Raises
        ------
        InputError
            Where joints or base parameters are not as many.
        """
        mechanism, base = dataset.mechanism, self.calibration.base
        sizes = (self.calibration.gain.shape[-1], None if base is None else base.shape[-1])
        if sizes[0] != mechanism.n or sizes[1] not in (None, len(mechanism.base_names)):
            raise InputError(
                f"data set {dataset.name!r}: the calibration is of {sizes[0]} joints with "
                f"{sizes[1]} base parameters, {mechanism.kind} has {mechanism.n} and "
                f"{len(mechanism.base_names)}: name a model of the same machine"
            )
        return self.calibration

    def as_priors(self, blocks: Sequence[ParameterBlock]) -> tuple[ParameterBlock, ...]:
        """The blocks, with priors where the other fit determined their parameters."""
        return tuple(replace(b, deviations=self.errors) if b.name in _BLOCKS else b for b in blocks)


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

    def corrected(self, recipe: Any) -> Iterable[tuple[Array, Problem]]:
        """Folds that share a calibration, with the problem on the data that it corrects.

        All data, the last fold, are in the last one.
        """
        ...


class Start(Protocol):
    """What shooting begins with: a `Recipe`, or a `CalibratedRecipe`."""

    @property
    def name(self) -> str: ...
    @property
    def steps(self) -> tuple[Recipe, ...]: ...
    @property
    def calibrated(self) -> Any: ...

    def friction_of(self, identifier: Identifier, data: Any, seed: int) -> tuple[Friction, Problem]:
        """The identifier's friction (F + 1, n, P) of the folds and of all data, and its problem."""
        ...

    def fit(self, identifier: Identifier, data: Any, seed: int) -> Fit:
        """The identifier's friction of all folds and of all data."""
        ...


@dataclass(frozen=True)
class Shooting:
    """Friction refined by shooting, from the fit of a one-step recipe.

    blocks : what is free: friction, and the delay where a motor's torque is sampled
    settings : windows, noise, iterations
    start : the recipe whose friction it begins with; beside what is free, its calibration does not
        count
    held : calibration of another fit, held but for the blocks that are free, which it informs
    """

    name: str = "shooting"
    blocks: tuple[ParameterBlock, ...] = DEFAULT_BLOCKS
    settings: Settings = Settings()
    start: Start = INTEGRAL
    held: KnownCalibration | None = None
    needs_intervals: ClassVar[bool] = True
    scheme: ClassVar[str] = "shooting"
    corrects: ClassVar[tuple[str, ...]] = ()

    @property
    def steps(self) -> tuple[Recipe, ...]:
        """The one-step recipes whose problems a fit needs: those of the one that it begins with."""
        return self.start.steps

    @property
    def calibrated(self) -> Any:
        """The calibrated recipe that a fit begins with, or None."""
        return self.start.calibrated

    def fit(self, identifier: Identifier, data: ShootingData, seed: int) -> Fit:
        """The identifier's friction of all folds and of all data, refined unless it is fixed.

        Raises
        ------
        InputError
            Where the fit fails.
        """
        if identifier.fixed:
            return self.start.fit(identifier, data, seed)
        first, _ = self.start.friction_of(identifier, data, seed)
        first = replace(first, calibration=None)
        return refine_folds(first, data.intervals, self, data.interval_weights)


def refine_folds(
    friction: Friction, intervals: Intervals, recipe: Shooting, training: Array
) -> Fit:
    """The fit to the last one of the folds, with the friction (F, n, P) of all of them.

    training : (F, K), the intervals that each fold may use; the last row is that of
        all data

    Each fold is fitted from its own one-step fit, so that nothing of it depends on the recordings
    that it holds out: neither its optimum, nor the way there.
    """
    blocks, starts = recipe.blocks, [friction[f] for f in range(len(training))]
    if recipe.held is not None:
        blocks = recipe.held.as_priors(blocks)
        held = recipe.held.on(intervals.dataset)
        starts = [replace(start, calibration=held) for start in starts]
        if not has_actuator(blocks):
            dataset = with_calibrated_servos(intervals.dataset, held)
            intervals = replace(intervals, dataset=dataset)
    results = [
        fit_blocks(start, intervals, blocks, recipe.settings, use)
        for start, use in zip(starts, training > 0, strict=True)
    ]
    return with_folds(results)


def with_folds(fits: Sequence[Fit]) -> Fit:
    """The last one of F fits, with the friction (F, n, P) of all of them and their calibrations."""
    frictions = [fit.friction for fit in fits]
    theta = namespace(frictions[-1].theta).stack([f.theta for f in frictions])
    calibrations = [f.calibration for f in frictions if f.calibration is not None]
    folds = replace(frictions[-1], theta=theta, calibration=stack_calibrations(calibrations))
    return replace(fits[-1], folds=folds)
