"""Torque-speed envelope of motors whose torque is measured, from samples in which it saturates.

Torques that saturate stand on the upper edge of all torques over speed, forwards and backwards
alike. With d the distance above an edge h in units of the torque's noise, a share of them does:

    p(d) = share phi(d) + (1 - share) Phi(-d)/h

The likeliest edge of a grid is drawn to the samples that are near it. Its peak or its fall is
reached where samples pile up on it: five times as many as in a band as wide beside it, in three
stretches between which the torque changes its sign, at speeds that differ. A torque that only has
its crests there, as a sine does, has twice as many. A command that steps to one level looks like a
peak.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, stdtrit

from frictionid.arrays import MAD, Array, usual_step
from frictionid.data.envelope import Envelope, Estimated, Reached
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import seen_by_encoder
from frictionid.data.signals import Signal, holds, run_edges, sample
from frictionid.data.state_estimators import States

from .findings import Finding, finding

_NOISE = 0.01  # of the largest torque, at least: velocities are smoothed, drives lag
_MAD = MAD / np.sqrt(6.0)  # of second differences
_PILED, _STRETCHES, _LENGTH = 5.0, 3, 3
_SPREAD = 0.1  # of the fastest speed, that samples on the edge must differ by
_FEW = 1000  # samples of the search
_MOVES = 0.02  # of the fastest speed: at rest a torque that holds a load stands still
_FAR = 3.0  # times the fastest speed, beyond which no fall is followed to zero
_AT_LIMIT = 0.98  # of what a motor can make
_ABOUT = 0.1  # of the time between samples
_KNEES, _BEYOND = np.linspace(0.05, 1.0, 20), np.geomspace(0.05, 1.5, 12)  # of the fastest speed
_SHARE, _OUTLIERS, _ROUNDS = 0.3, 1e-4, 10
Parts = tuple[Estimated | None, Estimated | None, Estimated | None]


class _Samples(NamedTuple):
    """Torques (S,) [N m] in the direction in which they act, with speeds w (S,) in that direction.

    stretch (S,) : number of samples before with another sign, or of another recording
    sigma : noise [N m]
    """

    torque: Array
    w: Array
    stretch: Array
    sigma: float


def torque_speeds(dataset: Dataset, motion: Sequence[States]) -> Iterator[Reached]:
    """What of its envelope each motor's measured torque reaches."""
    for j in dataset.driven_joints:
        if (samples := _samples(dataset, motion, j)) is None:
            continue
        speed = np.abs(samples.w)
        fastest = float(np.quantile(speed, 0.99))
        most, at = np.argmax(samples.torque), np.argmax(speed)
        parts = _edge(samples, fastest) if fastest else (None, None, None)
        limits = samples.torque[most], speed[most], speed[at], samples.torque[at]
        yield Reached(j + 1, *parts, *map(float, limits))


def limit_findings(
    dataset: Dataset, motion: Sequence[States], measured: Sequence[Reached]
) -> Iterator[Finding]:
    """How near torques come to the limits of their motors: given ones, and what data show.

    measured : of motors whose torque is measured, see `torque_speeds`
    """
    for reached in measured:
        if reached.is_reached:
            yield finding("torque_speed", {}, {"sentence": reached.sentence}, reached.joint)
    pairs = zip(dataset.recordings, motion, strict=True)
    shares = [share for r, s in pairs if (share := _share(r, s)) is not None]
    for j in dataset.driven_joints if shares else ():
        share = np.concatenate(shares)[:, j]
        if share.any():  # a motor that is never on says nothing
            code = "motor_limit" if (share >= _AT_LIMIT).any() else "motor_below_limit"
            numbers = {"at": float((share >= _AT_LIMIT).mean()), "most": float(share.max())}
            yield finding(code, numbers, joint=j + 1)


