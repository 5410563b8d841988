"""Video files, written as a whole or not at all.

The encoder says nothing of a full disk: what it has written is read again.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from frictionid.errors import InputError, needs
from frictionid.files import written_beside

with needs("camera"):
    import cv2


class VideoFormat(NamedTuple):
    """Four letters of the codec, frames per second, (width, height) [px], options of OpenCV."""

    codec: str
    rate: float
    size: tuple[int, int]
    options: tuple[int, ...] = ()


@contextmanager
def video_file(path: Path, form: VideoFormat) -> Iterator[cv2.VideoWriter]:
    """A writer of a QuickTime or MPEG-4 file, which has its name once it is whole.

    Raises
    ------
    InputError
        Where it cannot be written, as on a full disk.
    """
    with written_beside(path) as beside:
        code = cv2.VideoWriter.fourcc(*form.codec)
        writer = cv2.VideoWriter(
            str(beside), cv2.CAP_FFMPEG, code, form.rate, form.size, form.options
        )
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
