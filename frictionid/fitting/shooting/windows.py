"""Windows of intervals: predictions from initial states, which are eliminated, and solutions."""

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array

from ..covariance import grouped_covariance
from ..fit import Covariance
from ..parameter_block import Estimate, values_of
from ..sandwich import Groups, clusters_of
from .problem import Linearisation, ShootingProblem
from .sample_intervals import Intervals

START_VELOCITY = 10.0  # times the slow speed: deviation of a velocity from the smoothed one
# Sizes of the joints per size, or size per second, of the initial state: predictions without
# information; and sizes that they are held at.
_WILD, _FAR = 1e4, 1e3
AT_ONCE = 40_000  # intervals of windows that are linearised, or solved for, at a time


class WindowPrediction(NamedTuple):
    """Predictions of W windows of at most N intervals, linear in initial states and parameters.

    error (W, N + 1, n) [rad]: measured minus predicted angle, scaled to the usual noise; slope
    (W, N + 1, n, 2n + D): of the predicted angle, in the window's initial state and the parameters;
    share (W, N + 1): how much a sample counts, half where it belongs to two windows, nothing where
    there is none. moved (W, N, s): from nodes to where their window's own prediction passes;
    carried (W, N, s, 2n + D): its derivatives.
    """

    error: Array
    slope: Array
    share: Array
    moved: Array
    carried: Array

    def take(self, rows: Array | slice) -> "WindowPrediction":
        """Those of some windows."""
        return WindowPrediction(*(x[rows] for x in self))


def initial_state_prior(
    intervals: Intervals, nodes: Array, first: Array, angle: Array | float, velocity: Array | float
) -> Array:
    """Prior (2, W, 2n) of the moves of initial states: means, and precisions.

    A joint at rest does not show its velocity, which stays near the smoothed one.

    first : (W,) intervals that windows begin with; angle : precision of the angles, next to nothing
    velocity : [rad/s] standard deviation of the velocities, one or (n,)
    """
    n = intervals.n
    mean, precision = np.zeros((2, len(first), 2 * n))
    mean[:, n:] = intervals.w[first] - nodes[first, n : 2 * n]
    precision[:, :n], precision[:, n:] = angle, 1.0 / np.square(velocity)
    return np.stack([mean, precision])


@np.errstate(over="ignore", invalid="ignore")
def predict_windows(
    intervals: Intervals, linearised: Linearisation, nodes: Array, windows: Array, offset: Array
) -> WindowPrediction:
    """Predictions of windows (W, N) from their initial states, by intervals from nodes (K, s).

    The prediction from the window's initial state passes node k + 1 at x_{k+1} + g_{k+1} with
    g_{k+1} = F_k - x_{k+1} + P_k g_k to first order in the gaps F_k - x_{k+1}; when they have
    closed, it is exactly the prediction from the initial state [Bock1983].

    Windows that explode (a law that the parameters make too steep) are kept as they are: their
    predictions are far off, and nothing moves them until the parameters are better.
    """
    n, s = intervals.n, nodes.shape[1]
    W, N = windows.shape
    D = linearised.by.shape[-1]
    on = windows >= 0
    index = np.where(on, windows, 0)
    last = on & ~np.concatenate([on[:, 1:], np.zeros((W, 1), bool)], axis=1)
    error, share = np.zeros((W, N + 1, n)), np.zeros((W, N + 1))
    slope = np.zeros((W, N + 1, n, 2 * n + D))
    moved, carried = np.zeros((W, N, s)), np.zeros((W, N, s, 2 * n + D))
    weight = np.ones((W, N + 1, n))
    g, T = np.zeros((W, s)), np.zeros((W, s, 2 * n + D))
    T[:, : 2 * n, : 2 * n] = np.eye(2 * n)
    for k in range(N):
        i, end = index[:, k], last[:, k]
        use = on[:, k] if not on[:, k].all() else slice(None)  # views, no copies
        moved[use, k], carried[use, k] = g[use], T[use]
        error[use, k] = (intervals.before[i] - offset - nodes[i, :n] - g[:, :n])[use]
        slope[use, k] = T[use, :n]
        weight[use, k] = intervals.weight_before[i][use]
        share[use, k] = 1.0 if k else 0.5
        P = linearised.by_start[i]
        follows = np.where(end, i, index[:, min(k + 1, N - 1)])
        gap = np.where(end[:, None], 0.0, linearised.end[i] - nodes[follows])
        g = (P @ g[..., None])[..., 0] + gap
        T = P @ T
        T[..., 2 * n :] += linearised.by[i]
        if end.any():
            at = linearised.end[i, :n] + g[:, :n]
            error[end, k + 1] = (intervals.after[i] - offset - at)[end]
            slope[end, k + 1] = T[end, :n]
            weight[end, k + 1] = intervals.weight_after[i][end]
            share[end, k + 1] = 0.5
    for d in np.flatnonzero(linearised.angle.any(axis=1)):
        slope[..., 2 * n + d] += linearised.angle[d] * (share > 0)[..., None]
    if (weight != 1.0).any():
        error, slope = error * weight, slope * weight[..., None]
    prediction = WindowPrediction(error, slope, share, moved, carried)
    return _without_explosions(prediction, intervals.dataset.scales.size)


