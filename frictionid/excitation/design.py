"""Design of an experiment: torque signals, the motion they should make, and what it identifies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.excitation.experiment import Experiment
from frictionid.excitation.information import Concatenated, equations
from frictionid.excitation.motion import Motions, jerk_decades, predict_motions, smoothed_states
from frictionid.excitation.search import Search, search_signals
from frictionid.excitation.signals import SignalSpace

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


OTHER_SCALES = (0.5, 2.0)  # of the prior friction, at which the signals are simulated as well


@dataclass(frozen=True)
class Design:
    """Torque signals to apply, and what is expected of them.

    space, search : settings of the design
    x (R, size) : the signals; torque (K + 1, R, n) [N m] and start angles (R, n) that they mean
    motions, monte_carlo : at the prior friction (L = 1)
    others : the same motions with half and twice that friction (L = 2)
    values : smallest eigenvalue of the scaled information after each stage of the search
    """

    space: SignalSpace
    search: Search
    x: Array
    torque: Array
    start: Array
    motions: Motions
    monte_carlo: MonteCarlo
    others: Motions
    values: Array

    @property
    def experiment(self) -> Experiment:
        """The experiment that the signals are for."""
        return self.space.experiment


def design_signals(
    space: SignalSpace, search: Search, done: Callable[[str], None] = lambda _: None
) -> Design:
    """Best signals of a search, with their expected motion and standard errors.

    `done` is called with a line of text after each stage of the search.

    Measured against plain sines of the same length at the torque limit, on an acrobot with four
    recordings of 5 s: at 1.125, 1.5 and 2 Hz the standard errors of friction are at most 0.48 of
    those of the sine. At the resonance, 1.25 Hz, they are so, too, but for Coulomb friction of the
    joint without motor, 0.60 with free inertia (0.37 with known inertia): there a sine swings that
    joint about as far and as often as the motor can.
    """
    x, values = search_signals(space, search, done)
    torque, start = space.torque(x), space.start(x)
    nominal = replace(space.experiment, friction_scales=(1.0,))
    motions = predict_motions(nominal, torque, start)
    others = predict_motions(replace(nominal, friction_scales=OTHER_SCALES), torque, start)
    repeated = monte_carlo(nominal, motions, search.seed)
    return Design(space, search, x, torque, start, motions, repeated, others, values)
