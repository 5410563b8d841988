"""Motions that torque signals make, and their expected information: covariances of a fit to them.

With e the one-step residual, linear in friction and base parameters, A its Jacobian, and D the
derivatives of the sum of A'e by the angles y, through the smoother, whose noise is sigma,

    H = sum A'A        V = sigma^2 D D' + F        covariance = H^-1 V H^-1

F is the variance of the stiction mask: noise decides which rows near the velocity threshold count,
and there e is large, for the smoother rounds the corner of a reversal. Without F a search finds
motions that hardly exceed the threshold, whose friction is known half as well as promised. All sums
add up over recordings. This is the scatter of a fit by the integral recipe, not the Cramer-Rao
bound: its residuals are correlated, and it does not weight them [Walter1997].
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array, lil_array
from scipy.stats import norm

from frictionid.arrays import Array
from frictionid.data.integrals import averages
from frictionid.data.kalman import even_series, likeliest_jerk_ratio, rts_smoother
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import States
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.dynamics.step_size import StepSize
from frictionid.fitting.one_step.residual import (
    Problem,
    one_step_problem,
    stiction_mask,
    stiction_projector,
)
from frictionid.friction import Friction, along
from frictionid.mechanics import Plant
from frictionid.mechanics.plant import momentum_balance

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
    """The response at the ends of a longer recording, its middle row between them."""
    size = len(response)
    half = size // 2
    out = lil_array((samples, samples))
    for i in range(samples):
        row = min(i, half) if i < samples - half else size - (samples - i)
        out[i, i - row : i - row + size] = response[row]
    return out.tocsr()


_SINGULAR = 1e-9  # smallest eigenvalue of a correlation matrix that differs from zero
_STEP = 1e-6  # [rad], [rad/s]


class Information(NamedTuple):
    """Sums H and V, (..., P, P), of recordings; parameters are friction, joint by joint, then p."""

    H: Array
    V: Array

    def pick(self, index: Array | slice) -> "Information":
        """Sums of one recording, or of some."""
        return Information(*(x[..., index, :, :] for x in self))


def covariances(information: Information) -> Array:
    """Covariance (..., P, P) of the parameters, infinite where H is singular."""
    H, V = information
    scale = np.sqrt(np.einsum("...ii->...i", H))
    scale = np.where(scale > 0, scale, 1.0)
    both = scale[..., :, None] * scale[..., None, :]
    values, vectors = np.linalg.eigh(H / both)
    singular = (values[..., :1] < _SINGULAR)[..., None]
    safe = np.where(values < _SINGULAR, 1.0, values)
    inverse_H = (vectors / safe[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    out = inverse_H @ (V / both) @ inverse_H / both
    return np.where(singular, np.diag(np.full(H.shape[-1], np.inf)), out)


def expected_information(experiment: Experiment, motions: Motions, seed: int) -> Information:
    """H and V (L, N, P, P) of N signals at L friction scales.

    The seed is that of one draw of noise by which the smoother's jerk ratio is found.
    """
    images, L, N, n = motions.q.shape
    dt, noise = 1.0 / experiment.camera_rate, experiment.noise
    draw = np.random.default_rng(seed).normal(0.0, noise, (images, 1, 1, n))
    decades = jerk_decades(motions.q + draw, dt)
    q, w = smoothed_states(motions.q, decades, dt)
    smoothed = motions._replace(q=q, w=w)
    parts = [
        _sensitivities(Concatenated.at_level(experiment, smoothed, level)) for level in range(L)
    ]
    H, by_state, by_mask = (np.concatenate(x) for x in zip(*parts, strict=True))
    V = np.zeros_like(H)
    decades = decades.reshape(L * N, n)
    speed = np.abs(np.moveaxis(w, 0, 2).reshape(L * N, images, n))
    margin = speed - experiment.velocity_threshold
    for j in range(n):
        for decade in np.unique(decades[:, j]):
            alike = decades[:, j] == decade
            gains = smoother_gains(images, dt, float(decade))
            V[alike] += noise[j] ** 2 * _noise_variance(by_state[alike, ..., j], gains)
            sigma = noise[j] * np.sqrt(gains[1].power(2).sum(axis=1))
            V[alike] += _mask_variance(by_mask[alike, ..., j], margin[alike, :, j] / sigma)
    P = H.shape[-1]
    return Information(H.reshape(L, N, P, P), V.reshape(L, N, P, P))


def _noise_variance(by_state: Array, gains: tuple[Any, Any]) -> Array:
    """D D' (C, P, P) of unit noise of a joint's angles.

    by_state (C, 2, P, T + 1) : derivatives of the sum of A'e by its smoothed angles and velocities
    """
    C, _, P, samples = by_state.shape
    by_quantity = np.swapaxes(by_state, 0, 1).reshape(2, C * P, samples)
    total: Any = sum(x @ gain for x, gain in zip(by_quantity, gains, strict=True))
    D = total.reshape(C, P, samples)
    return D @ np.swapaxes(D, -1, -2)


def _mask_variance(change: Array, margin: Array) -> Array:
    """Variance (C, P, P) of sums of changes (C, P, T + 1) that occur or not, independently.

    margin (C, T + 1) : speed above the velocity threshold, in standard deviations
    """
    probability = norm.cdf(margin)
    D = change * np.sqrt(probability * (1 - probability))[:, None]
    return D @ np.swapaxes(D, -1, -2)


@dataclass(frozen=True, eq=False)
class Concatenated:
    """Motions of N signals at one friction scale as one recording, so that one call serves all.

    friction ; plant : with one batch entry ; recording : N (T + 1) samples ; count : N
    velocity_threshold (n,) [rad/s] : of the stiction mask
    """

    friction: Friction
    plant: Plant
    recording: Recording
    w: Array
    count: int
    velocity_threshold: Array

    @staticmethod
    def at_level(experiment: Experiment, motions: Motions, level: int) -> "Concatenated":
        """Motions at one of the friction scales."""

        def flat(x: Array) -> Array:
            return np.swapaxes(x, 0, 1).reshape(-1, x.shape[-1])

        q, w = flat(motions.q[:, level]), flat(motions.w[:, level])
        u = flat(np.concatenate([motions.u, motions.u[-1:]]))
        time = np.arange(len(q)) / experiment.camera_rate
        recording = Recording("expected", Signal(time, q), Signal(time, u, hold="previous"))
        scale, friction = experiment.friction_scales[level], experiment.friction
        return Concatenated(
            Friction(friction.law, scale * friction.theta),
            experiment.plant[None],
            recording,
            w,
            motions.q.shape[2],
            experiment.velocity_threshold,
        )

    @property
    def q(self) -> Array:
        """Angles (N (T + 1), n)."""
        return self.recording.angle.value

    @cached_property
    def problem(self) -> Problem:
        """One-step problem of the motions."""
        return self.problem_at(self.q, self.w)

    def problem_at(self, q: Array, w: Array) -> Problem:
        """One-step problem of other angles and velocities."""
        states = States(self.recording.angle.time, q, w)
        return one_step_problem("integral", self.plant, (self.recording,), (states,))

    @cached_property
    def mask(self) -> Array:
        """Stiction mask (K, n) of a fit."""
        return stiction_mask(self.problem, self.velocity_threshold)

    @cached_property
    def projector(self) -> Array:
        """Projector (K, n, n) of the stiction mask."""
        return stiction_projector(self.problem.G, self.mask)

    @cached_property
    def used(self) -> Array:
        """Intervals (K,) that count: not those between two motions, nor the first of each one."""
        images = len(self.w) // self.count
        out = np.ones(len(self.w), dtype=bool)
        out[0::images] = out[images - 1 :: images] = False
        return out[:-1]


def equations(motions: Concatenated, projector: Array, problem: Problem) -> tuple[Array, Array]:
    """Jacobian A (K, n, P) and A'e (K, P) of a problem along motions, under a stiction mask."""
    e = problem.residual(along(motions.friction, problem.nodes))
    A = [friction_jacobian(motions.friction, problem), base_jacobian(motions.plant[0], problem)]
    A = projector @ np.concatenate(A, axis=-1)
    return A, (A * e[..., None]).sum(-2)


