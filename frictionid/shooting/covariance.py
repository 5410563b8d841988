"""Covariance of the parameters from the scatter between recordings; undetermined combinations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.shooting.gauss_newton import Solution
from frictionid.shooting.meaningless_parameters import meaningless
from frictionid.shooting.parameters.parameter_block import Parameter, values_of
from frictionid.shooting.problem import ShootingProblem

_FEW = 4  # recordings: of fewer, stretches of time are the clusters
_SOME = 3  # recordings whose own scatter counts as well, where it is larger
_STRETCHES = 24
_SINGULAR = 1e-9  # of the largest singular value of the scaled normal equations
_DRAWS = 2000


@dataclass(frozen=True, eq=False)
class Covariance:
    """Parameters with their covariance.

    entries, values : (D,) of the free parameters
    matrix : (D, D), of the t distribution with `freedom` degrees; rows of parameters at a bound or
        in an undetermined combination are infinite on the diagonal
    singular : (D,) singular values of the normal equations, scaled to ones on the diagonal
    undetermined : combinations of parameters that the data do not determine, in words
    bound : (D,) true where a parameter lies at a bound
    clusters : number of recordings, or stretches of time, whose scatter was taken
    meaningless : (D,) true for parameters that mean nothing where others, not identified, are zero
    """

    parameters: tuple[Parameter, ...]
    values: Array
    matrix: Array
    freedom: int
    singular: Array
    undetermined: tuple[str, ...]
    bound: Array
    clusters: int
    meaningless: Array

    @property
    def error(self) -> Array:
        """Standard errors (D,)."""
        return np.sqrt(np.diag(self.matrix))

    @property
    def correlation(self) -> Array:
        """Correlation (D, D), NaN for parameters without a finite error."""
        error = np.where(np.isfinite(self.error) & (self.error > 0), self.error, np.nan)
        return self.matrix / np.outer(error, error)

    def interval(self, level: float = 0.95) -> Array:
        """Lower and upper ends (D, 2) of each parameter's interval; its bounds limit it."""
        half = stdtrit(self.freedom, 0.5 + level / 2) * self.error
        low, high = np.array([(p.low, p.high) for p in self.parameters]).reshape(-1, 2).T
        return np.stack(
            [np.maximum(self.values - half, low), np.minimum(self.values + half, high)], axis=-1
        )

    @property
    def identified(self) -> Array:
        """True (D,) for parameters that the data determine.

        Not at a bound, and with a 95 % interval no wider, to either side, than the value: of a
        delay, a bias or an offset, whose value may well be zero, the interval must only be finite.
        Nor does a parameter count that means nothing where others may be zero.
        """
        return _known(self) & ~self.meaningless

    def draws(self, seed: int = 0, count: int = _DRAWS) -> Array:
        """Parameters (count, D) drawn from their t distribution; those without an error stay."""
        known = np.isfinite(self.error)
        own = self.matrix[np.ix_(known, known)]
        value, vector = np.linalg.eigh(own)
        root = vector * np.sqrt(np.maximum(value, 0.0))
        generator = np.random.default_rng(seed)
        normal = generator.standard_normal((count, int(known.sum())))
        chi = generator.chisquare(self.freedom, count) / self.freedom
        out = np.repeat(self.values[None], count, axis=0)
        out[:, known] += (normal @ root.T) / np.sqrt(chi)[:, None]
        return out


def covariance_of(problem: ShootingProblem, solution: Solution) -> Covariance:
    """Covariance of a fit, from what each recording alone would change in it.

    The sandwich estimate with the leverage of each recording taken into account: parameters are
    solved for with every recording left out in turn, to first order [BellMcCaffrey2002]; so noise,
    the model's errors, and what differs between recordings all count. Fewer than four recordings
    are divided into 24 stretches of time; of three recordings the larger of both errors counts.
    """
    parameters, free = problem.parameters, solution.free
    H = solution.curvature + np.diag(problem.prior_precision)
    singular, lost, words = _undetermined(H, free, parameters)
    owner, clusters = (own[solution.closed] for own in _clusters(problem, solution))
    once = free & _shown_once(H, solution, clusters)
    keep = np.flatnonzero(free & ~once)
    D, count = len(parameters), len(np.unique(clusters))
    matrix = np.zeros((D, D))
    matrix[np.ix_(keep, keep)] = _sandwich(H, solution._replace(free=free & ~once), owner, clusters)
    unknown = ~free | lost | once
    words += tuple(
        f"only one recording or stretch of it shows {parameters[k].name}"
        for k in np.flatnonzero(once & ~lost)
    )
    _forget(matrix, list(np.flatnonzero(unknown)))
    values = values_of(solution.estimate, problem.blocks)
    out = Covariance(
        *(parameters, values, matrix, max(count - 1, 1), singular, words, ~free, count),
        meaningless=np.zeros(D, dtype=bool),
    )
    friction = solution.estimate.friction
    needs = meaningless(friction, parameters, ~_known(out))
    words += tuple(_needs(parameters, k, others) for k, others in needs.items())
    ends = [
        k for k in map(int, np.flatnonzero(~free)) if k not in needs and _at_limit(out, k, friction)
    ]
    words += tuple(_ends(parameters[k], float(values[k])) for k in ends)
    for k in ends:
        _forget(matrix, [i for i, p in enumerate(parameters) if _same_joint(p, parameters[k])])
    return replace(out, undetermined=words, meaningless=np.isin(np.arange(D), list(needs)))


