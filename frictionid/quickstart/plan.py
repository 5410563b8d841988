"""Which friction laws a first verdict compares on a data set, and how they are fitted."""

from typing import Any, NamedTuple

import numpy as np

from frictionid.comparison.suite import IdentifierEntry
from frictionid.comparison.suite_recipes import RecipeEntry, usual_method
from frictionid.data.recordings import Dataset
from frictionid.fitting.identifiers import Frictionless
from frictionid.fitting.shooting.settings import is_driven


class Plan(NamedTuple):
    """What is compared.

    recipe : how laws are fitted; laws : from simple to rich
    further : laws of position or memory, which join them where a fit in one step shows them
    horizons : [s] of predictions, the first one counts that the folds hold out
    folds : at most; samples : of all joints, at most
    """

    recipe: RecipeEntry
    laws: tuple[IdentifierEntry, ...]
    further: tuple[IdentifierEntry, ...]
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
        last = ("further laws",) if self.further else ()
        return ("check", *(law.label for law in self.laws), *last)


_BY_DIRECTION = {"kind": "stribeck", "name": "stribeck_asymmetric", "symmetric": False}
_AUTO = {"harmonics": "auto"}
_COGGING = {
    "kind": "sum",
    "name": "cogging",
    "laws": ["coulomb_viscous", {"kind": "cogging", **_AUTO}],
}
# a candidate like others: in one step gravity, offset and noise hide most of a weak one
_SPRING = {"kind": "sum", "name": "spring", "laws": ["stribeck", "spring"]}
_PEAKED = {"kind": "load_dependent", "name": "load_dependent_stribeck", "stribeck": True}


def _laws(*laws: str | dict[str, Any]) -> tuple[IdentifierEntry, ...]:
    tables = (law if isinstance(law, dict) else {"kind": law} for law in laws)
    return tuple(map(IdentifierEntry.model_validate, tables))


_OF_POSITION = _laws({"kind": "ripple", **_AUTO}, _COGGING)
BY_ANGLES = Plan(
    RecipeEntry(name="shooting", by="shooting"),
    _laws(
        "none",
        "coulomb_viscous",
        "load_dependent",
        "motor_load",
        "stribeck",
        _BY_DIRECTION,
        _SPRING,
        "spline",
    ),
    (*_OF_POSITION, *_laws("lugre")),
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
# `motor_load` explains any torque beside free inertias; without its controller an arm drifts off
BY_TORQUES = Plan(
    RecipeEntry.model_validate(_COARSE),
    _laws("none", "coulomb_viscous", "load_dependent", _PEAKED),
    further=(),
    horizons=(0.05,),
    folds=5,
    samples=120_000,
)


def plan_for(dataset: Dataset) -> Plan:
    """The plan of a data set: `motor_load` is a candidate where a motor drives.

    Drag, `quadratic`, stands in its place where none does, and in that of `load_dependent` where no
    load changes, as of a carriage: there that is Coulomb friction.
    Of many joints angles are compared in fewer folds, without friction by direction or of memory.
    """
    if usual_method(dataset, Frictionless()) == BY_TORQUES.recipe.name:
        return BY_TORQUES
    many = dataset.mechanism.n > _FAST
    slow = (_BY_DIRECTION["name"], _SPRING["name"]) if many else ()
    laws = tuple(law for law in BY_ANGLES.laws if law.label not in slow)
    idle = {"motor_load": not is_driven(dataset), "load_dependent": not _load_changes(dataset)}
    laws = tuple(dict.fromkeys(_DRAG if idle.get(law.label) else law for law in laws))
    plan = BY_ANGLES._replace(laws=laws)
    further = (*_OF_POSITION, *_laws(_SPRING))
    return plan._replace(further=further, folds=BY_TORQUES.folds) if many else plan


def _load_changes(dataset: Dataset) -> bool:
    """Whether any joint's load changes with position, speed or recording."""
    machine, fast = dataset.mechanism, dataset.scales.fast
    if machine.loads_of_gears:  # of one joint the weight's, and what its own inertia asks for
        q = np.concatenate([r.angle.value for r in dataset.recordings])
        weight = machine.dynamics(machine.nominal_base, q, 0.0 * q)[1]
        return machine.n > 1 or bool((np.abs(weight) > _ROUNDING).any())
    states = [(r.parameters, r.angle.value, w) for r in dataset.recordings for w in (0.0, fast)]
    load = np.concatenate([machine.load(p, q, 0.0 * q + w, 0.0 * q) for p, q, w in states])
    return bool((np.ptp(load, axis=0) > _ROUNDING * load.max(axis=0)).any())


(_DRAG,) = _laws("quadratic")
_ROUNDING = 1e-9
_FAST = 2  # joints, above which a fit by angles takes many seconds
