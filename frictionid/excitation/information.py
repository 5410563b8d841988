"""What recordings will tell: the expected covariance of least squares on the momentum balance.

With e the one-step residual, linear in friction and base parameters phi, A = de/dphi, and D the
derivatives of the sum of A'e by the angles y, through the smoother, whose noise is sigma,

    H = sum A'A        V = sigma^2 D D' + F        covariance = H^-1 V H^-1

F comes from joints near the velocity below which their friction is left open: noise decides which
rows count, and there e is large, for the smoother rounds the corner of a reversal. Without F a
search finds motions that hardly leave that velocity, whose friction is known half as well as
promised. All sums add up over recordings. It is what a fit by the integral recipe scatters by, not
a bound: its residuals are correlated, and it does not weight them [Walter1997].
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from frictionid.arrays import Array, inverse
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal
from frictionid.data.states import States
from frictionid.excitation.experiment import Experiment
from frictionid.excitation.motion import Motions
from frictionid.excitation.smoothing import gains, jerk_ratio, seen
from frictionid.friction import Friction, along
from frictionid.identifiers.formulation import INTEGRAL
from frictionid.identifiers.residual import Problem, integral_problem
from frictionid.mechanics import Plant
from frictionid.mechanics.momentum_balance import momentum_balance

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


def standard_errors(each: Expected, part: slice = slice(None)) -> Array:
    """Standard errors (P,) by all recordings of `each` (1, R, P, P) together."""
    total = Expected(*(x[0].sum(0) for x in each))
    return np.sqrt(np.diagonal(covariances(total, part)))


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
    H, reach, switched = (np.concatenate(x) for x in zip(*parts, strict=True))
    V = np.zeros_like(H)
    flat = decades.reshape(L * N, n)
    speed = np.abs(np.moveaxis(w, 0, 2).reshape(L * N, images, n))
    for j in range(n):
        for decade in np.unique(flat[:, j]):
            own = flat[:, j] == decade
            gain = gains(images, dt, float(decade))
            V[own] += experiment.angle_noise**2 * _through(reach[own, ..., j], gain)
            sigma = experiment.angle_noise * np.sqrt(gain[1].power(2).sum(axis=1))
            V[own] += _at_random(switched[own, ..., j], (speed[own, :, j] - INTEGRAL.rest) / sigma)
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


def _at_random(change: Array, margin: Array) -> Array:
    """Variance (C, P, P) of sums of changes (C, P, T + 1) that happen or not, each by itself.

    margin (C, T + 1) : of the velocity above the one that decides, in standard deviations
    """
    share = norm.cdf(margin)
    D = change * np.sqrt(share * (1 - share))[:, None]
    return np.asarray(D @ np.swapaxes(D, -1, -2))


def _one_level(experiment: Experiment, motions: Motions, level: int) -> tuple[Array, Array, Array]:
    """H (N, P, P), and changes of A'e at one level by q and w, and by rest, of each sample.

    The first are derivatives (N, 2, P, T + 1, n), the others differences (N, P, T + 1, n). The
    motions are glued to one recording, so that one call serves all.
    """
    images, _, N, n = motions.q.shape
    theta = experiment.levels[level] * experiment.friction.theta
    friction = Friction(experiment.friction.law, theta)
    glued = Glued.of(experiment, motions, level)
    still = resting(glued)
    part = open_part(glued.problem(glued.q, glued.w).G, still)
    A, now = _rows(friction, glued, glued.q, glued.w, part)
    used = used_rows(N, images)
    A = A[used].reshape(N, -1, *A.shape[1:])

    def by_sample(ends: Array) -> Array:
        """Changes of each interval by its ends (2, K, P, n), summed for each sample."""
        out = np.zeros((N * images, *ends.shape[2:]))
        out[:-1] += ends[0] * used[:, None, None]
        out[1:] += ends[1] * used[:, None, None]
        return np.moveaxis(out.reshape(N, images, *ends.shape[2:]), 1, 2)

    reach = np.stack([by_sample(x) for x in state_part(friction, glued, now, part)], axis=1)
    switched = by_sample(_switched(friction, glued, still, now))
    return np.einsum("ckip,ckiq->cpq", A, A), reach, switched


def used_rows(N: int, images: int) -> Array:
    """Which intervals of glued motions count, (N images - 1,).

    Not those between two motions, nor each first one, which the recipe does not use either.
    """
    used = np.ones(N * images, dtype=bool)
    used[0::images] = used[images - 1 :: images] = False
    return used[:-1]


class Glued(NamedTuple):
    """Motions of one level, one behind the other as one recording, (N (T + 1), n)."""

    plant: Plant
    recording: Recording
    q: Array
    w: Array

    @staticmethod
    def of(experiment: Experiment, motions: Motions, level: int) -> Glued:
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
        return Glued(one, recording, q, w)

    def problem(self, q: Array, w: Array) -> Problem:
        states = States(self.recording.angle.time, q, w)
        return integral_problem(self.plant, (self.recording,), (states,))


def equations(friction: Friction, glued: Glued) -> tuple[Array, Array]:
    """A (K, n, P) and A'e (K, P) of glued motions, blind where a joint rests."""
    part = open_part(glued.problem(glued.q, glued.w).G, resting(glued))
    return _rows(friction, glued, glued.q, glued.w, part)


