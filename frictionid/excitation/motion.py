"""Motion that signals are expected to make: the physics step, all of them side by side."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.excitation.experiment import Experiment
from frictionid.friction import Friction
from frictionid.rollout import rollout
from frictionid.signals import Signal, averages
from frictionid.step import State

MARGIN = 0.95  # of a limit: the machine will not move exactly as the guess
# [rad/s], wider smoothing than the fit's, because substeps are dear: friction below 0.2 rad/s is
# not read anyway, and the step holds joints at rest by itself.
FINE, COARSE = 0.05, 0.1


class Motions(NamedTuple):
    """Motions at the camera's times for L levels of friction and N signals, at each level's guess.

    q, w (T + 1, L, N, n); u (T, N, n) mean torque of each interval.
    """

    q: Array
    w: Array
    u: Array

    def pick(self, index: Array) -> Motions:
        """Motions of some of the signals."""
        return Motions(self.q[:, :, index], self.w[:, :, index], self.u[:, index])

    def at(self, levels: slice) -> Motions:
        """Motions at some of the levels."""
        return Motions(self.q[:, levels], self.w[:, levels], self.u)

    def within(self, experiment: Experiment) -> Array:
        """Whether each signal's motion keeps the limits, with a margin, at all levels, (N,)."""
        limits = experiment.limits
        with np.errstate(invalid="ignore"):  # a motion that diverged keeps no limit
            slow = np.abs(self.w) <= MARGIN * limits.velocity
            near = (np.abs(self.q) <= MARGIN * limits.angle) & np.isfinite(self.q)
        return (slow & near).all(axis=(0, 1, 3))


def moved(experiment: Experiment, torque: Array, start: Array, *, width: float = FINE) -> Motions:
    """Motions under commands (K + 1, N, n) from start angles (N, n), at rest.

    `width` [rad/s] is that of the friction's smoothing.
    """
    images = experiment.images
    flat = Signal(experiment.commands, torque.reshape(len(torque), -1), hold="previous")
    u = averages(flat, images).reshape(len(images) - 1, *torque.shape[1:])
    theta = np.multiply.outer(np.array(experiment.levels), experiment.friction.theta)
    friction = Friction(replace(experiment.friction.law, width=width), theta[:, None])
    out = rollout(experiment.plant, friction, State(start, 0.0 * start), u, np.diff(images))
    return Motions(out.q, out.w, u)
