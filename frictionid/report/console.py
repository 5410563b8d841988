"""Where results are printed, the same as text or HTML, and the descriptions of kinds."""

import io
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from frictionid.comparison.kind_descriptions import Entry, KindDescription

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


def say(*parts: Any) -> None:
    """Print texts, which a terminal wraps between words, and tables, whose lines stay whole."""
    out = console()
    for part in parts:
        wraps = out.is_terminal and isinstance(part, str)
        out.print(part, markup=False, soft_wrap=not wraps)


def printed(show: Callable[[], object]) -> str:
    r"""What a function that prints results would print, as plain text.

    >>> printed(lambda: say("0.1 rad [1]"))
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


class Shown(ABC):
    """A result that prints itself, at the prompt and in a notebook."""

    @abstractmethod
    def show(self) -> None:
        """Print it."""

    def __repr__(self) -> str:
        return printed(self.show).rstrip("\n")

    def _repr_html_(self) -> str:
        return printed_html(self.show)


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


def show_kinds(kinds: "Sequence[KindDescription]", hint: str) -> None:
    """Print each kind with the names and units of its parameters, and how to see `hint`."""
    for kind in kinds:
        console().print(kind.name, style="bold", markup=False)
        say(f"  {kind.summary}")
        if kind.parameters:
            names = ", ".join(f"{p.name} [{p.unit}]" for p in kind.parameters)
            say(f"  parameters: {names}")
        elif kind.settings:
            say(f"  settings: {', '.join(setting.name for setting in kind.settings)}")
    say(f"\n{hint}")


def show_kind(kind: "KindDescription") -> None:
    """Print all of a kind: what it is, its parameters and its settings."""
    out = console()
    out.print(kind.name, style="bold", markup=False)
    for paragraph in filter(None, (kind.summary, *kind.details)):
        say(f"{paragraph}\n")
    for title, entries in (
        ("parameter", kind.parameters),
        ("setting", kind.settings),
        ("base parameter: what motion identifies", kind.base),
    ):
        if entries:
            out.print(_table(title, entries))


def _table(title: str, entries: "Sequence[Entry]") -> object:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, padding=(0, 1), title_justify="left")
    columns = {
        title: [entry.name for entry in entries],
        "default": [entry.default for entry in entries],
        "unit": [entry.unit for entry in entries],
        "meaning": [entry.meaning for entry in entries],
    }
    shown = {name: cells for name, cells in columns.items() if any(cells)}
    for name in shown:
        table.add_column(name, header_style="bold")
    for cells in zip(*shown.values(), strict=True):
        table.add_row(*map(Text, cells))
    return table