def _without_explosions(prediction: WindowPrediction, size: Array) -> WindowPrediction:
    """The predictions of joints of some size (n,) with windows that explode held where they are."""
    n = prediction.error.shape[-1]
    by_start = prediction.slope[..., : 2 * n] * np.tile(size, 2) / size[:, None]
    steep = np.abs(by_start).max(axis=(1, 2, 3))
    sums = [x.sum(axis=(1, 2, 3)) for x in (prediction.slope, prediction.carried)]
    finite = np.isfinite(sums).all(axis=0)
    tame = finite & (steep < _WILD) & (np.abs(prediction.error / size).max(axis=(1, 2)) < _FAR)
    if tame.all():
        return prediction
    far = _FAR * size * (prediction.share[..., None] > 0)
    rows = ~tame[:, None, None]
    return prediction._replace(
        error=np.where(rows, far, prediction.error),
        slope=np.where(rows[..., None], 0.0, prediction.slope),
        moved=np.where(rows, 0.0, prediction.moved),
        carried=np.where(rows[..., None], 0.0, prediction.carried),
    )


class NormalEquations(NamedTuple):
    """Normal equations H step = g of each window, its initial state eliminated.

    H (W, D, D), g (W, D) of the shared parameters; to_start (W, 2n, D) and start (W, 2n): the
    initial state moves by start - to_start step. leverage (W, N + 1, n): share of each residual
    that the window's own initial state takes up.
    """

    H: Array
    g: Array
    to_start: Array
    start: Array
    leverage: Array

    def weighted(self, counts: Array) -> "NormalEquations":
        """What windows say of the shared parameters, each as much as it counts (W,)."""
        if (counts == 1).all():
            return self
        on = counts > 0  # what is left out may be infinite
        H = np.where(on[:, None, None], self.H * counts[:, None, None], 0.0)
        return self._replace(H=H, g=np.where(on[:, None], self.g * counts[:, None], 0.0))


