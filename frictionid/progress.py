"""Progress of long work: what runs and how many steps are left, for whoever listens."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

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
