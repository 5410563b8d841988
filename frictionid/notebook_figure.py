"""The figures of frictionid: Matplotlib figures that a notebook shows without pyplot."""

import io

from matplotlib.figure import Figure

DPI = 110  # of what a notebook shows


class NotebookFigure(Figure):
    """A figure that belongs to no window and no list of figures; a notebook shows it as PNG."""

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=DPI)
        return stream.getvalue()
