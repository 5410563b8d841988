"""A progress bar for long work."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from frictionid.cli.quiet import is_quiet


@contextmanager
def counted(total: int, title: str) -> Iterator[Callable[[str], None]]:
    """A bar of `total` steps; call what it gives with the name of each finished step."""
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("[dim]{task.fields[last]}"),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal or is_quiet()) as bar:
        task = bar.add_task(escape(title), total=total, last="")
        yield lambda name: bar.update(task, advance=1, last=escape(name))
