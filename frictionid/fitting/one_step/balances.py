"""Running integrals of the momentum balance, from which the balance of any window is a difference.

    (M w)|b - (M w)|a - integral of dL/dq dt = integral of (u - Tf) dt      [N m s]

They are found once, interval by interval with Simpson's rule, and serve windows of every width.
Long recordings are taken in blocks, so that the terms of all samples never exist at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from frictionid.arrays import Array, usual_step
from frictionid.data.integrals import SignalIntegrals, window_means
from frictionid.data.state_estimators import States
from frictionid.mechanics import Mechanism
from frictionid.mechanics.plant import midpoints, with_base_motion

# Speeds of the Stribeck shapes that stand for unknown friction, as shares of the fast speed.
SHAPES = (0.04, 0.15)
SHAPE_NAMES = ("coulomb", "viscous", "offset", "slow", "slower")
# Of coupled parts: an offset is that of a joint.
PART_SHAPES = ("coulomb", "viscous", "slow", "slower")
# A window may hold a reversal of the joint, at rest for up to this share of it.
REVERSAL = 0.3
# Samples at the ends of a recording with outliers that no window has: an outlier among them would
# look like motion.
ENDS = 3
_BLOCK = 20_000  # samples whose terms are evaluated together
_FEW = 100  # numbers of each that take little room: those of two joints


class Rows(NamedTuple):
    """K windows of all recordings; torques are means over the window [N m].

    inertia, gravity (K, n, m) : means of d(M w)/dt and -dL/dq for each of m parameter vectors
    friction (K, n, F) : friction shapes per joint, see `SHAPE_NAMES`
    coupled (K, n, c, f) : those of c parts that turn with several joints, see `PART_SHAPES`, as
    they act on each joint
    w (K, n) [rad/s] mean velocity ; moving (K, n) : whether the joint, and parts that turn with it,
    neither rest nor, as a rule, reverse, so that its balance shows their sliding friction
    recording (K,) ; start, stop (K,) [s]
    """

    inertia: Array
    gravity: Array
    friction: Array
    coupled: Array
    w: Array
    moving: Array
    recording: Array
    start: Array
    stop: Array

    def at(self, parameters: Array) -> Rows:
        """Rows of unit vectors taken at one parameter vector per recording, (R, nb)."""
        p = parameters[self.recording][:, None]
        return self._replace(
            inertia=(self.inertia * p).sum(-1, keepdims=True),
            gravity=(self.gravity * p).sum(-1, keepdims=True),
        )

    @property
    def regressor(self) -> Array:
        """The whole left side for each parameter vector, (K, n, m)."""
        return self.inertia + self.gravity

    def required(self, parameters: Array) -> Array:
        """Mean torque (K, n) [N m] that base parameters (R, nb) need, without friction."""
        return (self.regressor * parameters[self.recording][:, None]).sum(-1)

    def means(self, torque: SignalIntegrals, delay: ArrayLike = 0.0) -> Array:
        """Mean torque (..., K, n) [N m] logged `delay` (...) [s] before each window."""
        return window_means(torque, self.recording, self.start, self.stop, delay)

    def shapes(self, joint: int) -> Array:
        """Friction shapes (K, S) in the balance of a joint: its own, and those of coupled parts."""
        K, _, c, f = self.coupled.shape
        parts = self.coupled[:, joint].reshape(K, c * f)
        return np.concatenate([self.friction[:, joint], parts[:, parts.any(axis=0)]], axis=1)

    def without(self, dead: Sequence[int]) -> Rows:
        """The rows without the balances of joints (from 0) whose torques show nothing."""
        if not len(dead):
            return self
        return self._replace(moving=self.moving & ~np.isin(np.arange(self.moving.shape[1]), dead))

    def where(self, keep: Array) -> Rows:
        """Some of the rows."""
        return Rows(*(field[keep] for field in self))


class Windows(NamedTuple):
    """K windows: recording, and first and last of the samples of all recordings end to end."""

    recording: Array
    first: Array
    last: Array


class Samples(NamedTuple):
    """T samples of R recordings end to end: time (T,) [s], q and w (..., T, n), sizes (R,).

    Leading axes of q and w: the same motion under several hypotheses. ends (R,) : how many samples
    at either end are in no window, because outliers do not show there; base_motion (T, 9) of a
    floating base, or None
    """

    time: Array
    q: Array
    w: Array
    sizes: Array
    ends: Array
    base_motion: Array | None = None

    @staticmethod
    def joined(states: Sequence[States]) -> Samples:
        """The samples of some recordings."""
        time, q, w = (np.concatenate(x) for x in zip(*(s.motion for s in states), strict=True))
        wild = [s.left_out is not None and bool(s.left_out.any()) for s in states]
        ends = np.where(wild, ENDS, 0)
        motions = [s.base_motion for s in states if s.base_motion is not None]
        along = np.concatenate(motions) if motions else None
        return Samples(time, q, w, np.array([len(s.time) for s in states]), ends, along)

    def windows(self, width: float) -> Windows:
        """Windows of a width [s], two samples at least, each overlapping the next by half."""
        parts, first = [], 0
        sizes = zip(self.sizes.tolist(), self.ends.tolist(), strict=True)
        for i, (count, end) in enumerate(sizes):
            time = self.time[first : first + count]
            interval = usual_step(time)
            half = max(round(width / 2 / interval), 1)
            start = np.arange(0, count - 2 * half, half)
            start = start[(start >= end) & (start + 2 * half < count - end)]
            # a gap makes a window longer: Simpson's rule would guess what happened there
            kept = time[start + 2 * half] - time[start] < 2 * width + 1e-9
            kept |= interval * 2 * half > width
            start = first + start[kept]
            parts.append((np.full(len(start), i), start, start + 2 * half))
            first += count
        return Windows(*(np.concatenate(x) for x in zip(*parts, strict=True)))


class Balances(NamedTuple):
    """Running integrals at T samples; `Samples` may lead with axes of hypotheses, as all do then.

    momentum, force (m, T, n) : M w, and the integral of dL/dq, for m parameter vectors or, instead,
    for the nominal one under each of m hypotheses ; shapes (F, ..., T, parts) : of friction, for
    each joint and then each coupled part ; angle (..., T, n) : of w ; forward, backward
    (..., T + 1, parts) : number of samples before in which the part slides this way
    """

    mechanism: Mechanism
    samples: Samples
    momentum: Array
    force: Array
    shapes: Array
    angle: Array
    forward: Array
    backward: Array

    def rows(self, windows: Windows, *, reversals: bool = False) -> Rows:
        """Rows of the windows; reversals : whether windows count in which a joint reverses quickly.

        They count at the mean of sgn(w).
        """
        a, b = windows.first, windows.last
        start, stop = self.samples.time[a], self.samples.time[b]
        length = (stop - start)[:, None]
        inertia, gravity, shapes, w = (
            (x.take(b, axis=-2) - x.take(a, axis=-2)) / length
            for x in (self.momentum, self.force, self.shapes, self.angle)
        )
        acts, n = self.mechanism.friction_map, self.mechanism.n
        friction = np.moveaxis(shapes, 0, -1)
        parts = [SHAPE_NAMES.index(name) for name in PART_SHAPES]
        sliding = self._sliding(windows, REVERSAL if reversals else None)
        return Rows(
            inertia=np.moveaxis(inertia, 0, -1),
            gravity=np.moveaxis(-gravity, 0, -1),
            friction=friction[:, :n],
            coupled=acts[n:].T[None, :, :, None] * friction[:, None, n:, parts],
            w=w,
            moving=~(~sliding @ (acts != 0)),
            recording=windows.recording,
            start=start,
            stop=stop,
        )

    def each(self) -> Iterator[Balances]:
        """The balances under each of m hypotheses, in the first axis of the samples."""
        for i, (q, w) in enumerate(zip(self.samples.q, self.samples.w, strict=True)):
            yield self._replace(
                samples=self.samples._replace(q=q, w=w),
                momentum=self.momentum[i : i + 1],
                force=self.force[i : i + 1],
                shapes=self.shapes[:, i],
                angle=self.angle[i],
                forward=self.forward[i],
                backward=self.backward[i],
            )

    def _sliding(self, windows: Windows, reversal: float | None) -> Array:
        """Whether each part slides all through each window (K, parts), in one direction.

        Or, with `reversal`, in any direction and but for that share of the window's samples.
        """
        a, b = windows.first, windows.last + 1
        count = (b - a)[:, None]
        up, down = self.forward[b] - self.forward[a], self.backward[b] - self.backward[a]
        one_way = np.maximum(up, down) == count
        return one_way if reversal is None else one_way | (up + down >= (1 - reversal) * count)


def balances_of(
    mechanism: Mechanism, samples: Samples, parameters: Array | None, threshold: Array, fast: Array
) -> Balances:
    """Running integrals of the balances.

    Parameters
    ----------
    mechanism : Mechanism
    samples : Samples
    parameters : array, shape (R, nb), or None
        Base parameters of each recording, taken under each hypothesis; None: the units of the base
        parameters, one vector each, so that the rows are the response to them.
    threshold, fast : array, shape (..., parts) [rad/s]
        Above which speed a part slides, and the one that scales the friction shapes.
    """
    recording = np.repeat(np.arange(len(samples.sizes)), samples.sizes)
    step = np.diff(samples.time)
    # an interval between two recordings has no length
    dt = np.where(np.diff(recording) == 0, step, 0.0)
    step = np.where(dt > 0, step, 1.0)
    acts, nb, n = mechanism.friction_map, len(mechanism.base_names), mechanism.n
    each = samples.q[..., 0, 0].size if parameters is not None else max(nb * n * n // _FEW, 1)
    few = max(_BLOCK // max(each, 1), 1)
    momentum, running = [], []
    for a in range(0, len(dt), few):
        b = min(a + few, len(dt))
        q, w, middle = _nodes(samples.q[..., a : b + 1, :], samples.w[..., a : b + 1, :], step[a:b])
        at = np.concatenate([np.arange(a, b + 1), np.arange(a, b)])
        along = samples.base_motion
        if along is not None:
            along = along[a : b + 1]
            along = np.concatenate([along, (along[1:] + along[:-1]) / 2])
        p = with_base_motion(_parameters(mechanism, parameters, recording[at], q), along)
        terms = mechanism.terms(p, q, w)
        momentum.append(terms.momentum[..., : b - a + (b == len(dt)), :])
        shapes = _shapes(w @ acts.T, fast[..., None, :])
        width = dt[a:b, None]
        running.append([_simpson(x, middle) * width for x in (terms.dLdq, shapes, w)])
    force, shapes, angle = (
        _running(np.concatenate(x, axis=-2)) for x in zip(*running, strict=True)
    )
    speed, rest = samples.w @ acts.T, threshold[..., None, :]
    forward, backward = (_running(x.astype(np.int32)) for x in (speed > rest, speed < -rest))
    M = np.concatenate(momentum, axis=-2)
    return Balances(mechanism, samples, M, force, shapes, angle, forward, backward)


def _parameters(
    mechanism: Mechanism, parameters: Array | None, recording: Array, q: Array
) -> Array:
    """Parameter vectors (..., S, nb) of S nodes."""
    if parameters is not None:
        return np.broadcast_to(parameters[recording], (*q.shape[:-1], parameters.shape[-1]))
    nb = len(mechanism.base_names)
    return np.broadcast_to(np.eye(nb)[:, None], (nb, len(recording), nb))


def _nodes(q: Array, w: Array, step: Array) -> tuple[Array, Array, int]:
    """Motion (..., 2 L + 1, n) at L + 1 samples, then at the L midpoints; where these begin."""
    pairs = zip((q, w), midpoints(q, w, step), strict=True)
    all_q, all_w = (np.concatenate(pair, axis=-2) for pair in pairs)
    return all_q, all_w, q.shape[-2]


def _simpson(values: Array, middle: int) -> Array:
    """Means (..., L, n) over the intervals of values (..., 2 L + 1, n) as `_nodes` orders them."""
    ends = values[..., : middle - 1, :] + values[..., 1:middle, :]
    return (ends + 4.0 * values[..., middle:, :]) / 6.0


def _running(parts: Array) -> Array:
    """Sums (..., T + 1, n) of the parts (..., T, n) before each place."""
    out = np.zeros((*parts.shape[:-2], parts.shape[-2] + 1, parts.shape[-1]), parts.dtype)
    np.cumsum(parts, axis=-2, out=out[..., 1:, :])
    return out


def _shapes(w: Array, fast: Array) -> Array:
    """Friction shapes (F, ..., S, parts) at velocities w (..., S, parts), see `SHAPE_NAMES`."""
    sign, speed = np.sign(w), np.abs(w)
    slow = [sign * np.exp(speed / (-share * fast)) for share in SHAPES[::-1]]
    return np.stack([sign, w, np.ones_like(w), *slow])
