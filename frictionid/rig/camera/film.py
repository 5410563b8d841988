"""Videos of simulated recordings: exposure blur, noise, jitter, dropped frames, occlusions."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from frictionid.config import NotNegative, Positive, read_toml, validated
from frictionid.data.recordings import TrueMotion
from frictionid.data.signals import Array
from frictionid.errors import InputError, needs
from frictionid.simulate.dataset_folder import settings_of

from .scene import Image, Look, Scene, SyncLed, View, chain
from .source import Frame, video_file

with needs("camera"):
    import cv2


CLOCK = 90_000  # ticks per second of time stamps
_STREAK = 1.0  # [px] between two instants of an exposure
_COLOUR = {  # resolution of the colour in JPEGs
    "jpeg": cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420,
    "jpeg444": cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
    "mpeg4": 0,
}


@validated
class Film:
    """A simulated camera.

    Attributes
    ----------
    lengths : of the links from marker to marker [m]
    rate : frames per second
    exposure : [s]
    noise : standard deviation of each colour [of 255]
    dropped : share of missing frames
    jitter : standard deviation of the instants [s]
    hidden : share of frames in which something occludes a dot
    view, look : geometry and appearance
    sync_led : LED in the picture, or None
    codec : "jpeg", pictures with time stamps and their colour at half the resolution, as in most
        videos; "jpeg444", at full resolution; or "mpeg4", compressed and evenly spaced
    seed : of noise, jitter, dropped frames and occlusions
    """

    lengths: tuple[Positive, ...]
    rate: Positive = 60.0
    exposure: Positive = 0.004
    noise: NotNegative = 6.0
    dropped: NotNegative = 0.0
    jitter: NotNegative = 0.0
    hidden: NotNegative = 0.0
    view: View = View()
    look: Look = Look()
    sync_led: SyncLed | None = None
    codec: Literal["jpeg", "jpeg444", "mpeg4"] = "jpeg"
    seed: int = 0

    def __post_init__(self) -> None:
        if len(self.look.dots) != len(self.lengths) + 1:
            raise InputError(
                f"look.dots has {len(self.look.dots)} entries for {len(self.lengths)} links: give "
                "one for the pivot, each joint and the tip, [] where there is no dot"
            )
        if self.sync_led is not None:
            (x, y), (width, height) = self.sync_led.at, self.view.size
            if not (0 <= x < width and 0 <= y < height):
                raise InputError(
                    f"sync_led.at = [{x:g}, {y:g}] lies outside the picture of {width} x {height} "
                    "pixels; move it"
                )
        if self.codec == "mpeg4" and (self.dropped or self.jitter):
            raise InputError(
                'codec = "mpeg4" has no time stamps for dropped or jittering frames; use "jpeg"'
            )


def load_film(path: str | Path) -> Film:
    """Simulated camera of a camera.toml."""
    return settings_of(Film, read_toml(Path(path), "name a camera.toml"), str(path))


def shots(film: Film, motion: TrueMotion) -> Iterator[Frame]:
    """Frames of a motion at the middles of their exposures; the same for the same settings."""
    rng = np.random.default_rng([film.seed, 7])
    scene = Scene(film.look, film.view, film.seed, film.sync_led)
    angle = CubicHermiteSpline(motion.angle.time, motion.angle.value, motion.velocity.value)
    bank = _noise(film, rng)
    occlude = _occluder(film, rng)
    for time in _times(film, motion, rng):
        within = np.array([-0.5, 0.0, 0.5]) * film.exposure + time
        ends = film.view.pixels(chain(angle(within), np.array(film.lengths)))
        streak = np.linalg.norm(ends[-1] - ends[0], axis=-1).max()
        count = int(np.clip(np.ceil(streak / _STREAK), 1, 48))
        # middles of equal parts of the exposure
        at = time + ((np.arange(count) + 0.5) / count - 0.5) * film.exposure
        markers = film.view.pixels(chain(angle(at), np.array(film.lengths)))
        lit = 0.0 if film.sync_led is None else film.sync_led.share(*within[[0, -1]].tolist())
        image = scene.picture(markers, lit)
        hidden = occlude(image, ends[1])
        yield Frame(float(time), _noisy(image, bank, rng), hidden)


def video_path(film: Film, stem: Path) -> Path:
    """Path of the video: the stem with .mov (JPEGs with time stamps) or .mp4 (at the film's rate).

    A name with a dot keeps it: "run.1" becomes "run.1.mov".
    """
    return stem.with_name(stem.name + (".mp4" if film.codec == "mpeg4" else ".mov"))


def write_film(film: Film, motion: TrueMotion, stem: Path) -> Path:
    """Write the video of a motion; its path."""
    jpeg = film.codec != "mpeg4"
    quality = [cv2.IMWRITE_JPEG_QUALITY, 95, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, _COLOUR[film.codec]]
    codec, rate = ("jpeg", CLOCK) if jpeg else ("mp4v", film.rate)
    options = (cv2.VIDEOWRITER_PROP_RAW_VIDEO, 1) if jpeg else ()
    start, path = motion.angle.time[0], video_path(film, stem)
    with video_file(path, codec, rate, film.view.size, options) as writer:
        for shot in shots(film, motion):
            if jpeg:
                writer.set(cv2.VIDEOWRITER_PROP_PTS, float(round((shot.time - start) * CLOCK)))
                writer.set(cv2.VIDEOWRITER_PROP_KEY_FLAG, 1.0)
                writer.write(cv2.imencode(".jpg", shot.image, quality)[1])
            else:
                writer.write(shot.image)
    return path


def _times(film: Film, motion: TrueMotion, rng: np.random.Generator) -> Array:
    """Middles of the exposures [s], inside the motion."""
    start, stop = motion.angle.time[0], motion.angle.time[-1]
    count = int(np.floor((stop - start) * film.rate + 1e-9)) + 1
    time = start + np.arange(count) / film.rate
    if film.jitter:
        limit = 0.4 / film.rate
        time = time + np.clip(film.jitter * rng.standard_normal(count), -limit, limit)
    if film.dropped:
        keep = rng.random(count) >= film.dropped
        keep[0] = True
        time = time[keep]
    if film.jitter:
        time = np.clip(time, start, stop)
        time[0] = start
    # time stamps are whole ticks, and exact
    return time[0] + np.round((time - time[0]) * CLOCK) / CLOCK


def _noise(film: Film, rng: np.random.Generator) -> Array | None:
    if not film.noise:
        return None
    width, height = film.view.size
    noise = rng.standard_normal((height + 64, width + 64, 3), dtype=np.float32)
    return np.asarray(np.round(film.noise * noise), dtype=np.int16)


def _noisy(image: Image, bank: Array | None, rng: np.random.Generator) -> Image:
    """The picture with noise: each time another part of a larger sheet."""
    if bank is None:
        return image
    x, y = rng.integers(0, 64, 2)
    part = np.ascontiguousarray(bank[y : y + image.shape[0], x : x + image.shape[1]])
    return np.asarray(cv2.add(image, part, dtype=cv2.CV_8U), dtype=np.uint8)


def _occluder(film: Film, rng: np.random.Generator) -> Callable[[Image, Array], Array]:
    """Draws a grey rectangle that occludes one of the dots now and then, for one to four frames.

    It returns which markers (n + 1,) are occluded wholly or in part.
    """
    left, marker, offset, half = 0, 1, np.zeros(2), np.zeros(2)
    r = film.look.radius

    def draw(image: Image, markers: Array) -> Array:
        nonlocal left, marker, offset, half
        hidden = np.zeros(len(markers), dtype=bool)
        if not film.hidden:
            return hidden
        if not left and rng.random() < film.hidden / 2.5:  # 2.5 frames on average
            left = int(rng.integers(1, 5))
            marker = int(rng.integers(1, len(markers)))
            half = rng.uniform(r, 4 * r, 2)
            offset = rng.uniform(-1, 1, 2) * (half + 0.7 * r)
        if left:
            left -= 1
            middle = markers[marker] + offset
            low = np.floor(middle - half).astype(int).tolist()
            high = np.ceil(middle + half).astype(int).tolist()
            cv2.rectangle(image, low, high, (70, 75, 80), -1)
            hidden = (np.abs(markers - middle) < half + r).all(axis=-1)
        return hidden

    return draw
