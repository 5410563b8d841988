"""One-step recipes on data corrected by a calibration: torque clock, inertia, sensors.

In each training fold shooting fits a friction that is nobody's candidate together with the
calibration. The data are corrected by that calibration, and any identifier fits its one-step
problem on them: all families have the same one. A model with memory then cannot mistake a torque
delay or a missing inertia for friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from frictionid.arrays import Array
from frictionid.data.calibration import Calibration
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.coordinates import with_units_of

from ..fit import Fit
from ..identifier import Identifier
from ..one_step.formulation import INTEGRAL, Recipe
from ..one_step.one_step_fit import checked, checked_fit, one_step_fit
from ..one_step.residual import Problem
from .recipe import Shooting, ShootingData, refine_folds

# Parts of a calibration that may correct the data, under the names of the blocks that free them.
PARTS = ("inertia", "delay", "gain", "bias", "offset")


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
