"""One-step recipes: the problems that they make of data, fits of these, and errors of the fits.

STUDY is the recipe of the study [DeMeester2020], INTEGRAL the default.

The curvature of a sum of squares counts rows as independent. Their errors are not: neighbouring
states are smoothed together, and what a model does not explain lasts. So a parameter's variance is
that by the scatter between clusters of rows, the sandwich, and what a test by the sum of squares
shows is divided by the ratio of both [Ribatet2012].
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, Literal, NamedTuple, Protocol

import numpy as np

from frictionid.arrays import Array, usual_step
from frictionid.config import NotNegative, validated
from frictionid.data.joint_scales import are_mixed
from frictionid.data.recordings import Dataset
from frictionid.data.signals import taken
from frictionid.data.state_estimators import RTS, Backward, Estimator, States, thin
from frictionid.errors import InputError
from frictionid.friction import Friction, present
from frictionid.friction.coordinates import with_units_of
from frictionid.mechanics import Mechanism, Plant

from ..fit import Covariance, Fit
from ..gauss_newton import Conditions
from ..identifier import Identifier
from ..parameter_block import Parameter
from .linearised import Linearised, clusters
from .residual import Problem, mask_stiction, normalised, one_step_problem


@validated
class Recipe:
    """How a one-step problem is made: estimated states and a scheme, "euler" or "integral".

    velocity_threshold : [rad/s] of the stiction mask of a fit, see `mask_stiction`. None: from
    the speeds in each recording. 0 uses all rows, as the study did.
    """

    name: str
    states: Estimator
    scheme: Literal["euler", "integral"]
    velocity_threshold: NotNegative | None = 0.0
    needs_intervals: ClassVar[bool] = False
    calibrated: ClassVar[None] = None
    corrects: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        if self.scheme == "integral" and isinstance(self.states, Backward):
            raise InputError(
                f"recipe {self.name!r}: backward differences lag half a sample, which makes the "
                '"integral" scheme worse than "euler": choose the states "rts" or "savgol"'
            )

    @property
    def steps(self) -> "tuple[Recipe, ...]":
        """The one-step recipes whose problems a fit needs."""
        return (self,)

    def friction_of(
        self, identifier: Identifier, data: "TrainingData", seed: int
    ) -> tuple[Friction, Problem]:
        """The identifier's friction (F + 1, n, P) of the folds and of all data, and its problem."""
        uses = identifier.uses_mechanism
        problem = data.problems[self.name] if uses else data.without_mechanism(self)
        friction = checked_fit(identifier, problem, data.weights[self.name], seed)
        return with_units_of(data.mechanism, friction), problem

    def fit(self, identifier: Identifier, data: "TrainingData", seed: int) -> Fit:
        """The identifier's friction of all folds and of all data; InputError where that fails."""
        friction, problem = self.friction_of(identifier, data, seed)
        weights = data.weights[self.name][-1]
        return one_step_fit(friction, problem, weights, intervals=not identifier.fixed)


class TrainingData(Protocol):
    """What recipes fit: a one-step problem for each, and the weights (F + 1, K) of its rows.

    The rows of the weights are those of the folds' training and, last, of all data.
    """

    @property
    def problems(self) -> Mapping[str, Problem]: ...
    @property
    def weights(self) -> Mapping[str, Array]: ...
    @property
    def mechanism(self) -> Mechanism: ...

    def without_mechanism(self, recipe: Recipe) -> Problem:
        """The problem for joints of unit inertia on which nothing but friction acts."""
        ...


STUDY = Recipe("study", Backward(), "euler")
INTEGRAL = Recipe("integral", RTS(), "integral", velocity_threshold=None)


# --- Problems -------------------------------------------------------------------------------------


