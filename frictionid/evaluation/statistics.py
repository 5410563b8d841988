"""Tests of paired scores of folds: whether one model's are lower than another one's."""

from typing import NamedTuple

import numpy as np
from scipy.special import stdtr, stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array

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
