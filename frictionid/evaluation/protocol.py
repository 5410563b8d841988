"""What is scored, and where: the same for all identifiers."""

from __future__ import annotations

import math
from dataclasses import dataclass

from frictionid.errors import InputError
from frictionid.evaluation.hysteresis import HysteresisSettings


@dataclass(frozen=True)
class Protocol:
    """Horizons of the rollouts [s], `every` how many seconds one starts, and what comes before.

    history : [s] of each recording before its first score, at least the longest memory
    sample_time : [s] between the samples used, None for all
    whole : whether recordings are also simulated as a whole, from their start, see `free_run`
    initial_states : estimator of the states that rollouts start from, by samples up to there only:
        a kinematic "filter", the same state for all, or each "model" itself, see `state_estimator`
    true_initial_states : whether simulated motion is also predicted from its true states, with
        memories of the true motion before, so that only the model's error remains
    loops : sinusoids of the hysteresis loops, shown of all laws; None: the usual ones, of laws with
        memory only

    >>> Protocol(horizons=(0.5,)).every
    0.25
    """

    horizons: tuple[float, ...] = (0.1, 0.25, 0.5, 1.0)
    every: float = 0.25
    history: float = 0.15
    sample_time: float | None = None
    whole: bool = False
    initial_states: str = "filter"
    true_initial_states: bool = False
    loops: HysteresisSettings | None = None

    def __post_init__(self) -> None:
        if not self.horizons:
            raise InputError("horizons must name at least one time ahead, e.g. [0.5]")
        for horizon in self.horizons:
            _check("horizons", horizon, math.isfinite(horizon) and horizon > 0, "positive seconds")
        _check("every", self.every, math.isfinite(self.every) and self.every > 0, "positive [s]")
        fine = math.isfinite(self.history) and self.history >= 0
        _check("history", self.history, fine, "0 s or more, and finite")
        known = self.initial_states in ("filter", "model")
        _check("initial_states", self.initial_states, known, '"filter" or "model"')
        apart = self.sample_time
        if apart is not None:
            _check("sample_time", apart, math.isfinite(apart) and apart > 0, "positive [s]")


def _check(name: str, value: float | str, fine: bool, rule: str) -> None:
    if not fine:
        raise InputError(f"{name}: {value} must be {rule}")
