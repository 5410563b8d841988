"""Statistics of models: whether one scores lower than another, and how complex each is."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.special import stdtr, stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.fitting.gauss_newton import Conditions
from frictionid.fitting.one_step.linearised import Linearised
from frictionid.fitting.one_step.recipe import spread_of
from frictionid.fitting.one_step.residual import Problem, normalised
from frictionid.friction import Friction, present
from frictionid.friction.laws.levels import stem
from frictionid.friction.provenance import Estimates

FEWEST = 3  # folds, below which a scatter says nothing
REGION = 0.1  # of the best model's error: smaller differences make no practical difference


class CorrelatedTest(NamedTuple):
    """Mean of paired differences over the folds, and what is known about it; else NaN.

    Folds of a cross-validation share most of their training data, so that their errors are
    correlated and the ordinary standard error is too small [BengioGrandvalet2004]. It is widened:
    the corrected t-test [NadeauBengio2003] gives interval and p-value, the Bayesian correlated
    t-test [Corani2015] the probabilities that the difference lies below and above a region of
    practical equivalence [Benavoli2017].

    Attributes
    ----------
    mean, error : the mean difference and its corrected standard error
    folds : number of differences
    low, high : 95 % interval of the difference
    p_value : two-sided, that there is no difference
    below, above : probabilities that the difference is below -region, and above region
    """

    mean: float
    error: float
    folds: int
    low: float = float("nan")
    high: float = float("nan")
    p_value: float = float("nan")
    below: float = float("nan")
    above: float = float("nan")

    @property
    def clear(self) -> bool | None:
        """Whether its 95 % interval excludes zero; None if that is not known."""
        if self.folds < FEWEST or not np.isfinite(self.mean):
            return None
        return bool(self.p_value < 0.05)


def correlated_test(differences: Array, region: float) -> CorrelatedTest:
    """Corrected t-test and Bayesian correlated t-test of paired differences (J,).

    With s the standard deviation of the differences, and a share 1/J of the data in each test set,

        error^2 = s^2 (1/J + 1/(J - 1)),

    and (mean - difference)/error has Student's t distribution with J - 1 degrees of freedom: the
    sampling distribution of the corrected t-test, and the posterior of the Bayesian one.

    Parameters
    ----------
    differences : array (J,), all finite
        Errors of one model less those of the other, of each fold.
    region : float
        Half the width of the region of practical equivalence, in the unit of the differences.

    Raises
    ------
    ValueError
        With fewer than two differences, or where one is not finite.

    Examples
    --------
    >>> test = correlated_test(np.array([0.05, 0.0, 0.01, 0.04]), region=0.02)
    >>> [round(p, 3) for p in (test.below, test.above)]
    [0.045, 0.599]
    """
    count = len(differences)
    if count < 2 or not np.isfinite(differences).all():
        raise ValueError(f"differences of {count} folds: at least 2, all finite")
    share = 1.0 / count
    mean, deviation = float(np.mean(differences)), float(np.std(differences, ddof=1))
    return t_test(mean, deviation * np.sqrt(1.0 / count + share / (1.0 - share)), count, region)


def t_test(mean: float, error: float, count: int, region: float) -> CorrelatedTest:
    """The test of a mean difference of so many folds or recordings by its standard error."""
    if error == 0.0:  # all agree
        sides = float(mean < -region), float(mean > region)
        return CorrelatedTest(mean, 0.0, count, mean, mean, float(mean == 0.0), *sides)
    below, above = (float(stdtr(count - 1, (-region + s * mean) / error)) for s in (-1.0, 1.0))
    half = float(stdtrit(count - 1, 0.975) * error)
    p_value = 2.0 * float(stdtr(count - 1, -abs(mean) / error))
    return CorrelatedTest(
        mean, float(error), count, mean - half, mean + half, p_value, below, above
    )


def paired(mine: Array, other: Array) -> CorrelatedTest:
    """Scores of a model less those of another one, both of the same folds (J,).

    >>> paired(np.array([0.3, 0.4, 0.5]), np.array([0.1, 0.3, 0.3])).clear
    False
    """
    nothing = float("nan")
    if len(mine) != len(other) or len(mine) < 2:
        return CorrelatedTest(nothing, nothing, 0)
    if not (np.isfinite(mine) & np.isfinite(other)).all():
        return CorrelatedTest(nothing, nothing, len(mine))
    return correlated_test(mine - other, 0.0)


# --- Effective parameters, and what each of them has to save --------------------------------------

_BY_DIRECTION = " by direction"
_RANK = 1e-10  # of the largest eigenvalue: smaller ones are rounding


def effective_parameters(friction: Friction, problem: Problem, weights: Array) -> float:
    """Effective number of parameters of friction (n, P) that was fitted to a problem, weights (K,).

    The trace of the hat matrix, with the Jacobian J of the residuals and the precision Q of the
    priors in units of the residuals' variance, times the excess of each parameter, see `Spread`,

        tr(H (H + Q)^-1),    H = J'WJ,

    over the parameters that lie at no bound and, of a sparse law, are terms that it has. Without
    priors this is how many of them the rows determine. A network has as many as weights: early
    stopping and weight decay leave fewer, which no linear theory counts.

    >>> from frictionid.fitting.identifiers.least_squares import LeastSquares
    >>> from frictionid.fitting.identifiers.check_identifier import synthetic_problem
    >>> from frictionid.friction.laws import Stribeck
    >>> problem = synthetic_problem(1)
    >>> weights = np.ones((1, len(problem.r)))
    >>> fit = LeastSquares(Stribeck()).fit(problem, weights, 0)[0]
    >>> round(effective_parameters(fit, problem, weights[0]), 6)
    4.0
    """
    theta = np.asarray(friction.theta, dtype=float)
    if friction.law.is_network or not theta.size:
        return float(theta.size)
    free = present(friction.law, theta)
    constraints = friction.constraints
    if constraints is not None:
        free = free & (theta > constraints.low) & (theta < constraints.high)
    law, flat = Linearised(friction.law, problem), theta.reshape(1, -1)
    share = normalised(np.reshape(weights, (1, -1)), problem)
    residual = law.residual(flat)
    hessian = law.normal_equations(flat, residual, share)[1][0]
    precision, free = np.zeros(len(hessian)), free.ravel()
    if constraints is not None:
        none = np.zeros_like(flat)
        under = Conditions(share, none - np.inf, none + np.inf, none, none, np.zeros(1))
        spread = spread_of(law, flat, residual, under)
        precision = constraints.deviation.ravel() ** -2.0 * spread.excess[0] * spread.variance[0]
        if constraints.tie is not None:  # equal joints have their parameters together
            once = constraints.tie.argmax(axis=0)
            hessian, precision, free = (
                constraints.tie.T @ hessian @ constraints.tie,
                precision[once],
                free[once],
            )
    hessian, precision = hessian[np.ix_(free, free)], precision[free]
    return trace_of_hat(hessian, precision)


def trace_of_hat(hessian: Array, precision: Array) -> float:
    """Trace of H (H + Q)^-1 for normal equations H (N, N) and a diagonal Q (N,).

    >>> trace_of_hat(np.diag([4.0, 1.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    1.5
    """
    size = np.sqrt(np.diag(hessian) + precision)
    scale = np.where(size > 0, size, 1.0)
    H = hessian / np.outer(scale, scale)
    inner = np.linalg.pinv(H + np.diag(precision / scale**2), rcond=_RANK, hermitian=True)
    return float(np.trace(inner @ H))


def nested_names(names: Iterable[str]) -> frozenset[str]:
    """Names of parameters, of laws that differ by direction together with those of other laws.

    >>> sorted(nested_names(["coulomb_positive", "coulomb_negative", "viscous"]))
    ['coulomb', 'coulomb by direction', 'viscous']
    """
    names = frozenset(names)
    stems = frozenset(map(stem, names))
    return stems | {f"{name}{_BY_DIRECTION}" for name in stems - names}


def shown_names(estimates: Estimates | None) -> frozenset[str] | None:
    """Of these names those of friction that data tell from zero, at any joint (99 %).

    None where a fit has no intervals. Velocities say nothing of how much there is, and are not
    among them. A torque differs by direction where the interval of the difference does not hold
    zero.
    """
    if estimates is None:
        return None
    reach = float(stdtrit(estimates.freedom, 0.995))
    used = [
        (k, e)
        for k, e in enumerate(estimates.parameters)
        if e.block == "friction" and e.unit != "rad/s" and not e.at_bound
    ]
    names = {stem(e.parameter) for _, e in used if abs(e.value) > reach * e.error}
    for (i, a), (j, b) in combinations(used, 2):
        if (a.joint, stem(a.parameter)) == (b.joint, stem(b.parameter)):
            C = estimates.square(estimates.covariance)
            if abs(a.value - b.value) > reach * np.sqrt(C[i, i] + C[j, j] - 2.0 * C[i, j]):
                names.add(f"{stem(a.parameter)}{_BY_DIRECTION}")
    return frozenset(names)


def zero_names(document: Mapping[str, Any]) -> frozenset[str]:
    """Names of the parameters that are zero at all joints of a model file, and of velocities."""
    entries = [pair for joint in document.get("joints", ()) for pair in joint.items()]
    amounts = {stem(name) for name, e in entries if e["value"] and e["unit"] != "rad/s"}
    return frozenset(stem(name) for name, _ in entries) - amounts


def nested_complexity(counts: Sequence[float], names: Sequence[frozenset[str]]) -> Array:
    """Complexities (M,) of models: their effective parameters, more than those of nested models.

    Which parameters a fit determines is chance where some make no difference; a law that has all
    parameters of another one, by their `nested_names`, and further ones is never the simpler one.

    >>> levels, peak = frozenset({"coulomb", "viscous"}), frozenset({"coulomb", "viscous", "peak"})
    >>> nested_complexity([4.0, 3.0, 9.0], [levels, peak, frozenset()])
    array([4., 5., 9.])
    """
    out = np.array(counts, dtype=float)
    for i in sorted(range(len(out)), key=lambda i: len(names[i])):
        inner = [out[k] + 1.0 for k in range(len(out)) if names[k] and names[k] < names[i]]
        out[i] = max([out[i], *inner])
    return out


def information_criteria(
    squares: Sequence[float], counts: Sequence[float], parameters: float, units: float | None = None
) -> tuple[float, float]:
    """Akaike's and Schwarz's criterion [Akaike1974], [Schwarz1978] of normal residuals.

    Of two fits to the same residuals the lower is better.

    -2 log likelihood = sum_j N_j ln(S_j/N_j) + constant, with an unknown noise for each joint.

    Where residuals err alike, the likelihood is a composite one: the parameters then count
    tr(J^-1 K), by curvature J and scatter K of the score between independent units, and the sample
    is as large as these are many [VarinVidoni2005].

    squares, counts : (n,) sums of squares S and numbers of residuals N, less those that free
        initial states take; parameters : effective number; units : independent ones, by default all
        residuals

    >>> one, other = (information_criteria([s], [100.0], k) for s, k in ((1.0, 2), (0.9, 3)))
    >>> np.subtract(other, one).round(2)
    array([-8.54, -5.93])
    """
    S, N = np.asarray(squares, dtype=float), np.asarray(counts, dtype=float)
    deviance = float(np.sum(N * np.log(S / N)))
    size = float(N.sum()) if units is None else units
    return deviance + 2 * parameters, deviance + float(np.log(size)) * parameters
