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
from .window_loops import eliminate, follow

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
    (W, N), s, n = windows.shape, nodes.shape[1], intervals.n
    width = 2 * n + linearised.by.shape[-1]
    shapes = (N + 1, n), (N + 1, n, width), (N + 1,), (N, s), (N, s, width)
    prediction = WindowPrediction(*(np.zeros((W, *shape)) for shape in shapes))
    measured = np.stack([intervals.before, intervals.after]) - offset
    weight = np.stack([intervals.weight_before, intervals.weight_after])
    follow(windows, measured, weight, nodes, *linearised, *prediction)
    return _without_explosions(prediction, intervals.dataset.scales.size)


@np.errstate(over="ignore", invalid="ignore")
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

    H (W, D, D), g (W, D) of the shared parameters, as much as each window counts; to_start
    (W, 2n, D) and start (W, 2n): the initial state moves by start - to_start step. leverage
    (W, N + 1, n): share of each residual that the window's own initial state takes up.
    """

    H: Array
    g: Array
    to_start: Array
    start: Array
    leverage: Array


def eliminate_states(
    prediction: WindowPrediction,
    weight: Array,
    sigma: Array,
    prior: Array,
    damping: Array | float = 0.0,
    counts: Array | float = 1.0,
) -> NormalEquations:
    """Schur complements of the initial states in each window's least-squares problem.

    weight (W, N + 1, n), sigma (n,) [rad]; prior (2, W, 2n): of the initial state's move, mean and
    precision; damping (W, 2n), more precision for its step alone; counts (W,) of windows
    """
    (W, R, n), size = prediction.error.shape, prior.shape[-1]
    D = prediction.slope.shape[-1] - size
    root = np.sqrt(weight * prediction.share[..., None]) / sigma
    shapes = (D, D), (D,), (size, D), (size,), (R, n)
    normal = NormalEquations(*(np.zeros((W, *shape)) for shape in shapes))
    rows = (x.reshape(W, R * n, *x.shape[3:]) for x in (prediction.slope, prediction.error, root))
    out = normal._replace(leverage=normal.leverage.reshape(W, -1))  # a view
    eliminate(*rows, prior, damping + np.zeros((W, size)), counts * np.ones(W), *out)
    return normal


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
