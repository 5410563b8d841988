"""Friction of any shape beside which a machine is calibrated."""

from dataclasses import dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.law import NUMERICAL_WIDTH
from frictionid.friction.laws import Spline

from ..identifier import Identifier
from ..one_step.residual import Problem, data_range
from .least_squares import LeastSquares

_KNOTS, _SHARP = 5, 0.01  # of the flexible curve; its smoothing, of the fastest speed


@dataclass(frozen=True)
class Flexible(Identifier):
    """Fits a curve of any shape that grows with the load: friction to calibrate a machine beside.

    It is nobody's candidate, `Spline(loaded=True)`. Its knots are octaves apart, the last one at
    half of the fastest speed in the rows in use, so that nothing depends on how fast a machine is.
    The level at rest is free; from knot to knot, and with the usual load, it changes by as much as
    it is, as a prior has it: where a joint hardly slides, nothing else would bound it, and a load
    that hardly changes cannot be separated from the level otherwise.
    """

    seeded = False

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        shown = data_range(problem, weights)
        fastest = float(shown.fastest.max())
        if not fastest > 0:
            raise InputError(
                "no joint moves in a fold, so that nothing can be calibrated: give recordings with "
                "motion, or use the recipe 'integral'"
            )
        knots = tuple(fastest * 0.5**k for k in range(_KNOTS, 0, -1))
        law = Spline(knots, width=min(NUMERICAL_WIDTH, _SHARP * fastest), loaded=True)
        usual = {p.name: float(np.max(shown.usual(p.unit))) for p in law.parameters[1:]}
        prior = {name: (0.0, size) for name, size in usual.items() if 0 < size < np.inf}
        return LeastSquares(law, prior=prior, robust=None).fit(problem, weights, seed)
