"""Methods of fitting: the protocol of all recipes, and of one's own."""

from __future__ import annotations

from typing import Protocol

from frictionid.fitting.fit import Fit
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.one_step.formulation import Recipe
from frictionid.fitting.shooting import CalibratedRecipe
from frictionid.fitting.shooting.calibrated_recipe import CalibratedData


class Method(Protocol):
    """A way of fitting: `Recipe`, `Shooting`, `InverseDynamics`, `CalibratedRecipe`, or one's own.

    first_step : the one-step recipe that a fit uses, or begins with
    steps : all one-step recipes whose problems a fit needs
    needs_intervals : whether a fit needs the intervals of the measured angles
    calibrator : the recipe that estimates the calibration a fit needs, or None
    scheme : "euler", "integral", "shooting" or "inverse dynamics"
    corrects : parts of the calibration that correct the data
    """

    @property
    def name(self) -> str: ...
    @property
    def first_step(self) -> Recipe: ...
    @property
    def steps(self) -> tuple[Recipe, ...]: ...
    @property
    def needs_intervals(self) -> bool: ...
    @property
    def calibrator(self) -> CalibratedRecipe | None: ...
    @property
    def scheme(self) -> str: ...
    @property
    def corrects(self) -> tuple[str, ...]: ...

    def check(self, identifier: Identifier) -> None:
        """Check that it can fit an identifier; InputError where it cannot."""
        ...

    def fit(self, identifier: Identifier, data: CalibratedData, seed: int) -> Fit:
        """The identifier's friction of all folds and of all data; InputError where that fails."""
        ...
