"""Recipes of a suite: tables of how a one-step problem is made, and of what shooting frees.

And those that are taken where nothing is named: method, recipe, time between samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field

from frictionid.config import STRICT, NonEmpty, Positive, Strict, distinct, nearest
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation.prepared import usual_interval
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.identifiers import Flexible, Frictionless
from frictionid.fitting.one_step.recipe import INTEGRAL, Recipe
from frictionid.fitting.parameter_block import ParameterBlock
from frictionid.fitting.shooting import CalibratedRecipe, Settings, Shooting
from frictionid.fitting.shooting.recipe import PARTS, KnownCalibration, known_calibration
from frictionid.fitting.shooting.settings import torque_is_sampled
from frictionid.fitting.torque_balance import InverseDynamics, TorqueSettings
from frictionid.friction.model_files import load_model

from .registry import BLOCKS, ESTIMATORS, IDENTIFIERS, RECIPES, Kind, built
from .training_set import Method

Start = Recipe | CalibratedRecipe  # what shooting begins with
Name = Annotated[str, Field(pattern=r"^\w[\w.+ -]*$")]

ONE_STEP = Kind((Recipe,), internal=frozenset({"name", "states"}))
SHOOTING = Kind((Settings,))
TORQUES = Kind((TorqueSettings,))
_REFINING: Mapping[str, tuple[Shooting | InverseDynamics, Kind]] = {
    "shooting": (Shooting(), SHOOTING),
    "inverse_dynamics": (InverseDynamics(), TORQUES),
}
# the calibration is not what is asked for: a fifth of its standard errors is near enough
_CALIBRATING = Shooting(settings=Settings(tolerance=0.2))
CALIBRATED = CalibratedRecipe(
    "calibrated", INTEGRAL, _CALIBRATING, Flexible(), ("inertia", "delay", "bias", "offset")
)
METHODS: Mapping[str, Method] = {
    **RECIPES,
    CALIBRATED.name: CALIBRATED,
    **{n: m for n, (m, _) in _REFINING.items()},
}


class CalibrationEntry(Strict):
    """Calibration that corrects the data of a recipe, estimated by shooting beside friction.

    friction : kind of identifier; None: a curve of any shape that grows with the load
    free : blocks that are free; None: friction, and of inertia, delay and bias those that show
        something
    use : those of them that correct the data, all but friction by default
    fixed : parameters that stay
    """

    friction: str | None = None
    free: NonEmpty[str] | None = None
    use: NonEmpty[str] | None = None
    fixed: list[str] = []


class RecipeEntry(Strict):
    """A recipe: "study", "integral", "calibrated" or "shooting", or one of the suite's own.

    A one-step recipe has `states`, a table of a state estimator, and the settings of `Recipe`.

    With `by` = "shooting" friction is refined by shooting: `free` names the blocks (where it is
    missing, friction, and of inertia, delay and bias those that show something), `fixed`
    parameters that stay, `priors` standard deviations of blocks; `start` is the one-step or
    calibrated recipe whose friction it begins with; its other keys are those of the `Settings` of
    shooting.

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
    free: NonEmpty[str] | None = None
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
    def form(self) -> str:
        """Which recipe it is: "one_step", "calibrated", "shooting" or "inverse_dynamics"."""
        if self.calibration is not None or self.like is not None:
            return "calibrated"
        if self.name == CALIBRATED.name and self.by is None and self.states is None:
            return "calibrated"
        if self.by is not None:
            return self.by
        if self.name in _REFINING and (self.states is None or self.known is not None):
            return self.name
        return "one_step" if self.known is None else "shooting"

    @property
    def where(self) -> str:
        """What complaints about the recipe begin with."""
        return f"recipe {self.name!r}"

    def keys(self, kind: Kind) -> dict[str, Any]:
        """The settings of a kind that the table has."""
        return {k: v for k, v in (self.model_extra or {}).items() if k in kind.settings}

    def check_keys(self) -> None:
        """Complain about the first key that belongs to recipes of another form."""
        table = self.model_dump(exclude_none=True)
        for form, keys in _KEYS.items():
            for key in keys:
                if key in table and key not in _KEYS[self.form]:
                    raise InputError(f"{self.where}{_misplaced(key, form, self.form)}")


