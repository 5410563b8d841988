"""frictionid.fit: friction of one data set, by any law and method."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from frictionid.comparison.equal_joints import groups_of, with_equal
from frictionid.comparison.fit_model import fit_model, with_smoothing_bias
from frictionid.comparison.suite_recipes import (
    ONE_STEP_NAMES,
    RecipeEntry,
    recipe_named,
    recipe_of,
    usual_method,
    usual_sample_time,
)
from frictionid.comparison.training_set import Method
from frictionid.config import checked, nearest
from frictionid.errors import InputError
from frictionid.evaluation import Protocol
from frictionid.fitting.shooting.recipe import known_calibration
from frictionid.friction import Law
from frictionid.progress import counted

from .fitted import Fit
from .models import DatasetLike, LawLike, count, dataset_of, friction_of, identifier_of, numbers

METHODS = ("one_step", "shooting", "inverse_dynamics", *ONE_STEP_NAMES)


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

    Examples
    --------
    >>> method_of("shooting", free=["friction", "inertia"]).blocks[1].name
    'inertia'
    >>> method_of("study").name
    'study'
    """
    if not isinstance(method, str) and hasattr(method, "fit"):
        if free is not None or fixed or windows is not None or iterations is not None or consistent:
            raise InputError(
                "free, fixed, windows, iterations and consistent go with the name of a method"
            )
        return method
    if method not in METHODS:
        raise InputError(f"method = {method!r} is unknown; {nearest(str(method), METHODS)}")
    if method in ONE_STEP_NAMES:
        method, recipe = "one_step", method
    calibrated = None
    if calibration is not None:
        called = str(calibration) if isinstance(calibration, str | Path) else "the model"
        calibrated = known_calibration(friction_of(calibration), called)
    shots: dict[str, Any] = {
        "free": free if free is None else _names("free", free),
        "fixed": _names("fixed", fixed) or None,
        "windows": None if windows is None else numbers("windows", windows),
        "iterations": iterations,
        "consistent": consistent or None,
    }
    options = {key: value for key, value in shots.items() if value is not None}
    if method == "one_step":
        if options:
            raise InputError(
                f"{', '.join(options)}: only by shooting or inverse_dynamics, not in one step"
            )
        if calibrated is None:
            return recipe_named(recipe)
        entry = {"name": f"{recipe} calibrated", "like": recipe, "known": ""}
        return recipe_of(checked(RecipeEntry, entry, "fit"), held=calibrated)
    entry = {"name": method, "by": method, **options}
    entry["start"] = "integral" if recipe == method else recipe
    if calibrated is not None and method != "shooting":
        raise InputError(f"method = {method!r} takes no calibration: use method = 'shooting'")
    return recipe_of(checked(RecipeEntry, entry, "fit"), held=calibrated)


def _names(what: str, names: str | Sequence[str]) -> list[str]:
    parts = names.split(",") if isinstance(names, str) else names
    if not isinstance(parts, Iterable):
        raise InputError(f"{what} = {names!r} must be a list of names")
    return [str(part).strip() for part in parts]


def fit(
    data: DatasetLike,
    law: LawLike,
    *,
    method: str | Method | None = None,
    recipe: str | None = None,
    free: str | Sequence[str] | None = None,
    fixed: Sequence[str] = (),
    windows: float | Sequence[float] | None = None,
    iterations: int | None = None,
    consistent: bool = False,
    calibration: Any = None,
    equal: Sequence[Sequence[str | int]] = (),
    settings: Mapping[str, Any] | None = None,
    sample_time: float | None = None,
    seed: int = 0,
    bias: bool = False,
) -> Fit:
    """Fit friction to all recordings of a data set.

    Parameters
    ----------
    data : Dataset, or path or name of one
    law : str, Law, Identifier, a class of these, or a list of laws, one for each joint
        Such as "stribeck"; `frictionid.identifiers()` lists the names.
    method : str or Method, optional
        "shooting" on the measured angles, with intervals; "inverse_dynamics" on the torques, for
        arms; "one_step" on smoothed states, which takes masses, gains and clocks as given. The name
        of a recipe stands for a one-step fit by it. None: as `usual_method` says, and of long data
        samples as `quick` takes them.
    recipe : str, optional
        Of the one-step fit: "integral" by default, "study", or "calibrated".
    free : list of str, optional
        Blocks that these free: "friction", "inertia", "delay", "gain", "bias", "offset",
        "actuator"; friction is always free. None: friction, and of inertia, delay and bias those
        that the data tell.
    fixed : list of str
        Parameters that stay as they are, such as "inertia.gravity_2".
    windows : list of float [s], optional
        Lengths of the windows of shooting.
    iterations : int, optional
        Of shooting, at most.
    consistent : bool
        Whether base parameters of inverse dynamics must be those of bodies that there can be.
    calibration : Fit, Friction or path of a model file, optional
        Its base parameters, delay, gain, bias and offset are held; blocks that are free have its
        standard errors as priors.
    equal : list of lists of str or int
        Groups of joints with the same friction, by names or by numbers from 1; laws with
        parameters, fitted in one step or by shooting. A second fit, apart, tests them.
    settings : mapping, optional
        Settings of the law or identifier that a name stands for, such as {"symmetric": False}.
    sample_time : float [s], optional
        Use samples at least this far apart.
    seed : int
    bias : bool
        Whether intervals of a one-step fit hold the bias of smoothed states, too. It is that of a
        second fit, to the motion that the first one predicts; takes seconds.

    Examples
    --------
    >>> fast = fit("acrobot_clean", "coulomb_viscous", method="one_step")
    >>> fast.frame[["parameter", "value"]].round(3).head(2)
      parameter  value
    0   coulomb  0.167
    1   viscous  0.004
    """
    dataset = dataset_of(data)
    identifier = identifier_of(law, settings)
    if method is None:
        shot = bool(equal) or windows is not None or iterations is not None
        asked = {"one_step": bias or recipe is not None, "shooting": shot}
        asked["inverse_dynamics"] = consistent
        method = next((m for m, yes in asked.items() if yes), usual_method(dataset, identifier))
        sample_time = sample_time or usual_sample_time(dataset, method)
    protocol = Protocol(sample_time=sample_time)
    if equal:
        groups = groups_of(equal, dataset.mechanism.friction_names)
        identifier = with_equal(identifier, groups)
    if method in ("shooting", "inverse_dynamics") and free is not None:
        free = list(dict.fromkeys(["friction", *_names("free", free)]))
    chosen = method_of(
        method,
        recipe="integral" if recipe is None else recipe,
        free=free,
        fixed=fixed,
        windows=windows,
        iterations=iterations,
        consistent=consistent,
        calibration=calibration,
    )
    with counted(None, "fitting"):
        friction = fit_model(dataset, identifier, chosen, protocol, count("seed", seed))
        if bias:
            friction = with_smoothing_bias(friction, dataset, identifier, chosen, protocol, seed)
    return Fit(friction, dataset)


def load_model(path: str | Path, laws: Sequence[type[Law]] = ()) -> Fit:
    """A fitted model of a file; its data are not at hand.

    Parameters
    ----------
    path : str or Path
    laws : list of type
        Classes of one's own laws that the file may name.

    Raises
    ------
    InputError
        Where it is no model file, or names a law that is not known.
    """
    return Fit(friction_of(Path(path), laws))
