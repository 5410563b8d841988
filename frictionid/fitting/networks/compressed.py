"""Static networks by Levenberg-Marquardt on compressed squares: all folds at once, in seconds.

A law that depends on its joint's velocity alone sees the rows only through its torques at some
eighty speeds, in a hat basis (see `compressed_problem`). Its weights have a normal prior about
their initial values, whose deviation is chosen by recordings held out inside each fold. The maximum
of the posterior solves equations that are as small as there are speeds [MacKay1992].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field
from scipy.sparse import csr_array, diags_array, hstack

from frictionid.arrays import Array
from frictionid.config import Count, NotNegative, Positive, check_settings
from frictionid.errors import InputError
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.networks.training import (
    Share,
    friction_scales,
    held_out,
    member_seeds,
)
from frictionid.fitting.one_step.residual import Problem
from frictionid.fitting.one_step.row_weights import normalised
from frictionid.friction import Friction, Inputs, Law, at_rest
from frictionid.friction.laws.ensemble import together
from frictionid.friction.laws.network_law import NetworkLaw, is_learned
from frictionid.friction.smooth_sign import smooth_sign

_FINE = 30.0  # how much closer nodes stand at rest than at the highest speed


class Compressed(NamedTuple):
    """Squares of each fold: A (F, N, N), b (F, N) and c (F,), with N = n V.

    speeds (n, V) [rad/s]: the velocities of each joint at which its torques stand, negative ones
    first; both directions have a node at rest. rows (F,): how many rows have a weight.
    """

    A: Array
    b: Array
    c: Array
    speeds: Array
    rows: Array

    def cost(self, torque: Array) -> Array:
        """Weighted squares [rad^2/s^2] of torques (..., F, n, V), shape (..., F)."""
        T = torque.reshape(*torque.shape[:-2], -1)
        return self.c + ((self.times(T) - 2 * self.b) * T).sum(-1)

    def without(self, part: Compressed) -> Compressed:
        """Squares of the rows that are in none of a part of them."""
        A, b, c = self.A - part.A, self.b - part.b, self.c - part.c
        return Compressed(A, b, c, self.speeds, self.rows - part.rows)

    def times(self, T: Array) -> Array:
        """Product A T for T (..., F, N)."""
        return (self.A @ T[..., None])[..., 0]


def node_speeds(problem: Problem, weights: Array, count: int) -> Array:
    """Velocities (n, 2 count) from the fastest negative to the fastest positive of each joint.

    Of the rows with a weight (K,).
    """
    highest = np.abs(problem.nodes.inputs.w[problem.stencil[weights > 0]]).max(axis=(0, 1))
    share = np.expm1(np.linspace(0.0, 1.0, count) * np.log1p(_FINE)) / _FINE
    speeds = np.maximum(highest, 1e-3)[:, None] * share
    return np.concatenate([-speeds[:, ::-1], speeds], axis=1)


def compressed(
    problem: Problem, weights: Array, speeds: Array, width: float, shape: str
) -> Compressed:
    """Squares of the rows under weights (F, K), for torques at node velocities (n, V).

    width, shape : smoothing of sgn(w), which stays exact between the nodes
    """
    n, V = speeds.shape
    means = [_means(problem, j, speeds[j], width, shape) for j in range(n)]
    A, b = np.zeros((len(weights), n * V, n * V)), np.zeros((len(weights), n * V))
    for i in range(n):
        columns = hstack([diags_array(problem.G[:, i, j]) @ means[j] for j in range(n)], "csr")
        for f, weight in enumerate(weights):
            weighted = (diags_array(weight) @ columns).T
            A[f] += (weighted @ columns).toarray()
            b[f] += weighted @ problem.r[:, i]
    c = np.einsum("fk,ki->f", weights, problem.r**2)
    return Compressed(A, b, c, speeds, (weights > 0).sum(axis=1) * 1.0)


def _means(problem: Problem, joint: int, speeds: Array, width: float, shape: str) -> Any:
    """Share (K, V) of the torque at each node speed in the mean friction of each row."""
    basis = _hat_basis(problem.nodes.inputs.w[:, joint], speeds, width, shape)
    parts = zip(problem.coefficients, problem.stencil.T, strict=True)
    return sum(c * basis[index] for c, index in parts)


def _hat_basis(w: Array, speeds: Array, width: float, shape: str) -> Any:
    """Hat functions (S, V) of the node speeds at velocities w (S,), times |sgn(w)| smoothed."""
    half = len(speeds) // 2
    positive = speeds[half:]
    below = np.clip(np.searchsorted(positive, np.abs(w), side="right") - 1, 0, half - 2)
    share = (np.abs(w) - positive[below]) / (positive[below + 1] - positive[below])
    sign = np.abs(smooth_sign(w, width, shape))
    low = np.where(w > 0, half + below, half - 1 - below)
    high = np.where(w > 0, low + 1, low - 1)
    rows = np.tile(np.arange(len(w)), 2)
    values = np.concatenate([(1.0 - share) * sign, share * sign])
    return csr_array((values, (rows, np.concatenate([low, high]))), (len(w), len(speeds)))


_SHARP, _CREEP = 1e-9, 1e-6  # [rad/s]: smoothing that does not show at a speed next to zero
_DAMPING = (1e-8, 1e8)
_RIDGE = 1e-9  # of the mean curvature in the torques

Several = Annotated[int, Field(ge=2)]


@dataclass(frozen=True)
class CompressedNetwork(Identifier):
    """Fits a network of its own joint's velocity, such as `MLP()`.

    nodes : speeds in each direction at which the data are compressed
    prior_deviations : standard deviations of the weights about their initial values, from which
        each fold chooses by the recordings held out in it, a `share` of its weight
    members : networks with other initial weights and other recordings held out; friction is their
        mean
    iterations : steps at most
    tolerance : a fit ends where a step reduces the cost by less, relative

    Raises
    ------
    InputError
        For another kind of law, or settings out of range.
    """

    law: Law
    nodes: Several = 40
    prior_deviations: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.1, 0.3, 1.0)
    share: Share = 0.15
    members: Count = 1
    iterations: Several = 60
    tolerance: NotNegative = 1e-5

    def __post_init__(self) -> None:
        check_settings(self)
        law, reason = self.law, ""
        if not isinstance(law, NetworkLaw) or not law.has_gradient or law.has_memory:
            reason = "is no static network with a gradient"
        elif law.others:
            reason = "sees other joints"
        if reason:
            raise InputError(
                "Levenberg-Marquardt on compressed squares needs a network of its own joint's "
                f'velocity, {law} {reason}: choose solver = "adam"'
            )

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        weights = normalised(weights, problem)
        scales = friction_scales(problem, weights)
        folds = zip(weights[:, None], scales[:, None], strict=True)
        each = [self._fitted(problem, own, scale, seed) for own, scale in folds]
        return together(self.law, [np.concatenate(member) for member in zip(*each, strict=True)])

    def _fitted(self, problem: Problem, weights: Array, scales: Array, seed: int) -> list[Array]:
        """Parameters (1, n, P) of each member of one fold, on speeds of its own."""
        law: Any = self.law
        speeds = node_speeds(problem, weights[0], self.nodes)
        whole = self._compressed(problem, weights, speeds)
        thetas = []
        for own in member_seeds(seed, self.members):
            initial = law.initial_parameters(scales, np.random.default_rng(own))
            deviation = np.full(len(weights), self.prior_deviations[0])
            if len(self.prior_deviations) > 1:
                held = held_out(problem, weights, self.share, own)
                left_out = self._compressed(problem, weights * held, speeds)
                deviation = self._best_deviation(whole.without(left_out), left_out, initial)
            thetas.append(self._posterior_mode(whole, initial, deviation))
        return thetas

    def _compressed(self, problem: Problem, weights: Array, speeds: Array) -> Compressed:
        return compressed(problem, weights, speeds, self.law.width, self.law.shape)

    def _best_deviation(self, training: Compressed, held: Compressed, initial: Array) -> Array:
        """Prior deviation (F,) whose fit to one part of a fold's rows is best on the other."""
        fits = [
            self._posterior_mode(training, initial, np.full(len(initial), deviation))
            for deviation in self.prior_deviations
        ]
        costs = np.stack([held.cost(_torque(self.law, theta, held.speeds)) for theta in fits])
        return np.asarray(self.prior_deviations)[costs.argmin(axis=0)]

    def _posterior_mode(self, squares: Compressed, initial: Array, deviation: Array) -> Array:
        """Parameters (F, n, P) of the highest posterior under a prior deviation (F,)."""
        prior = _Prior(initial, deviation, is_learned(self.law) * 1.0, _precision(squares))
        state = _state(self.law, squares, prior, initial)
        damping, active = np.ones(len(initial)), np.ones(len(initial), dtype=bool)
        for _ in range(self.iterations):
            tried = _state(self.law, squares, prior, _stepped(squares, prior, state, damping))
            better = active & (tried.cost < state.cost)
            gain = np.where(better, 1.0 - tried.cost / state.cost, 0.0)
            damping = np.clip(damping * np.where(better, 0.2, 5.0), *_DAMPING)
            pairs = zip(tried, state, strict=True)
            state = _State(*(_where(better, new, old) for new, old in pairs))
            # each fold stops by itself, so that it is the same alone
            active &= np.where(better, gain >= self.tolerance, damping < _DAMPING[1])
            if not active.any():
                break
        return state.theta


