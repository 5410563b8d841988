"""What rig.toml says of the picture: markers from pivot to tip, links, the camera, a lamp."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import tomli_w
from pydantic import Field, field_validator, model_validator

from frictionid.config import Strict, checked, nearest
from frictionid.data.readers.table import content_of
from frictionid.errors import InputError

TABLES = ("markers", "links", "camera", "lamp")
_OF_OTHERS = ("mechanism", "motor", "protocol", "angles")  # in the same rig.toml
APART = 40.0  # [deg] of hue: nearer colours cannot be told apart

Positive = Annotated[float, Field(gt=0)]


class Marker(Strict):
    """The pivot, a joint or the tip.

    name : str
    hue [deg], saturation, value : colour of its dot; saturation and value from 0 to 1
    radius : of the dot [px]
    at : pixel where it is, for one that does not move and needs no dot
    moves : whether the pivot's dot is followed in each frame, else its median counts
    """

    name: Annotated[str, Field(min_length=1)]
    hue: Annotated[float, Field(ge=0, le=360)] | None = None
    saturation: Annotated[float, Field(gt=0, le=1)] = 0.8
    value: Annotated[float, Field(gt=0, le=1)] = 0.8
    radius: Positive = 8.0
    at: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    moves: bool = True

    @model_validator(mode="after")
    def _seen(self) -> Self:
        if self.hue is None and self.at is None:
            raise ValueError(
                f"marker {self.name!r} has neither a colour nor a place; give its dot a hue [deg], "
                "or at = [x, y] where it stays"
            )
        if self.hue is not None and self.saturation < 0.15:
            raise ValueError(
                f"marker {self.name!r}: saturation = {self.saturation:g} is grey: only colourful "
                "dots are found; use one of a strong colour"
            )
        return self


class Links(Strict):
    """Distances between neighbouring markers: [m], which calibrate the view, and in pixels."""

    lengths: list[Positive] | None = None
    pixels: list[Positive] | None = None


class Camera(Strict):
    """How pictures are taken.

    exposure : time that a picture is exposed [s]
    stamp : whether time stamps name the start, the middle or the end of the exposure
    down : direction in which things fall, [deg] counter-clockwise from downwards in the picture
    mirrored : whether the camera looks from where counter-clockwise appears clockwise
    calibrate : whether tilt and lens are found from the links, whose lengths cannot change
    rate : frames per second of sequences of pictures
    """

    exposure: Annotated[float, Field(ge=0)] = 0.004
    stamp: Literal["start", "middle", "end"] = "middle"
    down: float = 0.0
    mirrored: bool = False
    calibrate: bool = True
    rate: Positive | None = None


class Lamp(Strict):
    """A lamp that the drive logs, too, and that ties the clocks of both.

    at : its pixel; radius : of the disc whose brightness counts [px]
    name : of the column with its brightness
    """

    at: Annotated[list[float], Field(min_length=2, max_length=2)]
    radius: Positive = 6.0
    name: str = "lamp"

    @field_validator("name")
    @classmethod
    def _column(cls, name: str) -> str:
        if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
            raise ValueError(f"{name!r} must have letters, digits, - and _ only: it names a column")
        if re.fullmatch(r"time|state|(q|sigma|predicted)[0-9]+", name):
            raise ValueError(f"{name!r} is another column of the table; choose another name")
        return name


class Marks(Strict):
    """Markers in their order from the pivot to the tip, links, camera, and a lamp."""

    markers: Annotated[list[Marker], Field(min_length=2)]
    links: Links = Links()
    camera: Camera = Camera()
    lamp: Lamp | None = None

    @field_validator("markers")
    @classmethod
    def _chain(cls, markers: list[Marker]) -> list[Marker]:
        for marker in markers[1:]:
            if marker.hue is None:
                raise ValueError(f"marker {marker.name!r} moves; give its dot a hue [deg]")
        names = [m.name for m in markers]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two markers are called {name!r}; rename one")
        for a, b in combinations([m for m in markers if m.hue is not None], 2):
            apart = hue_distance(a.hue or 0.0, b.hue or 0.0)
            if 0 < apart < APART:
                raise ValueError(
                    f"the hues of {a.name!r} and {b.name!r} are {apart:g} deg apart and cannot be "
                    f"told from each other; use colours {APART:g} deg apart, or the same hue"
                )
        return markers

    @model_validator(mode="after")
    def _one_length_per_link(self) -> Self:
        links = len(self.markers) - 1
        for label, given in self.links:
            if given is not None and len(given) != links:
                raise ValueError(
                    f"links.{label} has {len(given)} numbers for {links + 1} markers; give one "
                    "for each pair of neighbours"
                )
        return self

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.markers) - 1


def hue_distance(a: float, b: float) -> float:
    """Angle between two hues [deg], at most 180.

    >>> hue_distance(350.0, 20.0)
    30.0
    """
    return abs((a - b + 180.0) % 360.0 - 180.0)


def load_marks(path: Path) -> Marks:
    """Markers, links, camera and lamp of a rig.toml; its other tables belong to others.

    Raises
    ------
    InputError
        Where the file cannot be read or a setting of these tables is wrong.
    """
    content = content_of(path)
    try:
        document = tomllib.loads(content.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is no TOML ({error}); correct it") from None
    for key in document:
        close = nearest(key, TABLES)
        if key not in (*TABLES, *_OF_OTHERS) and close.startswith("did"):
            raise InputError(f"{path}: unknown table [{key}]; {close}")
    tables = {key: document[key] for key in TABLES if key in document}
    return checked(Marks, tables, str(path))


def marks_text(marks: Marks, notes: Sequence[str] = ()) -> str:
    """rig.toml with these markers, links, camera and lamp; notes become comments at its head.

    >>> two = [Marker(name="pivot", at=[1.0, 2.0]), Marker(name="tip", hue=10.0)]
    >>> "hue = 10.0" in marks_text(Marks(markers=two))
    True
    """
    table: dict[str, Any] = marks.model_dump(exclude_none=True, exclude_defaults=True)
    table["markers"] = [_rounded(m) for m in table["markers"]]
    head = "".join(f"# {note}\n" for note in notes)
    return head + tomli_w.dumps({k: _rounded(v) if k != "markers" else v for k, v in table.items()})


def _rounded(table: dict[str, Any]) -> dict[str, Any]:
    def short(value: Any) -> Any:
        if isinstance(value, float) and value and math.isfinite(value):
            return float(f"{value:.5g}")
        return [short(v) for v in value] if isinstance(value, list) else value

    return {key: short(value) for key, value in table.items()}
