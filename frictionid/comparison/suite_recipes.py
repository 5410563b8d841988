"""Recipes of a suite: tables of how a one-step problem is made, and of what shooting frees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from frictionid.comparison.cross_validate import Method
from frictionid.comparison.registry import BLOCKS, ESTIMATORS, IDENTIFIERS, RECIPES
from frictionid.config import Strict, built, distinct, nearest
from frictionid.errors import InputError
from frictionid.identifiers.formulation import INTEGRAL, Recipe
from frictionid.shooting import CalibratedRecipe, Settings, Shooting
from frictionid.shooting.calibrated_recipe import PARTS
from frictionid.shooting.parameters import ParameterBlock

Positive = Annotated[float, Field(gt=0)]
Name = Annotated[str, Field(pattern=r"^\w[\w.+ -]*$")]


class CalibrationEntry(Strict):
    """What corrects the data of a recipe: found by shooting, beside friction of a kind.

    free : blocks that are free; use : those of them that correct, all but friction by default;
    fixed : parameters that stay
    """

    friction: str = "stribeck"
    free: Annotated[list[str], Field(min_length=1)] = ["friction", "inertia", "delay"]
    use: Annotated[list[str], Field(min_length=1)] | None = None
    fixed: list[str] = []


class RecipeEntry(Strict):
    """A recipe: "study" or "integral" as they stand, or states, scheme and threshold of one's own.

    `velocity_threshold` [rad/s] is that of the stiction mask, 0 for none.

    With a `calibration` the data are corrected by what shooting finds, and fitted by the one-step
    recipe that `like` names.

    With `by` = "shooting" friction is refined by shooting: `free` names the blocks, `fixed` the
    parameters of them that stay, `priors` their standard deviations; `start` is the one-step recipe
    it begins with, of the suite or as it stands; `windows`, `iterations` and `start_velocity` are
    its settings.
    """

    name: Name
    by: Literal["shooting"] | None = None
    free: Annotated[list[str], Field(min_length=1)] | None = None
    fixed: list[str] | None = None
    priors: dict[str, Positive] | None = None
    start: str | None = None
    windows: Annotated[list[Positive], Field(min_length=1)] | None = None
    iterations: Annotated[int, Field(ge=1)] | None = None
    start_velocity: Positive | None = None
    states: dict[str, Any] | None = None
    scheme: Literal["euler", "integral"] | None = None
    velocity_threshold: Annotated[float, Field(ge=0)] | None = None
    like: str | None = None
    calibration: CalibrationEntry | None = None
    renamed: ClassVar[Mapping[str, str]] = {
        "rig": "calibration",
        "rest": "velocity_threshold",
    }


def recipes_of(entries: Sequence[RecipeEntry]) -> list[Method]:
    """Recipes of their tables; shooting may begin with a one-step recipe that stands beside it."""
    own = [recipe_of(entry) for entry in entries if entry.by is None and entry.calibration is None]
    steps = {recipe.name: recipe for recipe in own if isinstance(recipe, Recipe)}
    return [recipe_of(entry, steps) for entry in entries]


def recipe_of(entry: RecipeEntry, own: Mapping[str, Recipe] | None = None) -> Method:
    """Recipe of its table; `own` are one-step recipes that it may name as its start."""
    where = f"recipe {entry.name!r}"
    steps = [
        key for key in ("states", "scheme", "velocity_threshold") if getattr(entry, key) is not None
    ]
    shots = [key for key in _SHOTS if getattr(entry, key) is not None]
    if entry.calibration is not None or entry.like is not None:
        if steps or shots or entry.by:
            other = [*steps, *shots, "by"][0]
            raise InputError(
                f"{where}: {other} does not go with calibration: name a recipe by like"
            )
        return calibrated_recipe_of(entry, where, own)
    if entry.by == "shooting" or (entry.name == "shooting" and not steps):
        if steps:
            raise InputError(f"{where}: {steps[0]} belongs to one-step recipes, name one as start")
        return shooting_of(entry, where, own)
    if shots:
        raise InputError(f'{where}: {shots[0]} needs by = "shooting"')
    if entry.name in RECIPES:
        if steps:
            raise InputError(f"{where} has its own {steps[0]}: give yours another name")
        return RECIPES[entry.name]
    if entry.states is None or entry.scheme is None:
        raise InputError(
            f"{where} is unknown; {nearest(entry.name, RECIPES)}; one's own needs states and scheme"
        )
    states = built(entry.states, ESTIMATORS, f"{where}, states")
    return Recipe(entry.name, states, entry.scheme, entry.velocity_threshold or 0.0)


_SHOTS = ("free", "fixed", "priors", "start", "windows", "iterations", "start_velocity")


def shooting_of(
    entry: RecipeEntry, where: str, own: Mapping[str, Recipe] | None = None
) -> Shooting:
    """Shooting with the blocks and settings of its table."""
    start = recipe_named(entry.start or INTEGRAL.name, own)
    if isinstance(start, Shooting):
        raise InputError(f"{where}: start = {entry.start!r} must be a one-step recipe")
    blocks = blocks_of(entry.free or ["friction"], entry.fixed or [], entry.priors or {}, where)
    usual = Settings()
    settings = replace(
        usual,
        windows=tuple(entry.windows or usual.windows),
        iterations=entry.iterations or usual.iterations,
        start_velocity=entry.start_velocity or usual.start_velocity,
    )
    return Shooting(entry.name, blocks, settings, start)


def calibrated_recipe_of(
    entry: RecipeEntry, where: str, own: Mapping[str, Recipe] | None = None
) -> CalibratedRecipe:
    """The recipe that `like` names, on data corrected by the calibration of its table."""
    if entry.calibration is None or entry.like is None:
        lost = "calibration" if entry.calibration is None else "like"
        raise InputError(f"{where}: the key {lost!r} is missing; calibration and like go together")
    step = recipe_named(entry.like, own)
    if isinstance(step, Shooting):
        raise InputError(f"{where}: like = {entry.like!r} must be a one-step recipe")
    calibration = entry.calibration
    blocks = blocks_of(calibration.free, calibration.fixed, {}, f"{where}, calibration")
    use = calibration.use or [name for name in calibration.free if name in PARTS]
    friction = built({"kind": calibration.friction}, IDENTIFIERS, f"{where}, calibration")
    return CalibratedRecipe(entry.name, step, Shooting(blocks=blocks), friction, tuple(use))


def blocks_of(
    free: Sequence[str], fixed: Sequence[str], priors: Mapping[str, float], where: str
) -> tuple[ParameterBlock, ...]:
    """Blocks by their names; `fixed` parameters stay as they are, `priors` hold others near."""
    for name in (*free, *priors):
        if name not in BLOCKS:
            raise InputError(f"{where}: block {name!r} is unknown; {nearest(name, BLOCKS)}")
    for name in priors:
        if name not in free:
            raise InputError(f"{where}: a prior of block {name!r}, which is not free")
    distinct(list(free), "blocks")
    stay = _fixed(fixed, free, where)
    blocks = []
    for name in free:
        settings: dict[str, Any] = {"prior": priors[name]} if name in priors else {}
        if name in stay:
            settings["fixed"] = stay[name]
        blocks.append(BLOCKS[name](**settings))
    return tuple(blocks)


def _fixed(fixed: Sequence[str], free: Sequence[str], where: str) -> dict[str, tuple[str, ...]]:
    """Parameters that stay, told as "inertia.x", "friction.x" or "actuator.x", of each block."""
    parts: dict[str, list[str]] = {"inertia": [], "friction": [], "actuator": []}
    for name in fixed:
        block, _, parameter = name.partition(".")
        if block not in parts or not parameter or block not in free:
            raise InputError(
                f"{where}: fixed = {name!r} must be inertia.NAME or friction.NAME, actuator.kt or "
                'actuator.R of a free block, such as "inertia.gravity_2"'
            )
        parts[block].append(parameter)
    return {block: tuple(names) for block, names in parts.items()}


def recipe_named(name: str, own: Mapping[str, Recipe] | None = None) -> Recipe | Shooting:
    """Recipe that stands as it is, or one of a suite's own, by its name."""
    known = {**RECIPES, **(own or {})}
    if name not in known:
        raise InputError(f"recipe {name!r} is unknown; {nearest(name, known)}")
    return known[name]