def resting(glued: Glued) -> Array:
    """Intervals (K, n) in which a fit leaves the friction of a joint open, as in `sliding`."""
    problem = glued.problem(glued.q, glued.w)
    w = problem.nodes.inputs.w[problem.stencil]
    turns = (w > 0).any(1) & (w < 0).any(1)
    return np.asarray(turns | (np.abs(w) < INTEGRAL.rest).any(1))


def open_part(G: Array, still: Array) -> Array:
    """What is left of e (K, n, n) where the friction of joints (K, n) is open, as in `sliding`."""
    out = np.broadcast_to(np.eye(G.shape[-1]), G.shape).copy()
    rows = still.any(1)
    G, still = G[rows], still[rows]
    blind = G * still[:, None, :]
    project = np.eye(G.shape[-1]) - blind @ np.linalg.pinv(blind, rcond=1e-9)
    out[rows] = ((project @ G) * ~still[:, None, :]) @ inverse(G)
    return out


def _rows(friction: Friction, glued: Glued, q: Array, w: Array, part: Array) -> tuple[Array, Array]:
    problem = glued.problem(q, w)
    e = problem.residual(along(friction, problem.nodes))
    A = [friction_part(friction, problem), base_part(glued.plant[0], problem)]
    A = part @ np.concatenate(A, axis=-1)
    return A, (A * e[..., None]).sum(-2)


def _switched(friction: Friction, glued: Glued, still: Array, now: Array) -> Array:
    """Change of A'e (2, K, P, n) if a joint came to rest, or moved, at an interval's start or end.

    None where its other end rests or moves the other way, for then it is open anyway.
    """
    problem, n = glued.problem(glued.q, glued.w), still.shape[1]
    moves = np.where(np.abs(glued.w) >= INTEGRAL.rest, np.sign(glued.w), 0.0)
    side = np.sign(glued.w)
    start = (moves[1:] != 0) & (moves[1:] == side[:-1])
    end = (moves[:-1] != 0) & (moves[:-1] == side[1:])
    out = np.zeros((2, *now.shape, n))
    for j in range(n):
        other = still.copy()
        other[:, j] = ~other[:, j]
        _, near = _rows(friction, glued, glued.q, glued.w, open_part(problem.G, other))
        for which, decides in enumerate((start[:, j], end[:, j])):
            out[which, ..., j] = (near - now) * decides[:, None]
    return out


def state_part(friction: Friction, glued: Glued, now: Array, part: Array) -> Array:
    """Derivatives of A'e by q or w at the start or end of each interval, (2, 2, K, P, n).

    `now` is A'e (K, P). A changes as well, which counts where the smoother has bent the motion and
    e is not zero. Every other sample is shifted, so that one difference serves all intervals.
    """
    n = glued.q.shape[-1]
    out = np.zeros((2, 2, *now.shape, n))
    even = np.arange(len(glued.q)) % 2 == 0
    for parity, what, j in product((True, False), (0, 1), range(n)):
        shift = np.zeros((2, *glued.q.shape))
        shift[what, even == parity, j] = _SHIFT
        _, near = _rows(friction, glued, glued.q + shift[0], glued.w + shift[1], part)
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
    start, end, force = (np.moveaxis(x, 0, -1) for x in momentum_balance(terms, problem.stencil))
    dt = problem.dt[:, None, None]
    return problem.G / dt @ (start - end + force * dt)
