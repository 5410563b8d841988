"""Sparse dynamics without physics: acceleration as few of many monomials [Brunton2016].

pysindy's STLSQ proposes which monomials a joint's acceleration has, one support for each threshold;
recordings that are left out decide between them. It works on Gram matrices, one for each recording.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.laws.state_library import StateLibrary
from frictionid.identifiers.grams import clusters, grams
from frictionid.identifiers.identifier import Identifier
from frictionid.identifiers.residual import Problem
from frictionid.identifiers.row_weights import relative
from frictionid.identifiers.sparse_support import Found, chosen, least

_DIGITS = 9
_NOTHING = 1e-9  # of the largest column, below which a column is none


@dataclass(frozen=True)
class SparseDynamics(Identifier):
    """Finds the monomials of (q, w, u) of all joints that acceleration consists of.

    degree, turning, width : of the monomials, see `StateLibrary`
    thresholds : of coefficients, relative to their columns' and the acceleration's size
    ridge : added to the diagonal of the normal equations, of columns of length one
    sure : the smallest support is taken that predicts left-out recordings as well as the best one,
        within so many standard errors

    Raises
    ------
    InputError
        For settings that mean nothing, and rows of joints at rest that are left open.
    """

    degree: int = StateLibrary.degree
    turning: bool = True
    width: float = StateLibrary.width
    thresholds: tuple[float, ...] = (0.003, 0.01, 0.03, 0.1)
    ridge: float = 1e-6
    sure: float = 1.0
    seeded: ClassVar[bool] = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "thresholds", tuple(self.thresholds))
        StateLibrary(1, self.degree, self.turning, self.width)
        if not self.thresholds or not all(0 < t < 1 for t in self.thresholds):
            raise InputError(
                f"sindy_dynamics: thresholds = {list(self.thresholds)} must be between 0 and 1"
            )
        for name in ("ridge", "sure"):
            if not getattr(self, name) >= 0:
                raise InputError(f"sindy_dynamics: {name} = {getattr(self, name)} must be positive")

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        n = problem.r.shape[-1]
        law = StateLibrary(n, self.degree, self.turning, self.width)
        A = _columns(law, problem)
        P = A.shape[-1] - n
        theta = np.zeros((len(weights), n, P))
        labels = clusters(problem)
        for f, G in enumerate(grams(A[:, None], relative(weights, problem), labels)):
            for j in range(n):
                pick = np.r_[:P, P + j]
                theta[f, j] = self._joint(G[:, pick[:, None], pick])
        return Friction(law, theta)

    def _joint(self, G: Array) -> Array:
        """Coefficients (P,) by Gram matrices (C, P + 1, P + 1), zero where there is no term."""
        size = np.sqrt(np.einsum("cii->i", G))
        usable = size[:-1] > _NOTHING * size[:-1].max()
        out = np.zeros(len(usable))
        if size[-1] == 0:
            return out
        scale = np.where(size > 0, size, 1.0)
        G = G / scale / scale[:, None]
        T = G.sum(0)
        proposed = {tuple(np.flatnonzero(c).tolist()) for c in self._proposed(T, usable)}
        found = [Found(float(least(T, np.array([s]))[0][0]), s) for s in proposed if s]
        found.sort(key=lambda one: (len(one.support), one.support))
        support = np.array(chosen(G, [Found(float(T[-1, -1]), ()), *found], self.sure), dtype=int)
        if support.size:
            out[support] = least(T, support[None])[1][0] * scale[-1] / scale[support]
        return out

    def _proposed(self, T: Array, usable: Array) -> Iterator[Array]:
        """Coefficients (P,) that STLSQ finds for each threshold."""
        from pysindy import STLSQ
        from sklearn import config_context

        own = np.flatnonzero(np.append(usable, True))
        # without its last digits: what STLSQ makes of a fold must not hang on rounding
        values, vectors = np.linalg.eigh(np.round(T[np.ix_(own, own)], _DIGITS))
        X = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
        for threshold in self.thresholds:
            with warnings.catch_warnings(), config_context(assume_finite=True):
                warnings.simplefilter("ignore")  # it warns where nothing is left
                made = STLSQ(threshold=threshold, alpha=self.ridge, unbias=False)
                found = made.fit(X[:, :-1], X[:, -1])
            out = np.zeros(len(usable))
            out[own[:-1]] = np.ravel(found.coef_)
            yield out


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
        raise InputError("a model without physics needs all rows: use a recipe with rest = 0")
    return np.linalg.solve(problem.G, problem.r[..., None])[..., 0], scale
