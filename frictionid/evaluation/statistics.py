"""Statistics of errors that are known fold by fold: which models are practically worse.

Folds of a cross-validation share most of their training data, so that their errors are correlated
and the ordinary standard error is too small [BengioGrandvalet2004]. Both tests here widen it by the
same factor: the corrected t-test [NadeauBengio2003] gives interval and p-value, the Bayesian
correlated t-test [Corani2015] gives probabilities that the difference lies below, inside and above
a region of practical equivalence [Benavoli2017].
"""

from typing import NamedTuple

import numpy as np
from scipy.special import stdtr, stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array

FEWEST = 3  # folds, below which a scatter says nothing
CERTAIN = 0.95  # probability from which on a statement counts as shown
REGION = 0.1  # of the best model's error: smaller differences make no practical difference


class CorrelatedTest(NamedTuple):
    """Mean of paired differences over the folds, and what is known about it.

    Attributes
    ----------
    mean, error : the mean difference and its corrected standard error
    low, high : 95 % interval of the difference
    p_value : two-sided, that there is no difference
    below, inside, above : probabilities that the difference is below -region, within, above region
    folds : number of differences
    """

    mean: float
    error: float
    low: float
    high: float
    p_value: float
    below: float
    inside: float
    above: float
    folds: int


def correlated_test(
    differences: Array, region: float, *, test_share: float | None = None
) -> CorrelatedTest:
    """Corrected t-test and Bayesian correlated t-test of paired differences (J,).

    With s the standard deviation of the differences and a share rho of the data in each test set

        error^2 = s^2 (1/J + rho/(1 - rho)),

    and (mean - difference)/error has Student's t distribution with J - 1 degrees of freedom: the
    sampling distribution of the corrected t-test, and the posterior of the Bayesian one.

    Parameters
    ----------
    differences : array (J,), all finite
        Errors of one model less those of the other, of each fold.
    region : float
        Half the width of the region of practical equivalence, in the unit of the differences.
    test_share : float, optional
        Share rho of the data in each test set; without it that of a cross-validation, 1/J.

    Raises
    ------
    ValueError
        With fewer than two differences, or where one is not finite.

    Examples
    --------
    >>> test = correlated_test(np.array([0.05, 0.0, 0.01, 0.04]), region=0.02)
    >>> [round(p, 3) for p in (test.below, test.inside, test.above)]
    [0.045, 0.356, 0.599]
    """
    count = len(differences)
    if count < 2 or not np.isfinite(differences).all():
        raise ValueError(f"differences of {count} folds: at least 2, all finite")
    share = 1.0 / count if test_share is None else test_share
    mean, deviation = float(np.mean(differences)), float(np.std(differences, ddof=1))
    return t_test(mean, deviation * np.sqrt(1.0 / count + share / (1.0 - share)), count, region)


def t_test(mean: float, error: float, count: int, region: float) -> CorrelatedTest:
    """The test of a mean difference of so many folds or recordings by its standard error."""
    if error == 0.0:  # all agree
        sides = float(mean < -region), float(mean > region)
        inside = 1.0 - sum(sides)
        p_value = float(mean == 0.0)
        return CorrelatedTest(mean, 0.0, mean, mean, p_value, sides[0], inside, sides[1], count)
    below, above = (float(stdtr(count - 1, (-region + s * mean) / error)) for s in (-1.0, 1.0))
    half = float(stdtrit(count - 1, 0.975) * error)
    low, high = mean - half, mean + half
    p_value = 2.0 * float(stdtr(count - 1, -abs(mean) / error))
    error, inside = float(error), 1 - below - above
    return CorrelatedTest(mean, error, low, high, p_value, below, inside, above, count)


class Pair(NamedTuple):
    """Mean difference over the folds with its corrected error; NaN where one is not finite.

    p_value : two-sided, of the corrected t-test
    """

    mean: float
    error: float
    folds: int
    p_value: float = float("nan")

    @property
    def clear(self) -> bool | None:
        """Whether its 95 % interval excludes zero; None if that is not known."""
        if self.folds < FEWEST or not np.isfinite(self.mean):
            return None
        return bool(self.p_value < 1 - CERTAIN)


def paired(mine: Array, other: Array) -> Pair:
    """Scores of a model less those of another one, both of the same folds (J,).

    >>> paired(np.array([0.3, 0.4, 0.5]), np.array([0.1, 0.3, 0.3])).clear
    False
    """
    if len(mine) != len(other) or len(mine) < 2:
        return Pair(float("nan"), float("nan"), 0)
    finite = np.isfinite(mine) & np.isfinite(other)
    if not finite.all():
        return Pair(float("nan"), float("nan"), len(mine))
    test = correlated_test(mine - other, 0.0)
    return Pair(test.mean, test.error, test.folds, test.p_value)
