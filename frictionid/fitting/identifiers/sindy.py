"""SINDy on one-step residuals: a sparse sum of candidate functions [Brunton2016].

pysindy's optimisers see what friction has to explain, not a numerical derivative:

    minimise  sum_k w_k |r_k - G_k sum_i theta_i f_i|^2  with few theta_i that are not zero

Each threshold proposes an active set; recordings that are held out decide which one is right.
Sparse dynamics without physics does the same with monomials of the state, for the acceleration. All
of it works on Gram matrices, one for each recording.
"""

import warnings
from collections.abc import Iterable, Iterator
from dataclasses import field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from frictionid.arrays import Array
from frictionid.config import Count, NotNegative, Positive, validated
from frictionid.errors import InputError, needs
from frictionid.friction import Friction
from frictionid.friction.laws.library import Library
from frictionid.friction.laws.state_laws import StateLibrary

from ..identifier import Identifier
from ..one_step.linearised import clusters, columns, grams
from ..one_step.residual import Problem, normalised
from .active_sets import (
    ActiveSet,
    Constraints,
    admissible,
    best_fits,
    best_proposals,
    search,
    selected,
    unit_columns,
)

_DIGITS = 9
_UNCHECKED: dict[str, Any] = {"assume_finite": True, "skip_parameter_validation": True}


def proposed_coefficients(T: Array, optimizers: Iterable[Any]) -> Iterator[Array]:
    """Coefficients (N,) by each optimiser, for a Gram matrix T (N + 1, N + 1) with the target last.

    The optimisers see a factor X of T = X'X, whose N + 1 rows have the same least squares as the
    rows behind T.
    """
    with needs("sindy"):
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


_HALF = 0.5
_FASTER = 0.98  # quantile of the speeds that must reach where a peak has fallen off
_NO_COLUMN = 1e-12  # of the longest column

# Of a fold: Gram matrices (C, N + 1, N + 1) of the clusters with columns of length one, lengths
# (N,) of the candidates' columns before, relative to that of the residual, and what sets may hold.
_Fold = tuple[Array, Array, Constraints]
Fraction = Annotated[float, Field(gt=0, lt=1)]


