"""Export of a fitted friction to what simulators, controllers and drives read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from frictionid.api.models import DatasetLike, dataset_of, friction_of
from frictionid.errors import InputError
from frictionid.export.exported import exported
from frictionid.export.formats import ExportSettings, Written, writer_of
from frictionid.files import write_bytes
from frictionid.outputs import check_outputs


class Exported(NamedTuple):
    """Files that were written, and what the target cannot hold.

    paths : the files
    lost : sentences; none where the target computes the same friction
    """

    paths: tuple[Path, ...]
    lost: tuple[str, ...]


def export(
    model: Any,
    to: str,
    out: str | Path,
    *,
    data: DatasetLike | None = None,
    speeds: Sequence[float] = (),
    settings: ExportSettings | None = None,
    replace: bool = False,
) -> Exported:
    """Write a fitted friction in a format; see `frictionid.export.formats.FORMATS`.

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
    joints = () if dataset is None else tuple(dataset.mechanism.friction_names)
    friction = friction_of(model)
    if joints and len(joints) != friction.n:
        raise InputError(
            f"the model has friction at {friction.n} parts, the data set at {len(joints)}: "
            "name the one that it was fitted to"
        )
    written = write(exported(friction, joints, speeds), chosen)
    paths = _paths(Path(out), written)
    read = [path for path in (model, chosen.into) if isinstance(path, str | Path)]
    check_outputs(paths, [Path(path) for path in read], replace=replace)
    for path, content in zip(paths, written.files.values(), strict=True):
        write_bytes(path, content)
    return Exported(paths, written.lost)


def _paths(out: Path, written: Written) -> tuple[Path, ...]:
    """Where the files go: the first where the user says, the others beside it."""
    first, *others = written.files
    return (out, *(out.with_name(out.stem + ending) for ending in others))
