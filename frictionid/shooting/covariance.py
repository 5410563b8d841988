"""How sure the parameters are: between-recording scatter, what is undetermined, and bands."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.shooting.gauss_newton import Shot
from frictionid.shooting.linearise import Intervals, values_of
from frictionid.shooting.meaningless_parameters import idle
from frictionid.shooting.parameters.parameter_block import Entry

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
    undetermined : combinations of parameters that the data do not tell, in words
    bound : (D,) true where a parameter lies at a bound
    clusters : number of recordings, or stretches of time, whose scatter was taken
    idle : (D,) true for parameters that mean nothing where others, not identified, are zero
    """

    entries: tuple[Entry, ...]
    values: Array
    matrix: Array
    freedom: int
    singular: Array
    undetermined: tuple[str, ...]
    bound: Array
    clusters: int
    idle: Array

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
        reach = stdtrit(self.freedom, 0.5 + level / 2) * self.error
        low, high = (np.array([getattr(e, name) for e in self.entries]) for name in ("low", "high"))
        return np.stack(
            [np.maximum(self.values - reach, low), np.minimum(self.values + reach, high)], axis=-1
        )

    @property
    def identified(self) -> Array:
        """True (D,) for parameters that the data determine.

        Not at a bound, and with a 95 % interval no wider, to either side, than the value: of a
        delay, a bias or an offset, whose value may well be zero, the interval must only be finite.
        Nor does a parameter count that means nothing where others may be zero.
        """
        return _known(self) & ~self.idle

    def draws(self, seed: int = 0, count: int = _DRAWS) -> Array:
        """Parameters (count, D) drawn from their t distribution; those without an error stay."""
        sure = np.isfinite(self.error)
        own = self.matrix[np.ix_(sure, sure)]
        value, vector = np.linalg.eigh(own)
        root = vector * np.sqrt(np.maximum(value, 0.0))
        generator = np.random.default_rng(seed)
        normal = generator.standard_normal((count, int(sure.sum())))
        chi = generator.chisquare(self.freedom, count) / self.freedom
        out = np.repeat(self.values[None], count, axis=0)
        out[:, sure] += (normal @ root.T) / np.sqrt(chi)[:, None]
        return out


def covariance_of(intervals: Intervals, shot: Shot) -> Covariance:
    """Covariance of a fit, from what each recording alone would change in it.

    The sandwich estimate with the leverage of each recording taken into account: parameters are
    solved for with every recording left out in turn, to first order [BellMcCaffrey2002]; so noise,
    the model's errors, and what differs between recordings all count. Fewer than four recordings
    are divided into 24 stretches of time; of three recordings the larger of both errors counts.
    """
    entries = tuple(e for part in intervals.parts for e in part.entries)
    values = values_of(shot.guess, intervals.parts)
    D = len(entries)
    precision = np.array([1.0 / e.prior**2 for e in entries])
    use, free = shot.closed, shot.free
    H = shot.normal.H[use].sum(axis=0) + np.diag(precision)
    singular, lost, words = _undetermined(H, free, entries)
    owner, groups = (own[use] for own in _clusters(intervals, shot))
    score = shot.normal.g[use] - shot.normal.H[use] @ shot.move
    keep = np.flatnonzero(free)
    inner = _scatter(H, shot.normal.H[use], score, groups, keep)
    if _SOME <= len(np.unique(owner)) < _FEW:
        between = np.diag(_scatter(H, shot.normal.H[use], score, owner, keep))
        wider = np.sqrt(np.maximum(1.0, between / np.maximum(np.diag(inner), 1e-300)))
        inner = inner * np.outer(wider, wider)
    C = len(np.unique(groups))
    matrix = np.zeros((D, D))
    matrix[np.ix_(keep, keep)] = inner
    unknown = ~free | lost
    matrix[unknown], matrix[:, unknown] = 0.0, 0.0
    matrix[unknown, unknown] = np.inf
    out = Covariance(
        *(entries, values, matrix, max(C - 1, 1), singular, words, ~free, C),
        idle=np.zeros(D, dtype=bool),
    )
    hanging = idle(shot.guess.friction, entries, ~_known(out))
    words += tuple(_hangs(entries, k, on) for k, on in hanging.items())
    return replace(out, undetermined=words, idle=np.isin(np.arange(D), list(hanging)))


def _known(covariance: Covariance) -> Array:
    """True (D,) for parameters with an interval that tells them from zero, where that matters."""
    c = covariance
    reach = stdtrit(c.freedom, 0.975) * c.error
    zero = np.array([e.block in ("delay", "bias", "offset") for e in c.entries], dtype=bool)
    small = reach <= np.abs(c.values)
    return np.asarray(np.isfinite(reach) & ~c.bound & (small | zero), dtype=bool)


def _hangs(entries: tuple[Entry, ...], k: int, on: tuple[int, ...]) -> str:
    others = [entries[i].name for i in on]
    names = others[0] if len(others) == 1 else f"{', '.join(others[:-1])} and {others[-1]}"
    return f"{entries[k].name} means nothing where {names} may be zero"


def _scatter(H: Array, parts: Array, score: Array, groups: Array, keep: Array) -> Array:
    """Covariance of some parameters from what each group of windows alone would change in them."""
    names = np.unique(groups)
    moves = np.zeros((len(names), len(keep)))
    for c, name in enumerate(names):
        own = groups == name
        rest = (H - parts[own].sum(axis=0))[np.ix_(keep, keep)]
        moves[c] = -_solve(rest, score[own].sum(axis=0)[keep])
    off = moves - moves.mean(axis=0)
    return np.asarray((len(names) - 1) / len(names) * off.T @ off)


def _solve(H: Array, g: Array) -> Array:
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    inverse = np.linalg.pinv(H / np.outer(scale, scale), rcond=_SINGULAR, hermitian=True)
    return np.asarray(inverse @ (g / scale) / scale)


def _clusters(intervals: Intervals, shot: Shot) -> tuple[Array, Array]:
    """Recording (W,) and cluster (W,) of each window."""
    owner = intervals.track.recording[shot.windows[:, 0]]
    if len(np.unique(owner)) >= _FEW:
        return owner, owner
    return owner, np.arange(len(owner)) * min(_STRETCHES, len(owner)) // len(owner)


def _undetermined(
    H: Array, free: Array, entries: tuple[Entry, ...]
) -> tuple[Array, Array, tuple[str, ...]]:
    """Singular values, which parameters share in a combination without information, in words."""
    keep = np.flatnonzero(free)
    lost = np.zeros(len(entries), dtype=bool)
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
        names = [entries[keep[i]].name for i in main]
        words.append(
            f"the data do not tell {names[0]}"
            if len(names) == 1
            else f"only a combination of {', '.join(names[:-1])} and {names[-1]} shows in the data"
        )
    return value[::-1], lost, tuple(words)
