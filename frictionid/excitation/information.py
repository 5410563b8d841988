"""What recordings will tell: the expected covariance of least squares on the momentum balance.

With e the one-step residual, linear in friction and base parameters phi, A = de/dphi, and D the
derivatives of the sum of A'e by the angles y, through the smoother, whose noise is sigma,

    H = sum A'A        V = sigma^2 D D'        covariance = H^-1 V H^-1

Both sums add up over recordings. It is what a fit by the integral recipe scatters by, not a bound:
its residuals are correlated, and it does not weight them [Walter1997].
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, inverse
from frictionid.excitation.experiment import Experiment
from frictionid.excitation.motion import Motions
from frictionid.excitation.smoothing import gains, jerk_ratio, seen
from frictionid.friction import Friction, along
from frictionid.mechanics import Plant
from frictionid.problem import Problem, integral_problem, sliding
from frictionid.recipe import INTEGRAL
from frictionid.recordings import Recording
from frictionid.signals import Signal
from frictionid.states import States

_BLIND = 1e-9  # smallest eigenvalue of a correlation matrix that is told from zero
_SHIFT = 1e-6  # [rad], [rad/s]


class Expected(NamedTuple):
    """Sums H and V, (..., P, P), of recordings; parameters are friction, joint by joint, then p."""

    H: Array
    V: Array

    def pick(self, index: Array) -> Expected:
        """Sums of one recording, or of some."""
        return Expected(self.H[..., index, :, :], self.V[..., index, :, :])


def covariances(expected: Expected, part: slice = slice(None)) -> Array:
    """Covariance (..., P, P) of those parameters if only they are fitted; infinite where blind."""
    H, V = expected.H[..., part, part], expected.V[..., part, part]
    scale = np.sqrt(np.einsum("...ii->...i", H))
    scale = np.where(scale > 0, scale, 1.0)
    both = scale[..., :, None] * scale[..., None, :]
    values, vectors = np.linalg.eigh(H / both)
    blind = (values[..., :1] < _BLIND)[..., None]
    safe = np.where(values < _BLIND, 1.0, values)
    inverse_H = (vectors / safe[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    out = inverse_H @ (V / both) @ inverse_H / both
    return np.where(blind, np.diag(np.full(H.shape[-1], np.inf)), out)


def expected(experiment: Experiment, motions: Motions, seed: int) -> Expected:
    """H and V (L, N, P, P) of N signals at L levels of friction.

    The seed is that of one draw of noise by which the smoother's jerk ratio is found.
    """
    images, L, N, n = motions.q.shape
    dt = 1.0 / experiment.camera_rate
    noise = np.random.default_rng(seed).normal(0.0, experiment.angle_noise, (images, 1, 1, n))
    decades = jerk_ratio(motions.q, noise, dt)
    q, w = seen(motions.q, decades, dt)
    parts = [_one_level(experiment, motions._replace(q=q, w=w), level) for level in range(L)]
    H, reach = (np.concatenate(x) for x in zip(*parts, strict=True))
    V = np.zeros_like(H)
    flat = decades.reshape(L * N, n)
    for j in range(n):
        for decade in np.unique(flat[:, j]):
            own = flat[:, j] == decade
            V[own] += _through(reach[own, ..., j], gains(images, dt, float(decade)))
    V *= experiment.angle_noise**2
    P = H.shape[-1]
    return Expected(H.reshape(L, N, P, P), V.reshape(L, N, P, P))


def _through(reach: Array, gain: tuple[Array, Array]) -> Array:
    """D D' (C, P, P): what noise of one joint's angles does to the equations, (C, 2, P, T + 1)."""
    C, _, P, samples = reach.shape
    flat = (
        r.reshape(C * P, samples) @ g for g, r in zip(gain, np.swapaxes(reach, 0, 1), strict=True)
    )
    D = sum(flat).reshape(C, P, samples)
    return D @ np.swapaxes(D, -1, -2)


def _one_level(experiment: Experiment, motions: Motions, level: int) -> tuple[Array, Array]:
    """H (N, P, P), and what q and w do to the equations, (N, 2, P, T + 1, n), at one level.

    The motions are glued to one recording, so that one call serves all.
    """
    images, _, N, n = motions.q.shape
    theta = experiment.levels[level] * experiment.friction.theta
    friction = Friction(experiment.friction.law, theta)
    glued = _Glued.of(experiment, motions, level)
    A, _ = _rows(friction, glued, glued.q, glued.w)
    # rows between two motions, and the first interval, which the recipe does not use either
    used = np.ones(N * images, dtype=bool)
    used[0::images] = used[images - 1 :: images] = False
    A = A[used[:-1]].reshape(N, -1, *A.shape[1:])
    change = state_part(friction, glued) * used[:-1, None, None]
    reach = np.zeros((2, N * images, *change.shape[-2:]))
    reach[:, :-1] += change[:, 0]
    reach[:, 1:] += change[:, 1]
    reach = np.moveaxis(reach.reshape(2, N, images, -1, n), (1, 2), (0, 3))
    return np.einsum("ckip,ckiq->cpq", A, A), reach


class _Glued(NamedTuple):
    """Motions of one level, one behind the other as one recording, (N (T + 1), n)."""

    plant: Plant
    recording: Recording
    q: Array
    w: Array

    @staticmethod
    def of(experiment: Experiment, motions: Motions, level: int) -> _Glued:
        def flat(x: Array) -> Array:
            return np.swapaxes(x, 0, 1).reshape(-1, x.shape[-1])

        q, w = flat(motions.q[:, level]), flat(motions.w[:, level])
        u = flat(np.concatenate([motions.u, motions.u[-1:]]))
        time = np.arange(len(q)) / experiment.camera_rate
        recording = Recording("expected", Signal(time, q), Signal(time, u, hold="previous"))
        plant = experiment.plant
        one = Plant(
            plant.mechanism, {k: v[None] for k, v in plant.parameters.items()}, plant.p[None]
        )
        return _Glued(one, recording, q, w)

    def problem(self, q: Array, w: Array) -> Problem:
        states = States(self.recording.angle.time, q, w)
        return integral_problem(self.plant, (self.recording,), (states,))


def _rows(friction: Friction, glued: _Glued, q: Array, w: Array) -> tuple[Array, Array]:
    """A (K, n, P) and A'e (K, P) of glued motions, blind where a joint rests."""
    problem = glued.problem(q, w)
    e = problem.residual(along(friction, problem.nodes))
    open_ = sliding(problem, INTEGRAL.rest).G @ inverse(problem.G)
    A = [friction_part(friction, problem), base_part(glued.plant[0], problem)]
    A = open_ @ np.concatenate(A, axis=-1)
    return A, (A * e[..., None]).sum(-2)


