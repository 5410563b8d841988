"""frictionid.align: angles and a torque log on one clock, as a recording, and in pictures."""

import math
import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from frictionid.arrays import Array
from frictionid.check.motion import MIN_WINDOWS, motions_of, unit_rows
from frictionid.config import read_toml
from frictionid.data.integrals import integrals_of
from frictionid.data.plants import plant_of
from frictionid.data.readers.csv_table import CAMERA, DRIVE, decimal_cells, two_clock_csv
from frictionid.data.readers.table import table_name
from frictionid.data.signals import TORQUE_HOLD, Signal
from frictionid.errors import InputError
from frictionid.files import read_bytes, sha256, write_bytes, write_text
from frictionid.fitting.one_step.balances import Rows
from frictionid.outputs import check_outputs
from frictionid.report.figures.style import (
    COLOURS,
    DARK,
    GREY,
    figure,
    key_above,
    png,
)
from frictionid.report.numbers import either

from .align_files import Aligned, align_files, load_rig

ORIGIN = "aligned by frictionid align"
_DECIMALS = 9


def align(
    angles: str | Path,
    torque: str | Path,
    rig: str | Path = "rig.toml",
    *,
    name: str = "",
    marker: str = "",
    offset: float | None = None,
    hold: str = TORQUE_HOLD,
    folder: str | Path | None = None,
    replace: bool = False,
) -> Aligned:
    """Estimate offset and drift between two clocks from the motion itself.

    Parameters
    ----------
    angles : path of a table of angles, by the camera's clock
    torque : path of the drive's log
    rig : path of settings with the tables [mechanism] and [motor]
    name : str
        Of the recording; by default that of the angles' file.
    marker : str
        Column of both files with state or brightness of a sync LED.
    offset : float, optional
        [s], to within 0.5 s, where it is known.
    hold : "previous" or "linear", the logged torque between two rows
    folder : path, optional
        Data set that the recording is added to, with its pictures.
    replace : bool
        Whether a recording of that name may be replaced there.

    Raises
    ------
    InputError
        Where a file cannot be read, or nothing in it tells the offset.

    Examples
    --------
    A film and a log of one motion::

        aligned = frictionid.align("angles.csv", "drive.csv", "rig.toml")
        frictionid.check(aligned.dataset)
    """
    if hold not in ("linear", "previous"):
        raise InputError(f"hold = {hold!r} is unknown; known: linear, previous")
    if offset is not None and not math.isfinite(offset):
        raise InputError(f"offset = {offset} must be a finite number of seconds")
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", table_name(Path(angles).name))
    name, loaded = name or stem or "recording", load_rig(Path(rig))
    head = loaded.head(hold)
    if folder is not None:
        check_place(Path(folder), name, head, replace)
    aligned = align_files(
        *(Path(angles), Path(torque), loaded), name=name, marker=marker, offset=offset, hold=hold
    )
    if folder is None:
        return aligned
    pictures = {"clock": png(partial(clock_picture, aligned))}
    if aligned.command is not None and any(aligned.responses):
        pictures["command"] = png(partial(command_picture, aligned, aligned.command))
    add_recording(Path(folder), name, head, aligned.angle, aligned.torque)
    write_text(Path(folder) / f"{name}.align.toml", tomli_w.dumps(aligned.document))
    for kind, picture in pictures.items():
        write_bytes(Path(folder) / f"{name}.{kind}.png", picture)
    return aligned


def check_place(folder: Path, name: str, head: Mapping[str, Any], replace: bool) -> None:
    """Check that a recording can be added, before anything is computed.

    Raises
    ------
    InputError
        Where the folder holds other data, or a recording of this name already.
    """
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise InputError(
            f"--name {name!r} must have letters, digits, - and _ only: it names a file"
        )
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; name a folder with --out")
    if (folder / "dataset.toml").exists():
        _check_dataset(folder, head, replace)
    elif folder.is_dir() and any(folder.glob("*.csv")):
        raise InputError(f"{folder} holds tables without a dataset.toml; name a new folder")
    if (folder / f"{name}.csv").exists() and not replace:
        raise InputError(f"{folder} has a recording {name!r}: choose another --name, or --replace")
    endings = ("csv", "align.toml", "clock.png", "command.png")
    check_outputs([folder / f"{name}.{ending}" for ending in endings], replace=replace)


