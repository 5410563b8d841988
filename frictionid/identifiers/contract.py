"""What an identifier is: one method, from a one-step problem to friction."""

from __future__ import annotations

from typing import Protocol

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.problem import Problem


class Identifier(Protocol):
    """Finds friction in a problem; an instance holds settings only, frozen."""

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        """Friction whose theta has the batch axis of the weights, shape (F, n, P).

        Row k counts in fold f with weights[f, k] >= 0, shape (F, K): all folds are fitted at once,
        and a fold's result does not depend on the others. The same seed gives the same numbers.
        """
        ...
