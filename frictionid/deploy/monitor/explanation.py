"""Which causes explain a difference: friction of a joint, a payload, the torque's gain or delay.

Each cause alone, by generalised least squares: how much of the difference d with covariance V it
explains, T = b' M^-1 b with b the cause's rows of V^-1 d, and M its block of V^-1. Healthy
recordings against the others calibrate T, cause by cause. Another cause is a rival where, beside
it, the best one explains nothing more that is significant: the two cannot be separated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc  # scipy.stats takes half a second to import

from frictionid.arrays import Array

from .scatter import Difference

_MOST = 4  # causes that are named


class Explanation(NamedTuple):
    """What explains a difference.

    p : probability of a difference like this if nothing has changed
    p_of_cause : of each cause beside those that changed, corrected for their number
    groups : causes that changed; those of a group cannot be separated, the likeliest first
    """

    p: float
    p_of_cause: dict[str, float]
    groups: tuple[tuple[str, ...], ...]


class CauseTests(NamedTuple):
    """CauseTests of causes of a difference d with covariance V.

    inverse, pull : V^-1 (D, D) and V^-1 d; causes : their columns
    scale : of T, by cause; freedom : of the scatter
    """

    inverse: Array
    pull: Array
    causes: Mapping[str, Array]
    scale: Mapping[str, float]
    freedom: float

    def explained(self, columns: Array) -> float:
        """Squares that some columns explain."""
        if not len(columns):
            return 0.0
        b = self.pull[columns]
        return float(b @ np.linalg.solve(self.inverse[np.ix_(columns, columns)], b))

    def p(self, cause: str, beside: Sequence[str] = ()) -> float:
        """Probability of what a cause explains beside others, if it has not changed."""
        before = np.concatenate([np.zeros(0, dtype=int), *(self.causes[c] for c in beside)])
        columns = self.causes[cause]
        k = len(columns)
        gained = self.explained(np.concatenate([before, columns])) - self.explained(before)
        free = max(self.freedom - k + 1.0, 1.0)
        ratio = max(gained, 0.0) / self.scale[cause] / k * free / max(self.freedom, 1.0)
        return float(fdtrc(k, free, ratio))


def explained(test: CauseTests, rate: float) -> Explanation:
    """Causes of a difference, each found with a rate of false alarms over all of them."""
    causes = test.causes
    count = len(causes)
    chosen: list[str] = []

    def others(cause: str) -> list[str]:
        return [c for c in chosen if c != cause]

    def p(cause: str) -> float:
        """Of a cause beside those that are chosen."""
        return min(1.0, count * test.p(cause, others(cause)))

    first = min(p(cause) for cause in causes)
    for _ in range(2 * _MOST):
        best = min((c for c in causes if c not in chosen), key=p, default=None)
        if best is None or p(best) > rate or len(chosen) == _MOST:
            break
        chosen.append(best)  # and what only stood for it is no cause any more
        chosen = [c for c in chosen if c == best or p(c) <= rate]
    groups = []
    for cause in chosen:
        beside = others(cause)
        rivals = [c for c in causes if c not in chosen and test.p(cause, [*beside, c]) > rate]
        groups.append((cause, *sorted(rivals, key=lambda c: test.p(c, beside))))
    return Explanation(first, {cause: p(cause) for cause in causes}, tuple(groups))


def cause_tests(difference: Difference, causes: Mapping[str, Array]) -> CauseTests:
    """CauseTests of causes on a difference, calibrated by healthy recordings against the others."""
    inverse = np.linalg.inv(difference.covariance)
    plain = dict.fromkeys(causes, 1.0)
    sizes: dict[str, list[float]] = {cause: [] for cause in causes}
    for left, covariance in zip(difference.left, difference.covariances, strict=True):
        each = np.linalg.inv(covariance)
        alone = CauseTests(each, each @ left, causes, plain, difference.freedom)
        for cause, columns in causes.items():
            sizes[cause].append(alone.explained(columns) / len(columns))
    scale = {cause: _scale(np.array(values)) for cause, values in sizes.items()}
    return CauseTests(inverse, inverse @ difference.mean, causes, scale, difference.freedom)


def _scale(sizes: Array) -> float:
    """Mean of squares that should be one, and two standard errors, as few recordings tell it."""
    error = float(sizes.std()) / np.sqrt(max(len(sizes) - 1, 1))
    return max(1.0, float(sizes.mean()) + 2.0 * error)
