"""Gauss-Newton over all windows at once, start states eliminated, Huber weights, damped steps."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.identifiers.box_qp import bounded
from frictionid.shooting.intervals import cut
from frictionid.shooting.linearise import Intervals, put, values_of
from frictionid.shooting.parameters.parameter_block import Guess
from frictionid.shooting.windows import Chain, Normal, chained, eliminated

_MAD = 1.4826  # standard deviation over median absolute deviation, of normal noise
_LOST = 0.5  # [rad]: nodes that leave the measured motion by more begin anew
_DAMPING = (1e-8, 1e4)
_WORSE = 1.02  # a cost that grows by more was a step too far
_ROUNDS = 3
_MOST = 4.0  # of Huber's threshold: windows further off are lost anyhow
_CLOSED, _OPEN = 0.1, 1.0  # [noise]: a typical gap when most have closed, and one that has not
_FAR = 2.0  # [noise], and noise per sample: a long step of a start
_SHUT = 0.05  # [noise]: smaller gaps do not matter
_LEAST = 0.2  # of a step
_LEADING = 4  # iterations of the stages before the last
_NEAR = 0.5  # [standard errors]: steps with which those end
_COARSE = 3.0  # times as long are their substeps near rest


class Shot(NamedTuple):
    """Where a fit ended.

    guess; nodes (K, s); windows (W, N); residual (W, N + 1, n) [rad] after the last step, share and
    weight of each; sigma (n,) [rad]; normal equations (W, ...) of the windows before the last step,
    and that step, move (D,); free (D,),
    parameters that are not at a bound; closed (W,), windows that counted; settled, and the number
    of iterations.
    """

    guess: Guess
    nodes: Array
    windows: Array
    residual: Array
    share: Array
    weight: Array
    sigma: Array
    normal: Normal
    move: Array
    free: Array
    closed: Array
    settled: bool
    iterations: int


class _Stand(NamedTuple):
    """Parameters and nodes, and what they were linearised to.

    gap (W,): how far nodes are from their window's prediction, in standard deviations of the noise;
    damping (W,) of the step of a window's start; out (W,): does not count.
    """

    guess: Guess
    nodes: Array
    windows: Array
    chain: Chain
    prior: Array
    gap: Array
    damping: Array
    out: Array


def settle(
    intervals: Intervals,
    guess: Guess,
    use: Array,
    nodes: Array | None = None,
    *,
    stages: int = 0,
    mean: Array | None = None,
) -> Shot:
    """The fit to the intervals that may be used, (K,) true or false.

    nodes : where to begin, those of the smoothed motion by default
    stages : the last so many stages only, all by default
    mean : (D,) of the priors, where the fit begins by default
    """
    s, track = intervals.settings, intervals.track
    nodes = intervals.start(guess) if nodes is None else nodes
    sigma = _noise(intervals, use)
    mean = values_of(guess, intervals.parts) if mean is None else mean
    total = 0
    shot = None
    for seconds in s.windows[-stages:]:
        windows = cut(track, use, seconds)
        own = intervals if seconds == s.windows[-1] else _leading(intervals)
        shot = _stage(own, guess, nodes, windows, sigma, mean)
        total += shot.iterations
        guess, nodes, sigma = shot.guess, shot.nodes, shot.sigma
    assert shot is not None
    return shot._replace(iterations=total)


def _leading(intervals: Intervals) -> Intervals:
    """The intervals for the stages before the last, which need only come near."""
    s = intervals.settings
    few, near = min(s.iterations, _LEADING), max(s.tolerance, _NEAR)
    own = replace(s, iterations=few, tolerance=near, fine=_COARSE * s.fine)
    return replace(intervals, settings=own)


def _noise(intervals: Intervals, use: Array) -> Array:
    """First idea of the angle noise (n,) [rad]: what the smoother took off."""
    track = intervals.track
    off = np.abs(track.before - track.q)[use]
    floor = 1e-9 + 1e-6 * np.abs(track.before).max(axis=0)
    return np.maximum(_MAD * np.median(off, axis=0), floor)


def _stage(
    intervals: Intervals,
    guess: Guess,
    nodes: Array,
    windows: Array,
    sigma: Array,
    mean: Array,
) -> Shot:
    s = intervals.settings
    rows = windows[windows >= 0]
    damping, last, settled, count, share = _DAMPING[0], None, False, 0, 1.0
    shot, before_move = None, None
    while count < s.iterations and not settled:
        count += 1
        now = _linearised(intervals, guess, nodes, windows, rows, sigma)
        if last is not None and shot is not None:
            now = _judged(now, last, shot.move, sigma, s.huber)
            before, after = (_cost(x.chain, now.out, sigma, s.huber) for x in (last, now))
            worse = after > _WORSE * before and damping < _DAMPING[1]
            damping = max(damping, 1e-4) * 10.0 if worse else max(damping / 10.0, _DAMPING[0])
            now = last if worse else now
        last = now
        if shot is not None:
            share = _share(share, shot, before_move)
            before_move = shot.move
        shot, step = _solved(intervals, now, windows, sigma, mean, damping, share)
        sigma, guess, nodes = shot.sigma, shot.guess, shot.nodes
        settled = bool(step <= share * s.tolerance) and damping < 1e-2
    assert shot is not None
    return shot._replace(settled=settled, iterations=count)


def _share(share: float, shot: Shot, before: Array | None) -> float:
    """Share of the next step: steps that go to and fro are made shorter.

    Windows with kinks may push now one way, now the other.
    """
    if before is None:
        return share
    H = shot.normal.H[shot.closed].sum(axis=0)
    back = -float(before @ H @ shot.move)
    size = np.sqrt(float(before @ H @ before) * float(shot.move @ H @ shot.move))
    return max(0.5 * share, _LEAST) if back > 0.3 * size else min(1.0, 1.5 * share)


def _judged(now: _Stand, last: _Stand, move: Array, sigma: Array, huber: float) -> _Stand:
    """Each window with the step of its own start judged.

    Where a joint just misses or just reaches a stop, the prediction has a kink, and steps may fail
    again and again. A window that has become worse, when most have closed, goes back and makes a
    smaller step; one that is not continuous does not count meanwhile.
    """
    if not np.median(now.gap) < _CLOSED:
        return now
    before, after = (_costs(x.chain, sigma, huber) for x in (last, now))
    worse = ~(after < 1.3 * before + 2.0) & (last.gap < _OPEN)
    open_ = (now.gap > _SHUT) & (now.gap > 0.5 * last.gap)
    damping = np.where(worse | open_, np.maximum(10.0 * last.damping, 0.1), last.damping / 10.0)
    damping = np.where(damping < 0.01, 0.0, np.minimum(damping, 1e4))
    out = (damping > 0) & (now.gap > _OPEN) & ~worse
    out |= ((damping > 0) | last.out) & (after >= 0.999 * _most(now.chain, huber))
    if worse.any():
        now = _returned(now, last, worse, move)
    return now._replace(damping=damping, out=out)


def _returned(now: _Stand, last: _Stand, which: Array, move: Array) -> _Stand:
    """Some windows as they were, but for the shared parameters' move since."""
    size = last.chain.slope.shape[-1] - len(move)
    old = last.chain
    error = old.error[which] - old.slope[which][..., size:] @ move
    moved = old.moved[which] + old.carried[which][..., size:] @ move
    chain = now.chain
    for whole, part in (
        (chain.error, error),
        (chain.slope, old.slope[which]),
        (chain.moved, moved),
        (chain.carried, old.carried[which]),
        (now.prior[0], last.prior[0][which]),
        (now.gap, last.gap[which]),
    ):
        whole[which] = part
    at = now.windows[which]
    at = at[at >= 0]
    now.nodes[at] = last.nodes[at]
    return now


