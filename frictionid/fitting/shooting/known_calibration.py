"""The calibration of another fit: held as it is, or free near it by its standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.data.calibration import Calibration
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.fitting.parameters.parameter_block import ParameterBlock
from frictionid.friction import Friction

_BLOCKS = ("inertia", "delay", "gain", "bias", "offset", "target_delay", "backlash")


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