def _share(recording: Recording, states: States) -> Array | None:
    """Share of its motor's limit that a servo asks for at each sample, (T, n).

    Of the torque that it can make at that speed; of a voltage what the controller puts out, as in
    braking the back-EMF adds to it.
    """
    servo, time = recording.servo, recording.angle.time
    if servo is None or (motor := servo.torque_speed) is None:
        return None
    # targets that step about a sample, which no delay tells, have stepped
    controller = servo.at(time + _ABOUT * usual_step(time))
    w = sample(Signal(states.time, states.w, "linear"), time)
    q = seen_by_encoder(servo, recording.angle).value
    u = controller.torque(q, w)
    if servo.has_motor:
        out, current = np.abs(controller.output(q, w)), np.abs(u) / controller.most
        return np.maximum(out / controller.limit, current / servo.efficiency) * (u != 0)
    most = np.maximum(motor.top(np.sign(u) * w), _NOISE * motor.peak)
    return np.abs(u) / most


def _samples(dataset: Dataset, motion: Sequence[States], j: int) -> _Samples | None:
    torque, w, stretch, noise, count = [], [], [], [], 0
    for recording, states in zip(dataset.recordings, motion, strict=True):
        clock, u = recording.torque.time, recording.torque.value[:, j]
        inside = (clock >= states.time[0]) & (clock <= states.time[-1])
        if recording.servo is not None or inside.sum() < _LENGTH or not u.any():
            continue
        clock, u = clock[inside], u[inside]
        late = usual_step(clock) / 2 if holds(recording.torque) else 0.0
        speed = np.interp(clock + late, states.time, states.w[:, j])
        torque.append(np.abs(u))
        w.append(np.where(u < 0, -speed, speed))
        stretch.append(count + np.cumsum(np.diff(np.sign(u), prepend=np.sign(u[0])) != 0))
        count = int(stretch[-1][-1]) + 1
        noise.append(np.abs(np.diff(u, 2)))
    if not torque:
        return None
    every = np.concatenate(torque)
    sigma = max(_MAD * np.median(np.concatenate(noise)), _NOISE * every.max())
    return _Samples(every, np.concatenate(w), np.concatenate(stretch), sigma)