def _check_dataset(folder: Path, head: Mapping[str, Any], replace: bool) -> None:
    """Check that a data set is one of aligned recordings that another one fits into."""
    described = folder / "dataset.toml"
    document = read_toml(described)
    if document.get("origin") != ORIGIN:
        raise InputError(f"{folder} holds another data set; name a new folder with --out")
    for key, value in head.items():
        before = document.get(key)
        if isinstance(before, dict):  # deviations are checked when the angles have been read
            before = {k: v for k, v in before.items() if k != "sigma"}
        if before != value:
            raise InputError(
                f"{folder} has recordings with another [{key}]; name a new folder with --out"
            )
    if not replace and read_bytes(described) != tomli_w.dumps(document).encode():
        raise InputError(
            f"{described} was edited by hand, and comments are lost when a recording is added: "
            "name a new folder with --out, or --replace"
        )


def add_recording(
    folder: Path, name: str, head: Mapping[str, Any], angle: Signal, torque: Signal
) -> None:
    """Add a recording to a data set; torque (n columns) is on the angles' clock."""
    described = folder / "dataset.toml"
    document = read_toml(described) if described.exists() else {}
    if document and ("sigma" in document["columns"]) != (angle.sigma is not None):
        raise InputError(
            f"{folder} has recordings {'without' if angle.sigma is not None else 'with'} standard "
            f"deviations of the angles, {name!r} is another kind; name a new folder with --out"
        )
    text = _table(head, angle, torque)
    hashes = {
        **document.get("sha256", {}),
        f"{name}.csv": sha256(text.encode()),
    }
    columns = dict(head["columns"])
    if angle.sigma is not None:
        columns["sigma"] = _deviations(head)
    document = {
        **document,
        "name": document.get("name") or re.sub(r"\W+", "_", folder.resolve().name) or "aligned",
        "origin": ORIGIN,
        **head,
        "columns": columns,
        "recordings": {**document.get("recordings", {}), "patterns": sorted(hashes)},
        "sha256": dict(sorted(hashes.items())),
    }
    # in this order: a table that is not yet named in dataset.toml does no harm
    write_text(folder / f"{name}.csv", text)
    write_text(described, tomli_w.dumps(document))


def _table(head: Mapping[str, Any], angle: Signal, torque: Signal) -> str:
    """CSV text: rows of the camera's clock, then those of the drive's."""
    camera = {CAMERA: angle.time, **dict(zip(head["columns"]["angle"], angle.value.T, strict=True))}
    if angle.sigma is not None:
        camera |= dict(zip(_deviations(head), angle.sigma.T, strict=True))
    drive = {DRIVE: torque.time}
    drive |= {u: torque.value[:, j] for j, u in enumerate(head["columns"]["torque"]) if u}
    return two_clock_csv(
        *(
            {name: decimal_cells(column, _DECIMALS) for name, column in columns.items()}
            for columns in (camera, drive)
        )
    )


def _deviations(head: Mapping[str, Any]) -> list[str]:
    """Columns of the standard deviations of the angles."""
    return [f"sigma{j + 1}" for j in range(len(head["columns"]["angle"]))]


_SHOWN = 8.0  # [s] of torque
_CROWD = 4000  # points


def clock_picture(aligned: Aligned) -> Any:
    """What every offset explains, and the torque that motion and friction ask for."""
    coarse = aligned.alignment.coarse
    count = 1 if coarse is None else 2
    picture = figure(2.4 * count)
    axes = picture.subplots(count, 1, squeeze=False)[:, 0]
    if coarse is not None:
        tried = np.isfinite(coarse.explained)
        share = np.maximum(coarse.explained[tried], -1.0)
        axes[0].plot(coarse.offsets[tried], share, color=GREY, lw=0.7)
        axes[0].axvline(coarse.offset, color=COLOURS[1], lw=1.0)
        axes[0].annotate(
            f"{aligned.alignment.clock.offset:.3f} s",
            (coarse.offset, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(4, -9),
            textcoords="offset points",
            color=COLOURS[1],
        )
        axes[0].set(xlabel="offset of the log's clock [s]", ylabel="torque explained")
    _torques(axes[-1], aligned)
    key_above(picture, _key(axes[-1]))
    return picture


def _key(ax: Any) -> dict[str, Any]:
    handles, labels = ax.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))


