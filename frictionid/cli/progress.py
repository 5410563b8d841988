"""A progress bar for long work, with the time that is left."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from frictionid.cli.quiet import is_quiet


@contextmanager
def counted(total: int, title: str, first: str = "") -> Iterator[Callable[[str], None]]:
    """A bar of `total` steps; call what it gives after each step, with what stands behind the bar.

    first : what stands there before
    """
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
        task = bar.add_task(escape(title), total=total, last=escape(first))
        yield lambda name: bar.update(task, advance=1, last=escape(name))


@contextmanager
def running(names: Sequence[str], title: str, jobs: int = 1) -> Iterator[Callable[[str], None]]:
    """A bar that shows what runs; call what it gives with the name of each finished step.

    names : of all steps, in the order in which they begin, `jobs` at a time
    """
    left = list(names)

    def now() -> str:
        return ", ".join(left[:jobs])

    with counted(len(left), title, now()) as count:

        def done(name: str) -> None:
            left.remove(name)
            count(now())

        yield done