def _edge(samples: _Samples, fastest: float) -> Parts:
    """Peak, knee and no-load speed, None where they are not reached."""
    step, top = max(len(samples.w) // _FEW, 1), np.quantile(samples.torque, 0.999)
    if not top > 0:
        return None, None, None
    few = samples._replace(torque=samples.torque[::step], w=samples.w[::step])
    edge = _likeliest(few, top - np.array([0.0, 1.0, 3.0]) * samples.sigma, fastest)
    for _ in range(_ROUNDS):
        edge = _nearer(samples, edge)
    return _estimated(samples, edge, fastest)


def _nearer(samples: _Samples, edge: Envelope) -> Envelope:
    """The edge through the samples that are near one."""
    near = np.abs(samples.torque - edge.top(samples.w)) < 3.0 * samples.sigma
    level, fall = near & (samples.w <= edge.knee), near & (samples.w > edge.knee)
    peak = float(np.median(samples.torque[level])) if level.sum() >= _LENGTH else edge.peak
    stall, slope = edge.stall, edge.slope
    if fall.sum() >= _LENGTH and np.ptp(samples.w[fall]) > 0:
        minus, stall = np.polyfit(samples.w[fall], samples.torque[fall], 1)
        slope = max(-minus, 1e-9)
    return Envelope(peak, (stall - peak) / slope, stall / slope)


def _likeliest(samples: _Samples, peaks: Array, fastest: float) -> Envelope:
    """The likeliest edge of a grid; samples slower than its knee see its peak only."""
    order = np.argsort(samples.w)
    torque, w = samples.torque[order] / samples.sigma, samples.w[order]
    likelihoods = []
    for peak in peaks:
        slower = np.append(0.0, np.cumsum(_log_likelihood(torque, peak / samples.sigma)))
        for knee in _KNEES * fastest:
            first = np.searchsorted(w, knee)
            edges = Envelope(peak, knee, knee + _BEYOND[:, None] * fastest)
            top = np.maximum(edges.top(w[first:]), 0.0) / samples.sigma
            likelihoods.append(slower[first] + _log_likelihood(torque[first:], top).sum(axis=1))
    shape = len(peaks), len(_KNEES), len(_BEYOND)
    i, j, k = np.unravel_index(np.argmax(likelihoods), shape)
    knee = _KNEES[j] * fastest
    return Envelope(peaks[i], knee, knee + _BEYOND[k] * fastest)


def _log_likelihood(torque: Array, top: Array) -> Array:
    """Of torques (S,) under an edge (..., S), both in units of the noise."""
    d = torque - top
    near, on, below = np.abs(d) < 9.0, np.zeros_like(d), (d < 0.0) * 1.0
    x = d[near]  # further off, Phi is 0 or 1
    on[near], below[near] = np.exp(-0.5 * x**2) / np.sqrt(2 * np.pi), ndtr(-x)
    return np.log(_SHARE * on + (1.0 - _SHARE) * below / (top + 1.0) + _OUTLIERS)


def _estimated(samples: _Samples, edge: Envelope, fastest: float) -> Parts:
    """What samples on an edge say of it."""
    d = (samples.torque - edge.top(samples.w)) / samples.sigma
    falls, moves = samples.w > edge.knee, np.abs(samples.w) > _MOVES * fastest
    level = _piled(samples, d, moves & ~falls, fastest)
    fall = _piled(samples, d, moves & falls & (samples.torque > 3 * samples.sigma), fastest)
    top = None
    if level is not None:
        (peak,), C, reach = _regression(samples, level, np.ones((level.sum(), 1)))
        top = Estimated(float(peak), reach * float(np.sqrt(C[0, 0])))
    if fall is None:
        return top, None, None
    columns = np.stack([np.ones(fall.sum()), -samples.w[fall]], axis=1)
    (stall, slope), C, reach = _regression(samples, fall, columns)
    if slope <= reach * C[1, 1] ** 0.5 or not 0 < stall < _FAR * fastest * slope:
        return top, None, None  # samples that stand at one level

    def speed_at(torque: float) -> Estimated:
        """Speed at which the fall is at a torque."""
        speed = (stall - torque) / slope
        by = np.array([1.0, -speed]) / slope
        return Estimated(float(speed), float(reach * np.sqrt(by @ C @ by)))

    if top is None:
        return None, None, speed_at(0.0)
    knee = speed_at(top.value)
    error = float(np.hypot(knee.half_width, top.half_width / slope))
    return top, knee._replace(half_width=error), speed_at(0.0)


def _piled(samples: _Samples, d: Array, part: Array, fastest: float) -> Array | None:
    """Samples (S,) of a part of the edge that stand on it, None where they do not pile up there."""
    on, beside = part & (np.abs(d) < 2.0), part & (d > -6.0) & (np.abs(d) > 2.0)
    long = [(a, b) for a, b in zip(*run_edges(on), strict=True) if b - a >= _LENGTH]
    stretches = {int(samples.stretch[a]) for a, _ in long}  # a torque that stands still has one
    if len(stretches) < _STRETCHES or on.sum() < _PILED * beside.sum():
        return None
    low, high = np.quantile(samples.w[on], [0.05, 0.95])
    if high - low < _SPREAD * fastest:
        return None
    keep = np.zeros(len(d), dtype=bool)
    for a, b in long:
        keep[a:b] = True
    return keep


def _regression(samples: _Samples, part: Array, X: Array) -> tuple[Array, Array, float]:
    """Least squares (P,), covariance (P, P) between stretches, and the quantile of 95 %.

    Of the torques of some samples, a mask (S,), on columns X (K, P).
    """
    y = samples.torque[part]
    inverse = np.linalg.inv(X.T @ X)
    x = inverse @ X.T @ y
    _, number = np.unique(samples.stretch[part], return_inverse=True)
    count = int(number.max()) + 1
    scores = np.zeros((count, X.shape[1]))
    np.add.at(scores, number, X * (y - X @ x)[:, None])
    freedom = max(count - X.shape[1], 1)
    C = count / freedom * inverse @ (scores.T @ scores) @ inverse
    return x, C, float(stdtrit(freedom, 0.975))
