"""A view of a simulated camera, and its pictures: background, links, coloured dots, a sync LED."""

from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from frictionid.config import Positive, validated
from frictionid.data.signals import Array
from frictionid.errors import InputError, needs

from .source import Image

with needs("camera"):
    import cv2


_SHIFT = 4  # fractional bits of the coordinates of lines


@validated
class Look:
    """Appearance of the rig and its background.

    Attributes
    ----------
    dots : hue [deg], saturation and value (0 to 1) of each marker's dot; () where there is none
    radius : of the dots [px]
    link : grey level of the links (0 to 1)
    link_width : [px]
    background : "plate", a white plate on a grey wall; "wall", a plain one; or "workshop", objects
        of many colours that are less saturated than the dots
    wall : colour of the wall, as of the dots
    gradient : share by which the light falls from one corner to the other
    shadow : share by which the shadow of the links, 25 px below, is darker
    """

    dots: tuple[tuple[float, ...], ...] = ((), (0.0, 0.85, 0.85), (210.0, 0.85, 0.85))
    radius: Positive = 8.0
    link: float = 0.55
    link_width: float = 22.0
    background: Literal["plate", "wall", "workshop"] = "plate"
    wall: tuple[float, float, float] = (30.0, 0.08, 0.6)
    gradient: float = 0.0
    shadow: float = 0.0

    def __post_init__(self) -> None:
        for dot in self.dots:
            if dot and not (len(dot) == 3 and all(0 <= part <= 1 for part in dot[1:])):
                raise InputError(
                    f"look.dots: {list(dot)} must be a hue [deg], a saturation and a value, "
                    "both from 0 to 1, or [] where there is no dot"
                )


@validated
class SyncLed:
    """An LED in the picture that the drive switches.

    Attributes
    ----------
    at : its pixel
    switches : times [s] by the drive's clock at which it goes on, off, on and so on
    radius : [px]
    lit, dark : its colour when it is on and off: hue [deg], saturation and value (0 to 1)
    """

    at: tuple[float, float]
    switches: tuple[float, ...]
    radius: Positive = 6.0
    lit: tuple[float, float, float] = (120.0, 0.15, 0.95)
    dark: tuple[float, float, float] = (120.0, 0.15, 0.2)

    def __post_init__(self) -> None:
        if any(b <= a for a, b in pairwise(self.switches)):
            raise InputError(f"sync_led.switches = {list(self.switches)} must increase")

    def share(self, start: float, stop: float) -> float:
        """Share of the time from start to stop [s] in which it is on.

        >>> SyncLed((9.0, 9.0), (1.0, 3.0)).share(0.5, 1.5)
        0.5
        """
        signs = (-1.0) ** np.arange(len(self.switches))
        past = np.maximum(np.array([[start], [stop]]) - np.array(self.switches), 0.0)
        before, after = (past * signs).sum(axis=1).tolist()
        return min(max((after - before) / (stop - start), 0.0), 1.0)


Pixels = Annotated[int, Field(ge=1, le=8192)]  # a picture of 8192 x 8192 takes 0.2 GB
_FAR = 10.0  # sizes of the picture


@validated
class View:
    """A pinhole camera with radial distortion that looks at a plane.

    Attributes
    ----------
    size : pixels to the right and downwards
    pivot : pixel at which an untilted camera without distortion sees the fixed joint
    scale : pixels per metre at the pivot's distance
    distance : of the camera from the plane [m]
    tilt : rotation vector [deg] of the plane about the picture's horizontal and vertical axis
    distortion : share by which points at the corners of the picture move outwards
    """

    size: tuple[Pixels, Pixels] = (1280, 720)
    pivot: tuple[float, float] = (640.0, 360.0)
    scale: Positive = 900.0
    distance: Positive = 2.0
    tilt: tuple[float, float] = (0.0, 0.0)
    distortion: float = 0.0

    def __post_init__(self) -> None:
        for at, size in zip(self.pivot, self.size, strict=True):
            if abs(at) > _FAR * size:
                raise InputError(
                    f"pivot = {list(self.pivot)} is far outside of a picture of {list(self.size)} "
                    "pixels: it is the pixel of the fixed joint"
                )

    def pixels(self, points: Array) -> Array:
        """Pixels (..., 2), x to the right and y downwards, of points (..., 2) [m] from the pivot.

        The points count to the right and downwards, too.

        >>> View().pixels(np.array([[0.1, 0.0]]))
        array([[730., 360.]])
        """
        size, pivot = np.array(self.size, float), np.array(self.pivot)
        middle = (size - 1) / 2
        flat = np.asarray(points, float) + (pivot - middle) / self.scale
        turned = Rotation.from_rotvec([*np.radians(self.tilt), 0.0]).as_matrix()[:, :2]
        X = flat @ turned.T  # (..., 3)
        seen = X[..., :2] / (1.0 + X[..., 2:] / self.distance) * self.scale
        corner = np.linalg.norm(middle)
        out = 1.0 + self.distortion * (seen**2).sum(-1, keepdims=True) / corner**2
        return middle + seen * out