def _at_limit(covariance: Covariance, k: int, friction: Friction) -> bool:
    """Whether a parameter of friction ends at a bound that is not its law's own.

    Such a bound says what the data resolve, or was given: beyond it the fit would be better.
    """
    p = covariance.parameters[k]
    return (
        p.block == "friction" and float(covariance.values[k]) not in friction.law.bounds[p.place[1]]
    )


def _same_joint(a: Parameter, b: Parameter) -> bool:
    return a.block == b.block == "friction" and a.place[0] == b.place[0]


def _forget(matrix: Array, which: list[int]) -> None:
    """Make the covariance of some parameters infinite, in place."""
    matrix[which], matrix[:, which] = 0.0, 0.0
    matrix[which, which] = np.inf


def _ends(p: Parameter, value: float) -> str:
    slow = value == p.low and p.unit in ("rad/s", "m/s")
    end = "the slowest speed that the data resolve, or that was given" if slow else "its bound"
    return (
        f"{p.name} ends at {value:.3g} {p.unit}, {end}: friction of this joint has another shape "
        "than this law can show here, and its parameters have no intervals"
    )


def _sandwich(H: Array, solution: Solution, owner: Array, clusters: Array) -> Array:
    """Covariance of the free parameters by clusters (W,); of three recordings (W,) the larger."""
    inner = _scatter(H, solution, clusters)
    if _SOME <= len(np.unique(owner)) < _FEW:
        between = np.diag(_scatter(H, solution, owner))
        wider = np.sqrt(np.maximum(1.0, between / np.maximum(np.diag(inner), 1e-300)))
        inner = inner * np.outer(wider, wider)
    return inner


def _known(covariance: Covariance) -> Array:
    """True (D,) for parameters with an interval that tells them from zero, where that matters."""
    c = covariance
    half = stdtrit(c.freedom, 0.975) * c.error
    zero = np.array([p.block in ("delay", "bias", "offset") for p in c.parameters], dtype=bool)
    small = half <= np.abs(c.values)
    return np.asarray(np.isfinite(half) & ~c.bound & (small | zero), dtype=bool)


def _needs(parameters: tuple[Parameter, ...], k: int, others: tuple[int, ...]) -> str:
    found = [parameters[i].name for i in others]
    names = found[0] if len(found) == 1 else f"{', '.join(found[:-1])} and {found[-1]}"
    return f"{parameters[k].name} means nothing where {names} may be zero"


def _scatter(H: Array, solution: Solution, groups: Array) -> Array:
    """Covariance of the free parameters from what each group of windows would change in them.

    C = (G - 1)/G sum_g (m_g - m)(m_g - m)',  m_g = -(H - H_g)^-1 s_g,  s = g - H move per window
    """
    keep, use = np.flatnonzero(solution.free), solution.closed
    parts = solution.normal.H[use]
    score = solution.normal.g[use] - parts @ solution.move
    names = np.unique(groups)
    moves = np.zeros((len(names), len(keep)))
    for c, name in enumerate(names):
        own = groups == name
        rest = (H - parts[own].sum(axis=0))[np.ix_(keep, keep)]
        moves[c] = -_solve(rest, score[own].sum(axis=0)[keep])
    off = moves - moves.mean(axis=0)
    return np.asarray((len(names) - 1) / len(names) * off.T @ off)


def _shown_once(H: Array, solution: Solution, groups: Array) -> Array:
    """Parameters (D,) of which nothing is left to know without one of the groups of windows.

    What scatters between the groups says nothing of these, and they would spoil the others.
    """
    parts, most = solution.normal.H[solution.closed], _SINGULAR * np.diag(H)
    left = [np.diag(H - parts[groups == name].sum(axis=0)) for name in np.unique(groups)]
    return np.asarray(np.min(left, axis=0) <= most)


def _solve(H: Array, g: Array) -> Array:
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    inverse = np.linalg.pinv(H / np.outer(scale, scale), rcond=_SINGULAR, hermitian=True)
    return np.asarray(inverse @ (g / scale) / scale)


def _clusters(problem: ShootingProblem, solution: Solution) -> tuple[Array, Array]:
    """Recording (W,) and cluster (W,) of each window."""
    owner = problem.intervals.recording[solution.windows[:, 0]]
    if len(np.unique(owner)) >= _FEW:
        return owner, owner
    return owner, np.arange(len(owner)) * min(_STRETCHES, len(owner)) // len(owner)


def _undetermined(
    H: Array, free: Array, parameters: tuple[Parameter, ...]
) -> tuple[Array, Array, tuple[str, ...]]:
    """Singular values, which parameters share in a combination without information, in words."""
    keep = np.flatnonzero(free)
    lost = np.zeros(len(parameters), dtype=bool)
    if not len(keep):
        return np.zeros(0), lost, ()
    own = H[np.ix_(keep, keep)]
    blind = np.diag(own) <= 0.0
    scale = np.where(blind, 1.0, np.sqrt(np.maximum(np.diag(own), 1e-300)))
    value, vector = np.linalg.eigh(own / np.outer(scale, scale))
    words = []
    for k in np.flatnonzero(value < _SINGULAR * value.max()):
        share = vector[:, k] ** 2
        main = np.argsort(-share)[: max(1, int((share > 0.02).sum()))]
        lost[keep[share > 1e-3]] = True
        names = [parameters[keep[i]].name for i in main]
        words.append(
            f"the data do not tell {names[0]}"
            if len(names) == 1
            else f"only a combination of {', '.join(names[:-1])} and {names[-1]} shows in the data"
        )
    return value[::-1], lost, tuple(words)
