"""Plan of a first comparison: which laws, by which method, on how much of the data.

The method is that of `frictionid.fit`, with fewer samples and folds, and coarser steps, so that it
takes about a minute.
"""

from __future__ import annotations

from typing import NamedTuple

from frictionid.comparison.suite import IdentifierEntry
from frictionid.comparison.suite_recipes import RecipeEntry
from frictionid.comparison.usual_method import usual_method
from frictionid.data.recordings import Dataset
from frictionid.fitting.identifiers import Frictionless
from frictionid.fitting.shooting.settings import torque_is_sampled


class Plan(NamedTuple):
    """What is compared.

    recipe : how laws are fitted; laws : from simple to rich
    horizons : [s] of predictions, the first one counts that the folds hold out
    folds : at most; samples : of all joints, at most
    """

    recipe: RecipeEntry
    laws: tuple[IdentifierEntry, ...]
    horizons: tuple[float, ...]
    folds: int
    samples: int

    @property
    def by_torque(self) -> bool:
        """Whether the torque left is compared, not predictions."""
        return self.recipe.by == "inverse_dynamics"

    @property
    def steps(self) -> tuple[str, ...]:
        """Names of the steps of a first verdict."""
        return ("check", *(law.label for law in self.laws))


_BY_DIRECTION = {"kind": "stribeck", "name": "stribeck_asymmetric", "symmetric": False}


def _laws(*kinds: str) -> tuple[IdentifierEntry, ...]:
    return tuple(IdentifierEntry(kind=kind) for kind in kinds)


BY_ANGLES = Plan(
    RecipeEntry(name="shooting", by="shooting"),
    (
        *_laws("none", "coulomb_viscous", "load_dependent", "motor_load", "stribeck"),
        IdentifierEntry.model_validate(_BY_DIRECTION),
        *_laws("spline"),
    ),
    horizons=(0.5, 0.25, 0.1),
    folds=10,
    samples=6_000,
)
_COARSE = {
    "name": "inverse_dynamics",
    "by": "inverse_dynamics",
    "node_time": 0.01,
    "tolerance": 0.05,
}
_PEAKED = {"kind": "load_dependent", "name": "load_dependent_stribeck", "stribeck": True}
# `motor_load` explains any torque beside free inertias; without its controller an arm drifts off
BY_TORQUES = Plan(
    RecipeEntry.model_validate(_COARSE),
    (
        *_laws("none", "coulomb_viscous", "load_dependent"),
        IdentifierEntry.model_validate(_PEAKED),
    ),
    horizons=(0.05,),
    folds=5,
    samples=24_000,
)


def plan_for(dataset: Dataset) -> Plan:
    """The plan of a data set: `motor_load` is a candidate where a motor's torque is sampled."""
    if usual_method(dataset, Frictionless()) == BY_TORQUES.recipe.name:
        return BY_TORQUES
    driven = torque_is_sampled(dataset) or any(r.servo for r in dataset.recordings)
    laws = (law for law in BY_ANGLES.laws if driven or law.kind != "motor_load")
    return BY_ANGLES._replace(laws=tuple(laws))
