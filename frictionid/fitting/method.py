"""Methods of fitting: the protocol of all recipes, and of one's own."""

from typing import Protocol

from frictionid.errors import InputError

from .fit import Fit
from .identifier import Identifier
from .one_step.formulation import Recipe
from .shooting import CalibratedRecipe
from .shooting.recipe import ShootingData


class Method(Protocol):
    """A way of fitting: `Recipe`, `Shooting`, `InverseDynamics`, `CalibratedRecipe`, or one's own.

    steps : the one-step recipe that a fit uses or begins with, and others whose problems it needs
    needs_intervals : whether a fit needs the intervals of the measured angles
    calibrated : the recipe on corrected data that a fit is or begins with, or None
    scheme : "euler", "integral", "shooting" or "inverse dynamics"
    corrects : parts of the calibration that correct the data
    """

    @property
    def name(self) -> str: ...
    @property
    def steps(self) -> tuple[Recipe, ...]: ...
    @property
    def needs_intervals(self) -> bool: ...
    @property
    def calibrated(self) -> CalibratedRecipe | None: ...
    @property
    def scheme(self) -> str: ...
    @property
    def corrects(self) -> tuple[str, ...]: ...

    def fit(self, identifier: Identifier, data: ShootingData, seed: int) -> Fit:
        """The identifier's friction of all folds and of all data; InputError where that fails."""
        ...


def check_method(method: Method, identifier: Identifier) -> None:
    """Refuse identifiers that use no mechanism where a method needs one."""
    if method.needs_intervals and not identifier.uses_mechanism:
        raise InputError(
            f"recipe {method.name!r}: shooting needs the physics that a black box lacks: give it "
            'recipes = ["integral"], or another one-step recipe'
        )
