"""G-weighted least squares: any law with parameters, all folds at once.

minimise  sum_k weights[f, k] |r_k - G_k Tf_k(theta)|^2   over theta within the law's bounds

by Levenberg-Marquardt, see `gauss_newton`, in rounds of Huber's weights.
"""

from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.config import Count, NotNegative, Positive, validated
from frictionid.errors import InputError
from frictionid.friction import Friction, Groups, Law
from frictionid.friction.law import NUMERICAL_WIDTH, check_temperature
from frictionid.friction.laws import Spline

from ..gauss_newton import Conditions, minimum
from ..identifier import Identifier
from ..one_step.linearised import Linearised, Ranges
from ..one_step.recipe import spread_of
from ..one_step.residual import Problem, data_range, huber_factors, normalised
from .start_of_fit import best_initial_guess, by_evidence, hardly_sliding

_ROUNDS = 2  # of weights
_ENOUGH = 100_000  # rows to begin with, where there are more
_NEAR = 1e-2  # tolerance of the fits that give the next weights
_SPREADS = (8.0, 2.0, 1.2, 1.03)  # factors up and down over which stepwise parameters are tried
_TRIED = 17  # values of each
_FOLLOWING = 4  # fits in which a level follows that of the other direction


@validated
class LeastSquares(Identifier):
    """Fits the parameters of a law.

    bounds, prior : of parameters by name: lower and upper bound, mean and standard deviation
    iterations : steps at most
    tolerance : a fit ends where a step would reduce the cost by less, relative
    robust : number of standard deviations beyond which rows are weighted down, after which the fit
        is repeated; None gives all rows their full weight
    equal : groups of joints, by their numbers from 1, that have the same parameters
    neutral : whether parameters that the rows do not tell stay at the law's neutral values; false
        gives the plain minimum

    It begins at the law's `initial` values that promise the lowest cost, for each joint its own.
    Laws without a gradient, and laws with memory, are differentiated numerically. A parameter
    without influence keeps its initial value.

    Examples
    --------
    >>> from frictionid.fitting.identifiers.check_identifier import synthetic_problem
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
    neutral: bool = True
    seeded = False

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        check_temperature(self.law, problem.nodes.inputs.temperature, fitted=True)
        weights = normalised(weights, problem)
        form, absent = by_evidence(self.law, problem, weights, self.equal)
        settings = self.bounds, self.prior, self.equal
        law = Linearised.within(form, problem, weights, settings)
        law = law if absent is None else law.decided(absent)
        law = law.without(hardly_sliding(law, weights))
        return replace(law.friction(self._fitted(law, weights)), law=form)

    def _fitted(self, law: Linearised, weights: Array) -> Array:
        """Parameters (F, N) at the minimum, with weights of rows and of priors found on the way."""
        theta, stepped = self._begin(law, weights)
        under = law.conditions(weights, np.zeros((len(weights), 1)))
        for _ in range(_ROUNDS if self.robust is not None or self.prior else 0):
            first = _better(law, theta, stepped, under)
            theta, residual, *_ = minimum(law, first, under, self.iterations, _NEAR)
            stepped, under = theta, self._conditions(law, weights, theta, residual)
        first = _better(law, theta, stepped, under)
        theta = minimum(law, first, under, self.iterations, self.tolerance).x
        for spread in _SPREADS if any(p.stepwise for p in law.law.parameters) else ():
            first = _better(law, theta, _scanned(law, theta, under, spread), under)
            theta = minimum(law, first, under, self.iterations, self.tolerance).x
        if not self.neutral:
            return theta
        theta, held = self._at_neutral(law, theta, under)
        for _ in range(_ROUNDS if self.robust is not None and held.any() else 0):
            under = self._conditions(law, weights, theta, law.residual(theta))
            again = self._holding(law, theta, held, under)
            theta[held.any(axis=1)] = again[held.any(axis=1)]
        return theta

    def _conditions(
        self, law: Linearised, weights: Array, theta: Array, residual: Array
    ) -> Conditions:
        """What fits are made under, by the last ones and their residuals (F, K, n)."""
        reduced, variance = weights, np.zeros((len(weights), 1))
        if self.robust is not None:
            reduced = weights * huber_factors(residual, weights, self.robust)
        if self.prior:
            spread = spread_of(law, theta, residual, law.conditions(reduced, variance))
            variance = spread.excess * spread.variance[:, None]
        return law.conditions(reduced, variance)

    def _at_neutral(self, law: Linearised, theta: Array, under: Conditions) -> tuple[Array, Array]:
        """Parameters (F, N) with those held at neutral values that the rows do not tell, and which.

        The worst known one of a fit first, as long as the fit without it is not shown to be worse:
        what two of them tell together, one tells alone.
        """
        size, held = law.size, np.zeros_like(theta, dtype=bool)
        left = np.isfinite(size) & (under.low < under.high)
        while left.any():
            spread = spread_of(law, theta, law.residual(theta), _with_held(law, theta, held, under))
            neutral = law.neutral(theta)
            # what others follow does not follow them
            free = left & (law.neutral(theta + held) == neutral)
            chosen = spread.worst(theta, neutral, size, free)
            if not chosen.any():
                break
            trial = self._holding(law, theta, held | chosen, under)
            goes = chosen.any(axis=1) & ~spread.shown(law, theta, trial, under, chosen)
            theta, left = np.where(goes[:, None], trial, theta), left & ~chosen
            held |= chosen & goes[:, None]
        neutral = law.neutral(theta)
        # what ended there by itself stays, but for what others follow
        there = (theta == neutral) & (law.neutral(theta + held) == neutral) & np.isfinite(size)
        return theta, held | there & held.any(axis=1, keepdims=True)

    def _holding(self, law: Linearised, theta: Array, held: Array, under: Conditions) -> Array:
        """Parameters (F, N) where some are held at what is neutral beside the others there."""
        for _ in range(_FOLLOWING):
            now = _with_held(law, theta, held, under)
            start = np.clip(theta, now.low, now.high)
            theta = minimum(law, start, now, self.iterations, self.tolerance).x
            if np.allclose(np.where(held, law.neutral(theta), theta), theta, rtol=1e-6, atol=0.0):
                break
        return theta

    def _begin(self, law: Linearised, weights: Array) -> tuple[Array, Array]:
        """Two guesses (F, N) each to begin at: of many rows, the fit of some of them."""
        step = len(law.problem.r) // _ENOUGH
        if step > 1 and not law.law.has_memory:
            few = law.every(step)
            with suppress(InputError):  # what all rows determine, some may not
                share = normalised(weights[:, ::step], few.problem)
                theta = self._fitted(few.without(hardly_sliding(few, share)), share)
                return theta, theta
        guess = best_initial_guess(law._replace(tie=None), weights)  # of each joint by itself
        theta, stepped = map(law.tied, guess)
        return theta, stepped


def _with_held(law: Linearised, theta: Array, held: Array, under: Conditions) -> Conditions:
    neutral = law.neutral(theta)
    low, high = (np.where(held, neutral, x) for x in (under.low, under.high))
    return under._replace(low=low, high=high)


def _better(law: Linearised, theta: Array, stepped: Array, under: Conditions) -> Array:
    """The better of two guesses (F, N) each; far from linear, a first step may be a bad one."""
    if stepped is theta:
        return theta
    with np.errstate(all="ignore"):
        costs = [law.cost(law.residual(x), under.weights) for x in (stepped, theta)]
    return np.where((costs[0] < costs[1])[:, None], stepped, theta)


def _scanned(law: Linearised, theta: Array, under: Conditions, spread: float) -> Array:
    """Parameters (F, N) with the values of stepwise ones, one after the other, of lowest cost.

    Values are tried from theta / spread to theta spread, within the bounds. Between two steps of
    the cost its slope is that of the other samples alone, or zero.
    """
    stepwise = np.array([p.stepwise for p in law.law.parameters])
    stepwise = np.broadcast_to(stepwise, (1, law.joints, len(stepwise)))
    theta = theta.copy()
    for column in np.flatnonzero(law.once(stepwise)[0]):
        values = theta[:, column] * np.geomspace(1 / spread, spread, _TRIED)[:, None]
        values, costs = np.clip(values, under.low[:, column], under.high[:, column]), []
        for value in values:
            theta[:, column] = value
            costs.append(law.cost(law.residual(theta), under.weights))
        theta[:, column] = values[np.argmin(costs, axis=0), range(len(theta))]
    return theta


# --- Friction of any shape beside which a machine is calibrated ----------------------------------

_KNOTS, _SHARP = 5, 0.01  # of the flexible curve; its smoothing, of the fastest speed


@dataclass(frozen=True)
class Flexible(Identifier):
    """Fits a curve of any shape that grows with the load: friction to calibrate a machine beside.

    It is nobody's candidate, `Spline(loaded=True)`. Its knots are octaves apart, the last one at
    half of the fastest speed in the rows in use, so that nothing depends on how fast a machine is.
    The level at rest is free; from knot to knot, and with the usual load, it changes by as much as
    it is, as a prior has it: where a joint hardly slides, nothing else would bound it, and a load
    that hardly changes cannot be separated from the level otherwise.
    """

    seeded = False

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        shown = data_range(problem, weights)
        fastest = float(shown.fastest.max())
        if not fastest > 0:
            raise InputError(
                "no joint moves in a fold, so that nothing can be calibrated: give recordings with "
                "motion, or use the recipe 'integral'"
            )
        knots = tuple(fastest * 0.5**k for k in range(_KNOTS, 0, -1))
        law = Spline(knots, width=min(NUMERICAL_WIDTH, _SHARP * fastest), loaded=True)
        usual = {p.name: float(np.max(shown.usual(p.unit))) for p in law.parameters[1:]}
        prior = {name: (0.0, size) for name, size in usual.items() if 0 < size < np.inf}
        return LeastSquares(law, prior=prior, robust=None).fit(problem, weights, seed)
