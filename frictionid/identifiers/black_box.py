"""Models without physics: what another identifier finds where nothing is known of the machine.

Their law says all of the acceleration, dw/dt = -Tf(q, w, u of all joints). They see the recordings
as the motion of joints of unit inertia on which nothing else acts, and are judged on the same rows,
folds and rollouts as friction is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.identifiers.identifier import Identifier
from frictionid.identifiers.residual import Problem


@dataclass(frozen=True)
class BlackBox(Identifier):
    """Identifier that gets a problem of unit inertia, in which rows at rest count like all others.

    inner : finds a law that is the negative acceleration

    >>> import numpy as np
    >>> from frictionid.identifiers import SparseDynamics
    >>> from frictionid.identifiers.synthetic_problem import synthetic_problem
    >>> problem = synthetic_problem(joints=1)
    >>> BlackBox(SparseDynamics(degree=1)).fit(problem, np.ones((1, len(problem.r))), 0).mechanism
    'unit'
    """

    inner: Identifier
    uses_mechanism: ClassVar[bool] = False

    @property
    def seeded(self) -> bool:
        """Whether a seed changes what the inner identifier finds."""
        return self.inner.seeded

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        return replace(self.inner.fit(problem, weights, seed), mechanism="unit")
