"""One-step recipes on data corrected by what shooting finds: torque clock, inertia, sensors.

A parametric friction is refined by shooting beside the rig, in each training fold; then the data
are corrected by that rig, and any identifier fits its one-step problem on them. So what a model
with memory finds is not the delay of a clock, nor inertia that the told mechanism lacks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.identifiers import Identifier
from frictionid.identifiers.formulation import Recipe
from frictionid.identifiers.residual import Problem
from frictionid.mechanics.calibration import Rig
from frictionid.shooting.intervals import Track
from frictionid.shooting.recipe import Shooting, refine_folds

# What of a rig may correct the data, under the names of the blocks that find it.
PARTS = ("inertia", "delay", "gain", "bias", "offset")


@dataclass(frozen=True)
class Corrected:
    """A one-step recipe on data that a rig corrects, found by shooting.

    step : what identifiers fit; by : what finds the rig, from the `friction` of an identifier;
    use : the parts of the rig that correct the data, some of those that `by` frees
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
            raise InputError(f"recipe {self.name!r}: use must name a part of the rig")


def rigs_of(
    recipe: Corrected, track: Track, problem: Problem, weights: Array, training: Array, whole: bool
) -> Rig:
    """Rigs of all folds and, last, of all data, with only the parts that correct.

    problem, weights (F + 1, K) : those of the recipe that `by` starts with; training (F + 1, K):
    intervals of the track; whole : whether all folds have the rig of all data, as they must where
    folds leave no windows to shoot at
    """
    use = slice(-1, None) if whole else slice(None)
    friction = recipe.friction.fit(problem, weights[use], 0)
    shot, _ = refine_folds(friction, track, recipe.by, training[use])
    if shot.rig is None:
        raise InputError(f"recipe {recipe.name!r}: shooting has found no rig: free a part of it")
    rig = some_of_rig(shot.rig, recipe.use)
    return rig[np.zeros(len(weights), dtype=int)] if whole else rig


def some_of_rig(rig: Rig, use: tuple[str, ...]) -> Rig:
    """The rig with only some of its parts; the others are those of an ideal one."""
    ideal = Rig.ideal(rig.gain.shape[-1])
    kept = {
        part: getattr(rig, part)
        if part in use
        else np.broadcast_to(getattr(ideal, part), getattr(rig, part).shape)
        for part in PARTS[1:]
    }
    return replace(rig, base=rig.base if "inertia" in use else None, **kept)


def groups(rig: Rig, folds: int) -> list[Array]:
    """Folds that have one and the same rig, in groups; that of the last fold is the last.

    >>> rig = Rig.ideal(1)
    >>> both = replace(rig, gain=np.ones((3, 1)), bias=np.zeros((3, 1)), offset=np.zeros((3, 1)))
    >>> [g.tolist() for g in groups(replace(both, delay=np.array([0.01, 0.02, 0.01])), 3)]
    [[1], [0, 2]]
    """
    parts = [rig.gain, rig.delay, rig.bias, rig.offset] + ([] if rig.base is None else [rig.base])
    rows = np.concatenate([np.reshape(part, (folds, -1)) for part in parts], axis=1)
    _, group = np.unique(rows, axis=0, return_inverse=True)
    flat = np.reshape(group, -1)  # NumPy 2.0 gives it more axes
    found = [np.flatnonzero(flat == g) for g in dict.fromkeys(flat.tolist())]
    return sorted(found, key=lambda own: int(own[-1]))
