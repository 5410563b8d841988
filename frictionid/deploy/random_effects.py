"""Random effects: estimates of several specimens, each with its error, as one distribution.

    y_i = mu + u_i + e_i,   u_i ~ N(0, tau^2) between specimens,   e_i ~ N(0, s_i^2) of estimates

With weights w_i = 1/(tau^2 + s_i^2) and the weighted mean m, the generalised statistic of Cochran

    Q(tau^2) = sum_i w_i (y_i - m)^2

has a chi-squared distribution with k - 1 degrees of freedom at the true tau [Viechtbauer2007]. All
follows from it: tau itself, where Q = k - 1 [PauleMandel1982], the fixed point of the iterated
estimator of DerSimonian and Laird [DerSimonianKacker2007]; its interval; and the distribution of
another specimen's true value, the mixture of

    N(m(tau_c^2), 1/sum_i w_i(tau_c^2) + tau_c^2),   Q(tau_c^2) = c,

over the quantiles c of chi-squared, which is over the confidence distribution of tau
[Nagashima2019]. It is exact where the errors vanish, a t distribution then, and it knows that a few
specimens say little of tau.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.special import chdtrc, chdtri, ndtr, stdtr, stdtrit  # scipy.stats takes half a second

from frictionid.arrays import Array
from frictionid.friction.provenance import Pooled

_POINTS = 400  # of the mixture
_HALVINGS = 40


class RandomEffects(NamedTuple):
    """One quantity of several specimens.

    Attributes
    ----------
    mean, error : the mean of all specimens there may be, and its standard error
    freedom : of the t distribution of the mean, specimens less one
    tau, tau_low, tau_high : standard deviation between specimens, with its 95 % interval
    Q, p_value : heterogeneity: Q at tau = 0, and how likely more is where all are alike
    means, deviations : (M,) of the normal distributions whose mixture another specimen follows
    """

    mean: float
    error: float
    freedom: int
    tau: float
    tau_low: float
    tau_high: float
    Q: float
    p_value: float
    means: Array
    deviations: Array

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval of the mean [HartungKnapp2001]."""
        half = float(stdtrit(self.freedom, 0.5 + level / 2)) * self.error
        return self.mean - half, self.mean + half

    def probability(self, x: Array) -> Array:
        """Probability that another specimen lies below values x, of any shape."""
        z = (np.asarray(x)[..., None] - self.means) / self.deviations
        return ndtr(z).mean(axis=-1)

    def quantile(self, p: float) -> float:
        """Value below which another specimen lies with probability p."""
        low = float(np.min(self.means - 40.0 * self.deviations))
        high = float(np.max(self.means + 40.0 * self.deviations))
        return float(_bisected(lambda x: self.probability(x) < p, low, high))

    def range(self) -> tuple[float, float]:
        """95 % prediction interval of another specimen, no narrower than that of the mean."""
        low, high = self.interval()
        return min(self.quantile(0.025), low), max(self.quantile(0.975), high)


def random_effects(values: Array, errors: Array) -> RandomEffects:
    """Random-effects meta-analysis of two or more estimates (k,) with standard errors (k,).

    The standard error of the mean is 1/sqrt(sum w), with a t distribution of k - 1 degrees of
    freedom: that of Hartung and Knapp, whose factor is one at this tau, and is not let fall below
    one where tau is zero [Rover2015].

    Examples
    --------
    >>> levels = random_effects(np.array([0.10, 0.14, 0.12, 0.17]), np.full(4, 0.005))
    >>> round(levels.mean, 4), round(levels.tau, 4), round(levels.p_value, 4)
    (0.1325, 0.0294, 0.0)
    >>> [round(end, 3) for end in levels.range()]  # of another specimen
    [0.027, 0.238]
    """
    y, s = np.asarray(values, dtype=float), np.asarray(errors, dtype=float)
    freedom = len(y) - 1
    levels = np.append((np.arange(_POINTS) + 0.5) / _POINTS, [0.025, 0.975])
    X = np.ones((len(y), 1))
    variance = between(X, y, s, np.append(chdtri(freedom, 1.0 - levels), freedom))
    line, covariance, _ = weighted(X, y, s, variance)
    homogeneous = float(weighted(X, y, s, np.zeros(1))[2][0])
    return RandomEffects(
        mean=float(line[-1, 0]),
        error=float(covariance[-1, 0, 0] ** 0.5),
        freedom=freedom,
        tau=float(np.sqrt(variance[-1])),
        tau_low=float(np.sqrt(variance[-2])),
        tau_high=float(np.sqrt(variance[-3])),
        Q=homogeneous,
        p_value=float(chdtrc(freedom, homogeneous)),
        means=line[:_POINTS, 0],
        deviations=np.sqrt(covariance[:, 0, 0] + variance)[:_POINTS],
    )