def states_of(
    dataset: Dataset, estimator: Estimator, sample_time: float | None
) -> tuple[States, ...]:
    """Estimated states of all recordings, at samples at least `sample_time` apart."""
    angles = [r.angle for r in dataset.recordings]
    if sample_time is None:
        return estimator(angles)
    if isinstance(estimator, Backward):  # differences need the samples they are used at
        few = [thin(States(*a[:2], a.value), sample_time).time for a in angles]
        pairs = zip(angles, few, strict=True)
        return estimator([taken(a, np.searchsorted(a.time, time)) for a, time in pairs])
    return tuple(thin(s, sample_time) for s in estimator(angles))


def problem_of(
    dataset: Dataset,
    plant: Plant,
    recipe: Recipe,
    sample_time: float | None = None,
    history: float = 0.0,
    states: tuple[States, ...] | None = None,
) -> Problem:
    """One-step problem of a data set by a recipe, without stiction mask: for scores.

    The rows are the same for every recipe. Each recording's first interval is left out, where
    backward differences know no velocity yet.

    sample_time : [s] between the samples used, None for all
    history : [s] of each recording before its first row
    states : of the recipe's estimator, if they are known already

    Raises
    ------
    InputError
        Where no recording has a row.
    """
    if states is None:
        states = states_of(dataset, recipe.states, sample_time)
    if all(len(s.time) < 2 for s in states):
        raise InputError(
            f"data set {dataset.name!r}: samples {sample_time} s apart leave no interval of any "
            "recording: lower sample_time"
        )
    lost = 1 if isinstance(recipe.states, Backward) else 0
    before = [max(_samples(history, s.time), 1) - lost for s in states]
    return one_step_problem(recipe.scheme, plant, dataset.recordings, states, before)


def _samples(seconds: float, time: Array) -> int:
    """Samples of a clock in so many seconds."""
    return round(seconds / usual_step(time)) if len(time) > 1 else 0


def training_problem(
    dataset: Dataset,
    plant: Plant,
    recipe: Recipe,
    sample_time: float | None = None,
    history: float = 0.0,
    states: tuple[States, ...] | None = None,
) -> Problem:
    """One-step problem for fits: `problem_of` with the rows of joints at rest projected out.

    Where some joints turn and others slide, r and G are in units of the joints' sizes, as in the
    scores: a fit does not depend on whether a position is in m or in mm.

    Raises
    ------
    InputError
        Where no joint moves, or no recording has a row.
    """
    if not dataset.scales.fast.any():
        raise InputError(
            f"data set {dataset.name!r}: no joint moves by more than the noise of its angle: give "
            "recordings of motion"
        )
    problem = problem_of(dataset, plant, recipe, sample_time, history, states)
    if are_mixed(plant.mechanism.position_units):
        sizes = dataset.scales.size
        problem = replace(problem, r=problem.r / sizes, G=problem.G / sizes[:, None])
    threshold = recipe.velocity_threshold
    return problem if threshold == 0 else mask_stiction(problem, threshold)


# --- Fits -----------------------------------------------------------------------------------------


def checked_fit(identifier: Identifier, problem: Problem, weights: Array, seed: int) -> Friction:
    """Friction (F, n, P) that an identifier fits under weights (F, K), see `checked`."""
    return checked(identifier.fit(problem, weights, seed), identifier, problem, weights)


def checked(
    friction: Friction, identifier: Identifier, problem: Problem, weights: Array
) -> Friction:
    """The friction that an identifier gives.

    Raises
    ------
    InputError
        Where it is not finite, or not one for each row of the weights and each joint.
    """
    shape = np.shape(friction.theta)
    wanted = (len(weights), problem.r.shape[-1], len(friction.law.names))
    if shape != wanted:
        raise InputError(f"{identifier!r} gives theta of shape {shape}, it must be {wanted}")
    if not np.isfinite(friction.theta).all():
        raise InputError(f"{identifier!r}: the fit failed: its numbers are not finite")
    return friction


