"""The suggestion: signals, the motion they are expected to make, and what it will tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from frictionid.arrays import Array
from frictionid.excitation.experiment import Experiment
from frictionid.excitation.monte_carlo import Repeated, repeated
from frictionid.excitation.motion import Motions, moved
from frictionid.excitation.search import Search, best
from frictionid.excitation.signals import Waves

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

    Measured against plain sines of the same length at the torque limit, on an acrobot with four
    recordings of 5 s: at 1.125, 1.5 and 2 Hz the standard errors of friction are at most 0.48 of
    theirs, and the same at the resonance, 1.25 Hz, but for Coulomb friction of the joint without
    motor, which with free inertia is known to 0.60 of theirs (0.37 with known inertia). A sine at
    the resonance swings that joint about as far and as often as the motor can.
    """
    x, values = best(waves, search, done)
    torque, start = waves.torque(x), waves.start(x)
    levels = replace(waves.experiment, levels=(1.0, *OTHERS))
    motions = moved(levels, torque, start)
    guess, others = motions.at(slice(0, 1)), motions.at(slice(1, None))
    many = repeated(replace(levels, levels=(1.0,)), guess, search.seed)
    return Advice(waves, search, x, torque, start, guess, many, others, values)
