"""Published friction: given numbers, compared with fitted ones in the same tables."""

from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.data.plants import stack_calibrations
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.laws import NoFriction

from ..identifier import Identifier
from ..one_step.residual import Problem


@dataclass(frozen=True)
class Published(Identifier):
    """Identifier `published`: a given friction, the same in every fold.

    Its own mechanism parameters and calibration replace those of the data set.

    Raises
    ------
    InputError
        In a fit, where the data have another number of joints.
    """

    friction: Friction
    seeded = False
    fixed = True

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        theta = self.friction.theta
        if theta.ndim != 2 or theta.shape[0] != problem.r.shape[-1]:
            raise InputError(
                f"the published friction has theta of shape {tuple(theta.shape)}, the data "
                f"{problem.r.shape[-1]} joints: give one friction with as many joints as the data"
            )
        calibrated, count = self.friction.calibration, len(weights)
        calibration = None if calibrated is None else stack_calibrations([calibrated] * count)
        return replace(
            self.friction,
            theta=np.repeat(theta[None], count, axis=0),
            calibration=calibration,
            constraints=None,
        )


@dataclass(frozen=True)
class BlackBox(Identifier):
    """Fits a problem of unit inertia, in which rows of joints at rest count like all others.

    inner : identifier of a law that is the negative acceleration

    >>> import numpy as np
    >>> from frictionid.fitting.identifiers import SparseDynamics
    >>> from frictionid.fitting.identifiers.check_identifier import synthetic_problem
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


@dataclass(frozen=True)
class Frictionless(Identifier):
    """Identifier `none`: friction is zero."""

    seeded = False
    fixed = True

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        return Friction(NoFriction(), np.zeros((len(weights), problem.r.shape[-1], 0)))
