"""Sparse dynamics without physics: acceleration as few of many monomials [Brunton2016].

pysindy's STLSQ proposes an active set of monomials for each threshold and joint; recordings that
are held out decide between them. All of it works on Gram matrices, one for each recording.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from frictionid.arrays import Array
from frictionid.config import Count, NotNegative, Positive, check_settings
from frictionid.errors import InputError, needs
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.identifiers.active_sets import ActiveSet, best_fits, selected, unit_columns
from frictionid.fitting.identifiers.sindy import Fraction, proposed_coefficients
from frictionid.fitting.one_step.grams import clusters, grams
from frictionid.fitting.one_step.residual import Problem, normalised
from frictionid.friction import Friction
from frictionid.friction.laws.state_laws import StateLibrary

_NO_COLUMN = 1e-9  # of the longest column


@dataclass(frozen=True)
class SparseDynamics(Identifier):
    """Finds the monomials of (q, w, u) of all joints that acceleration consists of.

    degree, turning, width : of the monomials, see `StateLibrary`
    thresholds : of coefficients, relative to the sizes of their columns and of the acceleration
    ridge : added to the diagonal of the normal equations, for columns of length one
    n_standard_errors : the smallest active set is taken that predicts held-out recordings as well
        as the best one, within so many standard errors

    Raises
    ------
    InputError
        For settings out of range, and for problems whose rows of joints at rest are masked.
    """

    degree: Count = StateLibrary.degree
    turning: bool = True
    width: Positive = StateLibrary.width
    thresholds: Annotated[tuple[Fraction, ...], Field(min_length=1)] = (0.003, 0.01, 0.03, 0.1)
    ridge: NotNegative = 1e-6
    n_standard_errors: NotNegative = 1.0
    seeded = False

    def __post_init__(self) -> None:
        check_settings(self)
        StateLibrary(1, self.degree, self.turning, self.width)

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        n = problem.r.shape[-1]
        law = StateLibrary(n, self.degree, self.turning, self.width)
        A = _columns(law, problem)
        P = A.shape[-1] - n
        theta = np.zeros((len(weights), n, P))
        labels = clusters(problem)
        for f, G in enumerate(grams(A[:, None], normalised(weights, problem), labels)):
            for j in range(n):
                columns = np.r_[:P, P + j]
                theta[f, j] = self._joint(G[:, columns[:, None], columns])
        return Friction(law, theta)

    def _joint(self, G: Array) -> Array:
        """Coefficients (P,) by Gram matrices (C, P + 1, P + 1), zero outside the active set."""
        G, length = unit_columns(G)
        theta = np.zeros(len(length) - 1)
        if length[-1] == 0:
            return theta
        T = G.sum(0)
        proposals = self._proposals(T, length[:-1] > _NO_COLUMN * length[:-1].max())
        sets = [ActiveSet(float(best_fits(T, np.array([s]))[0][0]), s) for s in proposals if s]
        sets.sort(key=lambda active_set: (len(active_set.columns), active_set.columns))
        empty = ActiveSet(float(T[-1, -1]), ())
        active = np.array(selected(G, [empty, *sets], self.n_standard_errors), dtype=int)
        if active.size:
            theta[active] = best_fits(T, active[None])[1][0] * length[-1] / length[active]
        return theta

    def _proposals(self, T: Array, usable: Array) -> set[tuple[int, ...]]:
        """Active sets that STLSQ proposes for the thresholds, of the usable columns (P,)."""
        with needs("sindy"):
            from pysindy import STLSQ

        columns = np.flatnonzero(usable)
        optimizers = (STLSQ(threshold=t, alpha=self.ridge, unbias=False) for t in self.thresholds)
        both = np.append(columns, len(usable))
        coefficients = proposed_coefficients(T[np.ix_(both, both)], optimizers)
        return {tuple(columns[np.flatnonzero(c)].tolist()) for c in coefficients}


def _columns(law: StateLibrary, problem: Problem) -> Array:
    """Monomials and measured accelerations [f, dw/dt] of all rows, (K, P + n), as they count."""
    y, scale = accelerations(problem)
    f = problem.mean(law.features(problem.nodes.inputs))
    return np.concatenate([f, -y], axis=-1) * scale[:, None]


def accelerations(problem: Problem) -> tuple[Array, Array]:
    """Negative accelerations y (K, n) [rad/s^2] of all rows, and how much a row counts (K,) [s].

    With G = s I the residual is s (y - Tf).

    Raises
    ------
    InputError
        Where some G is singular.
    """
    n = problem.r.shape[-1]
    scale = np.sqrt(np.mean(problem.G**2, axis=(1, 2)) * n)
    if not (np.abs(np.linalg.det(problem.G)) > 1e-9 * scale**n).all():
        raise InputError(
            "a model without physics needs all rows: use a recipe with velocity_threshold = 0"
        )
    return np.linalg.solve(problem.G, problem.r[..., None])[..., 0], scale
