"""Shooting as a recipe: what is freed, and which one-step fit it begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array, namespace
from frictionid.data.calibration import stack_calibrations, with_calibrated_servos
from frictionid.errors import InputError
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.one_step.formulation import INTEGRAL, Recipe, TrainingData
from frictionid.fitting.one_step.one_step_fit import ErrorBars, OneStepFit
from frictionid.fitting.parameters import ParameterBlock
from frictionid.fitting.shooting.known_calibration import KnownCalibration
from frictionid.fitting.shooting.refine import Refined, fit_blocks
from frictionid.fitting.shooting.sample_intervals import Intervals
from frictionid.fitting.shooting.servo_checks import has_actuator
from frictionid.fitting.shooting.settings import DEFAULT_BLOCKS, Settings
from frictionid.friction import Friction


class ShootingData(TrainingData, Protocol):
    """What shooting fits: intervals of measured angles.

    `interval_weights` (F + 1, K) are positive where a fold may use an interval; the last row is
    that of all data.
    """

    @property
    def intervals(self) -> Intervals: ...
    @property
    def interval_weights(self) -> Array: ...


@dataclass(frozen=True, eq=False)
class ShootingFit:
    """Friction (F, n, P) of F folds, the last one all data, refined by shooting."""

    friction: Friction
    refined: Refined

    def half_widths(self) -> Array:
        """Half the width (n, P) of the 95 % intervals of the friction of all data, or NaN."""
        covariance = self.refined.covariance
        half = np.full(np.shape(self.refined.friction.theta), np.nan)
        for entry, error in zip(covariance.parameters, covariance.error, strict=True):
            if entry.block == "friction":
                half[entry.place] = stdtrit(covariance.freedom, 0.975) * error
        return half

    def error_bars(self) -> ErrorBars:
        """Half the width of the 95 % intervals of the friction of all data, or NaN."""
        return ErrorBars(self.half_widths(), "95 % intervals")


@dataclass(frozen=True)
class Shooting:
    """Friction refined by shooting, from the fit of a one-step recipe.

    blocks : what is free: friction, and the delay where a motor's torque is sampled
    settings : windows, noise, iterations; start : the recipe it begins with
    known : calibration of another fit, held but for the blocks that are free, which it informs
    """

    name: str = "shooting"
    blocks: tuple[ParameterBlock, ...] = DEFAULT_BLOCKS
    settings: Settings = Settings()
    start: Recipe = INTEGRAL
    known: KnownCalibration | None = None
    needs_intervals: ClassVar[bool] = True
    scheme: ClassVar[str] = "shooting"
    calibrator: ClassVar[None] = None
    corrects: ClassVar[tuple[str, ...]] = ()

    @property
    def first_step(self) -> Recipe:
        """The one-step recipe that a fit begins with."""
        return self.start

    @property
    def steps(self) -> tuple[Recipe, ...]:
        """The one-step recipes whose problems a fit needs."""
        return (self.start,)

    def check(self, identifier: Identifier) -> None:
        """Check that it can fit an identifier.

        Raises
        ------
        InputError
            For identifiers that use no mechanism.
        """
        check_mechanism(self.name, identifier)

    def fit(
        self, identifier: Identifier, data: ShootingData, seed: int
    ) -> OneStepFit | ShootingFit:
        """The identifier's friction of all folds and of all data, refined unless it is fixed.

        Raises
        ------
        InputError
            Where the fit fails.
        """
        first = self.start.fit(identifier, data, seed)
        if identifier.fixed:
            return first
        refined = refine_folds(first.friction, data.intervals, self, data.interval_weights)
        return ShootingFit(*refined)


def check_mechanism(recipe: str, identifier: Identifier) -> None:
    """Refuse identifiers that use no mechanism.

    Raises
    ------
    InputError
        With the name of the recipe, and what to do.
    """
    if not identifier.uses_mechanism:
        raise InputError(
            f"recipe {recipe!r}: shooting needs the physics that a black box lacks: give it "
            'recipes = ["integral"], or another one-step recipe'
        )


def refine_folds(
    friction: Friction, intervals: Intervals, recipe: Shooting, training: Array
) -> tuple[Friction, Refined]:
    """Friction (F, n, P) of all folds with its calibrations, and the whole result of the last one.

    training : (F, K), the intervals that each fold may use; the last row is that of
        all data

    Each fold is fitted from its own one-step fit, so that nothing of it depends on the recordings
    that it holds out: neither its optimum, nor the way there.
    """
    blocks, starts = recipe.blocks, [friction[f] for f in range(len(training))]
    if recipe.known is not None:
        blocks = recipe.known.as_priors(blocks)
        held = recipe.known.on(intervals.dataset)
        starts = [replace(start, calibration=held) for start in starts]
        if not has_actuator(blocks):
            known = with_calibrated_servos(intervals.dataset, held)
            intervals = replace(intervals, dataset=known)
    results = [
        fit_blocks(start, intervals, blocks, recipe.settings, use)
        for start, use in zip(starts, training > 0, strict=True)
    ]
    return folds_together([result.friction for result in results]), results[-1]


def folds_together(frictions: Sequence[Friction]) -> Friction:
    """One friction (F, n, P) of those of F folds, with their calibrations."""
    theta = namespace(frictions[-1].theta).stack([f.theta for f in frictions])
    calibrations = [f.calibration for f in frictions if f.calibration is not None]
    return replace(frictions[-1], theta=theta, calibration=stack_calibrations(calibrations))
