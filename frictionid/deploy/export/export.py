"""Export of a fitted friction to what simulators, controllers and drives read."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace as with_fields
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from frictionid.api.machines import card_of
from frictionid.api.models import DatasetLike, dataset_of, friction_of
from frictionid.arrays import Array
from frictionid.config import nearest, unknown
from frictionid.data.servo import BY_CONTROLLER
from frictionid.deploy.export import FORMATS
from frictionid.errors import InputError
from frictionid.files import model_path, write_bytes
from frictionid.friction import Friction
from frictionid.friction.provenance import Estimate, Estimates
from frictionid.outputs import check_outputs

from ..compensation import CompensationLaw, listed
from ..pooled_models import with_parameters
from ..random_effects import pooled_draws
from .exported import ExportedFriction, ExportSettings, Written, exported
from .nearest import Replay, cost_of, cost_sentence
from .round_trip import sentence


class Exported(NamedTuple):
    """Files that were written, and what the target cannot hold.

    paths : the files
    lost : sentences; none where the target computes the same friction
    notes : sentences on what was changed in a file, and on what else to know
    cost : of the friction that the target holds, where it is another one and there are data
    round_trip : the files run by their engine, where there is one, and data
    """

    paths: tuple[Path, ...]
    lost: tuple[str, ...]
    notes: tuple[str, ...] = ()
    cost: Replay | None = None
    round_trip: Replay | None = None


_SETTINGS = "name precision into joints randomise seed".split()


def _settings_of(settings: ExportSettings | Mapping[str, Any]) -> ExportSettings:
    """Settings of an export, also of their names and values."""
    if isinstance(settings, ExportSettings):
        return settings
    for name in settings:
        if name not in _SETTINGS:
            raise InputError(f"export: {unknown(name, _SETTINGS)}")
    values: dict[str, Any] = {**settings}
    if values.get("into") is not None:
        values["into"] = Path(values["into"])
    return ExportSettings(**values)


def export(
    model: Any,
    to: str,
    out: str | Path,
    *,
    data: DatasetLike | None = None,
    speeds: Sequence[float] = (),
    temperature: float | None = None,
    settings: ExportSettings | Mapping[str, Any] | None = None,
    replace: bool = False,
) -> Exported:
    """Write a fitted friction in a format; see `FORMATS`.

    Parameters
    ----------
    model : Fit, Friction, card of a machine, or path of a model file ("machine:NAME" is a card)
    to : str
        The format, such as "c", "python" or "mujoco".
    out : str or Path
        File to write; where a format has several, the others stand beside it.
    data : data set, optional
        Its mechanism names the joints. What the target cannot hold is replayed on its motion.
    speeds : list of float, optional
        Greatest measured speed of each joint [rad/s or m/s], in place of the model's own.
    temperature : float [degC], optional
        At which friction is taken that depends on it.
    settings : ExportSettings or dict, optional
        "name" and "precision" ("double", "float") of code; "into", a file whose "joints" are given
        friction; "randomise", a number of samples of the parameters, by "seed".
    replace : bool
        Whether files that exist may be written over.

    Raises
    ------
    InputError
        For unknown formats, models that a format cannot hold, and places that cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import frictionid as fid
    >>> fit = fid.fit("acrobot_clean", "coulomb_viscous", method="one_step")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = export(fit, "python", Path(folder) / "friction.py")
    ...     made.paths[0].name, made.lost
    ('friction.py', ())
    """
    chosen, write = _settings_of(settings or {}), writer_of(to)
    dataset = getattr(model, "data", None) if data is None else dataset_of(data)
    card = card_of(model)
    named = card.joints if card else ()
    named = named if dataset is None else tuple(dataset.mechanism.friction_names)
    joints = chosen.joints or named
    friction = friction_of(model)
    if temperature is not None:
        if not friction.law.uses_temperature:
            raise InputError(
                f"temperature = {temperature:g} degC: this friction does not depend on it, leave "
                "it out"
            )
        friction = friction.at_temperature(temperature)
    if named and len(named) != friction.n:
        raise InputError(
            f"the model has friction at {friction.n} parts, the data set at {len(named)}: "
            "name the one that it was fitted to"
        )
    chosen = with_fields(chosen, stem=Path(out).stem, folder=Path(out).parent)
    prepared = exported(friction, joints, speeds, dataset, card)
    written = write(prepared, chosen)
    if chosen.randomise:
        samples = randomised(prepared, chosen.randomise, chosen.seed, _module(to, "held"))
        written = written._replace(files={**written.files, "_samples.json": samples})
    # the first file goes where the user says, the others beside it
    endings = list(written.files)[1:]
    paths = (Path(out), *(Path(out).with_name(chosen.stem + ending) for ending in endings))
    read = [model_path(Path(p)) for p in (model, chosen.into) if isinstance(p, str | Path)]
    check_outputs(paths, read, replace=replace)
    lost, cost = _lost(prepared, written, _module(to, "held"))
    replay, notes = _module(to, "replay"), written.notes
    back = replay(prepared, written) if replay and dataset is not None else None
    if back is not None:
        notes = (*notes, sentence(back, prepared.horizon))
    for path, content in zip(paths, written.files.values(), strict=True):
        write_bytes(path, content)
    return Exported(paths, lost, notes, cost, back)


Held = Callable[[ExportedFriction], Friction]


def _lost(
    model: ExportedFriction, written: Written, held: Held | None
) -> tuple[tuple[str, ...], Replay | None]:
    """Sentences on what is lost, and what that costs on the data's motion.

    held : friction that an engine holds of a model; no engine holds backlash
    """
    lost, friction = written.lost, written.held
    is_loose = False
    if held is not None and np.any(model.backlash):
        is_loose, friction = True, held(model) if friction is None else friction
        units = " or ".join(dict.fromkeys(model.units))
        lost = (*lost, f"backlash of {listed(model.backlash)} {units} is left: the target has none")
    has_servo = any(BY_CONTROLLER in line for line in model.friction.provenance.torque)
    if held is not None and model.drive is None and has_servo:
        lost = (*lost, "gains and delay of the servo are left: name the data set (--dataset)")
    if friction is None or isinstance(model.law, CompensationLaw):
        return lost, None
    if model.data is None:
        if model.nearest is not None and np.array_equal(friction.theta, model.nearest.theta):
            return (*lost, model.nearest.cost), None
        hint = "name a data set (--dataset) to see what that costs in torque and after 1 s"
        return (*lost, hint), None
    cost = cost_of(model, friction, has_backlash=not is_loose)
    return (*lost, cost_sentence(model, cost)), cost


FORMAT = "frictionid samples 1"
_FEWEST = 200  # draws behind the ranges of an engine's own numbers


def randomised(
    model: ExportedFriction, count: int, seed: int = 0, held: Held | None = None
) -> bytes:
    """JSON with 95 % ranges of all fitted parameters, and `count` samples of them together.

    Samples are normal with the fit's covariance, cut to the law's bounds and to what the ranges
    leave open to one side; of a pooled model they are further specimens, within the ranges of
    these. Parameters that the data do not determine stay at their values.

    Parameters
    ----------
    model : ExportedFriction
    count : int
    seed : int
    held : function, optional
        Friction that an engine holds of a model: its numbers are given of each sample, too.

    Raises
    ------
    InputError
        For models without a covariance.
    """
    entries, draws = _distribution(model.friction, max(count, _FEWEST), seed)
    thetas = with_parameters(model.friction, entries, draws)
    content: dict[str, Any] = {
        "format": FORMAT,
        "law": str(model.law),
        "joints": list(model.joints),
        "seed": seed,
        "parameters": [_entry(e, fixed=not np.ptp(draws[:, k])) for k, e in enumerate(entries)],
        "samples": draws[:count].tolist(),
    }
    if held is not None:
        content["engine"] = _engine(model, thetas, held, count)
    return (json.dumps(content, indent=1) + "\n").encode()


def _distribution(friction: Friction, count: int, seed: int) -> tuple[Sequence[Estimate], Array]:
    """Parameters with their 95 % ranges, and samples (count, D) of them."""
    several, refined = friction.provenance.pooled, friction.provenance.refined
    if several is not None:
        entries = [with_fields(e, interval_95=e.range_95) for e in several.parameters]
        return entries, pooled_draws(several, count, seed)
    if refined is None or not refined.parameters:
        raise InputError(
            "randomise: the model has no covariance of its parameters: fit by shooting "
            "(--by shooting), or pool models of several specimens (frictionid pool); the "
            "intervals of one-step fits hold the noise alone"
        )
    return refined.parameters, drawn(refined, count, seed)


def drawn(refined: Estimates, count: int, seed: int) -> Array:
    """Samples (count, D) of the parameters that shooting estimated.

    >>> e = Estimate("delay", "torque delay", "s", None, 1.0, interval_95=(0.0, 3.0))
    >>> drawn(Estimates(parameters=(e,), covariance=np.eye(1)), 3, 0).round(3)[:, 0]
    array([1.126, 0.868, 1.64 ])
    """
    entries, covariance = refined.parameters, refined.square(refined.covariance)
    value, variance = np.array([e.value for e in entries]), np.diag(covariance)
    free = np.isfinite(variance) & (variance > 0) & [not e.at_bound for e in entries]
    part = covariance[np.ix_(free, free)]
    size, turn = np.linalg.eigh(part)
    normal = np.random.default_rng(seed).standard_normal((count, len(part)))
    out = np.repeat(value[None], count, axis=0)
    out[:, free] += normal * np.sqrt(np.maximum(size, 0.0)) @ turn.T
    low, high = np.array([e.interval_95 for e in entries]).T
    # where an interval ends at zero, the parameter does
    return np.clip(out, np.where(low == 0, 0.0, -np.inf), np.where(high == 0, 0.0, np.inf))


def _entry(e: Estimate, *, fixed: bool) -> dict[str, Any]:
    low, high = (None, None) if fixed else e.interval_95
    names = {k: getattr(e, k) for k in ("block", "name", "joint", "unit", "value")}
    return {**names, "low_95": low, "high_95": high, "fixed": fixed}


def _engine(model: ExportedFriction, thetas: Array, held: Held, count: int) -> dict[str, Any]:
    """What the engine's numbers are in each draw, with their 95 % ranges."""
    middle, each = held(model), np.stack([held(model.with_theta(x)).theta for x in thetas])
    low, high = np.quantile(each, (0.025, 0.975), axis=0)
    names = [f"{name} of {joint}" for joint in model.joints for name in middle.law.names]
    columns = (names, *(x.ravel().tolist() for x in (middle.theta, low, high)))
    keys = ("name", "value", "low_95", "high_95")
    parameters = [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]
    samples = each[:count].reshape(min(count, len(each)), -1).tolist()
    return {"law": str(middle.law), "parameters": parameters, "samples": samples}


Writer = Callable[[ExportedFriction, ExportSettings], Written]


def writer_of(name: str) -> Writer:
    """Function `write` of a format.

    >>> writer_of("pyton")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    frictionid.errors.InputError: export format 'pyton' is unknown; ...
    """
    if name not in FORMATS:
        raise InputError(f"export format {name!r} is unknown; {nearest(name, FORMATS)}")
    return _module(name, "write")


def _module(name: str, part: str) -> Any:
    """What the module of a format has of a name, None where it has nothing.

    `write` writes it; `held` gives the friction that a format can hold, where it does not hold all;
    `replay` runs what was written by its engine.
    """
    return getattr(import_module(f"frictionid.deploy.export.formats.{name}"), part, None)
