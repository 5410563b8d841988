"""Motions that torque signals make by the physics step, all at once, and their smoothed states."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, lil_array

from frictionid.arrays import Array
from frictionid.data.integrals import averages
from frictionid.data.kalman import even_series, likeliest_jerk_ratio, rts_smoother
from frictionid.data.signals import Signal
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.dynamics.step_size import StepSize
from frictionid.friction import Friction

from .experiment import Experiment

MARGIN = 0.95  # of a limit: the machine will not move exactly as predicted
# Substeps of an interval in the search: a quarter of the cost, some mrad off after seconds.
QUICK = StepSize(2, 4)


class Motions(NamedTuple):
    """Motions at the camera's times for L friction scales and N signals.

    q, w (T + 1, L, N, n); u (T, N, n) mean torque of each interval.
    """

    q: Array
    w: Array
    u: Array

    def pick(self, index: Array) -> "Motions":
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
    state, size = State(start, 0.0 * start), QUICK if quick else None
    out = rollout(experiment.plant, friction, state, u, np.diff(images), step_size=size)
    return Motions(out.q, out.w, u)


_SUPPORT = 60  # samples; a smoothed state depends on those farther away by less than 1e-6
_DECADES = 4  # parts of a decade to which jerk ratios are rounded


def jerk_decades(q: Array, dt: float) -> Array:
    """Decades of the likeliest jerk ratio of noisy angles q (T, ...), (...), rounded to a quarter.

    One series for each entry of the other axes.
    """
    decades = np.log10(likeliest_jerk_ratio(even_series(q.reshape(len(q), -1), dt)))
    return (np.round(_DECADES * decades) / _DECADES).reshape(q.shape[1:])


def smoothed_states(q: Array, decades: Array, dt: float) -> tuple[Array, Array]:
    """Smoothed angles and velocities of angles q (T, ...), by decades of the jerk ratio (...)."""
    out = rts_smoother(even_series(q.reshape(len(q), -1), dt), 10.0 ** decades.ravel())
    return out[:, :, 0].reshape(q.shape), out[:, :, 1].reshape(q.shape)


@lru_cache(maxsize=96)
def smoother_gains(samples: int, dt: float, decade: float) -> tuple[csr_array, csr_array]:
    """Matrices (T, T) from angles to smoothed angles and velocities [1/s].

    >>> angle, velocity = smoother_gains(5, 0.1, 8.0)
    >>> line = np.arange(5) * 0.1
    >>> bool(np.allclose(angle @ line, line)), bool(np.allclose(velocity @ line, 1.0, atol=1e-3))
    (True, True)
    """
    size = min(samples, 2 * _SUPPORT + 1)
    response = rts_smoother(even_series(np.eye(size), dt), np.full(size, 10.0**decade))
    return _banded(response[:, :, 0], samples), _banded(response[:, :, 1], samples)


def _banded(response: Array, samples: int) -> csr_array:
    """The same response at the ends of a longer recording, its middle row between them."""
    size = len(response)
    half = size // 2
    out = lil_array((samples, samples))
    for i in range(samples):
        row = min(i, half) if i < samples - half else size - (samples - i)
        out[i, i - row : i - row + size] = response[row]
    return out.tocsr()