def friction_jacobian(friction: Friction, problem: Problem) -> Array:
    """de/dtheta (K, n, n P), joint by joint."""
    gradient = friction.law.gradient(friction.theta, problem.nodes.inputs)  # (S, n, P)
    S, n, P = gradient.shape
    mean = problem.mean(gradient.reshape(S, n * P)).reshape(-1, n, P)
    return -(problem.G[..., None] * mean[:, None]).reshape(len(mean), n, n * P)


def base_jacobian(plant: Plant, problem: Problem) -> Array:
    """de/dp (K, n, nb), where e = 0: the momentum balance of unit base parameters."""
    x, nb = problem.nodes.inputs, plant.p.shape[-1]
    terms = plant.mechanism.terms(np.eye(nb)[:, None], x.q, x.w)
    start, end, force = (np.moveaxis(t, 0, -1) for t in momentum_balance(terms, problem.stencil))
    dt = problem.dt[:, None, None]
    return problem.G / dt @ (start - end + force * dt)


def _sensitivities(motions: Concatenated) -> tuple[Array, Array, Array]:
    """H (N, P, P) of each signal, and changes of its sum of A'e by each sample.

    By angles and velocities derivatives (N, 2, P, T + 1, n), by the stiction mask differences
    (N, P, T + 1, n).
    """
    A, gradient = equations(motions, motions.projector, motions.problem)
    A = A[motions.used].reshape(motions.count, -1, *A.shape[1:])
    by_state = [_by_sample(motions, x) for x in _state_derivatives(motions, gradient)]
    by_mask = _by_sample(motions, _mask_changes(motions, gradient))
    return np.einsum("ckip,ckiq->cpq", A, A), np.stack(by_state, axis=1), by_mask


