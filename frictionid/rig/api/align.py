"""frictionid.align: angles and a torque log on one clock, as a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import tomli_w

from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import TORQUE_HOLD
from frictionid.errors import InputError
from frictionid.files import write_bytes, write_text
from frictionid.rig.align.align_files import (
    AlignedRecording,
    AlignmentOptions,
    align_files,
    load_rig,
)
from frictionid.rig.align.alignment_figure import alignment_pictures
from frictionid.rig.align.alignment_text import alignment_document, alignment_text
from frictionid.rig.align.recording_folder import add_recording, check_place, recording_name


@dataclass(frozen=True, eq=False, repr=False)
class Aligned:
    """A recording whose two files count from one instant.

    Attributes
    ----------
    name : str, of the recording
    found : AlignedRecording
        Signals by the angles' clock, offset and drift with their standard errors, and warnings.
    """

    name: str
    found: AlignedRecording

    def __repr__(self) -> str:
        one = self.found
        text = alignment_text(one.alignment, one.mechanism, one.marker, one.responses)
        return "\n".join([text, *(f"warning  {warning}" for warning in one.warnings)])

    @property
    def document(self) -> Mapping[str, Any]:
        """All numbers: offset, drift, responses of the motors, and hashes of the files."""
        one = self.found
        return alignment_document(one.alignment, one.marker, one.responses, one.sources)

    @cached_property
    def dataset(self) -> Dataset:
        """The recording as a data set."""
        recording = Recording(self.name, self.found.angle, self.found.torque)
        return Dataset(self.name, self.found.mechanism, (recording,))


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
    name, settings = name or recording_name(Path(angles)), load_rig(Path(rig))
    head = settings.head(hold)
    if folder is not None:
        check_place(Path(folder), name, head, replace)
    options = AlignmentOptions(marker, offset, hold)
    aligned = Aligned(name, align_files(Path(angles), Path(torque), settings, options))
    if folder is not None:
        _write(aligned, head, Path(folder))
    return aligned


def _write(aligned: Aligned, head: Mapping[str, Any], folder: Path) -> None:
    """Add the recording to a data set, its numbers and pictures beside it."""
    one, name = aligned.found, aligned.name
    pictures = alignment_pictures(one)
    add_recording(folder, name, head, one.angle, one.torque)
    write_text(folder / f"{name}.align.toml", tomli_w.dumps(aligned.document))
    for kind, picture in pictures.items():
        write_bytes(folder / f"{name}.{kind}.png", picture)