def _torques(ax: Any, aligned: Aligned) -> None:
    plant = plant_of(aligned.dataset)
    rows = unit_rows(plant.mechanism, motions_of(aligned.dataset.recordings))
    asked = rows.required(np.asarray(plant.p))
    logged = rows.means(integrals_of([aligned.torque]))
    asked = asked + least_squares_friction(rows, logged - asked)
    middle = (rows.start + rows.stop) / 2
    begin, end = _liveliest(middle, logged)
    shown = (middle >= begin) & (middle <= end)
    for j in np.flatnonzero(aligned.mechanism.driven):
        ax.plot(middle[shown], logged[shown, j], color=COLOURS[0], label="logged, aligned")
        ax.plot(
            middle[shown],
            asked[shown, j],
            color=COLOURS[1],
            lw=0.9,
            label="asked for by motion and friction",
        )
    ax.set_xlabel("time of the angles [s]")
    ax.set_ylabel(f"torque [{either(aligned.mechanism.torque_units)}]")


def least_squares_friction(rows: Rows, torque: Array) -> Array:
    """Friction (K, n) [N m] of the shapes of rows that explains most of torques (K, n)."""
    out = np.zeros_like(torque)
    for j in range(torque.shape[1]):
        use, shapes = rows.moving[:, j], rows.shapes(j)
        if use.sum() >= MIN_WINDOWS:
            out[:, j] = shapes @ np.linalg.lstsq(shapes[use], torque[use, j], rcond=None)[0]
    return out


def _liveliest(time: Array, torque: Array) -> tuple[float, float]:
    """A few seconds with as much torque as any."""
    power = np.concatenate([[0.0], np.cumsum((torque**2).sum(axis=-1))])
    width = max(int(np.searchsorted(time, time[0] + _SHOWN)), 1)
    if width >= len(time):
        return float(time[0]), float(time[-1])
    k = int(np.argmax(power[width:] - power[:-width]))
    return float(time[k]), float(time[min(k + width, len(time) - 1)])


def command_picture(aligned: Aligned, logged: Signal) -> Any:
    """Measured against commanded torque of each motor, and both over time."""
    drives = [(k, r) for k, r in enumerate(aligned.responses) if r is not None]
    driven = np.flatnonzero(aligned.mechanism.driven)
    picture = figure(2.6 * len(drives))
    axes = picture.subplots(len(drives), 2, squeeze=False, width_ratios=(1, 1.6))
    unit, time = either(aligned.mechanism.torque_units), aligned.torque.time
    for (ax, beside), (k, r) in zip(axes, drives, strict=True):
        measured = aligned.torque.value[:, driven[k]]
        late = np.interp(time - r.delay, logged.time, logged.value[:, k])
        shown = slice(None, None, max(1, len(late) // _CROWD))
        ax.plot(late[shown], measured[shown], ".", ms=1.5, color=COLOURS[0], alpha=0.4)
        line = np.linspace(late.min(), late.max(), 200)
        ax.plot(line, line, color=GREY, lw=0.7, ls=(0, (4, 2)))
        ax.plot(line, np.clip(r.gain * line + r.bias, r.low, r.high), color=DARK, lw=1.0)
        ax.set_xlabel(f"command, {1e3 * r.delay:.1f} ms before [{unit}]")
        ax.set_ylabel(f"measured [{unit}]")
        begin, end = _liveliest(time, measured[:, None])
        part = (time >= begin) & (time <= min(end, begin + _SHOWN / 4))
        command = np.interp(time, logged.time, logged.value[:, k])
        beside.plot(time[part], command[part], color=GREY, drawstyle="steps-post", label="command")
        beside.plot(time[part], measured[part], color=COLOURS[0], lw=0.9, label="measured")
        beside.set_xlabel("time of the angles [s]")
        beside.set_ylabel(f"torque [{unit}]")
    key_above(picture, _key(axes[0, 1]))
    return picture
