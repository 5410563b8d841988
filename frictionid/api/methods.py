"""Methods of fitting as a user gives them: a name, with what is free."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from frictionid.api.models import friction_of, numbers
from frictionid.comparison.registry import RECIPES
from frictionid.comparison.suite_recipes import RecipeEntry, recipe_named, recipe_of
from frictionid.config import checked, nearest
from frictionid.errors import InputError
from frictionid.fitting.method import Method
from frictionid.fitting.shooting.known_calibration import KnownCalibration, known_calibration

METHODS = ("one_step", "shooting", "inverse_dynamics", *RECIPES)


def method_of(
    method: str | Method = "one_step",
    *,
    recipe: str = "integral",
    free: str | Sequence[str] | None = None,
    fixed: Sequence[str] = (),
    windows: float | Sequence[float] | None = None,
    iterations: int | None = None,
    consistent: bool = False,
    calibration: Any = None,
) -> Method:
    """Method of a name: "one_step" by a recipe, or "shooting" or "inverse_dynamics" from there.

    Parameters are those of `frictionid.fit`; the name of a recipe stands for a one-step fit by it.

    Raises
    ------
    InputError
        For unknown names, and settings of shooting without shooting.

    Examples
    --------
    >>> method_of("shooting", free=["friction", "inertia"]).blocks[1].name
    'inertia'
    >>> method_of("study").name
    'study'
    """
    if not isinstance(method, str):
        if free is not None or fixed or windows is not None or iterations is not None or consistent:
            raise InputError(
                "free, fixed, windows, iterations and consistent go with the name of a method"
            )
        return method
    if method not in METHODS:
        raise InputError(f"method = {method!r} is unknown; {nearest(method, METHODS)}")
    if method in RECIPES:
        method, recipe = "one_step", method
    known = None if calibration is None else _known(calibration)
    shots: dict[str, Any] = {
        "free": free if free is None else _names(free),
        "fixed": _names(fixed) or None,
        "windows": None if windows is None else numbers("windows", windows),
        "iterations": iterations,
        "consistent": consistent or None,
    }
    given = {key: value for key, value in shots.items() if value is not None}
    if method == "one_step":
        if given:
            raise InputError(
                f"{', '.join(given)}: only with method = 'shooting' or 'inverse_dynamics'"
            )
        if known is None:
            return recipe_named(recipe)
        entry = {"name": f"{recipe} calibrated", "like": recipe, "known": ""}
        return recipe_of(checked(RecipeEntry, entry, "fit"), known=known)
    entry = {"name": method, "by": method, **given}
    entry["start"] = "integral" if recipe == method else recipe
    if known is not None and method != "shooting":
        raise InputError(f"method = {method!r} takes no calibration: use method = 'shooting'")
    return recipe_of(checked(RecipeEntry, entry, "fit"), known=known)


def _names(names: str | Sequence[str]) -> list[str]:
    parts = names.split(",") if isinstance(names, str) else names
    return [str(part).strip() for part in parts]


def _known(calibration: Any) -> KnownCalibration:
    name = str(calibration) if isinstance(calibration, str | Path) else "the model"
    return known_calibration(friction_of(calibration), name)