def _by_sample(motions: Concatenated, ends: Array) -> Array:
    """Changes (N, P, T + 1, n) by each sample, from those by the ends of intervals (2, K, P, n)."""
    out = np.zeros((len(motions.w), *ends.shape[2:]))
    out[:-1] += ends[0] * motions.used[:, None, None]
    out[1:] += ends[1] * motions.used[:, None, None]
    return np.moveaxis(out.reshape(motions.count, -1, *ends.shape[2:]), 1, 2)


def _state_derivatives(motions: Concatenated, gradient: Array) -> Array:
    """Derivatives of A'e by q or w at the start or end of each interval, (2, 2, K, P, n).

    gradient : A'e (K, P). A changes as well, which counts where the smoother has bent the motion
    and e is not zero. Every other sample is shifted, so that one difference serves all intervals.
    """
    n = motions.q.shape[-1]
    out = np.zeros((2, 2, *gradient.shape, n))
    even = np.arange(len(motions.q)) % 2 == 0
    for parity, what, j in product((True, False), (0, 1), range(n)):
        shift = np.zeros((2, *motions.q.shape))
        shift[what, even == parity, j] = _STEP
        shifted = motions.problem_at(motions.q + shift[0], motions.w + shift[1])
        change = (equations(motions, motions.projector, shifted)[1] - gradient) / _STEP
        starts = even[:-1] == parity
        out[what, 0, starts, :, j] = change[starts]
        out[what, 1, ~starts, :, j] = change[~starts]
    return out


def _mask_changes(motions: Concatenated, gradient: Array) -> Array:
    """Change of A'e (2, K, P, n) if a joint were masked, or not, at an interval's start or end.

    Zero where its other end is below the threshold or reversed: then it is masked anyway.
    """
    w, n = motions.w, motions.w.shape[1]
    direction = np.sign(w)
    moving = np.where(np.abs(w) >= motions.velocity_threshold, direction, 0.0)
    start = (moving[1:] != 0) & (moving[1:] == direction[:-1])
    end = (moving[:-1] != 0) & (moving[:-1] == direction[1:])
    out = np.zeros((2, *gradient.shape, n))
    for j in range(n):
        mask = motions.mask.copy()
        mask[:, j] = ~mask[:, j]
        projector = stiction_projector(motions.problem.G, mask)
        change = equations(motions, projector, motions.problem)[1] - gradient
        out[0, ..., j] = change * start[:, j, None]
        out[1, ..., j] = change * end[:, j, None]
    return out
