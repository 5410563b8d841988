"""One-step recipes on data corrected by what shooting finds: torque clock, inertia, sensors.

In each training fold shooting fits a parametric friction together with the calibration. The data
are corrected by that calibration, and any identifier fits its one-step problem on them. A model
with memory then cannot mistake a torque delay or a missing inertia for friction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.identifiers import Identifier
from frictionid.identifiers.formulation import Recipe
from frictionid.identifiers.residual import Problem
from frictionid.mechanics.calibration import Calibration
from frictionid.shooting.intervals import Intervals
from frictionid.shooting.recipe import Shooting, refine_folds

# What of a calibration may correct the data, under the names of the blocks that find it.
PARTS = ("inertia", "delay", "gain", "bias", "offset")


@dataclass(frozen=True)
class CalibratedRecipe:
    """A one-step recipe on data that a calibration corrects, found by shooting.

    step : what identifiers fit; by : what finds the calibration, from the `friction` of an
    identifier; use : the parts that correct the data, some of those that `by` frees
    """

    name: str
    step: Recipe
    by: Shooting
    friction: Identifier
    use: tuple[str, ...] = ("inertia", "delay")

    def __post_init__(self) -> None:
        free = [block.name for block in self.by.blocks]
        for part in self.use:
            if part not in PARTS or part not in free:
                raise InputError(
                    f"recipe {self.name!r}: use = {part!r} must be one of "
                    f"{', '.join(p for p in PARTS if p in free) or 'no part'}, which are free"
                )
        if not self.use:
            raise InputError(f"recipe {self.name!r}: use must name a part of the calibration")


def calibrations_of(
    recipe: CalibratedRecipe,
    intervals: Intervals,
    problem: Problem,
    weights: Array,
    training: Array,
    whole: bool,
) -> Calibration:
    """Calibrations of all folds and, last, of all data, with only the parts that correct.

    problem, weights (F + 1, K) : those of the recipe that `by` starts with; training (F + 1, K):
    intervals of the track; whole : whether all folds have the calibration of all data, as they
    must where folds leave no windows to shoot at
    """
    use = slice(-1, None) if whole else slice(None)
    friction = recipe.friction.fit(problem, weights[use], 0)
    solution, _ = refine_folds(friction, intervals, recipe.by, training[use])
    if solution.calibration is None:
        raise InputError(
            f"recipe {recipe.name!r}: shooting has found no calibration: free a part of it"
        )
    calibration = part_of_calibration(solution.calibration, recipe.use)
    return calibration[np.zeros(len(weights), dtype=int)] if whole else calibration


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
