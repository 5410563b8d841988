"""What new recordings have beyond healthy ones, and which causes explain it.

Estimates x_r (D,) of recordings are what they share, an effect linear in covariates z_r, their true
scatter and the noise of each estimate: x_r = B z_r + u_r + e_r, cov u = S, cov e_r = C_r, a model
of random effects [DerSimonianKacker2007]. S is by moments, from both groups about their means,
shrunk towards independent effects, since recordings are often no more than effects. The slopes of
the motion are shrunk as much as predicts left-out recordings best [Allen1974].

Each cause alone, by generalised least squares: how much of the difference d with covariance V it
explains, T = b' M^-1 b with b the cause's rows of V^-1 d, and M its block of V^-1. Friction is
tested twice: all its numbers, which few recordings hardly tell, and a change in proportion to
itself. Healthy recordings against the others calibrate T, test by test. Another cause is a rival
where, beside it, the best one explains nothing more that is significant: the two cannot be
separated. So is another cause together with friction, where friction would not be named.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, product
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls
from scipy.special import fdtrc  # scipy.stats takes half a second to import

from frictionid.arrays import Array

from .changes import Changes, with_others_held
from .effects import FRICTION, Effect, apart, causes_of

_SHRINKAGES = 10.0 ** np.arange(-1.0, 4.0)  # of the motion's slopes, in recordings
_LEAST = 0.02  # of the variance of independent rows
_MOST = 4  # causes that are named
_DECISIVE = 10.0  # of -2 log likelihood: another cause leaves far less
_DOUBT = 0.1  # probability that is no alarm, and yet no sign that friction has not changed
_SURE = 2.0  # standard errors of a variance, below which no scatter is seen
_FEW = 8  # recordings that say nothing of the motion's effect


class Difference(NamedTuple):
    """What new recordings have beyond the healthy ones.

    mean : (D,) ; covariance : (D, D) of it, if nothing has changed; freedom : of the scatter
    left : (N, D) of each healthy recording against the others; covariances : (N, D, D) of these
    """

    mean: Array
    covariance: Array
    freedom: float
    left: Array
    covariances: Array


def difference_of(healthy: Changes, new: Changes, size: Array) -> Difference:
    """What new recordings (K) have beyond healthy ones (N), on average.

    size : (D,) standard deviations of the priors, which no estimate is off by more
    """
    C, C_new = _noise(healthy, new, size)
    x, y, inverse, leverage, z = _beside_covariates(healthy, new, C)
    freedom = _freedom(leverage) + len(y) - 1
    about = np.concatenate([_about(x, C), _about(y, C_new)])
    S = _true_scatter(about, np.concatenate([C, C_new]), freedom)
    middle, error = _mean(x, S + C)
    mean, error_of_mean = _mean(y, S + C_new)
    # beyond the healthy range the motion's effect is open, by as much as recordings scatter
    distance = float((apart(healthy.motion, new.motion) ** 2).mean())
    by_slopes = max(float(z.mean(axis=0) @ inverse @ z.mean(axis=0)) - inverse[0, 0], 0.0)
    typical = len(x) * error
    covariance = error_of_mean + error + (by_slopes + distance) * typical
    share = np.minimum(leverage, 0.9)[:, None]
    return Difference(
        mean - middle,
        covariance,
        freedom,
        (x - middle) / (1.0 - share),
        (S + C) / (1.0 - share[..., None]),
    )


def _beside_covariates(
    healthy: Changes, new: Changes, C: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """Healthy (N, D) and new values (K, D) without the effects of covariates and motion.

    Also the inverse of the columns' squares, the leverage (N,), and the new columns.
    """
    Z, z = _covariates(healthy, new)
    inverse = np.linalg.inv(Z.T @ Z + np.diag(_penalty(Z, healthy, C)))
    slopes = inverse @ Z.T @ healthy.value
    slopes[0] = 0.0
    leverage = np.einsum("ri,ij,rj->r", Z, inverse, Z)
    return healthy.value - Z @ slopes, new.value - z @ slopes, inverse, leverage, z


def _freedom(leverage: Array) -> float:
    return max(len(leverage) - float(leverage.sum()), 1.0)


def true_scatter(healthy: Changes, effects: Sequence[Effect], weights: Array) -> Array:
    """Standard deviation (n,) of sums of each joint's parts between healthy recordings.

    All else held, without the error of each estimate, and what covariates and motion explain; zero
    where that may be all.

    weights : (n, 4) of the parts
    """
    noise, _ = _noise(healthy, healthy, np.array([e.size for e in effects]))
    values, _, _, leverage, _ = _beside_covariates(healthy, healthy, noise)
    healthy, freedom = healthy._replace(value=values), _freedom(leverage)
    precision, middle = np.linalg.inv(noise), values.mean(axis=0)
    square = []
    for free, row in zip(causes_of(effects).values(), weights, strict=False):  # friction is first
        error = row @ np.linalg.inv(precision[:, free][:, :, free]) @ row
        sums = with_others_held(healthy, middle, free).value[:, free] @ row
        beyond = float(sums.var() * len(sums) / freedom - error.mean())
        square.append(beyond if beyond > _SURE * error.mean() * np.sqrt(2.0 / freedom) else 0.0)
    return np.sqrt(square)


def _noise(healthy: Changes, new: Changes, size: Array) -> tuple[Array, Array]:
    """Covariances (N, D, D) and (K, D, D) of the estimates, as the scores of stretches scatter.

    With the curvature H of a recording, scores of covariance R H R and priors of precision P, an
    estimate is off by (H + P)^-1 (R H R + P) (H + P)^-1 on average.
    """
    excess = np.maximum(np.median(healthy.excess, axis=0), np.median(new.excess, axis=0))
    root, prior = np.sqrt(np.maximum(excess, _LEAST)), np.diag(size**-2.0)

    def noise(inverse: Array) -> Array:
        scores = (np.linalg.inv(inverse) - prior) * root[:, None] * root
        return inverse @ (scores + prior) @ inverse

    return noise(healthy.inverse), noise(new.inverse)


def _about(values: Array, covariances: Array) -> Array:
    """Rows (R, D) about their mean, each effect by itself, while their scatter is not known."""
    weights = 1.0 / np.einsum("rpp->rp", covariances)
    return values - (weights * values).sum(axis=0) / weights.sum(axis=0)


def _mean(values: Array, covariances: Array) -> tuple[Array, Array]:
    """Mean (D,) of rows (R, D), weighed by what they tell, and its covariance."""
    weights = np.linalg.inv(covariances)
    error = np.linalg.inv(weights.sum(axis=0))
    return error @ np.einsum("rpq,rq->p", weights, values), error


def _covariates(healthy: Changes, new: Changes) -> tuple[Array, Array]:
    """Columns (N, 1 + c + 2 n) and (K, 1 + c + 2 n): one, covariates, and the motion.

    A covariate that is the same in all healthy recordings, or unknown, is left out, and all where
    the recordings are too few to tell their effect.
    """
    both = np.concatenate([healthy.covariates, new.covariates])
    usable = np.isfinite(both).all(axis=0) & (np.ptp(healthy.covariates, axis=0) > 0)
    usable &= len(healthy.value) >= usable.sum() + 3
    motion = [x.motion.reshape(len(x.motion), -1) for x in (healthy, new)]
    columns = []
    middle, size = (f(healthy.covariates[:, usable], axis=0) for f in (np.mean, np.std))
    centre, spread = motion[0].mean(axis=0), np.maximum(motion[0].std(axis=0), 1e-3)
    for x, m in zip((healthy, new), motion, strict=True):
        beside = (x.covariates[:, usable] - middle) / size
        columns.append(np.column_stack([np.ones(len(m)), beside, (m - centre) / spread]))
    return columns[0], columns[1]


def _penalty(Z: Array, healthy: Changes, C: Array) -> Array:
    """Penalties of the columns: none of covariates, that of the motion by left-out recordings."""
    moves = healthy.motion[0].size
    free = np.zeros(Z.shape[1] - moves)
    if len(Z) < max(_FEW, Z.shape[1] + 3):
        return np.concatenate([free, np.full(moves, 1e12)])
    fixed = Z[:, : len(free)]
    others = healthy.value - fixed @ (np.linalg.pinv(fixed) @ healthy.value)
    size = others.var(axis=0) + 1e-6 * np.einsum("rpp->p", C) / len(C)
    best, least = 1e12, np.inf
    for penalty in (1e12, *_SHRINKAGES[::-1]):
        both = np.concatenate([free, np.full(moves, penalty)])
        hat = Z @ np.linalg.inv(Z.T @ Z + np.diag(both)) @ Z.T
        left = (healthy.value - hat @ healthy.value) / (1.0 - np.diag(hat))[:, None]
        error = float((left**2 / size).sum())
        if error < least * (1.0 - 1.0 / len(Z)):  # a smaller gain is chance
            best, least = float(penalty), error
    return np.concatenate([free, np.full(moves, best)])


def _true_scatter(about: Array, each: Array, freedom: float) -> Array:
    """Covariance (D, D) of the true scatter, from rows (R, D) about their means with their noise.

    That of independent effects is by moments of noise^-1 rows, in which each effect stands out by
    what the recordings tell of it alone; then the sample's is shrunk towards it.
    """
    tells = np.einsum("rpp->rp", each) ** -0.5
    tells /= np.sqrt((tells**2).sum(axis=0))
    noise = np.einsum("rp,rpq,rq->pq", tells, each, tells)
    weighted = tells * about * np.sqrt(len(about) / freedom)
    precision = np.linalg.inv(noise)
    size = np.diag(precision)
    moments = ((weighted @ precision) ** 2).sum(axis=0)
    beyond, _ = nnls(precision**2 / size[:, None] / size, moments / size - 1.0)
    sample = weighted.T @ weighted
    beyond = np.minimum(beyond / size, np.diag(sample))  # nothing scatters more than its estimates
    share = len(sample) / (len(sample) + freedom)
    total = (1.0 - share) * sample + share * (noise + np.diag(beyond))
    root = np.linalg.cholesky(noise)
    inner = np.linalg.solve(root, np.linalg.solve(root, total).T)
    value, vector = np.linalg.eigh((inner + inner.T) / 2)
    turned = root @ vector
    return (turned * np.maximum(value - 1.0, 0.0)) @ turned.T


class Explanation(NamedTuple):
    """What explains a difference.

    p : probability of a difference like this if nothing has changed
    p_of_cause : of each cause beside those that changed, corrected for their number
    groups : causes that changed; those of a group cannot be separated, the likeliest first
    hidden : a cause that changed, and two, one of them friction, that together explain as much
    doubt : whether the likeliest changes leave some of what friction explains
    """

    p: float
    p_of_cause: dict[str, float]
    groups: tuple[tuple[str, ...], ...]
    hidden: tuple[tuple[str, str, str], ...] = ()
    doubt: bool = False

    @property
    def ways(self) -> list[tuple[str, ...]]:
        """All that may have changed together, the likeliest first."""
        hidden = self.hidden if self.doubt else ()
        several = [
            [*((c,) for c in group), *(pair for cause, *pair in hidden if cause == group[0])]
            for group in self.groups
        ]
        ways = [tuple(chain(*way)) for way in product(*several)]
        return [way for way in ways if len(set(way)) == len(way)]


class CauseTests(NamedTuple):
    """Tests of causes of a difference d with covariance V.

    inverse, pull : V^-1 (D, D) and V^-1 d; causes : their columns
    likely : (D,) the likeliest change of a cause, where it has one, tested beside any other
    scale : of T, by cause and test; freedom : of the scatter
    """

    inverse: Array
    pull: Array
    causes: Mapping[str, Array]
    likely: Mapping[str, Array]
    scale: Mapping[str, Sequence[float]]
    freedom: float

    def tests(self, cause: str) -> list[Array]:
        """What a cause may change, rows (k, D) of each test."""
        rows = self._rows([cause])
        return [rows, self.likely[cause][None]] if cause in self.likely else [rows]

    def _rows(self, causes: Sequence[str]) -> Array:
        """All that some causes may change (k, D)."""
        return np.eye(len(self.pull))[[column for c in causes for column in self.causes[c]]]

    def explained(self, rows: Array) -> float:
        """Squares that changes along some rows explain."""
        b = rows @ self.pull
        return float(b @ np.linalg.solve(rows @ self.inverse @ rows.T, b))

    def p(self, cause: str, beside: Sequence[str] = ()) -> float:
        """Probability of what a cause explains beside others, if it has not changed."""
        before, least, tests = self._rows(beside), 1.0, self.tests(cause)
        for rows, scale in zip(tests, self.scale[cause], strict=True):
            k = len(rows)
            gained = self.explained(np.concatenate([before, rows])) - self.explained(before)
            free = max(self.freedom - k + 1.0, 1.0)
            ratio = max(gained, 0.0) / scale / k * free / max(self.freedom, 1.0)
            least = min(least, float(fdtrc(k, free, ratio)))
        return min(1.0, len(tests) * least)

    def left(self, cause: str, beside: Sequence[str]) -> float:
        """What a cause leaves beside others: -2 log likelihood of d, and 2 for each of its numbers.

        By the t distribution of as much freedom as the scatter has.
        """
        before = self._rows(beside)
        total = float(self.pull @ np.linalg.solve(self.inverse, self.pull))
        both = [np.concatenate([before, rows]) for rows in self.tests(cause)]
        return min(
            self.freedom * np.log1p(max(total - self.explained(rows), 0.0) / self.freedom)
            + 2.0 * len(rows)
            for rows in both
        )


def explained(test: CauseTests, rate: float) -> Explanation:
    """Causes of a difference, each found with a rate of false alarms over all of them.

    Of several the surest is taken first, unless another one leaves far less.
    """
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
        left = {c: test.left(c, chosen) for c in causes if c not in chosen and p(c) <= rate}
        if not left or len(chosen) == _MOST:
            break
        best, least = min(left, key=p), min(left, key=lambda c: left[c])
        best = least if left[least] < left[best] - _DECISIVE else best
        chosen.append(best)  # and what only stood for it is no cause any more
        chosen = [c for c in chosen if c == best or p(c) <= rate]
    groups = []
    for cause in chosen:
        beside = others(cause)
        rivals = [c for c in causes if c not in chosen and test.p(cause, [*beside, c]) > rate]
        groups.append((cause, *sorted(rivals, key=lambda c: test.p(c, beside))))
    explanation = Explanation(first, {cause: p(cause) for cause in causes}, tuple(groups))
    friction = [c for c in causes if c.startswith(FRICTION)]
    if any(c in friction for way in explanation.ways for c in way):
        return explanation
    doubt = any(test.p(c, chosen) < _DOUBT for c in friction)
    hidden = tuple(_hidden(test, chosen, friction, rate / count))
    return explanation._replace(hidden=hidden, doubt=doubt)


def _hidden(
    test: CauseTests, chosen: Sequence[str], friction: Sequence[str], rate: float
) -> Iterator[tuple[str, str, str]]:
    """Causes that another one explains as well with friction, if both of these have changed."""
    others = [c for c in test.causes if c not in (*friction, *chosen)]
    for cause, other, wear in product(chosen, others, friction):
        beside = [c for c in chosen if c != cause]
        both = max(test.p(other, [*beside, wear]), test.p(wear, [*beside, other]))
        if both <= rate < test.p(cause, [*beside, other, wear]):
            yield cause, other, wear


def cause_tests(
    difference: Difference, causes: Mapping[str, Array], likely: Mapping[str, Array]
) -> CauseTests:
    """Tests of causes on a difference, calibrated by healthy recordings against the others."""

    def tests(inverse: Array, off: Array, scale: Mapping[str, Sequence[float]]) -> CauseTests:
        return CauseTests(inverse, inverse @ off, causes, likely, scale, difference.freedom)

    each = np.linalg.inv(difference.covariances)
    healthy = [tests(*pair, {}) for pair in zip(each, difference.left, strict=True)]
    scale = {
        cause: [
            _scale(np.array([h.explained(rows) for h in healthy]) / len(rows))
            for rows in healthy[0].tests(cause)
        ]
        for cause in causes
    }
    return tests(np.linalg.inv(difference.covariance), difference.mean, scale)


def _scale(sizes: Array) -> float:
    """Mean of squares that should be one, and two standard errors, as few recordings tell it."""
    error = float(sizes.std()) / np.sqrt(max(len(sizes) - 1, 1))
    return max(1.0, float(sizes.mean()) + 2.0 * error)
