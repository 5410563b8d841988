"""SINDy on one-step residuals: a sparse sum of candidate functions [Brunton2016].

pysindy's optimisers see what friction has to explain, not a numerical derivative:

    minimise  sum_k w_k |r_k - G_k sum_i theta_i f_i|^2  with few theta_i that are not zero

They get the factor of its Gram matrix, whose few rows say the same as all the data. Which of their
supports is right is decided by recordings that are left out.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.laws.library import Library
from frictionid.identifiers.grams import clusters, columns, grams
from frictionid.identifiers.identifier import Identifier
from frictionid.identifiers.residual import Problem
from frictionid.identifiers.row_weights import relative
from frictionid.identifiers.sparse_support import Rules, chosen, lawful, least, plain, searched

OPTIMIZERS = ("stlsq", "sr3")
_HALF = 0.5
_SEEN = 0.98  # of the rows, a few must be as fast as a peak needs
_DIGITS = 9
_UNCHECKED: dict[str, Any] = {"assume_finite": True, "skip_parameter_validation": True}


@dataclass(frozen=True)
class SINDy(Identifier):
    """Finds which candidates of a library friction has, and their coefficients.

    For each of the `thresholds` (of coefficients, relative to their columns' and the residual's
    size) the optimiser "stlsq" or "sr3" proposes a support. With `search`, sets of candidates are
    then tried joint by joint, beside what the other joints have: columns that look alike lead
    thresholds astray. Of all these the smallest is chosen that predicts left-out recordings as well
    as the best one, within `sure` standard errors. Peaks that fall off faster than the motion
    shows are no candidates.

    With `ensemble` > 0 that is repeated on so many draws of the recordings, and candidates stay
    that are in at least half of them; `inclusion` says how often each one was.

    Raises
    ------
    InputError
        For settings that mean nothing, and where no joint slides.

    Examples
    --------
    >>> from frictionid.identifiers.synthetic_problem import synthetic_problem
    >>> problem = synthetic_problem(joints=1, noise=1e-4)
    >>> friction = SINDy().fit(problem, np.ones((1, len(problem.r))), seed=0)
    >>> print(*friction.law.equation(friction.theta[0]))
    Tf1 = 0.09993 N m s(w) + 0.02001 N m s/rad w + 0.04013 N m exp(-(w/1.5)^2) s(w)
    """

    library: Library = field(default_factory=Library)
    optimizer: str = "stlsq"
    thresholds: tuple[float, ...] = (0.01, 0.04, 0.15)
    ridge: float = 1e-3
    search: bool = True
    sure: float = 2.5
    ensemble: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "thresholds", tuple(self.thresholds))
        if self.optimizer not in OPTIMIZERS:
            raise InputError(
                f"sindy: optimizer = {self.optimizer!r} is unknown; known are "
                f"{', '.join(OPTIMIZERS)}"
            )
        if not self.thresholds or not all(0 < t < 1 for t in self.thresholds):
            raise InputError(f"sindy: thresholds = {list(self.thresholds)} must be between 0 and 1")
        for name, low in (("ridge", 0), ("sure", 0), ("ensemble", 0)):
            if not getattr(self, name) >= low:
                raise InputError(f"sindy: {name} = {getattr(self, name)} must be at least {low}")

    @property
    def seeded(self) -> bool:
        """Whether a seed draws recordings: those of an ensemble."""
        return self.ensemble > 0

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        n, P = problem.r.shape[-1], len(self.library.names)
        theta, share = np.empty((len(weights), n * P)), np.zeros(0)
        for f, (G, scale, rules) in enumerate(self._folds(problem, weights)):
            if self.ensemble:
                share = self._inclusion(G, rules, seed, self.ensemble)
                support = self._often(share, G, rules)
            else:
                support = self._once(G, rules)
            theta[f] = 0.0
            if support:
                S = np.array(support)
                theta[f, S] = least(G.sum(0), S[None])[1][0] / scale[S]
        found = Friction(self.library, theta.reshape(len(weights), n, P))
        return replace(found, provenance={"inclusion": self._told(share)}) if share.size else found

    def _told(self, share: Array) -> list[str]:
        """A line for each joint: in what share of the draws a candidate was, most often first."""
        lines = []
        for j, own in enumerate(share.reshape(-1, len(self.library.names))):
            order = [k for k in np.argsort(-own, kind="stable") if own[k] > 0]
            terms = ", ".join(f"{self.library.names[k]} {100 * own[k]:.0f} %" for k in order)
            lines.append(f"joint {j + 1}: {terms or 'none'}")
        return lines

    def inclusion(self, problem: Problem, weights: Array, seed: int, draws: int = 50) -> Array:
        """How often (F, n, P) each candidate is in the support of a draw of the recordings."""
        n, P = problem.r.shape[-1], len(self.library.names)
        shares = [
            self._inclusion(G, rules, seed, draws) for G, _, rules in self._folds(problem, weights)
        ]
        return np.stack(shares).reshape(len(weights), n, P)

    def _folds(self, problem: Problem, weights: Array) -> Iterator[tuple[Array, Array, Rules]]:
        """Of each fold: Gram matrices (C, M, M), columns of length one, their lengths, rules."""
        A = columns(self.library, problem)
        n, candidates = problem.r.shape[-1], self.library.candidates
        conflict = np.kron(np.eye(n), self.library.conflicts) > 0
        speed = np.abs(problem.mean(problem.nodes.inputs.w)) * np.abs(problem.G).any(axis=1)
        joint = np.repeat(np.arange(n), len(candidates))
        positive = np.tile([c.bounds[0] >= 0 for c in candidates], n)
        for f, G in enumerate(grams(A, relative(weights, problem), clusters(problem))):
            size = np.sqrt(np.einsum("cii->i", G))
            fast = np.quantile(speed[weights[f] > 0], _SEEN, axis=0)
            seen = fast[:, None] >= np.array([c.fast for c in candidates])
            usable = (size[:-1] > 1e-12 * size.max()) & seen.ravel()
            if not usable.any():
                raise InputError(f"no joint slides in the rows of fold {f}: give other recordings")
            scale = np.where(size > 0, size, 1.0)
            yield (
                G / scale / scale[:, None],
                scale[:-1] / scale[-1],
                Rules(joint, conflict, positive, usable),
            )

    def _often(self, share: Array, G: Array, rules: Rules) -> tuple[int, ...]:
        total = rules.conflict @ share
        return lawful(np.where(total >= _HALF, share, 0.0), G.sum(0), rules)

    def _inclusion(self, G: Array, rules: Rules, seed: int, draws: int) -> Array:
        """Share (N,) of draws of the clusters, with replacement, in whose support a column is."""
        count = np.zeros(len(rules.joint))
        seen = np.flatnonzero(np.einsum("cii->c", G) > 0)
        for draw in range(draws):
            drawn = np.random.default_rng([seed, draw]).choice(seen, len(seen))
            times = np.bincount(drawn, minlength=len(G))
            count[list(self._once(G * times[:, None, None], rules))] += 1
        return count / draws

    def _once(self, G: Array, rules: Rules) -> tuple[int, ...]:
        T = G.sum(0)
        proposals = [lawful(c, T, rules) for c in self._proposed(T)]
        if not self.search:
            return chosen(G, plain(T, rules, proposals), self.sure)
        return searched(G, rules, proposals, self.sure)

    def _proposed(self, T: Array) -> Iterator[Array]:
        """Coefficients (N,) that pysindy finds for each threshold."""
        from sklearn import config_context

        # without its last digits: what an optimiser makes of a fold must not hang on rounding
        values, vectors = np.linalg.eigh(np.round(T, _DIGITS))
        X = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
        for threshold in self.thresholds:
            # it warns where nothing is left, or it stopped early; checks take most of its time
            with warnings.catch_warnings(), config_context(**_UNCHECKED):
                warnings.simplefilter("ignore")
                found = self._optimizer(threshold).fit(X[:, :-1], X[:, -1])
            yield np.ravel(found.coef_)

    def _optimizer(self, threshold: float) -> Any:
        from pysindy import SR3, STLSQ

        if self.optimizer == "stlsq":
            return STLSQ(threshold=threshold, alpha=self.ridge, unbias=False)
        weight = SR3.calculate_l0_weight(threshold, 1.0)
        return SR3(reg_weight_lam=weight, regularizer="l0", relax_coeff_nu=1.0, unbias=False)
