"""Scatter of fits of the designed recordings, by simulated repetitions.

`information` uses one bandwidth of the smoother and small noise. Here each repetition has noise, a
bandwidth and a stiction mask of its own. The deviation of a fit, by one Gauss-Newton step from the
truth, is -H^-1 sum A'e.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.excitation.experiment import Experiment
from frictionid.excitation.information import Concatenated, equations
from frictionid.excitation.motion import Motions
from frictionid.excitation.smoothing import jerk_decades, smoothed_states

DRAWS = 80  # a standard deviation is then known to 8 %


class MonteCarlo(NamedTuple):
    """Deviations of D fits from the truth: of friction alone (D, F), and with free p (D, P)."""

    friction: Array
    everything: Array

    def errors(self, *, inertia: bool) -> Array:
        """Standard errors of friction (F,), with `inertia` of friction and base parameters (P,)."""
        return np.std(self.everything if inertia else self.friction, axis=0, ddof=1)

    def bias(self, *, inertia: bool) -> Array:
        """Mean deviations: the error of smoothing, whatever the noise."""
        out: Array = (self.everything if inertia else self.friction).mean(axis=0)
        return out


def monte_carlo(
    experiment: Experiment, motions: Motions, seed: int, draws: int = DRAWS
) -> MonteCarlo:
    """Deviations of fits to `draws` noisy repetitions of N recordings, all fitted together.

    motions : at the prior friction (L = 1)
    """
    images, _, N, n = motions.q.shape
    dt = 1.0 / experiment.camera_rate
    noise = np.random.default_rng(seed).normal(0.0, experiment.noise, (images, draws, N, n))
    q, w = smoothed_states(motions.q + noise, jerk_decades(motions.q + noise, dt), dt)
    H, g = [], []
    for d in range(draws):
        one = motions._replace(q=q[:, d : d + 1], w=w[:, d : d + 1])
        fit = Concatenated.of(experiment, one, 0)
        A, gradient = equations(fit, fit.projector, fit.problem)
        A = A[fit.used]
        H.append(np.einsum("kip,kiq->pq", A, A))
        g.append(gradient[fit.used].sum(0))
    count = experiment.friction.theta.size
    both = np.array(H), np.array(g)
    return MonteCarlo(_fitted(both[0][:, :count, :count], both[1][:, :count]), _fitted(*both))


def _fitted(H: Array, g: Array) -> Array:
    """-H^-1 g (D, P); infinite where some parameter has no effect."""
    scale = np.sqrt(np.einsum("dii->di", H))
    if not np.all(scale > 0):
        return np.full(g.shape, np.inf)
    scaled = H / (scale[:, :, None] * scale[:, None, :])
    out: Array = -np.linalg.solve(scaled, (g / scale)[..., None])[..., 0] / scale
    return out