_REFINED = ("by", "free", "fixed", "priors", "start")
_KEYS: Mapping[str, tuple[str, ...]] = {  # beside the name
    "one_step": ("states", *ONE_STEP.settings),
    "shooting": (*_REFINED, *SHOOTING.settings, "known"),
    "inverse_dynamics": (*_REFINED, *TORQUES.settings),
    "calibrated": ("like", "calibration", "known"),
}


def _misplaced(key: str, home: str, form: str) -> str:
    """What is wrong with a key of recipes of the form `home` in the table of another form."""
    if form == "calibrated":
        return f": {key} does not go with calibration: name a recipe by like"
    if home == "one_step":
        return f": {key} belongs to one-step recipes, name one as start"
    return f': {key} needs by = "{home}"'


def recipes_of(entries: Sequence[RecipeEntry], folder: Path = Path()) -> list[Method]:
    """Recipes of their tables, with paths from a folder; shooting may begin with another one."""
    entries = [e.model_copy(update={"known": e.known and str(folder / e.known)}) for e in entries]
    steps = {entry.name: _one_step(entry) for entry in entries if entry.form == "one_step"}
    calibrated = [recipe_of(entry, steps) for entry in entries if entry.form == "calibrated"]
    starts = {r.name: r for r in calibrated if isinstance(r, CalibratedRecipe)}
    return [recipe_of(entry, {**steps, **starts}) for entry in entries]


def recipe_of(
    entry: RecipeEntry,
    beside: Mapping[str, Start] | None = None,
    held: KnownCalibration | None = None,
) -> Method:
    """Recipe of its table; `beside` has those that it may name.

    held : a calibration in place of that of a model file

    Raises
    ------
    InputError
        For keys of different recipes in one table, unknown names, and values that do not fit.
    """
    if entry.form == "one_step":
        return _one_step(entry)
    entry.check_keys()
    if held is None and entry.known is not None:
        held = known_calibration(load_model(Path(entry.known)), entry.known)
    starts: dict[str, Start] = {**RECIPES, CALIBRATED.name: CALIBRATED, **(beside or {})}
    return (_calibrated if entry.form == "calibrated" else _refining)(entry, starts, held)


def _one_step(entry: RecipeEntry) -> Recipe:
    """One-step recipe of its table: "study" and "integral" by name, others by their keys."""
    entry.check_keys()
    keys, where = entry.keys(ONE_STEP), entry.where
    if entry.name in RECIPES:
        if entry.states is not None or keys:
            first = "states" if entry.states is not None else next(iter(keys))
            raise InputError(f"{where} has its own {first}: give yours another name")
        return RECIPES[entry.name]
    if entry.states is None or "scheme" not in keys:
        raise InputError(
            f"{where} is unknown; {nearest(entry.name, METHODS)}; one's own needs states and scheme"
        )
    states = built(entry.states, ESTIMATORS, f"{where}, states")
    try:
        return Recipe(entry.name, states, **ONE_STEP.values(keys))
    except InputError as error:
        text = str(error).removeprefix(f"{where}: ")
        raise InputError(f"{where}: {text}") from None


def _refining(
    entry: RecipeEntry, starts: Mapping[str, Start], held: KnownCalibration | None
) -> Method:
    """Shooting or inverse dynamics with the blocks and settings of its table.

    Where no blocks are named those of the default are free, without what is held; a delay only
    where a motor's torque is sampled.
    """
    method, kind = _REFINING[entry.form]
    name, where = entry.start or INTEGRAL.name, f"{entry.where}: start"
    usual = [b for b in method.blocks if held is None or b.enters == "friction"]
    blocks = _blocks(entry, usual, entry.priors or {}, entry.where)
    settings = kind.build(entry.keys(kind), entry.where)
    if isinstance(method, Shooting):
        return Shooting(entry.name, blocks, settings, _start_named(name, starts, where), held)
    return InverseDynamics(entry.name, blocks, settings, _step_named(name, starts, where))


