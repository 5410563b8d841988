"""What recordings will tell: the expected covariance of least squares on the momentum balance.

With e the one-step residual, linear in friction and base parameters phi, A = de/dphi, and angles
of noise sigma that reach e through the smoother, e = E dy,

    H = sum A'A        V = sigma^2 sum (A'E)(A'E)'        covariance = H^-1 V H^-1

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
from frictionid.excitation.smoothing import gains, jerk_ratio
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
    decades = jerk_ratio(motions.q, noise, dt).reshape(L * N, n)
    A, E = _linear(experiment, motions)
    H = np.einsum("ckip,ckiq->cpq", A, A)
    V = np.zeros_like(H)
    for j in range(n):
        reach_q, reach_w = (_reach(A, E[what, ..., j]) for what in (0, 1))
        for decade in np.unique(decades[:, j]):
            own = decades[:, j] == decade
            V[own] += _through(reach_q[own], reach_w[own], gains(images, dt, float(decade)))
    V *= experiment.angle_noise**2
    P = H.shape[-1]
    return Expected(H.reshape(L, N, P, P), V.reshape(L, N, P, P))


def _reach(A: Array, E: Array) -> Array:
    """Sum of A'E at each sample (C, P, T + 1), E (2, C, T, n) for both ends of the intervals."""
    C, T, _, P = A.shape
    out = np.zeros((C, P, T + 1))
    out[:, :, :-1] += np.einsum("ckip,cki->cpk", A, E[0])
    out[:, :, 1:] += np.einsum("ckip,cki->cpk", A, E[1])
    return out


def _through(reach_q: Array, reach_w: Array, gain: tuple[Array, Array]) -> Array:
    """D D' (C, P, P) with D = A'E the reach of each angle's noise through the smoother."""
    C, P, samples = reach_q.shape
    flat = [
        (g.T @ r.reshape(C * P, samples).T).T for g, r in zip(gain, (reach_q, reach_w), strict=True)
    ]
    D = (flat[0] + flat[1]).reshape(C, P, samples)
    return D @ np.swapaxes(D, -1, -2)


def _linear(experiment: Experiment, motions: Motions) -> tuple[Array, Array]:
    """A (C, T, n, P) and derivatives of e (2, 2, C, T, n, n) by q or w at both ends; C = L N."""
    levels = range(len(experiment.levels))
    A, E = zip(*(_one_level(experiment, motions, level) for level in levels), strict=True)
    return np.concatenate(A), np.concatenate(E, axis=2)


def _one_level(experiment: Experiment, motions: Motions, level: int) -> tuple[Array, Array]:
    """The same at one level, its motions glued to one recording, so that one call serves all."""
    images, _, N, _ = motions.q.shape
    theta = experiment.levels[level] * experiment.friction.theta
    friction = Friction(experiment.friction.law, theta)
    glued = _Glued.of(experiment, motions, level)
    problem = glued.problem(glued.q, glued.w)
    open_ = sliding(problem, INTEGRAL.rest).G @ inverse(problem.G)  # blind where a joint rests
    parts = [friction_part(friction, problem), base_part(experiment.plant, problem)]
    A = _cut(open_ @ np.concatenate(parts, axis=-1), images, N, axis=0)
    # the integral recipe does not use the first interval either
    A[:, 0] = 0.0
    E = np.einsum("kil,abklj->abkij", open_, state_part(friction, glued, problem))
    return A, _cut(E, images, N, axis=2)


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


def state_part(friction: Friction, glued: _Glued, problem: Problem) -> Array:
    """Derivatives of e by q or w at the start or end of each interval, (2, 2, K, n, n).

    Every other sample is shifted, so that one difference serves all intervals.
    """
    n = glued.q.shape[-1]
    e = problem.residual(along(friction, problem.nodes))
    E = np.zeros((2, 2, len(e), n, n))
    even = np.arange(len(glued.q)) % 2 == 0
    for parity, what, j in product((True, False), (0, 1), range(n)):
        shift = np.zeros((2, *glued.q.shape))
        shift[what, even == parity, j] = _SHIFT
        near = glued.problem(glued.q + shift[0], glued.w + shift[1])
        change = (near.residual(along(friction, near.nodes)) - e) / _SHIFT
        starts = even[:-1] == parity
        E[what, 0, starts, :, j] = change[starts]
        E[what, 1, ~starts, :, j] = change[~starts]
    return E


def _cut(values: Array, images: int, count: int, axis: int) -> Array:
    """Rows of glued motions as (..., N, T, ...), without those between two motions."""
    values = np.moveaxis(values, axis, 0)
    last = np.zeros_like(values[:1])
    rows = np.concatenate([values, last]).reshape(count, images, *values.shape[1:])[:, :-1]
    return np.moveaxis(rows, (0, 1), (axis, axis + 1))


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
