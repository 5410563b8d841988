"""Reader `markers`: joint angles from places of pivot, joints and tip in pictures.

Pixels count to the right and downwards. Angles are those of the mechanisms: 0 hangs down,
counter-clockwise in the picture is positive; the first is absolute, each other one relative to the
link before.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from frictionid.config import Strict, checked
from frictionid.errors import InputError
from frictionid.files import read_bytes

from ...recordings import Recording
from ...signals import Array, Signal
from ..column_toml import UNITS, Column
from ..table import Table, read_table, signal_of, table_name


class MarkerSettings(Strict):
    """Settings of the reader `markers`.

    x, y : columns of the markers, pivot first, then the joints and the tip; any unit of length
    time : column of the time, in `time_unit`; or rate : frames per second, for tables without one
    header : false for tables without a header line: columns are then called "1", "2", ...
    y_points : "down" as pixels count, or "up"
    pivot : "moving": each frame's own, or "fixed": its median over the recording
    mirrored : true where the camera looks from the side on which counter-clockwise is clockwise
    missing : rows without all markers: "refuse" or "drop" them
    """

    x: Annotated[list[Column], Field(min_length=2)]
    y: Annotated[list[Column], Field(min_length=2)]
    time: Column | None = None
    time_unit: Literal["s", "ms", "us"] = "s"
    rate: PositiveFloat | None = None
    header: bool = True
    y_points: Literal["down", "up"] = "down"
    pivot: Literal["moving", "fixed"] = "moving"
    mirrored: bool = False
    missing: Literal["refuse", "drop"] = "refuse"

    @model_validator(mode="after")
    def _pairs(self) -> Self:
        if len(self.x) != len(self.y):
            raise ValueError(f"x names {len(self.x)} columns and y {len(self.y)}; give one each")
        if len({*self.x, *self.y}) != 2 * len(self.x):
            raise ValueError("x and y name a column twice; each coordinate has its own")
        if (self.time is None) == (self.rate is None):
            raise ValueError("give either time (a column) or rate (frames per second)")
        return self


def read(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Angles of a passive chain of links, one joint per link, from a table of its markers."""
    chosen = checked(MarkerSettings, settings, f"{path}: [reader]")
    second = 1.0 if chosen.time is None else UNITS["time"][chosen.time_unit]
    clock = chosen.time or f"{np.format_float_positional(chosen.rate or 0.0)} Hz"
    names = [*chosen.x, *chosen.y, clock]
    table = read_table(read_bytes(path), str(path), names, header=chosen.header)
    if chosen.missing == "drop":
        table = table.complete([*chosen.x, *chosen.y])
    if not len(table.rows):
        raise InputError(f"{table.file}: no row has all markers; name other columns")
    column = partial(signal_of, table, clock, second=second)
    x, y = column(chosen.x), column(chosen.y)
    markers = np.stack([x.value, y.value], axis=-1)
    angle = Signal(x.time, _angles(markers, chosen, table))
    return Recording(table_name(path.name), angle, angle._replace(value=np.zeros_like(angle.value)))


def _angles(markers: Array, settings: MarkerSettings, table: Table) -> Array:
    """Joint angles (T, n) [rad] of markers (T, n + 1, 2) as they stand in the table."""
    if settings.y_points == "up":
        markers = -mirror(markers)
    if settings.mirrored:
        markers = mirror(markers)
    if settings.pivot == "fixed":
        markers = hold_pivot(markers)
    touching = (link_lengths(markers) == 0).any(axis=1)
    if touching.any():
        raise InputError(
            f"{table.file}, row {table.rows[int(np.argmax(touching))]}: two neighbouring markers "
            "coincide, so that there is no angle; repair or delete the row"
        )
    return link_angles(markers)


def link_angles(markers: Array) -> Array:
    """Joint angles of a chain of links by their ends, shape (T, n) [rad], unwrapped.

    theta_i = atan2(x_i+1 - x_i, y_i+1 - y_i),  q_1 = theta_1,  q_i = theta_i - theta_i-1

    Each starts within (-pi, pi] and changes by less than half a turn between frames.

    Parameters
    ----------
    markers : array, shape (T, n + 1, 2), any unit of length
        Pivot, the joints behind it and the tip; x to the right, y downwards.

    Examples
    --------
    A link to the right of the pivot, the next one straight up from its end:

    >>> np.degrees(link_angles(np.array([[[0.0, 0.0], [5.0, 0.0], [5.0, -3.0]]])))
    array([[90., 90.]])
    """
    link = np.diff(np.asarray(markers, float), axis=1)
    absolute = np.arctan2(link[..., 0], link[..., 1])
    relative = np.diff(absolute, axis=1, prepend=0.0)
    within_a_turn = np.pi - np.mod(np.pi - relative, 2 * np.pi)  # in (-pi, pi]
    return np.unwrap(within_a_turn, axis=0)


def link_lengths(markers: Array) -> Array:
    """Distances of neighbouring markers (T, n + 1, 2), shape (T, n), in the markers' unit.

    >>> link_lengths(np.array([[[0.0, 0.0], [3.0, 4.0]]]))
    array([[5.]])
    """
    return np.linalg.norm(np.diff(np.asarray(markers, float), axis=1), axis=-1)


def hold_pivot(markers: Array) -> Array:
    """The markers (T, n + 1, 2) with the pivot at its median over time, for a fixed one.

    >>> seen = np.array([[[0.0, 1.0], [2.0, 9.0]], [[4.0, 1.0], [3.0, 9.0]]])
    >>> hold_pivot(seen)[:, 0]
    array([[2., 1.],
           [2., 1.]])
    """
    markers = np.array(markers, float)
    markers[:, 0] = np.median(markers[:, 0], axis=0)
    return markers


def mirror(markers: Array) -> Array:
    """The markers as seen from the other side, left and right exchanged.

    >>> mirror(np.array([[[2.0, 3.0]]]))
    array([[[-2.,  3.]]])
    """
    return np.asarray(markers, float) * np.array([-1.0, 1.0])
