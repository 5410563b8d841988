"""The suggestion: signals, the motion they are expected to make, and what it will tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.excitation.experiment import Experiment
from frictionid.excitation.information import Expected, covariances, expected
from frictionid.excitation.motion import Motions, moved
from frictionid.excitation.search import Search, best
from frictionid.excitation.waves import Waves

OTHERS = (0.5, 2.0)  # shares of the guessed friction at which the signal is tried as well


@dataclass(frozen=True)
class Advice:
    """Torques to apply, and what is expected of them.

    experiment, waves, search : what was asked for
    x (R, size) : the signals; torque (K + 1, R, n) [N m] and start (R, n) as they say
    motions, expected : at the guessed friction (L = 1)
    others : the same motions with half and twice that friction (L = 2)
    values : smallest eigenvalue of the scaled information after each stage of the search
    """

    waves: Waves
    search: Search
    x: Array
    torque: Array
    start: Array
    motions: Motions
    expected: Expected
    others: Motions
    values: Array

    @property
    def experiment(self) -> Experiment:
        """The experiment that was planned."""
        return self.waves.experiment

    def errors(self, *, inertia: bool) -> Array:
        """Expected standard errors of friction, with `inertia` of friction and base parameters."""
        count = self.experiment.friction.theta.size
        return standard_errors(self.expected, slice(None if inertia else count))


def standard_errors(each: Expected, part: slice = slice(None)) -> Array:
    """Standard errors (P,) by all recordings of `each` (1, R, P, P) together."""
    total = Expected(*(x[0].sum(0) for x in each))
    return np.sqrt(np.diagonal(covariances(total, part)))


def advise(waves: Waves, search: Search, done: Callable[[str], None] = lambda _: None) -> Advice:
    """Best signals of a search, with their expected motion and standard errors."""
    x, values = best(waves, search, done)
    torque, start = waves.torque(x), waves.start(x)
    levels = replace(waves.experiment, levels=(1.0, *OTHERS))
    motions = moved(levels, torque, start)
    guess, others = motions.at(slice(0, 1)), motions.at(slice(1, None))
    each = expected(replace(levels, levels=(1.0,)), guess, search.seed)
    return Advice(waves, search, x, torque, start, guess, each, others, values)