class Scene:
    """Pictures of a chain of markers, without noise."""

    def __init__(self, look: Look, view: View, seed: int, led: SyncLed | None = None):
        self.look, self.size, self.led = look, view.size, led
        width, height = view.size
        across = np.linspace(0, 1, width)[None, :] + np.linspace(0, 1, height)[:, None]
        self.light = (1.0 - look.gradient * across / 2).astype(np.float32)[..., None]
        unlit = _backdrop(look, view, np.random.default_rng(seed))
        self.backdrop = np.clip(np.round(unlit * self.light), 0, 255).astype(np.uint8)

    def picture(self, exposed: Array, lit: float = 0.0) -> Image:
        """Image of markers whose pixels (S, n + 1, 2) are spread over the exposure.

        lit : share of the exposure in which the LED is on
        """
        image = self.backdrop.copy()
        if self.led is not None:
            on, off = (np.array(colour(*hsv)) for hsv in (self.led.lit, self.led.dark))
            at = np.array([self.led.at])
            self._disc(image, at, self.led.radius, off + lit * (on - off), shines=True)
        instants = exposed[np.linspace(0, len(exposed) - 1, min(3, len(exposed))).astype(int)]
        if self.look.shadow:
            self._links(image, instants + 25.0 * np.array([0.3, 1.0]), None)
        self._links(image, instants, 255 * self.look.link)
        for marker, hsv in enumerate(self.look.dots):
            if hsv:
                self._disc(image, exposed[:, marker], self.look.radius, np.array(colour(*hsv)))
        return image

    def _links(self, image: Image, exposed: Array, grey: float | None) -> None:
        """Links (or their shadow, where grey is None), averaged over the exposure."""
        reach = int(self.look.link_width) + 3
        x0, y0, x1, y1 = self._box(exposed.reshape(-1, 2), reach, reach)
        if x1 <= x0 or y1 <= y0:
            return
        cover = np.zeros((y1 - y0, x1 - x0), dtype=np.float32)
        for markers in exposed:
            mask = np.zeros(cover.shape, dtype=np.uint8)
            ends = np.round((markers - [x0, y0]) * 2**_SHIFT).astype(int)
            for a, b in pairwise(ends.tolist()):
                cv2.line(mask, a, b, 255, int(self.look.link_width), cv2.LINE_AA, _SHIFT)
            cover += mask.astype(np.float32) / (255 * len(exposed))
        part, cover = image[y0:y1, x0:x1], cover[..., None]
        if grey is None:
            new = part * (1 - self.look.shadow * cover)
        else:
            new = part * (1 - cover) + cover * self.light[y0:y1, x0:x1] * grey
        part[:] = np.round(new)

    def _disc(self, image: Image, path: Array, r: float, bgr: Array, shines: bool = False) -> None:
        """A disc that moves along a path during the exposure; one that shines needs no light."""
        x0, y0, x1, y1 = self._box(path, r + 2, r + 3)
        if x1 <= x0 or y1 <= y0:
            return
        y, x = np.mgrid[y0:y1, x0:x1]
        away = np.hypot(x - path[:, 0, None, None], y - path[:, 1, None, None])
        cover = np.clip(r + 0.5 - away, 0, 1).mean(0)[..., None]
        part = image[y0:y1, x0:x1]
        light = 1.0 if shines else self.light[y0:y1, x0:x1]
        part[:] = np.round(part * (1 - cover) + cover * light * bgr)

    def _box(self, places: Array, before: float, behind: float) -> tuple[int, int, int, int]:
        """Corners of the part of the picture with all places (P, 2) and a margin [px] around it."""
        low = np.clip(np.floor(places.min(0) - before).astype(int), 0, self.size)
        high = np.clip(np.ceil(places.max(0) + behind).astype(int), 0, self.size)
        return *low.tolist(), *high.tolist()


def colour(hue: float, saturation: float, value: float) -> tuple[float, float, float]:
    """Blue, green and red (0 to 255) of a hue [deg], saturation and value.

    >>> colour(0.0, 1.0, 1.0)
    (0.0, 0.0, 255.0)
    """
    pixel = np.array([[[hue, saturation, value]]], dtype=np.float32)
    b, g, r = (255 * cv2.cvtColor(pixel, cv2.COLOR_HSV2BGR)[0, 0]).tolist()
    return b, g, r


def _backdrop(look: Look, view: View, rng: np.random.Generator) -> Array:
    (width, height), pivot = view.size, view.pivot
    image = np.full((height, width, 3), colour(*look.wall), dtype=np.float32)
    if look.background == "plate":
        half = 0.36 * height
        low = (int(pivot[0] - half), int(pivot[1] - 0.5 * half))
        high = (int(pivot[0] + half), int(pivot[1] + 0.5 * half))
        cv2.rectangle(image, low, high, (235, 238, 236), -1)
    if look.background == "workshop":
        for _ in range(40):
            at = rng.uniform([0, 0], [width, height])
            extent = rng.uniform(20, 220, 2)
            # less saturated than a dot
            hsv = (rng.uniform(0, 360), rng.uniform(0, 0.3), rng.uniform(0.2, 0.9))
            ends = (at - extent / 2).astype(int).tolist(), (at + extent / 2).astype(int).tolist()
            cv2.rectangle(image, *ends, colour(*hsv), -1, cv2.LINE_AA)
    return cv2.GaussianBlur(image, (0, 0), 1.0)


def chain(angles: Array, lengths: Array) -> Array:
    """Pivot, joints and tip (T, n + 1, 2) [m] from the pivot, for joint angles (T, n) [rad].

    Angles are relative to the link before and 0 where the chain hangs; x to the right, y downwards.

    >>> chain(np.array([[np.pi / 2, 0.0]]), np.array([1.0, 2.0])).round(9)[0, -1]
    array([3., 0.])
    """
    absolute = np.cumsum(angles, axis=-1)
    links = np.stack([np.sin(absolute), np.cos(absolute)], axis=-1) * np.asarray(lengths)[:, None]
    ends = np.cumsum(links, axis=-2)
    return np.concatenate([np.zeros_like(ends[..., :1, :]), ends], axis=-2)
