"""Frames of a video file, a sequence of pictures or a live camera; video files that are written.

The encoder says nothing of a full disk: what it has written is read again.
"""

import glob
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from frictionid.errors import InputError, needs
from frictionid.files import regular_file, written_beside

with needs("camera"):
    import cv2


# FFmpeg, which OpenCV loads with its first video, would write lines beside our one; -8 is quiet
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

Image = NDArray[np.uint8]
_PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
_MAX_RATE = 1500.0  # [Hz]; a higher one is the resolution of the time stamps
_FIRST = 30  # frames whose time stamps give the rate
_TICK = 1e-3  # [s] to which some containers round their time stamps


class Frame(NamedTuple):
    """A picture (height, width, 3), blue, green and red, and its time stamp [s].

    hidden (n + 1,) : which markers are occluded, of a simulated one
    """

    time: float
    image: Image
    hidden: NDArray[Any] | None = None


@dataclass(frozen=True)
class Source:
    """A video file, a sequence of pictures or a live camera.

    Attributes
    ----------
    name : path, pattern or number of the camera
    kind : "video", "pictures" or "live"
    size : width and height [px]
    rate : frames per second, 0 where it is unknown
    count : number of frames, where that is known
    files : of a sequence of pictures
    grid : whether frames are evenly spaced at the rate, though their time stamps are rounded
    """

    name: str
    kind: str
    size: tuple[int, int]
    rate: float
    count: int | None
    files: tuple[str, ...] = ()
    grid: bool = False

    def frames(self, buffers: int = 0) -> Iterator[Frame]:
        """The frames, one after the other.

        buffers : number of pictures that a video reuses in turn: each is valid until so many later
            ones have come. By default each is new, which takes time.

        Raises
        ------
        InputError
            Where a video ends before its last frame, or pictures differ in size.
        """
        if self.kind == "pictures":
            return self._pictures()
        return self._live() if self.kind == "live" else self._video(buffers)

    def _video(self, buffers: int) -> Iterator[Frame]:
        capture = cv2.VideoCapture(self.name)
        width, height = self.size
        pool = [np.empty((height, width, 3), dtype=np.uint8) for _ in range(buffers)]
        read = 0
        try:
            while True:
                there, image = capture.read(pool[read % buffers]) if pool else capture.read()
                if not there:
                    break
                stamp = capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
                even = round(stamp * self.rate) / self.rate if self.grid else stamp
                if abs(even - stamp) <= 0.5001 * _TICK:  # containers round stamps
                    stamp = even
                yield Frame(stamp, np.asarray(image, dtype=np.uint8))
                read += 1
        finally:
            capture.release()
        if self.count is not None and read < self.count:
            raise InputError(
                f"{self.name} ends after {read} of {self.count} frames: it is cut off or damaged; "
                "copy it again, or cut it there with a video editor"
            )

    def _pictures(self) -> Iterator[Frame]:
        for k, file in enumerate(self.files):
            image = cv2.imread(file)
            if image is None:
                raise InputError(f"{file} is no picture; delete it or name others")
            if image.shape[1::-1] != self.size:
                raise InputError(
                    f"{file} has {image.shape[1]} x {image.shape[0]} pixels and the first picture "
                    f"{self.size[0]} x {self.size[1]}; all must have the same size"
                )
            yield Frame(k / self.rate, np.asarray(image, dtype=np.uint8))

    def _live(self) -> Iterator[Frame]:
        capture = cv2.VideoCapture(int(self.name))
        begin = time.monotonic()
        try:
            while True:
                there, image = capture.read()
                if not there:
                    return
                yield Frame(time.monotonic() - begin, np.asarray(image, dtype=np.uint8))
        finally:
            capture.release()


def open_source(what: str, rate: float | None = None) -> Source:
    """Source of a name: a file, a folder or pattern of pictures, or the number of a camera.

    Parameters
    ----------
    what : str
    rate : float, optional
        Frames per second of pictures, which have no time stamps.

    Raises
    ------
    InputError
        Where there is nothing, or it cannot be read as pictures.
    """
    if what.isdigit():
        return _camera(what)
    path = regular_file(Path(what))
    if path.is_dir():
        files = [str(p) for p in sorted(path.iterdir()) if p.suffix.lower() in _PICTURES]
        return _sequence(what, files, rate)
    if glob.has_magic(what):
        return _sequence(what, sorted(glob.glob(what)), rate)
    if not path.is_file():
        raise InputError(f"{what}: no such file; name a video, a folder of pictures or a camera")
    if path.suffix.lower() in _PICTURES:
        return _sequence(what, [what], rate or 1.0)
    return _file(what)


