"""The suggestion: signals, the motion they are expected to make, and what it will tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from frictionid.arrays import Array
from frictionid.excitation.experiment import Experiment
from frictionid.excitation.motion import Motions, moved
from frictionid.excitation.repeated import Repeated, repeated
from frictionid.excitation.search import Search, best
from frictionid.excitation.waves import Waves

OTHERS = (0.5, 2.0)  # shares of the guessed friction at which the signal is tried as well


@dataclass(frozen=True)
class Advice:
    """Torques to apply, and what is expected of them.

    experiment, waves, search : what was asked for
    x (R, size) : the signals; torque (K + 1, R, n) [N m] and start (R, n) as they say
    motions, repeated : at the guessed friction (L = 1)
    others : the same motions with half and twice that friction (L = 2)
    values : smallest eigenvalue of the scaled information after each stage of the search
    """

    waves: Waves
    search: Search
    x: Array
    torque: Array
    start: Array
    motions: Motions
    repeated: Repeated
    others: Motions
    values: Array

    @property
    def experiment(self) -> Experiment:
        """The experiment that was planned."""
        return self.waves.experiment


def advise(waves: Waves, search: Search, done: Callable[[str], None] = lambda _: None) -> Advice:
    """Best signals of a search, with their expected motion and standard errors.

    Measured against plain sines of the same length at the torque limit, 0.5 to 3 Hz, those over the
    limits left out: on a pendulum the standard errors of friction are at most 0.34 of those of any
    of them. With two joints the same holds at most frequencies (at most 0.5), but not at the best:
    near the acrobot's resonance of 1.1 to 1.25 Hz they are 0.3 to 0.7, and for viscous friction of
    a double pendulum near 1 Hz up to 1. There, noise and bias together are 0.1 to 0.6.
    """
    x, values = best(waves, search, done)
    torque, start = waves.torque(x), waves.start(x)
    levels = replace(waves.experiment, levels=(1.0, *OTHERS))
    motions = moved(levels, torque, start)
    guess, others = motions.at(slice(0, 1)), motions.at(slice(1, None))
    many = repeated(replace(levels, levels=(1.0,)), guess, search.seed)
    return Advice(waves, search, x, torque, start, guess, many, others, values)
