"""The option --quiet, which may stand anywhere: nothing is printed but errors."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout

QUIET = ("--quiet", "-q")


class _Nowhere(io.StringIO):
    """Output that is dropped."""


def is_quiet() -> bool:
    """Whether nothing is printed but errors."""
    return isinstance(sys.stdout, _Nowhere)


@contextmanager
def without_quiet(words: Sequence[str]) -> Iterator[list[str]]:
    """Arguments of the command line without --quiet; where it was among them, output is dropped."""
    rest = [word for word in words if word not in QUIET]
    if len(rest) == len(words):
        yield rest
        return
    with redirect_stdout(_Nowhere()):
        yield rest
