"""What fits of the planned recordings would scatter by: measured many times over in simulation.

The information of `information` is that of one bandwidth of the smoother and of small noise. Here
each repetition has noise of its own, finds its own bandwidth, and leaves open what seems to rest in
it. The deviation of a fit, by one Gauss-Newton step from the truth, is -H^-1 sum A'e.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.excitation.experiment import Experiment
from frictionid.excitation.information import Glued, equations, used_rows
from frictionid.excitation.motion import Motions
from frictionid.excitation.smoothing import jerk_ratio, seen

DRAWS = 80  # a standard deviation is then known to 8 %


class Repeated(NamedTuple):
    """Deviations of fits from the truth: alone (D, F) of friction, free (D, P) also of p."""

    alone: Array
    free: Array

    def errors(self, *, inertia: bool) -> Array:
        """Standard errors of friction (F,), with `inertia` of friction and base parameters (P,)."""
        return np.std(self.free if inertia else self.alone, axis=0, ddof=1)

    def bias(self, *, inertia: bool) -> Array:
        """Mean deviations: what the smoother bends, whatever the noise."""
        out: Array = (self.free if inertia else self.alone).mean(axis=0)
        return out


def repeated(experiment: Experiment, motions: Motions, seed: int, draws: int = DRAWS) -> Repeated:
    """Deviations of fits to `draws` noisy repetitions of N recordings, all fitted together.

    motions : at the guessed friction (L = 1)
    """
    images, _, N, n = motions.q.shape
    dt = 1.0 / experiment.camera_rate
    noise = np.random.default_rng(seed).normal(0.0, experiment.angle_noise, (images, draws, N, n))
    noisy = motions.q + noise
    q, w = seen(noisy, jerk_ratio(noisy, np.zeros(1), dt), dt)
    H, g = [], []
    for d in range(draws):
        glued = Glued.of(experiment, motions._replace(q=q, w=w), d)
        A, left = equations(experiment.friction, glued)
        used = used_rows(N, images)
        A, left = A[used], left[used]
        H.append(np.einsum("kip,kiq->pq", A, A))
        g.append(left.sum(0))
    count = experiment.friction.theta.size
    both = np.array(H), np.array(g)
    return Repeated(_fitted(both[0][:, :count, :count], both[1][:, :count]), _fitted(*both))


def _fitted(H: Array, g: Array) -> Array:
    """-H^-1 g (D, P); infinite where nothing is seen of some parameter."""
    scale = np.sqrt(np.einsum("dii->di", H))
    if not np.all(scale > 0):
        return np.full(g.shape, np.inf)
    scaled = H / (scale[:, :, None] * scale[:, None, :])
    out: Array = -np.linalg.solve(scaled, (g / scale)[..., None])[..., 0] / scale
    return out