class _Prior(NamedTuple):
    """Normal prior of the parameters, and the precision of the data.

    mean (F, n, P); deviation (F,); learned (P,), whether a parameter changes; precision (F,)
    [s^2/rad^2], number of rows over the variance of the residual
    """

    mean: Array
    deviation: Array
    learned: Array
    precision: Array


class _State(NamedTuple):
    """Parameters (F, n, P), torques (F, n, V) at the node speeds, their Jacobian, and cost (F,).

    jacobian (F, n, V, P) is zero for parameters that are not learned.
    """

    theta: Array
    torque: Array
    jacobian: Array
    cost: Array


def _precision(squares: Compressed) -> Array:
    """Number of rows over the variance (F,) of the residual that no curve explains."""
    N = squares.A.shape[-1]
    curvature = np.einsum("fii->f", squares.A) / N
    damped = squares.A + (_RIDGE * curvature)[:, None, None] * np.eye(N)
    T = np.linalg.solve(damped, squares.b[..., None])[..., 0]
    left = squares.c + ((squares.times(T) - 2 * squares.b) * T).sum(-1)
    return squares.rows * len(squares.speeds) / np.maximum(left, 1e-12 * squares.c)


def _inputs(speeds: Array) -> Inputs:
    """Inputs at the nodes (V, n); the two at rest are each moved a little to their side."""
    half = speeds.shape[1] // 2
    side = np.where(np.arange(2 * half) < half, -1.0, 1.0)
    return at_rest((side * np.maximum(np.abs(speeds), _CREEP)).T)


