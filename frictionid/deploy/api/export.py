"""Export of a fitted friction to what simulators, controllers and drives read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace as with_fields
from pathlib import Path
from typing import Any, NamedTuple

from frictionid.api.models import DatasetLike, dataset_of, friction_of
from frictionid.deploy.export.cost import Cost, cost_of, cost_sentence
from frictionid.deploy.export.exported import ExportedFriction, exported
from frictionid.deploy.export.formats import ExportSettings, Written, held_by, writer_of
from frictionid.deploy.export.randomise import randomised
from frictionid.errors import InputError
from frictionid.files import write_bytes
from frictionid.friction import Friction
from frictionid.outputs import check_outputs


class Exported(NamedTuple):
    """Files that were written, and what the target cannot hold.

    paths : the files
    lost : sentences; none where the target computes the same friction
    notes : sentences on what was changed in a file, and on what else to know
    cost : of the friction that the target holds, where it is another one and there are data
    """

    paths: tuple[Path, ...]
    lost: tuple[str, ...]
    notes: tuple[str, ...] = ()
    cost: Cost | None = None


def export(
    model: Any,
    to: str,
    out: str | Path,
    *,
    data: DatasetLike | None = None,
    speeds: Sequence[float] = (),
    temperature: float | None = None,
    settings: ExportSettings | None = None,
    replace: bool = False,
) -> Exported:
    """Write a fitted friction in a format; see `frictionid.deploy.export.formats.FORMATS`.

    Parameters
    ----------
    model : Fit, Friction, or path of a model file
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
    settings : ExportSettings, optional
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
    >>> fit = fid.fit("acrobot_clean", "coulomb_viscous")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = export(fit, "python", Path(folder) / "friction.py")
    ...     made.paths[0].name, made.lost
    ('friction.py', ())
    """
    chosen, write = settings or ExportSettings(), writer_of(to)
    dataset = data if data is None else dataset_of(data)
    if dataset is None:
        dataset = getattr(model, "data", None)
    named = () if dataset is None else tuple(dataset.mechanism.friction_names)
    joints = chosen.joints or named
    friction = _at(friction_of(model), temperature)
    if named and len(named) != friction.n:
        raise InputError(
            f"the model has friction at {friction.n} parts, the data set at {len(named)}: "
            "name the one that it was fitted to"
        )
    chosen = with_fields(chosen, stem=Path(out).stem)
    own = exported(friction, joints, speeds, dataset)
    written = write(own, chosen)
    if chosen.randomise:
        samples = randomised(own, chosen.randomise, chosen.seed, held_by(to))
        written = with_fields(written, files={**written.files, "_samples.json": samples})
    paths = _paths(Path(out), written)
    read = [path for path in (model, chosen.into) if isinstance(path, str | Path)]
    check_outputs(paths, [Path(path) for path in read], replace=replace)
    lost, cost = _lost(own, written)
    for path, content in zip(paths, written.files.values(), strict=True):
        write_bytes(path, content)
    return Exported(paths, lost, written.notes, cost)


def _at(friction: Friction, temperature: float | None) -> Friction:
    """The friction at a temperature, where one is chosen."""
    if temperature is None:
        return friction
    if not friction.law.uses_temperature:
        raise InputError(
            f"temperature = {temperature:g} degC: this friction does not depend on it, leave it out"
        )
    return friction.at_temperature(temperature)


def _lost(own: ExportedFriction, written: Written) -> tuple[tuple[str, ...], Cost | None]:
    """Sentences on what is lost, and what that costs on the data's motion."""
    if written.held is None:
        return written.lost, None
    if own.data is None:
        sentence = "name a data set (--dataset) to see what that costs in torque and after 1 s"
        return (*written.lost, sentence), None
    cost = cost_of(own, written.held)
    return (*written.lost, cost_sentence(own, cost)), cost


def _paths(out: Path, written: Written) -> tuple[Path, ...]:
    """Where the files go: the first where the user says, the others beside it."""
    first, *others = written.files
    return (out, *(out.with_name(out.stem + ending) for ending in others))
