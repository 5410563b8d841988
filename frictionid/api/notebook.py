"""Progress below a notebook's cell."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from typing import Any

from frictionid.progress import Done, listening, say_nothing


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