@validated
class SINDy(Identifier):
    """Finds which candidates of a library friction has, and their coefficients.

    optimizer : "stlsq" or "sr3" of pysindy, which proposes an active set for each threshold
    thresholds : of coefficients, relative to the sizes of their columns and of the residual
    ridge : of STLSQ, for columns of length one
    search_sets : also try sets of candidates joint by joint; collinear columns mislead thresholds
    n_standard_errors : the smallest active set is taken that predicts held-out recordings as well
        as the best one, within so many standard errors
    ensemble : number of draws of the recordings; where positive, candidates stay that are in the
        active sets of at least half of them (see `inclusion`)

    Peaks that fall off beyond the speeds of the motion are no candidates.

    Raises
    ------
    InputError
        For settings out of range, and where no joint slides.

    Examples
    --------
    >>> from frictionid.fitting.identifiers.check_identifier import synthetic_problem
    >>> problem = synthetic_problem(joints=1, noise=1e-4)
    >>> friction = SINDy().fit(problem, np.ones((1, len(problem.r))), seed=0)
    >>> print(*friction.law.equation(friction.theta[0]))
    Tf1 = 0.09993 N m s(w) + 0.02001 N m s/rad w + 0.04013 N m exp(-(w/1.5)^2) s(w)
    """

    library: Library = field(default_factory=Library)
    optimizer: Literal["stlsq", "sr3"] = "stlsq"
    thresholds: Annotated[tuple[Fraction, ...], Field(min_length=1)] = (0.01, 0.04, 0.15)
    ridge: NotNegative = 1e-3
    search_sets: bool = True
    n_standard_errors: NotNegative = 2.5
    ensemble: Annotated[int, Field(ge=0)] = 0

    @property
    def seeded(self) -> bool:
        """Whether a seed draws recordings: those of an ensemble."""
        return self.ensemble > 0

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        n, P = problem.r.shape[-1], len(self.library.names)
        theta, share = np.zeros((len(weights), n * P)), np.zeros(0)
        for f, (G, scale, constraints) in enumerate(self._folds(problem, weights)):
            if self.ensemble:
                share = self._inclusion(G, constraints, seed, self.ensemble)
                # columns of families that at least half of the draws have
                often = np.where(constraints.conflict @ share >= _HALF, share, 0.0)
                active = admissible(often, G.sum(0), constraints)
            else:
                active = self._active_set(G, constraints)
            if active:
                S = np.array(active)
                theta[f, S] = best_fits(G.sum(0), S[None])[1][0] / scale[S]
        friction = Friction(self.library, theta.reshape(len(weights), n, P))
        if not self.ensemble:
            return friction
        return friction.noted({"inclusion": tuple(self._inclusion_lines(share))})

    def inclusion(self, problem: Problem, weights: Array, seed: int, draws: int = 50) -> Array:
        """Share (F, n, P) of draws of the recordings in whose active set each candidate is."""
        folds = self._folds(problem, weights)
        shares = [self._inclusion(G, limits, seed, draws) for G, _, limits in folds]
        return np.stack(shares).reshape(len(weights), problem.r.shape[-1], -1)

    def _folds(self, problem: Problem, weights: Array) -> Iterator[_Fold]:
        A = columns(self.library, problem)
        n, candidates = problem.r.shape[-1], self.library.candidates
        speed = np.abs(problem.mean(problem.nodes.inputs.w)) * np.abs(problem.G).any(axis=1)
        needed = np.array([c.fast for c in candidates])
        constraints = Constraints(
            joint=np.repeat(np.arange(n), len(candidates)),
            conflict=np.kron(np.eye(n), self.library.conflicts) > 0,
            positive=np.tile([c.parameter.low >= 0 for c in candidates], n),
            usable=np.ones(n * len(candidates), dtype=bool),
        )
        for f, G in enumerate(grams(A, normalised(weights, problem), clusters(problem))):
            G, length = unit_columns(G)
            fastest = np.quantile(speed[weights[f] > 0], _FASTER, axis=0)
            reached = (fastest[:, None] >= needed).ravel()
            usable = (length[:-1] > _NO_COLUMN * length.max()) & reached
            if not usable.any():
                raise InputError(f"no joint slides in the rows of fold {f}: give other recordings")
            scale = length[:-1] / (length[-1] or 1.0)
            yield G, scale, constraints._replace(usable=usable)

    def _active_set(self, G: Array, constraints: Constraints) -> tuple[int, ...]:
        """Columns of the active set that is selected of those proposed and searched."""
        T = G.sum(0)
        coefficients = proposed_coefficients(T, map(self._optimizer, self.thresholds))
        proposals = [admissible(c, T, constraints) for c in coefficients]
        if self.search_sets:
            return search(G, constraints, proposals, self.n_standard_errors)
        sets = best_proposals(T, constraints, proposals)
        return selected(G, sets, self.n_standard_errors)

    def _inclusion(self, G: Array, constraints: Constraints, seed: int, draws: int) -> Array:
        """Share (N,) of draws of the clusters, with replacement, whose active set has a column."""
        count = np.zeros(G.shape[-1] - 1)
        present = np.flatnonzero(np.einsum("cii->c", G) > 0)
        for draw in range(draws):
            drawn = np.random.default_rng([seed, draw]).choice(present, len(present))
            times = np.bincount(drawn, minlength=len(G))
            count[list(self._active_set(G * times[:, None, None], constraints))] += 1
        return count / draws

    def _inclusion_lines(self, share: Array) -> list[str]:
        """A line for each joint: in what share of the draws each candidate was, largest first."""
        lines = []
        for j, shares in enumerate(share.reshape(-1, len(self.library.names))):
            order = [k for k in np.argsort(-shares, kind="stable") if shares[k] > 0]
            terms = ", ".join(f"{self.library.names[k]} {100 * shares[k]:.0f} %" for k in order)
            lines.append(f"joint {j + 1}: {terms or 'none'}")
        return lines

    def _optimizer(self, threshold: float) -> Any:
        with needs("sindy"):
            from pysindy import SR3, STLSQ

        if self.optimizer == "stlsq":
            return STLSQ(threshold=threshold, alpha=self.ridge, unbias=False)
        weight = SR3.calculate_l0_weight(threshold, 1.0)
        return SR3(reg_weight_lam=weight, regularizer="l0", relax_coeff_nu=1.0, unbias=False)


_NO_MONOMIAL = 1e-9  # of the longest column


@validated
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
        proposals = self._proposals(T, length[:-1] > _NO_MONOMIAL * length[:-1].max())
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