def one_step_fit(
    friction: Friction, problem: Problem, weights: Array, *, intervals: bool = True
) -> Fit:
    """A fit of friction (F, n, P), of all data with weights (K,) last, with its covariance.

    intervals : whether they are wanted; equations of sparse laws need them always
    """
    last, law = friction[-1], friction.law
    fit = Fit(last, folds=friction, problem=problem, weights=weights)
    named = law.names and not (law.is_network or law.cannot_be_saved)
    if not (law.is_sparse or (intervals and named)):
        return fit
    matrix, freedom = covariance_of_fit(last, problem, weights)
    parameters = tuple(
        Parameter("friction", f"{name} of joint {j + 1}", last.units_at(j)[i], 0.0, place=(j, i))
        for j in range(last.n)
        for i, name in enumerate(law.names)
    )
    nowhere = np.zeros(len(parameters), dtype=bool)
    covariance = Covariance(
        *(parameters, np.ravel(last.theta), matrix, freedom), bound=nowhere, meaningless=nowhere
    )
    return replace(fit, covariance=covariance)


# --- Errors ---------------------------------------------------------------------------------------


KNOWN = 0.5  # of its size, a standard error: a parameter that is known no better is not identified
_BLIND = 1e-13  # of the largest eigenvalue
CLEAR = 9.0  # deviance, adjusted: a fit that is worse by more is shown to be worse


def covariance_of_fit(friction: Friction, problem: Problem, weights: Array) -> tuple[Array, int]:
    """Covariance (n P, n P) of the parameters of a fit, of noise alone, and its degrees of freedom.

    By the sandwich H^-1 (sum_c s_c s_c') H^-1, with H = J'WJ, and the score s_c = J'We of
    each cluster c of rows: a recording, or where these are few, a stretch of one. What all
    recordings share, as the bias of smoothed states, is not in it. NaN where the data do not
    determine a parameter, and for terms that a sparse law does not have; equal joints are
    correlated by one.

    >>> from frictionid.fitting.identifiers import LeastSquares
    >>> from frictionid.fitting.identifiers.check_identifier import synthetic_problem
    >>> from frictionid.friction.laws import Stribeck
    >>> problem = synthetic_problem(1)
    >>> weights = np.ones((1, len(problem.r)))
    >>> fit = LeastSquares(Stribeck()).fit(problem, weights, 0)[0]
    >>> covariance, freedom = covariance_of_fit(fit, problem, weights[0])
    >>> np.sqrt(covariance.diagonal()).round(4), freedom
    (array([0.0012, 0.0013, 0.0369, 0.0002]), 20)
    >>> fit.theta.round(4)  # truth: 0.10, 0.04, 1.5, 0.02
    array([[0.0989, 0.0415, 1.5209, 0.0202]])
    """
    law, limits = problem.fitted_form(friction.law), friction.constraints
    linear = Linearised(law, problem, tie=None if limits is None else limits.tie)
    theta = linear.once(np.asarray(friction.theta)[None])
    share, label = normalised(np.reshape(weights, (1, -1)), problem)[0], clusters(problem)
    H, scores = _summed(linear, label, theta[0], linear.residual(theta)[0], share)
    determined = np.diag(H) > 0
    determined &= linear.once(
        np.broadcast_to(present(law, friction.theta), friction.theta.shape)[None]
    )[0]
    keep, used = np.flatnonzero(determined), np.unique(label[share > 0])
    bread = np.linalg.pinv(H[np.ix_(keep, keep)], hermitian=True)
    moves, freedom = scores[np.ix_(used, keep)] @ bread, max(len(used) - 1, 1)
    out = np.full(H.shape, np.nan)
    out[np.ix_(keep, keep)] = moves.T @ moves * len(used) / freedom
    if linear.tie is not None:
        each = linear.tie.argmax(axis=1)
        out = out[np.ix_(each, each)]
    return out, freedom


