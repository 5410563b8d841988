"""G-weighted least squares: any law with parameters, all folds at once.

minimise  sum_k weights[f, k] |r_k - G_k Tf_k(theta)|^2   over theta within the law's bounds

by Levenberg-Marquardt [Marquardt1963] with steps within the bounds. A secant correction adds to the
Gauss-Newton Hessian what earlier steps show it to lack [Dennis1981]: in the narrow valleys of
friction laws (a higher peak that falls off sooner) that saves most of the steps.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.config import Count, NotNegative, Positive, check_settings
from frictionid.errors import InputError
from frictionid.fitting.box_qp import bounded
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.identifiers.initial_guess import best_initial_guess
from frictionid.fitting.one_step.linearised import Given, Linearised, Ranges
from frictionid.fitting.one_step.residual import Problem
from frictionid.fitting.one_step.row_weights import huber_factors, normalised
from frictionid.friction import Friction, Groups, Law
from frictionid.friction.temperature import check_temperature

_EXACT = 1e-22  # costs below this part of that without friction are rounding
_DAMPING = (1e-9, 1e9)
_CLEAR = 1e-8  # a change of slope above rounding
_ROUNDS = 2  # of weights
_ENOUGH = 100_000  # rows to begin with, where there are more
_NEAR = 1e-2  # tolerance of the fits that give the next weights
_SPREADS = (8.0, 2.0, 1.2, 1.03)  # factors up and down over which stepwise parameters are tried
_TRIED = 17  # values of each


@dataclass(frozen=True)
class LeastSquares(Identifier):
    """Fits the parameters of a law.

    bounds, prior : of parameters by name: lower and upper bound, mean and standard deviation
    iterations : steps at most
    tolerance : a fit ends where a step would reduce the cost by less, relative
    robust : number of standard deviations beyond which rows are weighted down, after which the fit
        is repeated; None gives all rows their full weight
    equal : groups of joints, by their numbers from 1, that have the same parameters

    It begins at the law's `initial` values that promise the lowest cost, for each joint its own.
    Laws without a gradient, and laws with memory, are differentiated numerically. A parameter
    without influence keeps its initial value.

    Examples
    --------
    >>> from frictionid.fitting.identifiers.synthetic_problem import synthetic_problem
    >>> from frictionid.friction.laws import CoulombViscous
    >>> problem = synthetic_problem(joints=1)
    >>> friction = LeastSquares(CoulombViscous()).fit(problem, np.ones((1, len(problem.r))), seed=0)
    >>> print(friction[0])
    CoulombViscous(width=0.02, shape='tanh', symmetric=True)
      joint 1  coulomb 0.1265 N m, viscous 0.01494 N m s/rad
    """

    law: Law
    bounds: Ranges = field(default_factory=dict)
    prior: Ranges = field(default_factory=dict)
    iterations: Count = 100
    tolerance: NotNegative = 1e-11
    robust: Positive | None = 3.0
    equal: Groups = ()
    seeded = False

    def __post_init__(self) -> None:
        check_settings(self)

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        check_temperature(self.law, problem.nodes.inputs.temperature, fitted=True)
        weights = normalised(weights, problem)
        law = Linearised.of(self.law, problem, weights, Given(self.bounds, self.prior, self.equal))
        return replace(law.friction(self._fitted(law, weights)), law=self.law)

    def _fitted(self, law: Linearised, weights: Array) -> Array:
        """Parameters (F, N) at the minimum, with weights of rows and of priors found on the way."""
        theta, stepped = self._begin(law, weights)
        reduced, variance = weights, np.zeros(len(weights))
        for _ in range(_ROUNDS if self.robust is not None or self.prior else 0):
            theta = self._minimum(law, _first(law, theta, stepped, reduced, variance), _NEAR)
            stepped, residual = theta, law.residual(theta)
            if self.robust is not None:
                reduced = weights * huber_factors(residual, weights, self.robust)
            if self.prior:
                variance = _cost(residual, reduced) / _freedom(law, reduced)
        state = _first(law, theta, stepped, reduced, variance)
        theta = self._minimum(law, state, self.tolerance)
        for spread in _SPREADS if law.law.stepwise else ():
            tried = _tried(law, theta, reduced, spread)
            state = _first(law, theta, tried, reduced, variance)
            theta = self._minimum(law, state, self.tolerance)
        return theta

    def _begin(self, law: Linearised, weights: Array) -> tuple[Array, Array]:
        """Two guesses (F, N) each to begin at: of many rows, the fit of some of them."""
        step = len(law.problem.r) // _ENOUGH
        if step > 1 and not law.law.has_memory:
            few = law.every(step)
            with suppress(InputError):  # what all rows determine, some may not
                theta = self._fitted(few, normalised(weights[:, ::step], few.problem))
                return theta, theta
        theta, stepped = map(law.tied, best_initial_guess(law.untied, weights))
        return theta, stepped

    def _minimum(self, law: Linearised, state: _State, tolerance: float) -> Array:
        """Parameters (F, N) at the local minimum; folds that have converged take no more steps."""
        theta, active = state.theta.copy(), np.arange(len(state.theta))
        for _ in range(self.iterations):
            state, converged = _next(law, state, tolerance)
            theta[active] = state.theta
            active, state = active[~converged], state.of(~converged)
            if not len(active):
                break
        return theta


class _State(NamedTuple):
    """State of the iteration in each fold, at theta (F, N).

    residual (F, K, n); cost, damping, and cost without friction (F,); descent J'We (F, N); hessian
    J'WJ (F, N, N) by Gauss-Newton, and secant (F, N, N), its correction; bounds low and high, and
    the prior's mean and precision (F, N), in units of the cost
    """

    theta: Array
    low: Array
    high: Array
    mean: Array
    precision: Array
    weights: Array
    residual: Array
    cost: Array
    descent: Array
    hessian: Array
    secant: Array
    damping: Array
    frictionless: Array

    def of(self, folds: Array) -> _State:
        """State of some of the folds."""
        return _State(*(field[folds] for field in self))


def _first(
    law: Linearised, initial: Array, stepped: Array, weights: Array, variance: Array
) -> _State:
    """State at the better of two guesses each; far from linear, a first step may be a bad one.

    variance : (F,) of the weighted residuals, which makes priors comparable with them
    """
    theta = initial
    if stepped is not initial:
        with np.errstate(all="ignore"):
            better = _cost(law.residual(stepped), weights) < _cost(law.residual(initial), weights)
        theta = np.where(better[:, None], stepped, initial)
    residual, (mean, precision) = law.residual(theta), law.prior
    precision = np.multiply(precision.T, variance).T
    descent, hessian = law.normal_equations(theta, residual, weights)
    state = _State(
        *(theta, *law.bounds, mean, precision, weights, residual),
        *(_cost(residual, weights) + _prior_cost(theta, mean, precision), descent, hessian),
        *(np.zeros_like(hessian), np.full(len(theta), 1e-6)),
        _cost(law.problem.r[None], weights),
    )
    return state._replace(**_with_prior(state, descent, hessian))


def _tried(law: Linearised, theta: Array, weights: Array, spread: float) -> Array:
    """Parameters (F, N) with the values of stepwise ones, one after the other, of lowest cost.

    Values are tried from theta / spread to theta spread, within the bounds. Between two steps of
    the cost its slope is that of the other samples alone, or zero.
    """
    P, (low, high) = len(law.law.names), law.bounds
    stepwise = np.array([name in law.law.stepwise for name in law.law.names])
    columns = np.flatnonzero(law.once(np.broadcast_to(stepwise, (1, law.joints, P)))[0])
    theta = theta.copy()
    for column in columns:
        values = theta[:, column] * np.geomspace(1 / spread, spread, _TRIED)[:, None]
        costs = []
        for value in np.clip(values, low[:, column], high[:, column]):
            theta[:, column] = value
            costs.append(_cost(law.residual(theta), weights))
        best = np.argmin(costs, axis=0)
        theta[:, column] = np.clip(values, low[:, column], high[:, column])[best, range(len(theta))]
    return theta


def _cost(residual: Array, weights: Array) -> Array:
    cost: Array = (weights * np.einsum("...n,...n->...", residual, residual)).sum(axis=-1)
    return cost


def _prior_cost(theta: Array, mean: Array, precision: Array) -> Array:
    return (precision * (theta - mean) ** 2).sum(axis=-1)


def _with_prior(state: _State, descent: Array, hessian: Array) -> dict[str, Array]:
    """Descent and Hessian of the residuals, with those of the prior."""
    eye = np.eye(state.theta.shape[-1])
    return {
        "descent": descent + state.precision * (state.mean - state.theta),
        "hessian": hessian + state.precision[..., None] * eye,
    }


def _freedom(law: Linearised, weights: Array) -> Array:
    """Degrees of freedom (F,) of the residuals, less the parameters."""
    rows = (weights > 0).sum(axis=1) * law.joints
    return np.maximum(rows - law.joints * len(law.law.names), 1)


def _next(law: Linearised, state: _State, tolerance: float) -> tuple[_State, Array]:
    """State after one step where that lowers the cost, and which folds have converged, (F,)."""
    step, predicted = _step(state)
    theta = np.clip(state.theta + step, state.low, state.high)
    with np.errstate(all="ignore"):  # a step too far is refused below, whatever it gives
        residual = law.residual(theta)
        prior = _prior_cost(theta, state.mean, state.precision)
        reduction = state.cost - _cost(residual, state.weights) - prior
    converged = predicted <= tolerance * state.cost + _EXACT * state.frictionless
    better = reduction > 0
    ratio = reduction / np.maximum(predicted, 1e-300)
    factor = np.select([ratio > 0.75, ratio > 0.25], [0.1, 1.0], 20.0)
    new = state._replace(
        damping=np.clip(state.damping * factor, *_DAMPING),
        secant=np.where(better[:, None, None], state.secant, 0.0),
        theta=np.where(better[:, None], theta, state.theta),
        cost=np.where(better, state.cost - reduction, state.cost),
        residual=np.where(better[:, None, None], residual, state.residual),
    )
    return _with_equations(law, state, new, np.flatnonzero(better & ~converged)), converged


def _step(state: _State) -> tuple[Array, Array]:
    """Damped steps d (F, N) within the bounds, and the reductions of the cost (F,) they predict.

    (B + damping diag(J'WJ)) d = J'We, with B = J'WJ + secant where that is convex, else J'WJ; the
    predicted reduction is d'(2 J'We - B d).
    """
    eye = np.eye(state.theta.shape[-1])
    scale = _scale(state.hessian)
    full = state.hessian + state.secant
    root = np.sqrt(scale)[:, :, None] * np.sqrt(scale)[:, None, :]
    convex = np.linalg.eigvalsh(full / root).min(axis=-1, initial=1.0) >= -_DAMPING[0]
    B = np.where(convex[:, None, None], full, state.hessian)
    damped = B + (state.damping[:, None] * scale)[:, :, None] * eye
    step = bounded(damped, state.descent, state.low - state.theta, state.high - state.theta)
    predicted = step * (2 * state.descent - np.einsum("fij,fj->fi", B, step))
    return step, predicted.sum(axis=-1)


def _scale(hessian: Array) -> Array:
    diagonal = np.einsum("fii->fi", hessian)
    return np.where(diagonal > 0, diagonal, 1.0)


def _with_equations(law: Linearised, before: _State, after: _State, moved: Array) -> _State:
    """`after` with the normal equations of the folds that moved, and their secant correction.

    The symmetric rank-one update makes the Hessian explain the change of the gradient over the
    step d: with y the part of the change that J'WJ + secant does not explain,

        secant + y y' / (y'd),   where y'd is clearly not zero
    """
    part = after.of(moved)
    equations = law.normal_equations(part.theta, part.residual, part.weights)
    descent, hessian = _with_prior(part, *equations).values()
    d = part.theta - before.theta[moved]
    y = before.descent[moved] - descent - np.einsum("fij,fj->fi", hessian + part.secant, d)
    product = (y * d).sum(axis=-1)
    root = np.sqrt(_scale(hessian))
    size = np.linalg.norm(y / root, axis=-1) * np.linalg.norm(d * root, axis=-1)
    clear = np.abs(product) > _CLEAR * size
    factor = np.where(clear, 1.0 / np.where(clear, product, 1.0), 0.0)
    secant = part.secant + factor[:, None, None] * y[:, :, None] * y[:, None, :]
    return after._replace(
        descent=_replaced(after.descent, moved, descent),
        hessian=_replaced(after.hessian, moved, hessian),
        secant=_replaced(after.secant, moved, secant),
    )


def _replaced(field: Array, folds: Array, values: Array) -> Array:
    out = field.copy()
    out[folds] = values
    return out
