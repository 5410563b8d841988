"""Predicted motions of torque signals, by the physics step, all signals at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.integrals import averages
from frictionid.data.signals import Signal
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.dynamics.step import adaptive_step
from frictionid.dynamics.step_size import StepSize
from frictionid.excitation.experiment import Experiment
from frictionid.friction import Friction

MARGIN = 0.95  # of a limit: the machine will not move exactly as predicted
# Substeps of an interval in the search: a quarter of the cost, some mrad off after seconds.
QUICK = StepSize(2, 3)


class Motions(NamedTuple):
    """Motions at the camera's times for L friction scales and N signals.

    q, w (T + 1, L, N, n); u (T, N, n) mean torque of each interval.
    """

    q: Array
    w: Array
    u: Array

    def pick(self, index: Array) -> Motions:
        """Motions of some of the signals."""
        return Motions(self.q[:, :, index], self.w[:, :, index], self.u[:, index])

    def within(self, experiment: Experiment) -> Array:
        """Whether each signal keeps the limits, with a margin, at all friction scales, (N,)."""
        limits = experiment.limits
        with np.errstate(invalid="ignore"):  # a motion that diverged keeps no limit
            slow = np.abs(self.w) <= MARGIN * limits.velocity
            near = (np.abs(self.q) <= MARGIN * limits.angle) & np.isfinite(self.q)
        return np.asarray((slow & near).all(axis=(0, 1, 3)))


def predict_motions(
    experiment: Experiment, torque: Array, start: Array, *, quick: bool = False
) -> Motions:
    """Motions under commands (K + 1, N, n) from start angles (N, n), at rest.

    `quick` takes few substeps, accurate enough for a search.
    """
    images = experiment.images
    flat = Signal(experiment.commands, torque.reshape(len(torque), -1), hold="previous")
    u = averages(flat, images).reshape(len(images) - 1, *torque.shape[1:])
    theta = np.multiply.outer(np.array(experiment.friction_scales), experiment.friction.theta)
    friction = Friction(experiment.friction.law, theta[:, None])
    state, dt = State(start, 0.0 * start), np.diff(images)
    if quick:
        return Motions(*_few_substeps(experiment, friction, state, u, dt), u)
    out = rollout(experiment.plant, friction, state, u, dt)
    return Motions(out.q, out.w, u)


def _few_substeps(
    experiment: Experiment, friction: Friction, state: State, u: Array, dt: Array
) -> tuple[Array, Array]:
    """Angles and velocities (T + 1, L, N, n); anything after a divergence."""
    shape = (len(experiment.friction_scales), *state.q.shape)
    state = State(np.broadcast_to(state.q, shape), np.broadcast_to(state.w, shape))
    q, w = [state.q], [state.w]
    with np.errstate(all="ignore"):
        for k, long in enumerate(dt[:, None]):
            state = adaptive_step(experiment.plant, friction, state, u[k], long, QUICK)
            q.append(state.q)
            w.append(state.w)
    return np.array(q), np.array(w)