def _file(what: str) -> Source:
    with _opened(what, cv2.CAP_FFMPEG) as (capture, there):
        size, rate, count = _properties(capture)
        interval = _frame_interval(capture)
    if not there:
        raise InputError(f"{what} is no video that can be read, or has lost its end; name another")
    # variable rates are stated as the resolution of the stamps
    grid = 0 < rate < _MAX_RATE and abs(interval * rate - 1) < 0.05
    return Source(what, "video", size, rate if grid else 1 / interval, count or None, (), grid)


def _camera(what: str) -> Source:
    with _opened(int(what), cv2.CAP_ANY) as (capture, there):
        size, rate, _ = _properties(capture)
    if not there:
        raise InputError(f"camera {what} gives no pictures; name another number or a video file")
    return Source(what, "live", size, rate, None)


@contextmanager
def _opened(what: Any, backend: int) -> Iterator[tuple[Any, bool]]:
    """A capture, and whether it gives a picture; OpenCV writes no messages of its own meanwhile."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    capture = cv2.VideoCapture(what, backend)
    try:
        yield capture, capture.isOpened() and capture.grab()
    finally:
        capture.release()
        cv2.utils.logging.setLogLevel(level)


def _frame_interval(capture: Any) -> float:
    """Mean time [s] between the first frames."""
    stamps = [capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3]
    while len(stamps) < _FIRST and capture.grab():
        stamps.append(capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3)
    gaps = np.diff(stamps)
    return float(np.mean(gaps)) if len(gaps) and np.mean(gaps) > 0 else 1 / 30


def _properties(capture: Any) -> tuple[tuple[int, int], float, int]:
    get = capture.get
    size = int(get(cv2.CAP_PROP_FRAME_WIDTH)), int(get(cv2.CAP_PROP_FRAME_HEIGHT))
    return size, float(get(cv2.CAP_PROP_FPS)), int(get(cv2.CAP_PROP_FRAME_COUNT))


def _sequence(what: str, files: list[str], rate: float | None) -> Source:
    if not files:
        raise InputError(f"{what}: no pictures there ({', '.join(_PICTURES)}); name another folder")
    if rate is None:
        raise InputError(f"{what}: pictures have no times; add rate = ... to [camera] of the rig")
    for file in files:
        regular_file(Path(file))
    first = cv2.imread(files[0])
    if first is None:
        raise InputError(f"{files[0]} is no picture; delete it or name others")
    return Source(
        what, "pictures", (first.shape[1], first.shape[0]), rate, len(files), tuple(files)
    )


# --- Written --------------------------------------------------------------------------------------


@contextmanager
def video_file(
    path: Path, codec: str, rate: float, size: tuple[int, int], options: Sequence[int] = ()
) -> Iterator[cv2.VideoWriter]:
    """A writer of a QuickTime or MPEG-4 file, which has its name once it is whole.

    codec : four letters; rate : frames per second; size : width, height [px]; options : of OpenCV
    """
    with written_beside(path) as beside:
        code = cv2.VideoWriter.fourcc(*codec)
        writer = cv2.VideoWriter(str(beside), cv2.CAP_FFMPEG, code, rate, size, options)
        try:
            if not writer.isOpened():
                raise InputError(f"{path} cannot be written as a video; name another .mp4 or .mov")
            yield writer
        finally:
            writer.release()
        if "moov" not in boxes(beside):
            raise InputError(
                f"{path}: cannot be written as a whole: make room, or choose another place"
            )


def boxes(path: Path) -> list[str]:
    """Kinds of the boxes that a QuickTime or MPEG-4 file is made of, none where one is cut off."""
    size, kinds, at = path.stat().st_size, [], 0
    with path.open("rb") as file:
        while at < size:
            file.seek(at)
            head = file.read(16)
            length = int.from_bytes(head[:4], "big")
            length = int.from_bytes(head[8:], "big") if length == 1 else length
            if length < 8 or at + length > size:
                return []
            kinds.append(head[4:8].decode("latin-1"))
            at += length
    return kinds