def state_part(friction: Friction, glued: _Glued) -> Array:
    """Derivatives of A'e by q or w at the start or end of each interval, (2, 2, K, P, n).

    A changes as well, which counts where the smoother has bent the motion and e is not zero. Every
    other sample is shifted, so that one difference serves all intervals.
    """
    n = glued.q.shape[-1]
    _, now = _rows(friction, glued, glued.q, glued.w)
    out = np.zeros((2, 2, *now.shape, n))
    even = np.arange(len(glued.q)) % 2 == 0
    for parity, what, j in product((True, False), (0, 1), range(n)):
        shift = np.zeros((2, *glued.q.shape))
        shift[what, even == parity, j] = _SHIFT
        _, near = _rows(friction, glued, glued.q + shift[0], glued.w + shift[1])
        change = (near - now) / _SHIFT
        starts = even[:-1] == parity
        out[what, 0, starts, :, j] = change[starts]
        out[what, 1, ~starts, :, j] = change[~starts]
    return out


def friction_part(friction: Friction, problem: Problem) -> Array:
    """de/dtheta (K, n, n P), joint by joint."""
    gradient = friction.law.gradient(friction.theta, problem.nodes.inputs)  # (S, n, P)
    S, n, P = gradient.shape
    mean = problem.mean(gradient.reshape(S, n * P)).reshape(-1, n, P)
    return -(problem.G[..., None] * mean[:, None]).reshape(len(mean), n, n * P)


def base_part(plant: Plant, problem: Problem) -> Array:
    """de/dp (K, n, nb): the Lagrangian is linear in p, so each one's share is that of p = 1."""
    x = problem.nodes.inputs
    nb = plant.p.shape[-1]
    terms = plant.mechanism.terms(np.eye(nb)[:, None], x.q, x.w)
    force = np.moveaxis(problem.mean(terms.dLdq), 0, -1) * problem.dt[:, None, None]
    momentum = np.moveaxis(terms.momentum, 0, -1)
    first, last = problem.stencil[:, 0], problem.stencil[:, -1]
    return problem.G / problem.dt[:, None, None] @ (momentum[first] - momentum[last] + force)