def _calibrated(
    entry: RecipeEntry, starts: Mapping[str, Start], held: KnownCalibration | None
) -> CalibratedRecipe:
    """The recipe that `like` names, on data corrected by a calibration, held or of its table."""
    calibration, like, where = entry.calibration, entry.like, f"{entry.where}, calibration"
    if like is None and calibration is None and held is None and entry.name == CALIBRATED.name:
        return CALIBRATED
    if like is None or (calibration is None and held is None):
        lost = "like" if like is None else "calibration"
        raise InputError(
            f"{entry.where}: the key {lost!r} is missing; calibration and like go together"
        )
    step = _step_named(like, starts, f"{entry.where}: like")
    if calibration is None:
        shooting = Shooting(blocks=(), held=held)
        return CalibratedRecipe(entry.name, step, shooting, Frictionless(), PARTS)
    by = replace(CALIBRATED.by, blocks=_blocks(calibration, CALIBRATED.by.blocks, {}, where))
    use = calibration.use or [block.name for block in by.blocks if block.name in PARTS]
    friction = CALIBRATED.friction
    if calibration.friction is not None:
        friction = built({"kind": calibration.friction}, IDENTIFIERS, where)
    return CalibratedRecipe(entry.name, step, by, friction, tuple(use))


def _blocks(
    entry: RecipeEntry | CalibrationEntry,
    usual: Sequence[ParameterBlock],
    priors: Mapping[str, float],
    where: str,
) -> tuple[ParameterBlock, ...]:
    """Blocks that a table frees; where it names none the usual ones, offered as these are."""
    names = entry.free or [block.name for block in usual]
    blocks = blocks_of(names, entry.fixed or [], priors, where)
    if entry.free is not None:
        return blocks
    offered = {block.name for block in usual if block.offered}
    return tuple(replace(b, offered=b.name in offered) for b in blocks)


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
    options: dict[str, Mapping[str, Any]] = {"prior": priors, "fixed": _fixed(fixed, free, where)}
    return tuple(
        BLOCKS[name](**{key: part[name] for key, part in options.items() if name in part})
        for name in free
    )


_WHOLE = ("delay", "target_delay")  # blocks of a single parameter


def _fixed(fixed: Sequence[str], free: Sequence[str], where: str) -> dict[str, tuple[str, ...]]:
    """Fixed parameters of each block, from names such as "inertia.x" or "friction.x"."""
    parts: dict[str, tuple[str, ...]] = {}
    for name in fixed:
        block, _, parameter = name.partition(".")
        if not parameter or block not in free or block in _WHOLE:
            raise InputError(
                f"{where}: fixed = {name!r} must be inertia.NAME or friction.NAME, actuator.kt or "
                "actuator.R, gain.JOINT, bias.JOINT, offset.JOINT, backlash.JOINT or "
                'envelope.JOINT of a free block, such as "inertia.gravity_2"'
            )
        parts[block] = (*parts.get(block, ()), parameter)
    return parts


def _start_named(name: str, starts: Mapping[str, Start], where: str) -> Start:
    if name in _REFINING:
        raise InputError(f"{where} = {name!r} must be a one-step recipe, or a calibrated one")
    if name not in starts:
        raise InputError(f"recipe {name!r} is unknown; {nearest(name, starts)}")
    return starts[name]


def _step_named(name: str, starts: Mapping[str, Start], where: str) -> Recipe:
    step = _start_named(name, starts, where)
    if not isinstance(step, Recipe):
        raise InputError(f"{where} = {name!r} must be a one-step recipe")
    return step


def recipe_named(name: str) -> Method:
    """Recipe that needs no settings: "study", "integral", "calibrated", "shooting" and so on."""
    if name not in METHODS:
        raise InputError(f"recipe {name!r} is unknown; {nearest(name, METHODS)}")
    return METHODS[name]


# --- What a fit or a comparison takes where nothing is named --------------------------------------

ONE_STEP_NAMES = (*RECIPES, CALIBRATED.name)
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
    one_step = method == "one_step" or method in ONE_STEP_NAMES
    return None if one_step else time_between_samples(dataset, _MOST)


def time_between_samples(dataset: Dataset, most: int) -> float | None:
    """Time [s] between samples that leaves so many of all joints, or 0.01; None: all of them."""
    usual, joints = usual_interval(dataset), np.shape(dataset.recordings[0].angle.value)[1]
    apart = max(usual, min(dataset.seconds * joints / most, _COARSEST))
    return apart if apart > 1.5 * usual else None
