"""One-step residuals: everything about the data that a fit of friction needs, computed once.

Friction enters the one-step residual affinely,

    e = r - G sum_m c_m Tf(node_m)   [rad/s]  (predicted minus measured velocity)

with r and G constants of the data, so that fitting and scoring only ever evaluate this line.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from frictionid.arrays import MAD, Array, inverse, solve, times
from frictionid.data.integrals import averages
from frictionid.data.plants import on_recorded_base
from frictionid.data.recordings import Recording
from frictionid.data.signals import sample
from frictionid.data.state_estimators import States, slowest_speeds
from frictionid.errors import InputError
from frictionid.friction import PEAK_SHOWN, DataRange, Inputs, Law, Nodes, joined
from frictionid.friction.coordinates import (
    at_places,
    recorded_inputs,
    recorded_load,
    with_places,
)
from frictionid.mechanics import Plant
from frictionid.mechanics.plant import (
    SIMPSON,
    interleaved,
    interval_mean,
    interval_stencil,
    momentum_balance,
    with_midpoints,
)

# An interval this many times longer than the recording's usual one is a gap: no row bridges it, one
# of half a second has cost seven per cent of the friction curve.
GAP = 5.0
_RESTING = 0.02  # of the speeds in a recording: a joint that is slower may be at rest
# Of those in the fastest recording: the speeds of the slowest motion of joints that move in turn.
IN_TURN = 0.05
_BLIND = 1e-9  # of the best seen combination of joints
_HARDLY = 0.03  # of the largest load of a joint: by less, no coefficient shows
_SLOWEST = 0.01  # of the fastest speed: slowest one of a problem that does not know it


@dataclass(frozen=True)
class Problem:
    """One-step residuals of K rows, each a sample interval of a recording.

    nodes : where friction acts; r (K, n) [rad/s]; G (K, n, n) [rad/s per N m]
    stencil : (K, m) nodes of each row, with coefficients (m,) that add up to one
    recording : (K,) index of the recording; time, dt : (K,) [s] start and length of the interval
    history : the most samples of a recording before its first row, for laws that remember
    slowest : (R, n) [rad/s], slowest speeds that each recording resolves, see `slowest_speeds`
    masked : whether the rows of joints at rest are projected out, see `mask_stiction`

    Intervals across a gap in a recording are no rows.
    """

    nodes: Nodes
    r: Array
    G: Array
    stencil: Array
    coefficients: Array
    recording: Array
    time: Array
    dt: Array
    history: int = 0
    slowest: Array | float = 0.0
    masked: bool = False

    def fitted_form(self, law: Law) -> Law:
        """The law as it is fitted: not smoothed where rows of joints at rest are projected out.

        There all others slide, and numerical smoothing of sgn(w) would only blur slow ones.
        """
        return law.sharpened() if self.masked else law

    def mean(self, values: Array) -> Array:
        """Stencil average of node values (..., S, n) over each row, (..., K, n)."""
        return interval_mean(values, self.stencil, self.coefficients)

    def of_rows(self, rows: Array) -> "Problem":
        """The problem of some rows (k,), with the nodes of the recordings that they are of."""
        which, place = np.unique(self.recording[rows], return_inverse=True)
        first = self.nodes.first
        sizes = first[which + 1] - first[which]
        begin = np.cumsum([0, *sizes])
        at = np.arange(begin[-1]) + np.repeat(first[which] - begin[:-1], sizes)
        stencil = self.stencil[rows] + (begin[:-1] - first[which])[place][:, None]
        part = self.with_rows(rows, at, stencil)
        nodes = part.nodes._replace(first=begin, per_sample=self.nodes.per_sample)
        slowest = self.slowest if not np.ndim(self.slowest) else np.asarray(self.slowest)[which]
        return replace(part, nodes=nodes, recording=place, slowest=slowest)

    def with_rows(self, rows: slice | Array, places: slice | Array, stencil: Array) -> "Problem":
        """Some rows, with the nodes at these places, one series, in which their stencils look."""
        inputs, time = self.nodes.inputs.each(lambda x: x[places]), self.nodes.time[places]
        names = "r", "G", "recording", "time", "dt"
        arrays = {name: getattr(self, name)[rows] for name in names}
        nodes = Nodes(inputs, time, np.array([0, len(time)]))
        return replace(self, nodes=nodes, stencil=stencil, **arrays)

    def residual(self, torque: Array) -> Array:
        """Residual e (..., K, n) [rad/s] of friction torques at the nodes, (..., S, n)."""
        return self.r - times(self.G, self.mean(torque))


def data_range(problem: Problem, weights: Array) -> DataRange:
    """Speeds (F, n) that the rows with weights (F, K) resolve, and what is usual in them."""
    slowest, fastest = speed_range(problem, weights)
    x = problem.nodes.inputs
    load, square = problem.mean(np.abs(x.load)), problem.mean(x.u**2)
    by_sign = problem.G * problem.mean(np.sign(x.w))[:, None]
    each = [_usual(by_sign, problem.r, load, square, fold) for fold in weights]
    level, load, square = (np.stack(part) for part in zip(*each, strict=True))
    load = np.maximum(load, _HARDLY * load.max(axis=-1, keepdims=True))
    return DataRange(slowest, fastest, level, load, np.sqrt(square))


def _usual(
    by_sign: Array, r: Array, load: Array, square: Array, weights: Array
) -> tuple[Array, Array, Array]:
    """Of one fold the levels (n,) [N m] of Coulomb friction alone, and means of load and square."""
    total = max(float(weights.sum()), 1e-300)
    weighted = by_sign * weights[:, None, None]
    H = np.einsum("kip,kiq->pq", weighted, by_sign, optimize=True)
    level = np.linalg.pinv(H, rcond=_BLIND, hermitian=True) @ np.einsum("kip,ki->p", weighted, r)
    return np.abs(level), weights @ load / total, weights @ square / total


def speed_range(problem: Problem, weights: Array) -> tuple[Array, Array]:
    """Slowest and fastest speeds (F, n) that the rows with weights (F, K) show and resolve."""
    use = weights > 0
    w = np.abs(problem.nodes.inputs.w[problem.stencil])
    fastest = np.stack([w[rows].max(axis=(0, 1), initial=0.0) for rows in use])
    least = np.stack([w[rows].min(axis=(0, 1), initial=np.inf) for rows in use])
    if not np.ndim(problem.slowest):
        resolved = _SLOWEST * fastest
    else:
        recordings = [np.unique(problem.recording[rows]) for rows in use]
        usual = [np.median(np.asarray(problem.slowest)[which], axis=0) for which in recordings]
        resolved = np.maximum(np.stack(usual), 1e-6 * fastest)
    return np.maximum(resolved, np.minimum(PEAK_SHOWN * least, fastest)), fastest


def mask_stiction(problem: Problem, velocity_threshold: float | Array | None) -> Problem:
    """The same problem with the rows of joints at rest projected out.

    There friction is whatever holds the joint, or switches between the nodes: no law can be read
    from it. With the columns Gs of G of the masked joints (see `stiction_mask`), r and G become

        P r and P G,    P = I - Gs Gs^+,

    as if the friction of those joints were a free unknown of that row; the row still counts for the
    other joints. On the simulated `acrobot_clean` this takes the curve errors from 23 % and 24 % to
    0.9 % and 2.1 %.

    >>> from frictionid.friction import at_rest
    >>> w = np.array([[1.0, 0.0], [1.0, 0.0]])
    >>> nodes = Nodes(at_rest(w), np.array([0.0, 0.1]), np.array([0, 2]))
    >>> row = dict(recording=np.zeros(1, int), time=np.zeros(1), dt=np.full(1, 0.1))
    >>> G = np.array([[[2.0, 0.0], [0.0, 3.0]]])
    >>> p = Problem(nodes, np.ones((1, 2)), G, np.array([[0]]), np.ones(1), **row)
    >>> mask_stiction(p, 0.2).G[0].round(6) + 0.0
    array([[2., 0.],
           [0., 0.]])
    """
    mask = stiction_mask(problem, velocity_threshold)
    P = stiction_projector(problem.G, mask)
    # exactly zero, and not by rounding, so that a fit sees which joints never move
    G = (P @ problem.G) * ~mask[:, None, :]
    return replace(problem, r=times(P, problem.r), G=G, masked=True)


def stiction_mask(
    problem: Problem, velocity_threshold: float | Array | None, slowest: float = 0.0
) -> Array:
    """Whether each joint may stick in each row, (K, n) of bool.

    It may where it is slower than the threshold [rad/s], one or one for each joint, at a node of
    the row, or reverses in it.
    None: the slowest speed that the row's recording resolves, and no less than 2 % of the speeds in
    it: slower joints give way before they slip, in play and presliding that no law here describes.
    slowest: a recording whose speeds are a smaller share of those in the fastest one counts as one
    with this share, `IN_TURN` where joints move in turn and rest otherwise.
    """
    w, threshold = problem.nodes.inputs.w[problem.stencil], velocity_threshold  # (K, m, n)
    if threshold is None:
        first = problem.nodes.first
        each = [np.abs(problem.nodes.inputs.w[a:b]) for a, b in pairwise(first)]
        usual = _RESTING * np.stack([np.quantile(speeds, 0.95, axis=0) for speeds in each])
        usual = np.maximum(usual, slowest * usual.max(axis=0))
        threshold = np.maximum(problem.slowest, usual)[problem.recording][:, None]
    slow = (np.abs(w) < threshold).any(1)
    return np.asarray(slow | ((w > 0).any(1) & (w < 0).any(1)))


def stiction_projector(G: Array, mask: Array) -> Array:
    """Projectors P = I - Gs Gs^+ (K, n, n) on what the friction of masked joints cannot reach."""
    P = np.broadcast_to(np.eye(G.shape[-1]), G.shape).copy()
    rows = mask.any(1)
    masked = G[rows] * mask[rows][:, None, :]
    P[rows] -= masked @ np.linalg.pinv(masked, rcond=1e-9)
    P[mask.all(1)] = 0.0
    return P


# Rows of one recording: node inputs and times, r, G, start and length of each interval.
_Rows = tuple[Inputs, Array, Array, Array, Array, Array]


def _euler_rows(plant: Plant, recording: Recording, states: States) -> _Rows:
    time, q, w = states.motion
    u = averages(recording.torque, time)
    dt = np.diff(time)
    plant = on_recorded_base(plant, recording, time[:-1])
    terms = plant.terms(q[:-1], w[:-1])
    r = w[:-1] + solve(terms.M, terms.h + times(terms.B, u)) * dt[:, None] - w[1:]
    temperature = recording.temperature_at(time[:-1], plant.mechanism.joints)
    load = recorded_load(plant, time[:-1], q[:-1], w[:-1], u)
    nodes = at_places(plant.mechanism, Inputs(q[:-1], w[:-1], u, load, temperature))
    r, G = with_places(plant.mechanism, r, inverse(terms.M) * dt[:, None, None])
    return nodes, time[:-1], r, G, time[:-1], dt


def _integral_rows(plant: Plant, recording: Recording, states: States) -> _Rows:
    dt = np.diff(states.time)
    at, q, w = with_midpoints(*states.motion)
    plant = on_recorded_base(plant, recording, at)
    terms = plant.terms(q, w)
    begin, end, force = momentum_balance(terms, interval_stencil(len(states.time)))
    u = averages(recording.torque, states.time)
    M1, force = terms.M[2::2], force + times(terms.B, u)
    impulse = begin + force * dt[:, None]
    if plant.mechanism.floating:  # momentum at the end by a base that turns
        impulse -= end - times(M1, states.w[1:])
    r = solve(M1, impulse) - states.w[1:]
    # friction at a sample sees the torque logged there, not the mean of the next interval
    torque = interleaved(sample(recording.torque, states.time), u)
    temperature = recording.temperature_at(at, plant.mechanism.joints)
    nodes = recorded_inputs(plant, at, q, w, torque, temperature)
    r, G = with_places(plant.mechanism, r, inverse(M1) * dt[:, None, None])
    return nodes, at, r, G, states.time[:-1], dt


# Rows of a recording, coefficients of the nodes of each, and nodes for each sample.
_SCHEMES = {"euler": (_euler_rows, (1.0,), 1), "integral": (_integral_rows, SIMPSON, 2)}


def one_step_problem(
    scheme: str,
    plant: Plant,
    recordings: Sequence[Recording],
    states: Sequence[States],
    history: int | Sequence[int] = 0,
) -> Problem:
    """One problem of all recordings by a scheme, without gaps and the first `history` rows of each.

    "euler" : the study's explicit Euler step [DeMeester2020], one node at the interval's start.

        r = w0 + M0^-1 (h0 + B u) dt - w1,  G = M0^-1 dt, with u the mean torque of the interval

    "integral" : the momentum balance over each interval, by Simpson's rule on estimated motion.

        M1 w1 - M0 w0 = integral of (dL/dq + B u - Tf) dt, see `mechanics.momentum_balance`

    Its midpoints follow from the estimated states alone, so that r does not depend on friction. The
    states must be smoothed: backward differences lag half a sample, which is worse here than in an
    Euler step.
    """
    rows_of, coefficients, per_sample = _SCHEMES[scheme]
    pairs = enumerate(zip(recordings, states, strict=True))
    parts = [rows_of(plant[i], *pair) for i, pair in pairs]
    before = np.broadcast_to(history, len(parts))
    inputs, node_times, *_ = zip(*parts, strict=True)
    first = np.cumsum([0, *map(len, node_times)])
    rows = []
    for i, (_, _, r, G, start, dt) in enumerate(parts):
        kept = np.arange(len(r)) >= before[i]
        kept &= dt <= GAP * np.median(dt)
        node = first[i] + np.flatnonzero(kept)[:, None] * per_sample
        stencil, number = node + np.arange(len(coefficients)), np.full(kept.sum(), i)
        rows.append((r[kept], G[kept], stencil, number, start[kept], dt[kept]))
    r, G, stencil, recording, time, dt = (np.concatenate(x) for x in zip(*rows, strict=True))
    if not len(r):
        raise InputError(
            f"no recording is longer than the {before.max()} samples of history before its first "
            "row: record longer, shorten the history, or use more of the samples"
        )
    nodes = Nodes(joined(inputs), np.concatenate(node_times), first, per_sample)
    c = np.array(coefficients)
    slowest = np.stack([slowest_speeds(s) for s in states])
    parts_beyond = r.shape[-1] - slowest.shape[-1]  # coupled, as slow as the slowest joint
    slowest = np.pad(slowest, ((0, 0), (0, parts_beyond)), constant_values=slowest.max())
    return Problem(nodes, r, G, stencil, c, recording, time, dt, int(before.max()), slowest)


def normalised(weights: Array, problem: Problem) -> Array:
    """Weights (F, K) that add up to one in each fold.

    Raises
    ------
    InputError
        For another shape, weights that are negative or not finite, and folds without rows.
    """
    weights, K = np.asarray(weights, dtype=float), len(problem.r)
    if weights.ndim != 2 or weights.shape[1] != K:
        raise InputError(f"weights must have shape (folds, {K}), got {weights.shape}")
    if not (np.isfinite(weights).all() and (weights >= 0).all()):
        raise InputError("weights must be finite and not negative")
    highest = weights.max(axis=1, initial=0.0, keepdims=True)
    if not highest.all():
        fold = int(np.argmin(highest))
        raise InputError(f"fold {fold} has no rows to fit: use fewer folds or more recordings")
    weights = weights / highest
    return weights / weights.sum(axis=1, keepdims=True)


def huber_factors(residual: Array, weights: Array, clip: float) -> Array:
    """Factors (F, K) of the rows' weights by Huber's rule [Huber1964].

    One for rows whose residual (F, K, n) is within `clip` standard deviations in all joints, and
    clip over its size in them for others. A joint's standard deviation is that of the fold's rows
    without their tails, from the weighted median; rows in which its residual is zero (stiction, see
    `mask_stiction`) do not count in it.

    >>> residual = np.array([[[1.0], [-1.0], [2.0], [-2.0], [100.0]]])
    >>> huber_factors(residual, np.ones((1, 5)), clip=3.0)[0].round(3)
    array([1.   , 1.   , 1.   , 1.   , 0.089])
    """
    return np.stack([_factors(*pair, clip) for pair in zip(residual, weights, strict=True)])


def _factors(residual: Array, weights: Array, clip: float) -> Array:
    """Factors (K,) of one fold's residual (K, n) and weights (K,)."""
    size = np.abs(residual)
    order = np.argsort(size, axis=0)
    ordered = np.take_along_axis(size, order, axis=0)
    counted = np.where(ordered > 0, weights[order], 0.0)
    cumulated = np.cumsum(counted, axis=0)
    middle = (cumulated >= 0.5 * cumulated[-1:]).argmax(axis=0)[None]
    median = np.take_along_axis(ordered, middle, axis=0)
    allowed = np.maximum(clip * MAD * median, 1e-300)
    return np.min(allowed / np.maximum(size, allowed), axis=-1)
