"""Least squares of laws that are linear in their parameters: one solution for each fold."""

from dataclasses import dataclass, field, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.config import validated
from frictionid.errors import InputError
from frictionid.friction import Friction, Groups, Law
from frictionid.friction.law import NUMERICAL_WIDTH
from frictionid.friction.laws import Spline

from ..gauss_newton import box_step
from ..identifier import Identifier
from ..one_step.grams import check_linear, columns, grams
from ..one_step.linearised import Linearised, Ranges
from ..one_step.residual import Problem, data_range, normalised
from .initial_guess import check_rows
from .least_squares import LeastSquares

_RIDGE = 1e-13
_CHECKED = 200  # nodes of each joint
_ROUNDING = 1e-9
_KNOTS, _SHARP = 5, 0.01  # of the flexible curve; its smoothing, of the fastest speed


@validated
class Linear(Identifier):
    """Fits a linear law within its bounds, as `LeastSquares` does, from one Gram matrix per fold.

    A fold whose solution leaves the range in which the law is linear (a level below zero counts as
    zero) is fitted by `LeastSquares`.

    Raises
    ------
    InputError
        Where rows or weights do not determine the parameters, and for laws that are not linear.

    Examples
    --------
    >>> from frictionid.fitting.identifiers.check_identifier import synthetic_problem
    >>> from frictionid.friction.laws import Spline
    >>> problem = synthetic_problem(joints=1)
    >>> friction = Linear(Spline((1.0, 4.0))).fit(problem, np.ones((1, len(problem.r))), seed=0)
    >>> friction.curve(np.array([0.5, 2.0, 8.0])).round(2)[0].T
    array([[0.14, 0.15, 0.26]])
    """

    law: Law
    bounds: Ranges = field(default_factory=dict)
    prior: Ranges = field(default_factory=dict)
    equal: Groups = ()
    seeded = False

    def __post_init__(self) -> None:
        check_linear(self.law)

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        weights = normalised(weights, problem)
        law = Linearised.within(self.law, problem, weights, (self.bounds, self.prior, self.equal))
        A = columns(law.law, problem)
        size = np.abs(A[..., :-1]).reshape(*problem.r.shape, problem.r.shape[-1], -1)
        check_rows(law, weights, size.max(axis=(1, 3)) > 0)
        if law.tie is not None:
            A = np.concatenate([A[..., :-1] @ law.tie, A[..., -1:]], axis=-1)
        theta = solutions(grams(A, weights)[:, 0], *law.bounds)
        beyond = ~_in_linear_range(law.friction(theta), problem)
        beyond |= bool(self.prior)
        if beyond.any():
            by_steps = LeastSquares(
                self.law, self.bounds, self.prior, robust=None, equal=self.equal
            )
            theta[beyond] = law.once(by_steps.fit(problem, weights[beyond], seed).theta)
        return replace(law.friction(theta), law=self.law)


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
        return Linear(law, prior=prior).fit(problem, weights, seed)


def solutions(T: Array, low: Array, high: Array) -> Array:
    """Parameters (F, N) within bounds (F, N), of Gram matrices T (F, N + 1, N + 1)."""
    return box_step(T[:, :-1, :-1], T[:, :-1, -1], low, high, _RIDGE)


def _in_linear_range(friction: Friction, problem: Problem) -> Array:
    """Whether (F,) the law is linear at theta, checked at nodes from slow to fast."""
    inputs, law = problem.nodes.inputs, friction.law
    S = len(inputs.w)
    places = np.linspace(0, S - 1, min(_CHECKED, S)).astype(int)
    order = np.argsort(np.abs(inputs.w), axis=0)[places]
    x = inputs.each(lambda part: np.take_along_axis(part, order, axis=0))
    theta = friction.theta[:, None]
    linear = (law.gradient(0.0 * theta[:1], x) * theta).sum(-1)
    error = np.abs(law.torque(theta, x, ()) - linear).max(axis=(1, 2))
    return error <= _ROUNDING * np.abs(linear).max(axis=(1, 2))
