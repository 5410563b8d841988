"""Gauss-Newton on unexplained torques: steps within bounds, Huber weights, noise of each joint.

Minimised is  sum over windows and joints of  huber(e / sigma)^2 + priors.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import MAD, Array, stretches
from frictionid.config import Count, Positive, validated
from frictionid.errors import InputError
from frictionid.friction import along
from frictionid.mechanics.rigid_body.rigid_body_tree import (
    WRENCH,
    RigidBodyTree,
    nearest_consistent,
)

from ..gauss_newton import Conditions, minimum
from ..neutral import Unknown
from ..one_step.linearised import Linearised
from ..parameter_block import (
    Estimate,
    FreeBlock,
    FreeParameters,
    ParameterBlock,
    free_blocks,
    values_of,
    with_values,
)
from ..sandwich import STRETCHES, Groups, clusters_of
from .torque_balance import TorqueBalance

_RECENT = 4  # estimates that are kept


def left_to_friction(balance: TorqueBalance, estimate: Estimate) -> Array:
    """Mean torques (K, n) [N m] that rigid bodies do not need: gain u(t - delay) + bias - Y p."""
    calibration = estimate.calibration
    logged = balance.logged(calibration.delay)[0]
    applied = (calibration.gain * logged + calibration.bias) * estimate.mechanism.motors
    base = calibration.base + balance.base
    return applied - np.einsum("kib,kb->ki", balance.regressor, base)


def logged_gain(estimate: Estimate) -> Array:
    """Gain (n,) of the logged torques, at least a thousandth."""
    return np.maximum(estimate.calibration.gain, 1e-3)


@validated
class TorqueSettings:
    """How torques are balanced and friction is fitted to them.

    window : [s], time over which torques are averaged; ripple that is faster does not count
    node_time : [s], shortest time between the samples along which friction and inertia are computed
    iterations : Gauss-Newton steps at most, in each round of weights
    tolerance : a round ends with a step of less [standard errors]
    huber : residuals beyond so many standard deviations count less
    significance : a block of sensors (delay, gain, bias) whose deviation from an ideal sensor has a
        larger p-value is left out, and the fit repeated without it; 1 keeps all
    consistent : whether base parameters must be those of bodies that there can be, of a URDF or
        MJCF, see `mechanics.rigid_body.rigid_body_tree`
    """

    window: Positive = 0.05
    node_time: Positive = 0.004
    iterations: Count = 60
    tolerance: Positive = 1e-3
    huber: Positive = 2.5
    significance: Positive = 0.01
    consistent: bool = False


@dataclass(frozen=True, eq=False)
class TorqueProblem(FreeParameters):
    """What does not change while the free parameters are fitted to the torques.

    e = (gain u(t - delay) + bias - Y p - mean Tf) / gain    (K, n) [N m, as logged]

    The logged torque is what is measured: were its gain not divided by, a smaller one would make
    its noise smaller, too, and the gain of a joint with much friction would come out near zero.
    """

    balance: TorqueBalance
    blocks: tuple[FreeBlock, ...]
    estimate: Estimate  # with all that is not free
    settings: TorqueSettings
    recent: dict[bytes, Estimate] = field(default_factory=dict, init=False)  # asked for thrice

    @property
    def x(self) -> Array:
        """Values (1, D) of the free parameters in the estimate."""
        return values_of(self.estimate, self.blocks)[None]

    def conditions(self, sigma: Array, weight: Array) -> Conditions:
        """Conditions of one fit to torques with noise (n,) [N m], under weights (K, n)."""
        low, high, mean, precision = (each[None] for each in self.limits)
        return Conditions((weight / sigma**2)[None], low, high, mean, precision, np.zeros(1))

    def at(self, x: Array) -> Estimate:
        """The estimate with other values (1, D) of the free parameters."""
        key = x.tobytes()
        if key not in self.recent:
            estimate = with_values(self.estimate, self.blocks, x[0])
            while len(self.recent) > _RECENT:
                self.recent.pop(next(iter(self.recent)))
            self.recent[key] = estimate
        return self.recent[key]

    def possible(self, x: Array) -> Array:
        """Values (1, D) with base parameters on the way there whose M(q) is positive definite."""
        estimate, values = self.at(x), x.copy()
        for free in self.blocks:
            if free.block.enters == "base":
                base = np.asarray(estimate.calibration.base)
                values[0, free.columns] = base[[p.place[0] for p in free.parameters]]
        self.recent[values.tobytes()] = estimate
        return values

    def residual(self, x: Array) -> Array:
        """Unexplained torques (1, K, n) [N m] at values (1, D) of the free parameters."""
        return self.unexplained(self.at(x))[None]

    def cost(self, residual: Array, weights: Array) -> Array:
        """Weighted squares (1,) of residuals."""
        return (weights * residual**2).sum(axis=(1, 2))

    def normal_equations(self, x: Array, residual: Array, weights: Array) -> tuple[Array, Array]:
        """J'We (1, D) and J'WJ (1, D, D) with J = -de/dx."""
        H, g = normal_equations(self.slopes(self.at(x)), residual[0], weights[0])
        return g[None], H[None]

    def unexplained(self, estimate: Estimate) -> Array:
        """Unexplained torques e (K, n) [N m]."""
        balance = self.balance
        mean = balance.problem.mean(along(estimate.friction, balance.nodes))
        left = left_to_friction(balance, estimate) - mean @ estimate.mechanism.friction_map
        out = left / logged_gain(estimate)
        if balance.wrench is None:
            return out
        base = estimate.calibration.base + balance.base
        return np.concatenate([out, balance.wrench.left(base)], axis=1)

    def slopes(self, estimate: Estimate) -> Array:
        """Derivatives (K, n, D) of the unexplained torques in the free parameters."""
        balance, wrench, gain = self.balance, self.balance.wrench, logged_gain(estimate)
        (K, n), theta = balance.slides.shape, estimate.friction.theta
        out = np.zeros((K, n if wrench is None else n + len(WRENCH), len(self.parameters)))
        of_joints = out[:, :n]  # a view
        logged = balance.logged(estimate.calibration.delay)
        for block, parameters, columns in self.blocks:
            if block.enters == "friction":
                law = Linearised(estimate.friction.law, balance.problem)
                slope = law.slopes(np.reshape(theta, (1, -1)))[0]
                for k, p in enumerate(parameters, columns.start):
                    acts = estimate.mechanism.friction_map[p.place[0]]
                    of_joints[:, :, k] = -slope[:, p.place[0], p.place[1], None] * acts
            elif block.enters == "base":
                which = [p.place[0] for p in parameters]
                of_joints[:, :, columns] = -balance.regressor[:, :, which]
                if wrench is not None:
                    out[:, n:, columns] = -wrench.regressor[:, :, which]
            else:
                slope = block.torque_slope(estimate, parameters, *logged)
                of_joints[:, :, columns] = np.moveaxis(slope * estimate.mechanism.motors, 0, -1)
        of_joints /= gain[:, None]
        for block, parameters, columns in self.blocks:
            if block.name == "gain":
                j = [p.place[0] for p in parameters]
                places = np.arange(columns.start, columns.stop)
                of_joints[:, j, places] -= self.unexplained(estimate)[:, j] / gain[j]
        return out


_ROUNDS = 4  # of weights
_NEAR = 0.1  # of a standard error: a round that only gives the next weights ends there


class TorqueSolution(NamedTuple):
    """Where a fit to a problem ended.

    estimate; residual (K, n) [N m]; weight (K, n), zero for rows that do not count; sigma (n,)
    [N m]; slopes (K, n, D); free (D,), parameters that are not at a bound; converged; iterations;
    held, what the torques do not tell
    """

    problem: TorqueProblem
    estimate: Estimate
    residual: Array
    weight: Array
    sigma: Array
    slopes: Array
    free: Array
    converged: bool
    iterations: int
    held: tuple[Unknown, ...] = ()

    @property
    def blocks(self) -> tuple[ParameterBlock, ...]:
        """What was free."""
        return tuple(free.block for free in self.problem.blocks)

    def normal_equations(self, rows: Array | slice = slice(None)) -> tuple[Array, Array]:
        """H (D, D) and descent g (D,) of some rows, in units of the noise."""
        weights = self.weight[rows] / self.sigma**2
        return normal_equations(self.slopes[rows], self.residual[rows], weights)


def solve(problem: TorqueProblem) -> TorqueSolution:
    """The free parameters that explain the torques of the windows in use best."""
    settings, counts, x, iterations = problem.settings, problem.balance.counts, problem.x, 0
    residual = problem.residual(x)[0]
    for k in range(_ROUNDS):
        under = problem.conditions(*_weights(residual, counts, settings.huber))
        still = settings.tolerance if k + 1 == _ROUNDS else max(_NEAR, settings.tolerance)
        end = minimum(problem, x, under, settings.iterations, still=still)
        x, residual, iterations = end.x, end.residual[0], iterations + end.iterations
    estimate, free = problem.at(x), ((x > under.low) & (x < under.high))[0]
    sigma, weight = _weights(residual, counts, settings.huber)
    slopes, converged = problem.slopes(estimate), bool(end.converged[0])
    parts = residual, weight, sigma, slopes, free, converged, iterations
    return TorqueSolution(problem, estimate, *parts)


def _weights(residual: Array, counts: Array, clip: float) -> tuple[Array, Array]:
    """Noise (n,) of the joints' torques, and Huber's weights (K, n) of what counts [Huber1964]."""
    size = np.where(counts, np.abs(residual), np.nan)
    shown = counts.any(axis=0)
    sigma = np.ones(residual.shape[1])
    sigma[shown] = MAD * np.nanmedian(size[:, shown], axis=0)
    sigma = np.maximum(sigma, 1e-12 * max(float(np.nanmax(size, initial=0.0)), 1e-300))
    ratio = np.abs(residual) / (clip * sigma)
    return sigma, np.where(counts, 1.0 / np.maximum(ratio, 1.0), 0.0)


def normal_equations(slopes: Array, residual: Array, weights: Array) -> tuple[Array, Array]:
    """H (D, D) and descent g (D,) of unexplained torques (K, n) under weights (K, n) [1/(N m)^2].

    slopes : (K, n, D), derivatives of the torques in the parameters
    """
    D = slopes.shape[-1]
    weighted = (weights[..., None] * slopes).reshape(-1, D)
    return weighted.T @ slopes.reshape(-1, D), -(weighted.T @ residual.ravel())


def squares_like(solution: TorqueSolution, like: TorqueSolution) -> float:
    """Squares of torques that are left, in units of the noise, weighed as in another solution."""
    return float((like.weight * (solution.residual / like.sigma) ** 2).sum())


def groups_of(solution: TorqueSolution) -> Groups:
    """Normal equations of stretches of the recordings, at the solution.

    Neighbouring torques agree: what scatters is the mean of a stretch, or of a recording.
    """
    balance = solution.problem.balance
    rows = np.flatnonzero(balance.counts.any(axis=1))
    recording = balance.recording[rows]
    stretch = stretches(recording, balance.problem.time[rows], STRETCHES)
    labels, first = np.unique(stretch, return_index=True)
    each = [solution.normal_equations(rows[stretch == c]) for c in labels]
    H, g = (np.stack(parts) for parts in zip(*each, strict=True))
    cluster = clusters_of(H, recording[first], labels)
    return Groups(H, g, np.zeros(g.shape[1]), solution.free, recording[first], cluster)


_HELD = 1e6  # how much better than the data know the others base parameters are held that are fixed


def made_consistent(solution: TorqueSolution) -> TorqueSolution:
    """The solution with consistent base parameters: the nearest by the information of the fit.

    What else is free is fitted once more beside them.

    Raises
    ------
    InputError
        For mechanisms whose bodies are not known.
    """
    problem, mechanism = solution.problem, solution.estimate.mechanism
    base_block = next((b for b in problem.blocks if b.block.enters == "base"), None)
    if base_block is None or not base_block.parameters:
        return solution
    if not isinstance(mechanism, RigidBodyTree):
        raise InputError(
            f"consistent = true needs the bodies of a URDF or MJCF, which {mechanism.kind} does "
            "not have: leave it out; base parameters stay on a path on which M(q) is positive"
        )
    places = [p.place[0] for p in base_block.parameters]
    metric = _information(solution, places, len(mechanism.base_names))
    wanted = np.asarray(solution.estimate.calibration.base)
    base = nearest_consistent(mechanism, wanted, metric)
    fixed = np.setdiff1d(np.arange(len(base)), places)
    base[fixed] = wanted[fixed]
    held = solution.estimate._replace(calibration=replace(solution.estimate.calibration, base=base))
    others = tuple(b.block for b in problem.blocks if b is not base_block)
    after = solve(replace(problem, blocks=free_blocks(others, held), estimate=held))
    free = np.array(solution.free)
    rest = np.ones(len(free), dtype=bool)
    rest[base_block.columns] = False
    free[rest] = after.free
    slopes = problem.slopes(after.estimate)
    return after._replace(problem=problem, slopes=slopes, free=free, held=solution.held)


def _information(solution: TorqueSolution, places: list[int], count: int) -> Array:
    """Information (nb, nb) on the base parameters, whatever else is free; fixed ones are held."""
    problem = solution.problem
    H = solution.normal_equations()[0] + np.diag(problem.limits.precision)
    place = next(b for b in problem.blocks if b.block.enters == "base").columns
    rest = np.ones(len(H), dtype=bool)
    rest[place] = False
    inner = H[place, place]
    if rest.any():
        inner = (
            inner - H[place][:, rest] @ np.linalg.pinv(H[np.ix_(rest, rest)]) @ H[rest][:, place]
        )
    out = np.eye(count) * _HELD * float(np.diag(inner).max())
    out[np.ix_(places, places)] = (inner + inner.T) / 2
    return out
