"""Coefficients that pysindy's optimisers propose, from a Gram matrix instead of all rows."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from frictionid.arrays import Array

_DIGITS = 9
_UNCHECKED: dict[str, Any] = {"assume_finite": True, "skip_parameter_validation": True}


def proposed_coefficients(T: Array, optimizers: Iterable[Any]) -> Iterator[Array]:
    """Coefficients (N,) by each optimiser, for a Gram matrix T (N + 1, N + 1) with the target last.

    The optimisers see a factor X of T = X'X, whose N + 1 rows have the same least squares as the
    rows behind T.
    """
    from sklearn import config_context

    # without the last digits: what an optimiser makes of a fold must not depend on rounding
    values, vectors = np.linalg.eigh(np.round(T, _DIGITS))
    X = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    for optimizer in optimizers:
        # pysindy warns where no term is left, or it stopped early; checks take most of its time
        with warnings.catch_warnings(), config_context(**_UNCHECKED):
            warnings.simplefilter("ignore")
            coefficients = optimizer.fit(X[:, :-1], X[:, -1]).coef_
        yield np.ravel(coefficients)
