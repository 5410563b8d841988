"""Where results are printed, and the same as text or HTML for who shows it himself."""

from __future__ import annotations

import io
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any

WIDTH = 120  # columns, where the output is no terminal

_RECORDER: ContextVar[Any] = ContextVar("recorder", default=None)


def console() -> Any:
    """Where results are printed: in colour in a terminal, as plain text into a pipe."""
    from rich.console import Console

    recorder = _RECORDER.get()
    if recorder is not None:
        return recorder
    out = Console(highlight=False)
    return out if out.is_terminal else Console(highlight=False, width=WIDTH)


def printed(show: Callable[[], object]) -> str:
    r"""What a function that prints results would print, as plain text.

    >>> printed(lambda: console().print("0.1 rad [1]", markup=False))
    '0.1 rad [1]\n'
    """
    recorder = _recorded(show)
    return str(recorder.export_text(styles=False))


def printed_html(show: Callable[[], object]) -> str:
    """The same as HTML, in the colours of a terminal."""
    recorder = _recorded(show)
    style = "white-space:pre;overflow-x:auto;font-family:monospace;line-height:1.25"
    return str(
        recorder.export_html(inline_styles=True, code_format=f'<pre style="{style}">{{code}}</pre>')
    )


def _recorded(show: Callable[[], object]) -> Any:
    from rich.console import Console

    recorder = Console(
        file=io.StringIO(), record=True, width=WIDTH, highlight=False, force_jupyter=False
    )
    token = _RECORDER.set(recorder)
    try:
        show()
    finally:
        _RECORDER.reset(token)
    return recorder