def _linearised(
    intervals: Intervals,
    guess: Guess,
    nodes: Array,
    windows: Array,
    rows: Array,
    sigma: Array,
) -> _Stand:
    track, n = intervals.track, intervals.track.n
    first = windows[:, 0]
    nodes = nodes.copy()
    warm = intervals.warm(guess)
    if warm:
        nodes[first, 2 * n :] = np.concatenate(warm, axis=-1)[first]
    lines = intervals.lines(guess, nodes, rows)
    chain = chained(track, lines, nodes, windows, guess.calibration.offset)
    # a joint at rest does not tell its start velocity: it stays near the smoothed one
    precision = np.zeros((len(windows), 2 * n))
    precision[:, n:] = 1.0 / intervals.settings.start_velocity**2
    precision[:, :n] = 1e-6 / np.maximum(1.0, np.abs(nodes[first, :n])) ** 2
    wanted = np.zeros_like(precision)
    wanted[:, n:] = track.w[first] - nodes[first, n : 2 * n]
    gap = (np.abs(chain.moved[..., :n]) / sigma).max(axis=(1, 2))
    prior = np.stack([wanted, precision])
    none = np.zeros(len(windows))
    return _Stand(guess, nodes, windows, chain, prior, gap, none, none > 0)


def _cost(chain: Chain, out: Array, sigma: Array, huber: float) -> float:
    return float(_costs(chain, sigma, huber)[~out].sum())


def _costs(chain: Chain, sigma: Array, huber: float) -> Array:
    """Huber's cost (W,) of predictions as they stand, none counting more than its share."""
    e = np.abs(chain.error) / sigma
    rho = np.where(e <= huber, e**2, 2 * huber * e - huber**2) * chain.share[..., None]
    return np.minimum(rho.sum(axis=(1, 2)), _most(chain, huber))


def _most(chain: Chain, huber: float) -> Array:
    """Cost (W,) of windows that are lost."""
    return _MOST * huber**2 * chain.share.sum(axis=1)


