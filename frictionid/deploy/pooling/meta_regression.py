"""Estimates of several fits over a covariate, each with its error: a random-effects regression.

    y_i = level + slope (x_i - centre) + u_i + e_i,   u_i ~ N(0, tau^2),   e_i ~ N(0, s_i^2)

by weighted least squares, w_i = 1/(tau^2 + s_i^2), tau where the weighted sum of squares Q is its
expectation, the degrees of freedom k - 2 [PauleMandel1982]; intervals by Student's t of k - 2
degrees with the factor of Knapp and Hartung, which is not let fall below one [KnappHartung2003].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import stdtr, stdtrit  # scipy.stats takes half a second

from frictionid.arrays import Array

_HALVINGS = 60


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

    Raises
    ------
    ValueError
        With fewer than three values, or a covariate that does not vary.

    Examples
    --------
    >>> cold_to_warm = np.array([20.0, 30.0, 40.0, 50.0])
    >>> found = meta_regression(0.1 - 0.001 * (cold_to_warm - 35), np.full(4, 1e-4), cold_to_warm)
    >>> round(found.level, 4), round(found.slope, 6), round(found.at(20.0), 4)
    (0.1, -0.001, 0.115)
    """
    y, s, x = (np.asarray(a, dtype=float) for a in (values, errors, covariate))
    if len(y) < 3 or np.ptp(x) == 0:
        raise ValueError(f"{len(y)} values: at least 3, over a covariate that varies")
    centre = float(x.mean())
    X = np.stack([np.ones_like(x), x - centre], axis=1)
    freedom = len(y) - 2
    low, high = 0.0, float(np.sum((y - y.mean()) ** 2)) / freedom  # Q is below its mean there
    if _fit(X, y, s, 0.0)[2] <= freedom:
        high = 0.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if _fit(X, y, s, middle)[2] > freedom else (low, middle)
    line, covariance, Q = _fit(X, y, s, high)
    covariance = covariance * max(1.0, Q / freedom)
    return Regression(centre, float(line[0]), float(line[1]), covariance, freedom, high**0.5)


def _fit(X: Array, y: Array, s: Array, variance: float) -> tuple[Array, Array, float]:
    """Line (2,), its covariance (2, 2) and Q at a variance tau^2."""
    w = 1.0 / (variance + s**2)
    covariance = np.linalg.inv(X.T @ (w[:, None] * X))
    line = covariance @ (X.T @ (w * y))
    return line, covariance, float((w * (y - X @ line) ** 2).sum())
