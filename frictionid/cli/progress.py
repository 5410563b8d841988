"""What a command shows: a progress bar, nothing with --quiet, advice after Ctrl-C."""

import io
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import typer

from frictionid.progress import Done, compiling, listening

QUIET = ("--quiet", "-q")
COMPILING = "compiling, once on this machine"


_NOWHERE = io.StringIO()  # output that is dropped


def is_quiet() -> bool:
    """Whether nothing is printed but errors."""
    return sys.stdout is _NOWHERE


@contextmanager
def without_quiet(words: Sequence[str]) -> Iterator[list[str]]:
    """Arguments of the command line without --quiet; where it was among them, output is dropped."""
    rest = [word for word in words if word not in QUIET]
    if len(rest) == len(words):
        yield rest
        return
    with redirect_stdout(_NOWHERE):
        yield rest


def show(
    text: object, document: Mapping[str, Any], written: Iterable[Path | None] = (), *, json: bool
) -> None:
    """Print a result and the files that were written: in words, or with `json` all its numbers."""
    from frictionid.files import json_text

    paths = [path for path in written if path is not None]
    if json:
        print(json_text({**document, **({"written": paths} if paths else {})}), end="")
        return
    for line in (str(text), *(f"written to {path}" for path in paths)):
        if line:
            print(line)


@contextmanager
def interruptible(advice: str) -> Iterator[None]:
    """Work that Ctrl-C ends with one line of advice and exit status 130."""
    try:
        yield
    except KeyboardInterrupt:
        typer.echo(f"frictionid: interrupted; {advice}", err=True)
        raise typer.Exit(130) from None


@contextmanager
def counted(total: int, title: str, first: str = "") -> Iterator[Done]:
    """A bar of `total` steps; call what it gives after each step, with what stands behind the bar.

    first : what stands there before
    """
    with _bar(total, title, first) as (bar, task):
        yield lambda name: bar.update(task, advance=1, last=_plain(name))


@contextmanager
def heard(title: str) -> Iterator[None]:
    """A bar of the steps that the work inside reports, see `frictionid.progress`."""
    with _bar(None, title, "") as (bar, task):

        def step(what: str, left: int) -> None:
            done = bar.tasks[0].completed + 1
            bar.update(task, completed=done, total=done + left, last=_plain(what))

        with listening(step):
            yield


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(text)


@contextmanager
def _bar(total: int | None, title: str, first: str) -> Iterator[tuple[Any, Any]]:
    from rich.console import Console
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
        task = bar.add_task(_plain(title), total=total, last=_plain(first))
        with compiling(lambda what: bar.update(task, last=f"{COMPILING}: {_plain(what)}")):
            yield bar, task


@contextmanager
def said_once() -> Iterator[None]:
    """A line on a terminal where loops are compiled while no bar is shown."""
    said = False

    def say(_: str) -> None:
        nonlocal said
        if not said and sys.stderr.isatty() and not is_quiet():
            typer.echo(f"{COMPILING} (frictionid warm does it ahead) ...", err=True)
        said = True

    with compiling(say):
        yield


@contextmanager
def running(names: Sequence[str], title: str, jobs: int = 1) -> Iterator[Done]:
    """A bar that shows what runs; call what it gives with the name of each finished step.

    Where no terminal shows it, each finished step is a line.

    names : of all steps, in the order in which they begin, `jobs` at a time
    """
    left = list(names)

    def now() -> str:
        return ", ".join(left[:jobs])

    with counted(len(left), title, now()) as count:

        def done(name: str) -> None:
            left.remove(name)
            count(now())
            if len(names) > 1 and not (sys.stderr.isatty() or is_quiet()):
                typer.echo(f"{len(names) - len(left)} of {len(names)} done: {name}", err=True)

        yield done
