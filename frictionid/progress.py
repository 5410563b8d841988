"""Progress of long work: what runs and how many steps are left, for whoever listens."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from html import escape
from typing import Any

Done = Callable[[str], None]  # called with the name of each step that is finished
Listener = Callable[[str, int], None]

_LISTENER: ContextVar[Listener | None] = ContextVar("listener", default=None)
_COMPILING: ContextVar[Done | None] = ContextVar("compiling", default=None)


def say_nothing(_: object) -> None:
    """What is called with each step where nobody asks."""


def report_compiling(what: str) -> None:
    """Say that a loop is compiled now, which happens once on a machine."""
    heard = _COMPILING.get()
    if heard is not None:
        heard(what)


@contextmanager
def compiling(heard: Done) -> Iterator[None]:
    """A context in which it is heard what is compiled.

    >>> names = []
    >>> with compiling(names.append):
    ...     report_compiling("rollout")
    >>> names
    ['rollout']
    """
    token = _COMPILING.set(heard)
    try:
        yield
    finally:
        _COMPILING.reset(token)


def report_step(what: str, left: int) -> None:
    """Say that a step is done, of what, and that at most so many are left.

    >>> heard = []
    >>> with listening(lambda what, left: heard.append((what, left))):
    ...     report_step("fit", 3)
    >>> report_step("fit", 2)
    >>> heard
    [('fit', 3)]
    """
    listener = _LISTENER.get()
    if listener is not None:
        listener(what, left)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """A context in which the steps of long work are heard."""
    token = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(token)


def _in_notebook() -> bool:
    """Whether a notebook runs this, which can show HTML and change it."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


@contextmanager
def counted(total: int | None, title: str, heard: Done = say_nothing) -> Iterator[Done]:
    """A bar of `total` steps below the cell; call what it gives with what each step was.

    Without a total it counts the steps that the work inside reports. It is gone in the end. Outside
    of notebooks nothing is shown. `heard` is called with each step, too.
    """
    if not _in_notebook():
        yield heard
        return
    from IPython.display import HTML, display

    shown: Any = display(HTML(bar(title, 0, total, "")), display_id=True)
    done = 0

    def step(what: str, left: int | None = None) -> None:
        nonlocal done
        done += 1
        heard(what)
        shown.update(HTML(bar(title, done, total if left is None else done + left, what)))

    try:
        if total is None:
            with listening(step):
                yield step
        else:
            yield step
    finally:
        shown.update(HTML(""))


def bar(title: str, done: int, total: int | None, what: str) -> str:
    """HTML of a bar.

    >>> bar("fit", 1, 3, "stribeck")
    '<progress value="1" max="3"></progress> fit 1 of 3, stribeck'
    """
    size = f' value="{done}" max="{total}"' if total else ""
    count = f" {done} of {total}" if total else ""
    return f"<progress{size}></progress> {escape(title)}{count}{', ' * bool(what)}{escape(what)}"
