"""Tables of rig.toml for the camera: markers from pivot to tip, links, view and a sync LED."""

import math
import re
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import tomli_w
from pydantic import Field, NonNegativeFloat, field_validator, model_validator

from frictionid.config import Positive, Strict, checked

from ..rig_settings import rig_tables

MIN_HUE_DISTANCE = 40.0  # [deg]; colours nearer than this cannot be distinguished

Pixel = Annotated[list[float], Field(min_length=2, max_length=2)]
Share = Annotated[float, Field(gt=0, le=1)]


class Marker(Strict):
    """The pivot, a joint or the tip, seen as a coloured dot.

    Attributes
    ----------
    name : str
    hue [deg], saturation, value (0 to 1) : colour of the dot
    radius : of the dot [px]
    at : pixel of a marker that stays where it is and needs no dot
    moves : false where the dot of the pivot stays: its median place counts
    """

    name: Annotated[str, Field(min_length=1)]
    hue: Annotated[float, Field(ge=0, le=360)] | None = None
    saturation: Share = 0.8
    value: Share = 0.8
    radius: Positive = 8.0
    at: Pixel | None = None
    moves: bool = True

    @model_validator(mode="after")
    def _visible(self) -> Self:
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
    """Settings of the camera.

    Attributes
    ----------
    exposure : exposure time of a frame [s]
    stamp : whether time stamps name the start, the middle or the end of the exposure
    down : direction of gravity [deg], counter-clockwise from downwards in the picture
    mirrored : true where the camera looks from the side on which counter-clockwise is clockwise
    calibrate : whether tilt and lens are estimated from the constant lengths of the links
    rate : frames per second of sequences of pictures
    """

    exposure: NonNegativeFloat = 0.004
    stamp: Literal["start", "middle", "end"] = "middle"
    down: float = 0.0
    mirrored: bool = False
    calibrate: bool = True
    rate: Positive | None = None


class SyncLed(Strict):
    """An LED in the picture whose state the drive logs, too: it synchronises the two clocks.

    Attributes
    ----------
    at : its pixel
    radius : of the disc whose brightness is measured [px]
    name : column of the brightness in the table of angles
    """

    at: Pixel
    radius: Positive = 6.0
    name: str = "sync_led"

    @field_validator("name")
    @classmethod
    def _column(cls, name: str) -> str:
        if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
            raise ValueError(f"{name!r} must have letters, digits, - and _ only: it names a column")
        if re.fullmatch(r"time|state|(q|sigma|predicted)[0-9]+", name):
            raise ValueError(f"{name!r} is another column of the table; choose another name")
        return name


class MarkerSetup(Strict):
    """Markers in order from the pivot to the tip, links, camera, and a sync LED."""

    markers: Annotated[list[Marker], Field(min_length=2)]
    links: Links = Links()
    camera: Camera = Camera()
    sync_led: SyncLed | None = None

    @field_validator("markers")
    @classmethod
    def _distinguishable(cls, markers: list[Marker]) -> list[Marker]:
        for marker in markers[1:]:
            if marker.hue is None:
                raise ValueError(f"marker {marker.name!r} moves; give its dot a hue [deg]")
        names = [m.name for m in markers]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two markers are called {name!r}; rename one")
        for a, b in combinations([m for m in markers if m.hue is not None], 2):
            distance = hue_distance(a.hue or 0.0, b.hue or 0.0)
            if 0 < distance < MIN_HUE_DISTANCE:
                raise ValueError(
                    f"the hues of {a.name!r} and {b.name!r} are {distance:g} deg apart and cannot "
                    f"be distinguished; use colours {MIN_HUE_DISTANCE:g} deg apart, or the "
                    "same hue"
                )
        return markers

    @model_validator(mode="after")
    def _one_length_per_link(self) -> Self:
        links = len(self.markers) - 1
        for label, lengths in self.links:
            if lengths is not None and len(lengths) != links:
                raise ValueError(
                    f"links.{label} has {len(lengths)} numbers for {links + 1} markers; give one "
                    "for each pair of neighbours"
                )
        return self

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.markers) - 1


def hue_distance(a: Any, b: Any) -> Any:
    """Angle between two hues, or arrays of these [deg], at most 180.

    >>> hue_distance(350.0, 20.0)
    30.0
    """
    return abs((a - b + 180.0) % 360.0 - 180.0)


def load_marker_setup(path: Path) -> MarkerSetup:
    """Markers, links, camera and sync LED of a rig.toml; other tables are left to others."""
    tables = {
        key: table for key, table in rig_tables(path).items() if key in MarkerSetup.model_fields
    }
    return checked(MarkerSetup, tables, str(path))


def marker_setup_text(setup: MarkerSetup, notes: Sequence[str] = ()) -> str:
    """Text of a rig.toml with this setup; notes become comments at its head.

    >>> two = [Marker(name="pivot", at=[1.0, 2.0]), Marker(name="tip", hue=10.0)]
    >>> "hue = 10.0" in marker_setup_text(MarkerSetup(markers=two))
    True
    """
    table = _rounded(setup.model_dump(exclude_none=True, exclude_defaults=True))
    return "".join(f"# {note}\n" for note in notes) + tomli_w.dumps(table)


def _rounded(value: Any) -> Any:
    """All numbers of nested tables and lists to five significant digits."""
    if isinstance(value, dict):
        return {key: _rounded(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_rounded(entry) for entry in value]
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.5g}")
    return value
