"""The baseline without friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction import Friction
from frictionid.friction.laws import NoFriction


@dataclass(frozen=True)
class Frictionless(Identifier):
    """Identifier `none`: friction is zero."""

    seeded = False
    fixed = True

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        return Friction(NoFriction(), np.zeros((len(weights), problem.r.shape[-1], 0)))