def _solved(
    intervals: Intervals,
    now: _Stand,
    windows: Array,
    sigma: Array,
    mean: Array,
    damping: float,
    share: float,
) -> tuple[Shot, float]:
    """The fit after a share of one step, and the largest move of a parameter in standard errors."""
    s = intervals.settings
    chain, value = now.chain, values_of(now.guess, intervals.parts)
    entries = [e for part in intervals.parts for e in part.entries]
    low, high, sd = (np.array([getattr(e, k) for e in entries]) for k in ("low", "high", "prior"))
    precision = 1.0 / sd**2
    counts = ~now.out * 1.0
    weight = np.ones_like(chain.error)
    slow = _slow(intervals, now, sigma)
    for _ in range(_ROUNDS):
        normal = eliminated(chain, weight, sigma, now.prior, slow)
        H = np.einsum("w,wij->ij", counts, normal.H) + np.diag(precision)
        g = counts @ normal.g + precision * (mean - value)
        move = share * _step(H, g, low - value, high - value, damping)
        start = normal.start - normal.to_start @ move
        all_moves = np.concatenate([start, np.broadcast_to(move, (len(start), len(move)))], axis=1)
        residual = chain.error - (chain.slope @ all_moves[:, None, :, None])[..., 0]
        sigma = _scale(residual, chain.share, normal.leverage, sigma)
        size = np.abs(residual) / sigma
        weight = np.minimum(1.0, s.huber / np.maximum(size, 1e-12))
    wanted = value + move
    inside = (wanted > low + 1e-12) & (wanted < high - 1e-12)
    largest = _largest(H, move, inside, precision)
    guess = put(now.guess, intervals.parts, wanted)
    nodes = _moved(intervals, now, windows, all_moves)
    shot = Shot(
        *(
            guess,
            nodes,
            windows,
            residual,
            chain.share,
            weight,
            sigma,
            normal,
            move,
            inside,
            ~now.out,
        ),
        settled=False,
        iterations=0,
    )
    return shot, largest


def _slow(intervals: Intervals, now: _Stand, sigma: Array) -> Array:
    """Precision (W, 2n) that keeps the starts' steps small.

    What a window tells of its start is worth more, unless a joint rests or a kink is near.
    """
    per_time = np.median(intervals.track.dt) / sigma
    own = np.concatenate([1.0 / sigma, per_time]) / _FAR
    tells = np.concatenate([1.0 / sigma, per_time * len(now.chain.error[0])])
    return own**2 + now.damping[:, None] * tells**2


def _largest(H: Array, move: Array, inside: Array, precision: Array) -> float:
    """Largest move of a parameter in standard errors by the curvature alone.

    Of parameters that are not at a bound and leave a trace, each as far as the data, and not its
    prior, tell it.
    """
    own = H[np.ix_(inside, inside)]
    scale = np.sqrt(np.maximum(np.diag(own), 1e-300))
    variance = np.diag(np.linalg.pinv(own / np.outer(scale, scale), hermitian=True)) / scale**2
    told = np.clip(1.0 - precision[inside] * variance, 0.0, 1.0)
    known = variance > 0.0
    size = np.abs(move[inside][known]) * np.sqrt(told[known] / variance[known])
    return float(size.max(initial=0.0))


def _step(H: Array, g: Array, low: Array, high: Array, damping: float) -> Array:
    """Damped step within bounds, in units in which the diagonal of H is one."""
    if not len(g):
        return g
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    scaled = H / np.outer(scale, scale) + damping * np.eye(len(g))
    inner = bounded(scaled[None], (g / scale)[None], (low * scale)[None], (high * scale)[None])
    return inner[0] / scale


def _scale(residual: Array, share: Array, leverage: Array, sigma: Array) -> Array:
    """Angle noise (n,) [rad] from the residuals, each corrected for what its window took up."""
    known = share > 0
    clean = residual / np.sqrt(np.maximum(1.0 - leverage, 0.05))
    found = _MAD * np.median(np.abs(clean[known]), axis=0)
    return np.maximum(found, 1e-3 * sigma)


def _moved(intervals: Intervals, now: _Stand, windows: Array, moves: Array) -> Array:
    """Nodes on the predictions of their windows; those that got lost begin anew."""
    n, track = intervals.track.n, intervals.track
    nodes = now.nodes.copy()
    step = now.chain.moved + (now.chain.carried @ moves[:, None, :, None])[..., 0]
    on = windows >= 0
    at = windows[on]
    nodes[at] += step[on]
    off = np.abs(nodes[at, :n] - (track.before[at] - now.guess.calibration.offset)).max(axis=-1)
    bad = ~(off < _LOST) | ~np.isfinite(nodes[at]).all(axis=-1)
    if bad.any():
        owner = np.repeat(np.arange(len(windows)), on.sum(axis=1))
        lost = np.isin(owner, np.unique(owner[bad]))
        nodes[at[lost]] = intervals.start(now.guess)[at[lost]]
    return nodes
