"""Times of sides in alternation, so that other work on the machine disturbs all of them alike."""

from __future__ import annotations

import math
import resource
import subprocess
import sys
import time
from functools import cache
from typing import NamedTuple

import numpy as np
from case import Case, Part, Side

_SHORTEST = 0.05  # [s]: shorter runs are repeated within a measurement


class Spent(NamedTuple):
    """Time [s] of processors, those of ended child processes included, and on the wall."""

    processor: float
    wall: float


class Times(NamedTuple):
    """A side's times in all rounds, of the whole work; the first call is round 0."""

    spent: tuple[Spent, ...]
    imports: Spent
    error: float


class Row(NamedTuple):
    """What was measured of a case.

    ratios : in each round, the peer's time over ours; of repeated work all but the first
    by_processor : median of the ratios of processor times, whatever the case's clock
    ours, peer : median time [s]; first : time [s] of our first call beyond that; imports : [s] ours
    ours_error, peer_error : NaN where there is none
    """

    case: Case
    ratios: np.ndarray
    by_processor: float
    ours: float
    peer: float
    first: float
    imports: float
    ours_error: float
    peer_error: float

    @property
    def ratio(self) -> float:
        """Median of the ratios."""
        return float(np.median(self.ratios))

    @property
    def holds(self) -> bool | None:
        """Whether ratio and error are as asked for; None where nothing is."""
        case = self.case
        if case.bar is None and case.error_bar is None:
            return None
        right = case.error_bar is None or self.ours_error <= case.error_bar * self.peer_error
        return right and (case.bar is None or self.ratio >= case.bar)


def used() -> Spent:
    """Time up to now, of which differences tell."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    own = time.process_time() + children.ru_utime + children.ru_stime
    return Spent(own, time.perf_counter())


def since(begin: Spent, number: int = 1) -> Spent:
    """Time since then, of one of a number of equal runs."""
    return Spent(*((b - a) / number for a, b in zip(begin, used(), strict=True)))


@cache
def time_of_imports(modules: tuple[str, ...]) -> Spent:
    """Time that a fresh process takes to import modules, beyond that of Python's own start."""

    def started(code: str) -> Spent:
        begin = used()
        subprocess.run([sys.executable, "-c", code], check=True)
        return since(begin)

    if not modules:
        return Spent(0.0, 0.0)
    code = f"import {', '.join(modules)}"
    started(code)  # files are in memory then
    pairs = [(started(code), started("pass")) for _ in range(3)]
    least = np.min(pairs, axis=0)
    return Spent(*np.maximum(least[0] - least[1], 0.0).tolist())


def measured(part: Part) -> list[Row]:
    """Rows of a part."""
    sides = part.sides
    spent: dict[Side, list[Spent]] = {side: [] for side in sides}
    errors: dict[Side, float] = {}
    for _ in range(part.rounds):
        for side in sides:
            number = _number(spent[side])
            begin = used()
            for _ in range(number):
                errors[side] = side.run()
            spent[side].append(since(begin, number))
    times = {
        side: Times(
            tuple(Spent(*(t / side.share for t in s)) for s in spent[side]),
            time_of_imports(side.imports),
            errors[side],
        )
        for side in sides
    }
    return [_row(case, times[case.ours], times[case.peer]) for case in part.cases]


def _number(before: list[Spent]) -> int:
    least = min((s.wall for s in before), default=_SHORTEST)
    return math.ceil(_SHORTEST / max(least, 1e-6))


def _row(case: Case, ours: Times, peer: Times) -> Row:
    own, others = (np.array([getattr(s, case.clock) for s in t.spent]) for t in (ours, peer))
    later = slice(1 if len(own) > 1 and not case.once else 0, None)
    median = float(np.median(own[later]))
    return Row(
        case,
        _ratios(case, ours, peer, case.clock)[later],
        float(np.median(_ratios(case, ours, peer, "processor")[later])),
        median,
        float(np.median(others[later])),
        max(float(own[0]) - median, 0.0),
        getattr(ours.imports, case.clock),
        ours.error,
        peer.error,
    )


def _ratios(case: Case, ours: Times, peer: Times, clock: str) -> np.ndarray:
    """The peer's time over ours in each round, with the imports where work is done once."""
    own, others = (
        np.array([getattr(s, clock) for s in t.spent]) + case.once * getattr(t.imports, clock)
        for t in (ours, peer)
    )
    return others / own
