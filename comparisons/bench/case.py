"""What is measured: two sides that do the same work, and the ratio that is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple


@dataclass(frozen=True, eq=False)
class Side:
    """One way to an answer.

    what : in words, the tool first
    run : does the work once and gives the error of its answer, as `Case.error` says; NaN where
        there is none
    imports : modules that a process imports before, whose time is measured apart
    share : of the whole work that a run does, where the rest takes as long again and again
    """

    what: str
    run: Callable[[], float]
    imports: tuple[str, ...] = ()
    share: float = 1.0


@dataclass(frozen=True, eq=False)
class Case:
    """One row of the table: how many times longer the peer takes than ours.

    error : what the errors of both sides are, with the unit
    bar : least ratio that is asked for, or None
    error_bar : largest ratio of our error to the peer's that is asked for, or None
    once : whether the work is done once, so that imports and the first call count; else they are
        stated apart
    clock : "processor", time of all threads and processes; "wall" where a side uses several cores
    drawn : whether the picture has it
    """

    name: str
    ours: Side
    peer: Side
    error: str = ""
    bar: float | None = None
    error_bar: float | None = None
    once: bool = False
    clock: Literal["processor", "wall"] = "processor"
    drawn: bool = True


class Part(NamedTuple):
    """Cases measured together: in each round, all of their sides in turn; shared sides once."""

    cases: tuple[Case, ...]
    rounds: int

    @property
    def sides(self) -> list[Side]:
        """Sides of all cases, each once."""
        return list(dict.fromkeys(side for c in self.cases for side in (c.ours, c.peer)))


class NotInstalledError(Exception):
    """A peer is not installed; the text says how it is."""