def eliminate_states(
    prediction: WindowPrediction,
    weight: Array,
    sigma: Array,
    prior: Array,
    damping: Array | None = None,
) -> NormalEquations:
    """Schur complements of the initial states in each window's least-squares problem.

    weight (W, N + 1, n), sigma (n,) [rad]; prior (2, W, 2n): of the initial state's move, mean and
    precision; damping (W, 2n), more precision for its step alone
    """
    W, N = prediction.share.shape
    count = -(-W * N // AT_ONCE)
    if count == 1:
        return _eliminated(prediction, weight, sigma, prior, damping)
    parts = []
    for rows in np.array_split(np.arange(W), count):
        part = slice(int(rows[0]), int(rows[-1]) + 1)
        less = None if damping is None else damping[part]
        parts.append(_eliminated(prediction.take(part), weight[part], sigma, prior[:, part], less))
    return NormalEquations(*map(np.concatenate, zip(*parts, strict=True)))


def _eliminated(
    prediction: WindowPrediction, weight: Array, sigma: Array, prior: Array, damping: Array | None
) -> NormalEquations:
    """The same for windows all at once."""
    W = len(prediction.error)
    root = np.sqrt(weight * prediction.share[..., None]) / sigma
    D = prediction.slope.shape[-1]
    A = (prediction.slope * root[..., None]).reshape(W, -1, D)
    b = (prediction.error * root).reshape(W, -1)
    size = prior.shape[-1]
    alone, shared = A[..., :size], A[..., size:]
    turned = np.swapaxes(alone, 1, 2)
    wanted, precision = prior
    start = turned @ alone + precision[:, :, None] * np.eye(size)
    start_right = (turned @ b[..., None])[..., 0] + precision * wanted
    inverse = np.linalg.inv(start)
    cross = turned @ shared
    to_start = inverse @ cross
    best = (inverse @ start_right[..., None])[..., 0]
    # as a sum of squares: a difference of large ones may come out negative
    rest = shared - alone @ to_start
    H = np.swapaxes(rest, 1, 2) @ rest
    H += np.swapaxes(to_start, 1, 2) @ (precision[:, :, None] * to_start)
    kept = (precision * wanted)[:, None]
    g = (b[:, None] @ rest - kept @ to_start)[:, 0]
    leverage = ((alone @ inverse) * alone).sum(axis=-1).reshape(root.shape)
    if damping is not None:
        held = start + damping[:, :, None] * np.eye(size)
        both = np.linalg.solve(held, np.concatenate([cross, start_right[..., None]], axis=-1))
        to_start, best = both[..., :-1], both[..., -1]
    return NormalEquations(H, g, to_start, best, leverage)


class Solution(NamedTuple):
    """Where a fit to a problem ended.

    estimate; nodes (K, s); windows (W, N); residual (W, N + 1, n) [rad] after the last step, share
    (W, N + 1) and weight of each; sigma (n,) [rad]; normal equations of the windows before the last
    step, as much as each counts, and that step, move (D,); free (D,), parameters that are not at a
    bound; counts (W,), how much windows count; kinked (W,), true for those that were left out as
    their predictions jump; converged, and the number of iterations; stopped: why it ended early.
    """

    problem: ShootingProblem
    estimate: Estimate
    nodes: Array
    windows: Array
    residual: Array
    share: Array
    weight: Array
    sigma: Array
    normal: NormalEquations
    move: Array
    free: Array
    counts: Array
    kinked: Array
    converged: bool = False
    iterations: int = 0
    stopped: tuple[str, ...] = ()

    @property
    def values(self) -> Array:
        """Values (D,) of the free parameters."""
        return values_of(self.estimate, self.problem.blocks)

    @property
    def closed(self) -> Array:
        """True (W,) for windows that counted."""
        return self.counts > 0

    @property
    def curvature(self) -> Array:
        """Normal matrix (D, D) of the windows that counted, without priors."""
        return self.normal.H[self.closed].sum(axis=0)

    @property
    def groups(self) -> Groups:
        """The windows that count; of few recordings, stretches of time are clusters."""
        recording = self.problem.intervals.recording[self.windows[:, 0]]
        on, H, g = self.closed, self.normal.H, self.normal.g
        cluster = clusters_of(H[on], recording[on], np.arange(len(H))[on])
        return Groups(H[on], g[on], self.move, self.free, recording[on], cluster)

    def covariance(self, model_error: Array | float = 0.0) -> Covariance:
        """Covariance of the parameters, from what each recording alone would change in them.

        The sandwich estimate with the leverage of each recording taken into account: parameters are
        solved for with every recording left out in turn, to first order [BellMcCaffrey2002]; so
        noise, the model's errors, and what differs between recordings all count. Fewer than four
        recordings are divided into 24 stretches of time; of three recordings the larger of both
        errors counts.

        model_error : covariance (D, D) of errors that all recordings share, see `omitted_blocks`
        """
        parameters, friction = self.problem.parameters, self.estimate.friction
        return grouped_covariance(parameters, self.values, friction, self.groups, model_error)