def _summed(
    law: Linearised, label: Array, theta: Array, residual: Array, weights: Array
) -> tuple[Array, Array]:
    """J'WJ (N, N) at theta (N,), and the score J'We (C, N) of each cluster, labels (K,)."""
    N = len(theta)
    H, scores = np.zeros((N, N)), np.zeros((int(label.max()) + 1, N))
    for rows, part in law.stretches():
        J = part.jacobian(theta[None])[0].reshape(*part.problem.r.shape, -1)
        J = J if law.tie is None else J @ law.tie
        weighted = J * weights[rows, None, None]
        H += weighted.reshape(-1, N).T @ J.reshape(-1, N)
        each = np.einsum("kip,ki->kp", weighted, residual[rows])
        for p, column in enumerate(each.T):
            scores[:, p] += np.bincount(label[rows], column, minlength=len(scores))
    return H, scores


class Spread(NamedTuple):
    """What rows tell of parameters.

    error : (F, N), standard errors by clusters of rows, infinite without a trace
    excess : (F, N), their variance over that by the curvature, at least 1
    variance : (F,) of the weighted residuals
    """

    error: Array
    excess: Array
    variance: Array

    def worst(self, theta: Array, neutral: Array, size: Array, among: Array) -> Array:
        """The parameter (F, N) of each fit that is known least, if one `among` some is not known.

        Its error exceeds half of its size, and its interval holds the neutral value.
        """
        off = np.abs(theta - neutral)
        unknown = among & (off > 0) & (self.error > np.maximum(KNOWN * size, off / 2.0))
        measure = np.where(unknown, self.error / np.where(np.isfinite(size), size, 1.0), -1.0)
        out = np.zeros_like(unknown)
        out[np.arange(len(out)), np.argmax(measure, axis=1)] = True
        return out & unknown

    def shown(
        self, law: Linearised, theta: Array, without: Array, under: Conditions, chosen: Array
    ) -> Array:
        """Whether (F,) fits without some chosen parameters (F, N) are clearly worse than with."""
        before, after = (law.cost(law.residual(x), under.weights) for x in (theta, without))
        most = np.where(chosen, self.excess, 1.0).max(axis=1)
        return after - before > CLEAR * most * self.variance


def spread_of(law: Linearised, theta: Array, residual: Array, under: Conditions) -> Spread:
    """What the rows tell of the parameters (F, N) at a minimum, with the residuals (F, K, n) there.

    Bounds count for nothing here: where two parameters do the same, one of them often ends at zero,
    and the other one is not known any better for that.
    """
    label = clusters(law.problem)
    free = under.low < under.high
    each = zip(theta, residual, under.weights, free, strict=True)
    return Spread(
        *(np.stack(x) for x in zip(*(_of_fold(law, label, *f) for f in each), strict=True))
    )


def _of_fold(
    law: Linearised, label: Array, theta: Array, residual: Array, weights: Array, free: Array
) -> tuple[Array, Array, Array]:
    """Errors (N,), ratios (N,) and variance of one fold."""
    N, used = len(theta), np.unique(label[weights > 0])
    freedom = max(int((weights > 0).sum()) * residual.shape[1] - N, 1)
    variance = np.einsum("k,ki->", weights, residual**2) / freedom
    H, scores = _summed(law, label, theta, residual, weights)
    trace = np.diag(H) > _BLIND * np.diag(H).max(initial=0.0)
    shown = free & trace
    error, excess = np.where(free | ~trace, np.inf, 0.0), np.ones(N)
    keep, count = np.flatnonzero(shown), max(len(used) - 1, 1)
    inverse = _inverse(H[np.ix_(keep, keep)])
    moves = scores[np.ix_(used, keep)] @ inverse
    by_rows = variance * np.diag(inverse)
    by_cluster = np.maximum((moves**2).sum(axis=0) * len(used) / count, by_rows)
    error[keep], excess[keep] = np.sqrt(by_cluster), by_cluster / np.maximum(by_rows, 1e-300)
    return error, excess, variance


def _inverse(H: Array) -> Array:
    size = np.sqrt(np.diag(H))
    value, vector = np.linalg.eigh(H / np.outer(size, size))
    # a combination without a trace is known no better than rounding
    value = np.maximum(value, _BLIND * value.max(initial=0.0))
    return (vector / value) @ vector.T / np.outer(size, size)
