"""Gauss-Newton on unexplained torques: steps within bounds, Huber weights, noise of each joint.

Minimised is  sum over windows and joints of  huber(e / sigma)^2 + priors.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.fitting.box_qp import bounded
from frictionid.fitting.parameters.parameter_block import Estimate, values_of, with_values
from frictionid.fitting.torque_balance.residual import TorqueProblem
from frictionid.fitting.torque_balance.settings import TorqueSettings

_MAD = 1.4826  # standard deviation over median absolute deviation, of normal noise
_ROUNDS = 4  # of weights
_DAMPING = (1e-10, 1e6)
_TOLERANCE = 1e-3  # [standard errors] of the step with which a round ends


class TorqueSolution(NamedTuple):
    """Where a fit ended.

    estimate; residual (K, n) [N m]; weight (K, n), zero for rows that do not count; sigma (n,)
    [N m]; slopes (K, n, D); free (D,), parameters that are not at a bound; converged; iterations
    """

    estimate: Estimate
    residual: Array
    weight: Array
    sigma: Array
    slopes: Array
    free: Array
    converged: bool
    iterations: int

    @property
    def log_noise(self) -> float:
        """Logarithm of the product of the joints' noise: the less, the better explained."""
        return float(np.log(np.maximum(self.sigma, 1e-300)).sum())


class _State(NamedTuple):
    """A point of the iteration; cost is that under the weights of the round."""

    estimate: Estimate
    residual: Array
    cost: float
    damping: float


def solve(
    problem: TorqueProblem, estimate: Estimate, use: Array, settings: TorqueSettings
) -> TorqueSolution:
    """The free parameters that explain the torques best.

    use : (K,) true for the windows that may be used
    """
    counts = use[:, None] & problem.balance.slides
    residual = problem.residual(estimate)
    iterations, converged = 0, False
    for _ in range(_ROUNDS):
        sigma, weight = _weights(residual, counts, settings.huber)
        state = _State(estimate, residual, _cost(problem, estimate, residual, weight, sigma), 1e-6)
        for _ in range(settings.iterations):
            state, converged = _next(problem, state, weight, sigma)
            iterations += 1
            if converged:
                break
        estimate, residual = state.estimate, state.residual
    sigma, weight = _weights(residual, counts, settings.huber)
    values, (low, high) = values_of(estimate, problem.blocks), _bounds(problem)
    free = (values > low) & (values < high)
    slopes = problem.slopes(estimate)
    return TorqueSolution(estimate, residual, weight, sigma, slopes, free, converged, iterations)


def _weights(residual: Array, counts: Array, clip: float) -> tuple[Array, Array]:
    """Noise (n,) of the joints' torques, and Huber's weights (K, n) of what counts [Huber1964]."""
    size = np.where(counts, np.abs(residual), np.nan)
    known = counts.any(axis=0)
    sigma = np.ones(residual.shape[1])
    sigma[known] = _MAD * np.nanmedian(size[:, known], axis=0)
    sigma = np.maximum(sigma, 1e-12 * max(float(np.nanmax(size, initial=0.0)), 1e-300))
    ratio = np.abs(residual) / (clip * sigma)
    return sigma, np.where(counts, 1.0 / np.maximum(ratio, 1.0), 0.0)


def _bounds(problem: TorqueProblem) -> tuple[Array, Array]:
    p = problem.parameters
    return np.array([one.low for one in p]), np.array([one.high for one in p])


def _cost(
    problem: TorqueProblem, estimate: Estimate, residual: Array, weight: Array, sigma: Array
) -> float:
    off = values_of(estimate, problem.blocks) - problem.prior_mean
    fit = float((weight * (residual / sigma) ** 2).sum())
    return fit + float(problem.prior_precision @ off**2)


def normal_equations(
    slopes: Array, residual: Array, weight: Array, sigma: Array
) -> tuple[Array, Array]:
    """H (D, D) and descent g (D,) of the unexplained torques, in units of their noise."""
    J = slopes / sigma[:, None]
    weighted = (weight[..., None] * J).reshape(-1, J.shape[-1])
    flat = J.reshape(-1, J.shape[-1])
    return weighted.T @ flat, -(weighted.T @ (residual / sigma).ravel())


def _next(
    problem: TorqueProblem, state: _State, weight: Array, sigma: Array
) -> tuple[_State, bool]:
    """The state after a damped step where that lowers the cost, and whether it has converged."""
    H, g = normal_equations(problem.slopes(state.estimate), state.residual, weight, sigma)
    values, (low, high) = values_of(state.estimate, problem.blocks), _bounds(problem)
    H = H + np.diag(problem.prior_precision)
    g = g + problem.prior_precision * (problem.prior_mean - values)
    scale = np.sqrt(np.where(np.diag(H) > 0, np.diag(H), 1.0))
    A = H / np.outer(scale, scale)
    while True:
        damped = A + state.damping * np.eye(len(A))
        ends = ((low - values) * scale)[None], ((high - values) * scale)[None]
        step = bounded(damped[None], (g / scale)[None], *ends)[0] / scale
        small = float(np.abs(step * scale).max(initial=0.0)) < _TOLERANCE
        after = with_values(state.estimate, problem.blocks, np.clip(values + step, low, high))
        residual = problem.residual(after)
        cost = _cost(problem, after, residual, weight, sigma)
        if cost < state.cost:
            return _State(after, residual, cost, max(state.damping * 0.1, _DAMPING[0])), small
        if small or state.damping >= _DAMPING[1]:
            return state, small
        state = state._replace(damping=state.damping * 10.0)