def weighted(X: Array, y: Array, s: Array, variance: Array) -> tuple[Array, Array, Array]:
    """Weighted least squares of y (k,) on X (k, p) at variances tau^2 (N,).

    Coefficients (N, p), their covariance (N, p, p), and Q (N,), which falls as tau^2 grows.
    """
    w = 1.0 / (variance[:, None] + s**2)
    covariance = np.linalg.inv(np.einsum("nk,ki,kj->nij", w, X, X))
    line = np.einsum("nij,kj,nk->ni", covariance, X, w * y)
    return line, covariance, (w * (y - line @ X.T) ** 2).sum(axis=1)


def between(X: Array, y: Array, s: Array, level: Array) -> Array:
    """Variances tau^2 (N,) at which Q is as large as levels (N,); zero where it never is."""
    low, high = np.zeros(len(level)), np.sum((y - y.mean()) ** 2) / level  # Q is below there
    low, high = np.where(weighted(X, y, s, low)[2] <= level, [low, low], [low, high])
    return _bisected(lambda x: weighted(X, y, s, x)[2] > level, low, high)


def _bisected(is_below: Callable[[Any], Any], low: Any, high: Any) -> Any:
    """Numbers between low and high up to which `is_below` holds."""
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = np.where(is_below(middle), [middle, high], [low, middle])
    return (low + high) / 2


_GRID = 501  # points of a distribution between the ends of its range


def pooled_draws(pooled: Pooled, count: int, seed: int) -> Array:
    """Samples (count, D) of the pooled parameters: another specimen's, within the 95 % ranges.

    Each parameter by itself: how they go together, a few specimens do not show.
    """
    random = np.random.default_rng(seed)
    out = np.empty((count, len(pooled.parameters)))
    for k, e in enumerate(pooled.parameters):
        effects = random_effects(np.array(e.values), np.array(e.errors))
        x = np.linspace(*e.range_95, _GRID)
        below = effects.probability(x)
        out[:, k] = np.interp(random.uniform(below[0], below[-1], count), below, x)
    return out


class Regression(NamedTuple):
    """A parameter as a line over a covariate.

    Attributes
    ----------
    centre : of the covariate, where `level` is the value
    level, slope : at the centre, and per unit of the covariate
    covariance : (2, 2) of both
    freedom : of the t distribution, fits less two
    tau : standard deviation of the fits about the line, beyond their errors
    """

    centre: float
    level: float
    slope: float
    covariance: Array
    freedom: int
    tau: float

    @property
    def p_value(self) -> float:
        """How likely a slope as large is where the covariate changes nothing."""
        size = abs(self.slope) / float(self.covariance[1, 1]) ** 0.5
        return 2.0 * float(stdtr(self.freedom, -size))

    def at(self, x: float) -> float:
        """Value at a covariate."""
        return self.level + self.slope * (x - self.centre)

    def half_widths(self) -> tuple[float, float]:
        """Of the 95 % intervals of level and slope."""
        reach = float(stdtrit(self.freedom, 0.975))
        level, slope = np.sqrt(np.diag(self.covariance))
        return reach * float(level), reach * float(slope)


def meta_regression(values: Array, errors: Array, covariate: Array) -> Regression:
    """Random-effects regression of estimates (k,) with standard errors (k,) on a covariate (k,).

    There are three or more, over a covariate that varies.

    Examples
    --------
    >>> cold_to_warm = np.array([20.0, 30.0, 40.0, 50.0])
    >>> line = meta_regression(0.1 - 0.001 * (cold_to_warm - 35), np.full(4, 1e-4), cold_to_warm)
    >>> round(line.level, 4), round(line.slope, 6), round(line.at(20.0), 4)
    (0.1, -0.001, 0.115)
    """
    y, s, x = (np.asarray(a, dtype=float) for a in (values, errors, covariate))
    centre = float(x.mean())
    X = np.stack([np.ones_like(x), x - centre], axis=1)
    freedom = len(y) - 2
    variance = between(X, y, s, np.array([float(freedom)]))
    line, covariance, Q = (part[0] for part in weighted(X, y, s, variance))
    covariance = covariance * max(1.0, float(Q) / freedom)
    tau = float(variance[0]) ** 0.5
    return Regression(centre, float(line[0]), float(line[1]), covariance, freedom, tau)
