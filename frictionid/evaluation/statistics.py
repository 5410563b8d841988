"""Statistics of errors that are known fold by fold: which models are practically worse.

Folds of a cross-validation share most of their training data, so that their errors are correlated
and the ordinary standard error is too small [BengioGrandvalet2004]. Both tests here widen it by the
same factor: the corrected t-test [NadeauBengio2003] gives interval and p-value, the Bayesian
correlated t-test [Corani2015] gives probabilities that the difference lies below, inside and above
a region of practical equivalence [Benavoli2017].
"""

from __future__ import annotations

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
    error = deviation * float(np.sqrt(1.0 / count + share / (1.0 - share)))
    if error == 0.0:  # all folds agree
        sides = float(mean < -region), float(mean > region)
        inside = 1.0 - sum(sides)
        p_value = float(mean == 0.0)
        return CorrelatedTest(mean, 0.0, mean, mean, p_value, sides[0], inside, sides[1], count)
    below, above = (float(stdtr(count - 1, (-region + s * mean) / error)) for s in (-1.0, 1.0))
    half = float(stdtrit(count - 1, 0.975)) * error
    low, high = mean - half, mean + half
    p_value = 2.0 * float(stdtr(count - 1, -abs(mean) / error))
    return CorrelatedTest(mean, error, low, high, p_value, below, 1 - below - above, above, count)


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


class Standing(NamedTuple):
    """How a model stands against the best one.

    standing : "best"; "adequate", shown to be not practically worse; "worse", shown to be;
        "undecided", neither; "diverged", its error is not finite in every fold
    test : of its errors less those of the best, None where they are not finite
    """

    standing: str
    test: CorrelatedTest | None


class Choice(NamedTuple):
    """Which of several models the rule recommends, by their places.

    best : the lowest mean error; None where no model is finite
    region : half the width of the region of practical equivalence, 10 % of that error; of relative
        errors ln(1.1)
    standings : of all models
    simplest : the simplest one that is not shown to be practically worse
    adequate : the simplest one that is shown to be not practically worse
    """

    best: int | None
    region: float
    standings: tuple[Standing, ...]
    simplest: int | None
    adequate: int | None

    @property
    def recommended(self) -> int | None:
        """The model that the rule recommends; None where these data cannot tell."""
        return self.adequate if self.adequate == self.simplest else None


def choose(
    errors: Array,
    complexity: Array,
    implausible: Array | None = None,
    *,
    relative: bool = False,
) -> Choice:
    """The simplest model that is not practically worse than the best.

    The best model has the lowest mean error. Another one is practically worse where its error is
    larger by more than a tenth of the best one's with a probability of 95 %, and adequate where
    that has a probability of at most 5 % (`correlated_test`). Models are simple in the order of
    their complexity; of equally complex ones the first is that of the lower error.

    Parameters
    ----------
    errors : array (M, J)
        Error of each model in each fold.
    complexity : array (M,)
        Effective number of parameters; infinite for models that are never simpler than others.
    implausible : bool array (M,), optional
        Models that are chosen only where no other is left.
    relative : bool
        Whether the logarithms of the errors are compared. With few folds, of very different motion,
        the largest error hides what all folds agree on.

    Examples
    --------
    The first model makes no practical difference, the second one does:

    >>> folds = np.array([0.30, 0.31, 0.29, 0.30, 0.32])
    >>> choose(np.array([folds, folds + 0.003]), np.array([8.0, 4.0])).recommended
    1
    >>> choose(np.array([folds, folds + 0.3]), np.array([8.0, 4.0])).recommended
    0
    """
    finite = np.all(np.isfinite(errors), axis=1)
    if errors.shape[1] < FEWEST or not finite.any():
        return Choice(None, float("nan"), (), None, None)
    if relative:
        errors = np.log(errors)
    means = np.where(finite[:, None], errors, np.inf).mean(axis=1)
    best = int(np.argmin(means))
    region = float(np.log(1.0 + REGION)) if relative else REGION * float(means[best])
    standings = []
    for place, model_errors in enumerate(errors):
        test = correlated_test(model_errors - errors[best], region) if finite[place] else None
        standings.append(Standing(_standing(test, place == best), test))
    last = np.zeros(len(errors)) if implausible is None else implausible
    order = np.lexsort((means, complexity, last))
    kept = [int(i) for i in order if standings[i].standing not in ("worse", "diverged")]
    shown = [i for i in kept if standings[i].standing != "undecided"]
    return Choice(best, region, tuple(standings), kept[0], shown[0])


def _standing(test: CorrelatedTest | None, is_best: bool) -> str:
    if test is None:
        return "diverged"
    if is_best:
        return "best"
    if test.above >= CERTAIN:
        return "worse"
    return "adequate" if test.above <= 1 - CERTAIN else "undecided"
