"""Recipes of a suite: tables of how a one-step problem is made, and of what shooting frees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field

from frictionid.comparison.kinds import Kind, built
from frictionid.comparison.registry import (
    BLOCKS,
    ESTIMATORS,
    IDENTIFIERS,
    RECIPES,
    friction_of,
)
from frictionid.config import STRICT, Positive, Strict, distinct, nearest
from frictionid.errors import InputError
from frictionid.fitting.method import Method
from frictionid.fitting.one_step.formulation import INTEGRAL, Recipe
from frictionid.fitting.parameters import DelayBlock, ParameterBlock
from frictionid.fitting.shooting import CalibratedRecipe, Settings, Shooting
from frictionid.fitting.shooting.calibrated_recipe import PARTS
from frictionid.fitting.shooting.recipe import KnownCalibration, known_calibration
from frictionid.fitting.shooting.settings import DEFAULT_BLOCKS
from frictionid.fitting.torque_balance import InverseDynamics, TorqueSettings

Name = Annotated[str, Field(pattern=r"^\w[\w.+ -]*$")]

ONE_STEP = Kind((Recipe,), internal=frozenset({"name", "states"}))
SHOOTING = Kind((Settings,))
TORQUES = Kind((TorqueSettings,))
_REFINING: Mapping[str, Method] = {
    method.name: method for method in (Shooting(), InverseDynamics())
}
_NAMES = (*RECIPES, *_REFINING)
_BLOCK_KEYS = ("free", "fixed", "priors", "start")  # what these have beside their settings


class CalibrationEntry(Strict):
    """Calibration that corrects the data of a recipe, estimated by shooting beside friction.

    friction : kind of identifier
    free : blocks that are free
    use : those of them that correct the data, all but friction by default
    fixed : parameters that stay
    """

    friction: str = "stribeck"
    free: Annotated[list[str], Field(min_length=1)] = ["friction", "inertia", "delay"]
    use: Annotated[list[str], Field(min_length=1)] | None = None
    fixed: list[str] = []


class RecipeEntry(Strict):
    """A recipe: "study" or "integral", or one of the suite's own.

    A one-step recipe has `states`, a table of a state estimator, and the settings of `Recipe`.

    With `by` = "shooting" friction is refined by shooting: `free` names the blocks (friction, and
    the delay where a motor's torque is sampled, where it is missing), `fixed` parameters that stay,
    `priors` standard deviations of blocks; `start` is the one-step recipe that it begins with; its
    other keys are those of the `Settings` of shooting.

    With `by` = "inverse_dynamics" it is fitted to the balance of torques, with the same keys;
    friction, base parameters, delay and bias are free where `free` is missing, and its other keys
    are those of `TorqueSettings`.

    With a `calibration` the data are corrected by it, and fitted by the one-step recipe that `like`
    names. `known` names a model file in place of it: its base parameters, delay, gain, bias and
    offset are held, but for the blocks that shooting frees, which have its standard errors as
    priors.
    """

    model_config = ConfigDict(extra="allow", frozen=True, **STRICT)

    name: Name
    by: Literal["shooting", "inverse_dynamics"] | None = None
    free: Annotated[list[str], Field(min_length=1)] | None = None
    fixed: list[str] | None = None
    priors: dict[str, Positive] | None = None
    start: str | None = None
    states: dict[str, Any] | None = None
    like: str | None = None
    calibration: CalibrationEntry | None = None
    known: str | None = None
    settings: ClassVar[tuple[str, ...]] = (
        *ONE_STEP.settings,
        *SHOOTING.settings,
        *(name for name in TORQUES.settings if name not in SHOOTING.settings),
    )

    @property
    def is_one_step(self) -> bool:
        """Whether it is neither a calibrated recipe nor one of shooting or inverse dynamics."""
        other = self.by, self.calibration, self.like, self.known
        refines = self.name in _REFINING and self.states is None
        return other == (None,) * 4 and not refines

    def beside(self, folder: Path) -> RecipeEntry:
        """The table with its paths from a folder."""
        if self.known is None:
            return self
        return self.model_copy(update={"known": str(folder / self.known)})

    @property
    def where(self) -> str:
        """What complaints about the recipe begin with."""
        return f"recipe {self.name!r}"

    def keys(self, kind: Kind, *others: str) -> dict[str, Any]:
        """The keys that the table has of the settings of a kind, and of others."""
        table = {key: getattr(self, key) for key in others} | (self.model_extra or {})
        names = (*kind.settings, *others)
        return {k: v for k, v in table.items() if k in names and v is not None}


def recipes_of(entries: Sequence[RecipeEntry]) -> list[Method]:
    """Recipes of their tables; shooting may begin with a one-step recipe that stands beside it."""
    steps = {entry.name: one_step_of(entry) for entry in entries if entry.is_one_step}
    return [recipe_of(entry, steps) for entry in entries]


def recipe_of(
    entry: RecipeEntry,
    one_step: Mapping[str, Recipe] | None = None,
    held: KnownCalibration | None = None,
) -> Method:
    """Recipe of its table; `one_step` has those that it may name.

    known : a calibration in place of that of a model file

    Raises
    ------
    InputError
        For keys of different recipes in one table, unknown names, and values that do not fit.
    """
    if entry.is_one_step:
        return one_step_of(entry)
    steps = list(entry.keys(ONE_STEP, "states"))
    if entry.calibration is not None or entry.like is not None:
        shots = list(entry.keys(SHOOTING, *_BLOCK_KEYS, "by"))
        if steps or shots:
            raise InputError(
                f"{entry.where}: {[*steps, *shots][0]} does not go with calibration: "
                "name a recipe by like"
            )
        return _calibrated(entry, one_step, held)
    if steps:
        raise InputError(
            f"{entry.where}: {steps[0]} belongs to one-step recipes, name one as start"
        )
    if (entry.by or entry.name) == "inverse_dynamics":
        return inverse_dynamics_of(entry, one_step)
    return shooting_of(entry, one_step, held)


def one_step_of(entry: RecipeEntry) -> Recipe:
    """One-step recipe of its table: "study" and "integral" by name, others by their keys."""
    keys = entry.keys(ONE_STEP, "states")
    if shots := list(entry.keys(SHOOTING, *_BLOCK_KEYS)):
        raise InputError(f'{entry.where}: {shots[0]} needs by = "shooting"')
    if shots := list(entry.keys(TORQUES)):
        raise InputError(f'{entry.where}: {shots[0]} needs by = "inverse_dynamics"')
    if entry.name in RECIPES:
        if keys:
            first = next(iter(keys))
            raise InputError(f"{entry.where} has its own {first}: give yours another name")
        return RECIPES[entry.name]
    if "states" not in keys or "scheme" not in keys:
        raise InputError(
            f"{entry.where} is unknown; {nearest(entry.name, _NAMES)}; "
            "one's own needs states and scheme"
        )
    states = built(keys.pop("states"), ESTIMATORS, f"{entry.where}, states")
    try:
        return Recipe(entry.name, states, **ONE_STEP.values(keys))
    except InputError as error:
        text = str(error).removeprefix(f"{entry.where}: ")
        raise InputError(f"{entry.where}: {text}") from None


def shooting_of(
    entry: RecipeEntry,
    one_step: Mapping[str, Recipe] | None = None,
    held: KnownCalibration | None = None,
) -> Shooting:
    """Shooting with the blocks and settings of its table."""
    start = one_step_named(entry.start or INTEGRAL.name, one_step, f"{entry.where}: start")
    held = held or _calibration_in(entry.known)
    free = entry.free or [
        block.name for block in DEFAULT_BLOCKS if not held or block.enters == "friction"
    ]
    blocks = blocks_of(free, entry.fixed or [], entry.priors or {}, entry.where)
    if entry.free is None:
        blocks = _sampled(blocks)
    settings = SHOOTING.build(_only(SHOOTING, entry), entry.where)
    return Shooting(entry.name, blocks, settings, start, held)


def inverse_dynamics_of(
    entry: RecipeEntry, one_step: Mapping[str, Recipe] | None = None
) -> InverseDynamics:
    """Inverse dynamics with the blocks and settings of its table."""
    if entry.known is not None:
        raise InputError(f'{entry.where}: known needs by = "shooting"')
    start = one_step_named(entry.start or INTEGRAL.name, one_step, f"{entry.where}: start")
    settings = TORQUES.build(_only(TORQUES, entry), entry.where)
    if entry.free is None:
        default = InverseDynamics()
        free = [block.name for block in default.blocks]
        blocks = _sampled(blocks_of(free, entry.fixed or [], entry.priors or {}, entry.where))
    else:
        blocks = blocks_of(entry.free, entry.fixed or [], entry.priors or {}, entry.where)
    return InverseDynamics(entry.name, blocks, settings, start)


def _sampled(blocks: tuple[ParameterBlock, ...]) -> tuple[ParameterBlock, ...]:
    """The blocks, a delay only where a motor's torque is sampled."""
    return tuple(replace(b, where_sampled=True) if isinstance(b, DelayBlock) else b for b in blocks)


def _only(kind: Kind, entry: RecipeEntry) -> dict[str, Any]:
    """The settings of a kind that the table has; it may have no other kind's."""
    for other in (SHOOTING, TORQUES):
        for key in entry.keys(other):
            if key not in kind.settings:
                by = "shooting" if other is SHOOTING else "inverse_dynamics"
                raise InputError(f'{entry.where}: {key} needs by = "{by}"')
    return entry.keys(kind)


def _calibrated(
    entry: RecipeEntry,
    one_step: Mapping[str, Recipe] | None,
    held: KnownCalibration | None = None,
) -> CalibratedRecipe:
    """The recipe that `like` names, on data corrected by the calibration of its table."""
    calibration, like, where = entry.calibration, entry.like, f"{entry.where}, calibration"
    if calibration is None and like is not None and entry.known is not None:
        step = one_step_named(like, one_step, f"{entry.where}: like")
        return _held(entry.name, step, held or _calibration_in(entry.known))
    if calibration is None or like is None:
        lost = "calibration" if calibration is None else "like"
        raise InputError(
            f"{entry.where}: the key {lost!r} is missing; calibration and like go together"
        )
    step = one_step_named(like, one_step, f"{entry.where}: like")
    blocks = blocks_of(calibration.free, calibration.fixed, {}, where)
    use = calibration.use or [name for name in calibration.free if name in PARTS]
    friction = built({"kind": calibration.friction}, IDENTIFIERS, where)
    return CalibratedRecipe(entry.name, step, Shooting(blocks=blocks), friction, tuple(use))


def _held(name: str, step: Recipe, held: KnownCalibration | None) -> CalibratedRecipe:
    """A one-step recipe on data corrected by a known calibration."""
    nothing = IDENTIFIERS["none"].build({}, name)
    return CalibratedRecipe(name, step, Shooting(blocks=(), held=held), nothing, PARTS)


def _calibration_in(file: str | None) -> KnownCalibration | None:
    """The calibration of a model file."""
    return None if file is None else known_calibration(friction_of(Path(file)), file)


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


_PARTLY_FIXED = ("inertia", "friction", "actuator", "gain", "bias", "offset", "backlash")


def _fixed(fixed: Sequence[str], free: Sequence[str], where: str) -> dict[str, tuple[str, ...]]:
    """Fixed parameters of each block, from names such as "inertia.x" or "friction.x"."""
    parts: dict[str, list[str]] = {name: [] for name in _PARTLY_FIXED}
    for name in fixed:
        block, _, parameter = name.partition(".")
        if block not in parts or not parameter or block not in free:
            raise InputError(
                f"{where}: fixed = {name!r} must be inertia.NAME or friction.NAME, actuator.kt or "
                "actuator.R, gain.JOINT, bias.JOINT, offset.JOINT or backlash.JOINT of a free "
                "block, such as "
                '"inertia.gravity_2"'
            )
        parts[block].append(parameter)
    return {block: tuple(names) for block, names in parts.items()}


def one_step_named(name: str, one_step: Mapping[str, Recipe] | None, where: str) -> Recipe:
    """One-step recipe of a name: "study", "integral", or one of a suite."""
    recipes = {**RECIPES, **(one_step or {})}
    if name in _REFINING:
        raise InputError(f"{where} = {name!r} must be a one-step recipe")
    if name not in recipes:
        raise InputError(f"recipe {name!r} is unknown; {nearest(name, recipes)}")
    return recipes[name]


def recipe_named(name: str) -> Method:
    """Recipe that needs no settings: "study", "integral", "shooting" or "inverse_dynamics"."""
    if name not in _NAMES:
        raise InputError(f"recipe {name!r} is unknown; {nearest(name, _NAMES)}")
    return RECIPES[name] if name in RECIPES else _REFINING[name]
