"""Matplotlib figures in our styles, whatever the user's settings are."""

import io
import warnings
from base64 import b64encode
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

WIDTH = 7.2  # [inch], both columns of a journal's page
_DPI = 110  # of what a notebook shows
# Okabe and Ito's colours, distinct with any colour vision; without yellow, too pale on white
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def drawing() -> AbstractContextManager[Any]:
    """A context in which pictures have our styles, whatever the user's settings; these stay."""
    import matplotlib.style

    return matplotlib.style.context(["default", Path(__file__).with_suffix(".mplstyle")])


def figure(height: float, width: float = WIDTH) -> Any:
    """An empty figure as wide as a page, sizes in inches; a notebook shows it as PNG.

    It belongs to no window and no list of figures.
    """
    from matplotlib.figure import Figure

    picture: Any = Figure(figsize=(width, height), layout="constrained")
    picture._repr_png_ = partial(_png, picture)
    return picture


def _png(picture: Any) -> bytes:
    stream = io.BytesIO()
    picture.savefig(stream, format="png", dpi=_DPI)
    return stream.getvalue()


def drawn(draw: Callable[[], Any]) -> Any:
    """The figure that a function draws, in our styles; later settings do not change it."""
    with drawing():
        picture = draw()
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=r"Glyph .* missing")
            picture.draw_without_rendering()  # ticks are made here, in the styles of this moment
    return picture


def as_html(picture: Any) -> str:
    """A figure as an element of HTML."""
    return f'<img src="data:image/png;base64,{b64encode(picture._repr_png_()).decode()}"/>'
