"""Pictures of an alignment: torque by both clocks, and the drive's command against its torque."""

from __future__ import annotations

from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.check.motion import MIN_WINDOWS, motions_of, unit_rows
from frictionid.data.integrals import integrals_of
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.fitting.one_step.balances import Rows
from frictionid.report.figures.style import (
    COLOURS,
    DARK,
    GREY,
    WIDTH,
    drawing,
    figure,
    key_above,
    rendered,
)
from frictionid.report.numbers import either
from frictionid.rig.align.align_files import Aligned
from frictionid.rig.align.drive_response import DriveResponse

_SHOWN = 8.0  # [s] of torque
_CROWD = 4000  # points


def alignment_pictures(aligned: Aligned) -> dict[str, bytes]:
    """PNGs of an aligned recording by the endings of their names."""
    pictures = {"clock": clock_picture(aligned), "command": command_picture(aligned)}
    return {kind: picture for kind, picture in pictures.items() if picture is not None}


def clock_picture(aligned: Aligned) -> bytes:
    """PNG: what every offset explains, and the torque that motion and friction ask for."""
    with drawing():
        coarse = len(aligned.alignment.coarse.offsets) > 0
        picture = figure(2.4 * (1 + coarse))
        axes = picture.subplots(1 + coarse, 1, squeeze=False)[:, 0]
        if coarse:
            _correlation(axes[0], aligned)
        _torques(axes[-1], aligned)
        key_above(picture, _key(axes[-1]))
        return rendered(picture, ("png",))["png"]


def _key(ax: Any) -> dict[str, Any]:
    handles, labels = ax.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))


def _correlation(ax: Any, aligned: Aligned) -> None:
    coarse = aligned.alignment.coarse
    tried = np.isfinite(coarse.explained)
    share = np.maximum(coarse.explained[tried], -1.0)
    ax.plot(coarse.offsets[tried], share, color=GREY, lw=0.7)
    ax.axvline(coarse.offset, color=COLOURS[1], lw=1.0)
    ax.annotate(
        f"{aligned.alignment.clock.offset:.3f} s",
        (coarse.offset, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(4, -9),
        textcoords="offset points",
        color=COLOURS[1],
    )
    ax.set_xlabel("offset of the log's clock [s]")
    ax.set_ylabel("torque explained")


def _torques(ax: Any, aligned: Aligned) -> None:
    recording = Recording("motion", aligned.angle, aligned.torque)
    plant = plant_of(Dataset("picture", aligned.mechanism, (recording,)))
    rows = unit_rows(plant.mechanism, motions_of([recording]))
    asked = rows.required(np.asarray(plant.p))
    logged = rows.means(integrals_of([recording.torque]))
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


def command_picture(aligned: Aligned) -> bytes | None:
    """PNG: measured against commanded torque of each motor, and both over time."""
    drives = [(k, r) for k, r in enumerate(aligned.responses) if r is not None]
    if not drives or aligned.command is None:
        return None
    driven = np.flatnonzero(aligned.mechanism.driven)
    with drawing():
        picture = figure(2.6 * len(drives), WIDTH)
        axes = picture.subplots(len(drives), 2, squeeze=False, width_ratios=(1, 1.6))
        for row, (k, r) in zip(axes, drives, strict=True):
            time, measured = aligned.torque.time, aligned.torque.value[:, driven[k]]
            command = np.interp(time, aligned.command.time, aligned.command.value[:, k])
            late = np.interp(time - r.delay, aligned.command.time, aligned.command.value[:, k])
            _scatter(row[0], late, measured, r, aligned)
            _over_time(row[1], time, command, measured, aligned)
        key_above(picture, _key(axes[0, 1]))
        return rendered(picture, ("png",))["png"]


def _scatter(ax: Any, command: Array, measured: Array, r: DriveResponse, aligned: Aligned) -> None:
    shown = slice(None, None, max(1, len(command) // _CROWD))
    ax.plot(command[shown], measured[shown], ".", ms=1.5, color=COLOURS[0], alpha=0.4)
    line = np.linspace(command.min(), command.max(), 200)
    ax.plot(line, line, color=GREY, lw=0.7, ls=(0, (4, 2)))
    ax.plot(line, np.clip(r.gain * line + r.bias, r.low, r.high), color=DARK, lw=1.0)
    unit = either(aligned.mechanism.torque_units)
    ax.set_xlabel(f"command, {1e3 * r.delay:.1f} ms before [{unit}]")
    ax.set_ylabel(f"measured [{unit}]")


def _over_time(ax: Any, time: Array, command: Array, measured: Array, aligned: Aligned) -> None:
    begin, end = _liveliest(time, measured[:, None])
    shown = (time >= begin) & (time <= min(end, begin + _SHOWN / 4))
    ax.plot(time[shown], command[shown], color=GREY, drawstyle="steps-post", label="command")
    ax.plot(time[shown], measured[shown], color=COLOURS[0], lw=0.9, label="measured")
    ax.set_xlabel("time of the angles [s]")
    ax.set_ylabel(f"torque [{either(aligned.mechanism.torque_units)}]")