def _torque(law: Law, theta: Array, speeds: Array) -> Array:
    """Torque (F, n, V) at the nodes."""
    sharp = law.with_width(_SHARP)
    return np.swapaxes(sharp.torque(theta[:, None], _inputs(speeds), ()), 1, 2)


def _state(law: Law, squares: Compressed, prior: _Prior, theta: Array) -> _State:
    torque = _torque(law, theta, squares.speeds)
    gradient = law.with_width(_SHARP).gradient(theta[:, None], _inputs(squares.speeds))
    distance = (theta - prior.mean) / prior.deviation[:, None, None]
    cost = prior.precision * squares.cost(torque) + (distance**2).sum((1, 2))
    return _State(theta, torque, np.swapaxes(gradient, 1, 2) * prior.learned, cost)


def _stepped(squares: Compressed, prior: _Prior, state: _State, damping: Array) -> Array:
    """Parameters (F, n, P) after a damped Gauss-Newton step d.

    With the torques T at the node speeds and their Jacobian J, the prior's h = 1 / deviation^2, the
    precision p and the damping l, the normal equations

        (h (1 + l) I + p J'A J) d = h (mean - theta) + p J'(b - A T)

    are solved for the change u = J d of the torques (Woodbury identity): with s = 1 / (h (1 + l)),
    d0 = s h (mean - theta) and K = s p J J',

        (I + K A) u = J d0 + K (b - A T),   d = d0 + s p J'(b - A T - A u)
    """
    F, n, V, _ = state.jacobian.shape
    h = 1.0 / prior.deviation**2
    s = 1.0 / (h * (1.0 + damping))
    d0 = (prior.mean - state.theta) * (h * s)[:, None, None]
    product = np.zeros((F, n, V, n, V))
    for j in range(n):
        product[:, j, :, j] = state.jacobian[:, j] @ np.swapaxes(state.jacobian[:, j], 1, 2)
    K = product.reshape(F, n * V, n * V) * (prior.precision * s)[:, None, None]
    pull = squares.b - squares.times(state.torque.reshape(F, -1))
    right = (state.jacobian @ d0[..., None])[..., 0].reshape(F, -1) + (K @ pull[..., None])[..., 0]
    u = np.linalg.solve(np.eye(n * V) + K @ squares.A, right[..., None])[..., 0]
    weighted = (pull - squares.times(u)) * (prior.precision * s)[:, None]
    return state.theta + d0 + (weighted.reshape(F, n, 1, V) @ state.jacobian)[:, :, 0]


def _where(folds: Array, yes: Array, no: Array) -> Array:
    return np.where(folds.reshape(-1, *(1,) * (yes.ndim - 1)), yes, no)
