"""Models without physics: any identifier, on joints of unit inertia instead of the mechanism.

Their law is the negative acceleration, dw/dt = -Tf(q, w, u of all joints). They are scored on the
same rows, folds and rollouts as models of friction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from frictionid.arrays import Array
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction import Friction


@dataclass(frozen=True)
class BlackBox(Identifier):
    """Fits a problem of unit inertia, in which rows of joints at rest count like all others.

    inner : identifier of a law that is the negative acceleration

    >>> import numpy as np
    >>> from frictionid.fitting.identifiers import SparseDynamics
    >>> from frictionid.fitting.identifiers.synthetic_problem import synthetic_problem
    >>> problem = synthetic_problem(joints=1)
    >>> BlackBox(SparseDynamics(degree=1)).fit(problem, np.ones((1, len(problem.r))), 0).mechanism
    'unit'
    """

    inner: Identifier
    uses_mechanism = False

    @property
    def seeded(self) -> bool:
        """Whether the seed may change the result of the inner identifier."""
        return self.inner.seeded

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        return replace(self.inner.fit(problem, weights, seed), mechanism="unit")
