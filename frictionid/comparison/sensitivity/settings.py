"""What a sensitivity study varies: the [sensitivity] table of a suite."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from frictionid.comparison.sensitivity.variations import (
    NOMINAL,
    Variation,
    sensitive_parameters,
)
from frictionid.config import Strict
from frictionid.data.recordings import Dataset

Share = Annotated[float, Field(gt=-1.0, lt=10.0)]
Positive = Annotated[float, Field(gt=0.0)]


class SensitivitySettings(Strict):
    """What is wrong on purpose, and by how much; an empty list leaves a cause out.

    parameters : of the mechanism; all that its motion depends on if not given
    levels : relative errors of each; gain : of the torque
    delay : [s] that the torque is logged late
    tilt : [deg] of the base, where the first joint turns
    noise : [deg] standard deviations added to the angles; rate : one sample of so many is kept
    recordings : shares of the recordings that are fitted
    identifiers, recipes : names of those that are fitted; if not given, the first law that draws no
        random numbers, and all its recipes
    horizon : [s] of the rollout error
    """

    parameters: list[str] | None = None
    levels: list[Share] = [-0.1, 0.1]
    gain: list[Share] = [-0.1, 0.1]
    delay: list[float] = [-0.005, 0.005]
    tilt: list[float] = [-1.0, 1.0]
    noise: list[Positive] = [0.1, 0.3]
    rate: list[Annotated[int, Field(ge=2)]] = [2]
    recordings: list[Annotated[float, Field(gt=0.0, lt=1.0)]] = [0.25, 0.5]
    identifiers: Annotated[list[str], Field(min_length=1)] | None = None
    recipes: Annotated[list[str], Field(min_length=1)] | None = None
    horizon: Positive = 0.5

    @model_validator(mode="after")
    def _each_once(self) -> SensitivitySettings:
        for name, values in self:
            if isinstance(values, list) and len(set(values)) < len(values):
                raise ValueError(f"{name} must differ, they are {values}")
        return self


def variations_of(dataset: Dataset, settings: SensitivitySettings) -> tuple[Variation, ...]:
    """Variations of a data set, the nominal one first.

    A tilt is left out where the first joint slides, delay and gain where there is no torque, fewer
    recordings where there is one only.

    Raises
    ------
    InputError
        Where the mechanism has no parameter of a name.
    """
    names = settings.parameters
    if names is None:
        names = list(sensitive_parameters(dataset))
    for name in names:
        dataset.mechanism.check_name(name)
    turns = dataset.mechanism.position_units[0] == "rad"
    moves = any(np.any(r.torque.value) for r in dataset.recordings)
    several = len(dataset.recordings) > 1
    return (
        NOMINAL,
        *(Variation("parameter", level, name) for name in names for level in settings.levels),
        *_each("delay", settings.delay if moves else ()),
        *_each("gain", settings.gain if moves else ()),
        *_each("tilt", settings.tilt if turns else ()),
        *_each("noise", settings.noise),
        *_each("rate", settings.rate),
        *_each("recordings", settings.recordings if several else ()),
    )


def _each(cause: str, amounts: Sequence[Any]) -> list[Variation]:
    return [Variation(cause, float(amount)) for amount in amounts]
