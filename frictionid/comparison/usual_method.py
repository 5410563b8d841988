"""What a fit or a comparison takes where nothing is named: method, recipe, time between samples."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from frictionid.data.recordings import Dataset
from frictionid.evaluation.prepared import usual_interval
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.one_step.formulation import INTEGRAL
from frictionid.fitting.shooting.settings import torque_is_sampled

from .registry import RECIPES
from .suite_recipes import CALIBRATED

ONE_STEP = (*RECIPES, CALIBRATED.name)
_ARM = 3  # joints
_MOST = 100_000  # samples of all joints that are fitted by default
_COARSEST = 0.01  # [s] between samples


def usual_method(dataset: Dataset, identifier: Identifier) -> str:
    """Name of the method that a fit takes where none is named.

    Shooting, whose inertia, bias and delay are free where the data tell them. For arms inverse
    dynamics: three joints or more, each with a sampled torque. In one step networks of arms,
    networks with memory, which take minutes by shooting, and what uses no physics.

    Examples
    --------
    >>> from frictionid.data.readers.dataset import load_dataset
    >>> from frictionid.fitting.identifiers import Frictionless
    >>> usual_method(load_dataset("acrobot_clean"), Frictionless())
    'shooting'
    """
    law: Any = getattr(identifier, "law", None)
    network = getattr(law, "is_network", False)
    if not identifier.uses_mechanism or (network and law.has_memory):
        return "one_step"
    driven = dataset.actuated.all() and torque_is_sampled(dataset)
    if dataset.mechanism.n < _ARM or not driven:
        return "shooting"
    return "one_step" if network else "inverse_dynamics"


def usual_recipe(dataset: Dataset, identifiers: Sequence[Identifier]) -> str:
    """Recipe of a comparison that names none: how `frictionid.fit` fits, where it fits all alike.

    Else "calibrated", one step on data whose inertia and clock shooting has corrected, the same for
    all; of arms, and with what uses no physics, "integral".

    Examples
    --------
    >>> from frictionid.data.readers.dataset import load_dataset
    >>> from frictionid.fitting.identifiers import Frictionless
    >>> usual_recipe(load_dataset("acrobot_clean"), [Frictionless()])
    'shooting'
    """
    methods = {usual_method(dataset, identifier) for identifier in identifiers}
    if len(methods) == 1 and methods != {"one_step"}:
        return methods.pop()
    physics = all(identifier.uses_mechanism for identifier in identifiers)
    return CALIBRATED.name if physics and dataset.mechanism.n < _ARM else INTEGRAL.name


def usual_sample_time(dataset: Dataset, method: str) -> float | None:
    """Time [s] between samples that a fit of long data takes where none is named; None: all."""
    one_step = method == "one_step" or method in ONE_STEP
    return None if one_step else time_between_samples(dataset, _MOST)


def time_between_samples(dataset: Dataset, most: int) -> float | None:
    """Time [s] between samples that leaves so many of all joints, or 0.01; None: all of them."""
    usual, joints = usual_interval(dataset), np.shape(dataset.recordings[0].angle.value)[1]
    apart = max(usual, min(dataset.seconds * joints / most, _COARSEST))
    return apart if apart > 1.5 * usual else None
