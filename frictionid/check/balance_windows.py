"""Momentum balances over short windows: what all checks of the mechanics are computed from.

Over a window [a, b], and for each joint on its own,

    ((M w)|b - (M w)|a - integral of dL/dq dt) / (b - a) = mean of (u - Tf)      [N m]

The left side is linear in the base parameters; the rows hold its response to parameter vectors.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from frictionid.arrays import Array
from frictionid.check.motion import Measured, Motion, Speeds, mapped_motion, speeds_of
from frictionid.data.integrals import SignalIntegrals, window_means
from frictionid.mechanics import Mechanism
from frictionid.mechanics.momentum_balance import (
    interval_mean,
    interval_stencil,
    momentum_balance,
    with_midpoints,
)

# Long enough that the noise of two velocities does not hide friction, short enough to lie between
# two reversals of a swinging joint.
WIDTH = 0.15
# Where the smoother's blur is below this share of a window, windows may be shorter, down to this
# [s], and may hold a reversal of the joint, at rest for up to this share of the window.
SHARP, SHORTEST, REVERSAL = 1 / 30, 0.05, 0.3
# Speeds of the Stribeck shapes that stand for unknown friction, as shares of the fast speed.
SHAPES = (0.04, 0.15)
# Fewest windows of motion of a joint that a statement about it needs.
MIN_WINDOWS = 20


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
        torque: Array = (self.regressor * parameters[self.recording][:, None]).sum(-1)
        return torque

    def means(self, torque: SignalIntegrals, delay: ArrayLike = 0.0) -> Array:
        """Mean torque (..., K, n) [N m] logged `delay` (...) [s] before each window."""
        return window_means(torque, self.recording, self.start, self.stop, delay)

    def shapes(self, joint: int) -> Array:
        """Friction shapes (K, S) in the balance of a joint: its own, and those of coupled parts."""
        K, _, c, f = self.coupled.shape
        parts = self.coupled[:, joint].reshape(K, c * f)
        return np.concatenate([self.friction[:, joint], parts[:, parts.any(axis=0)]], axis=1)

    def of(self, measured: Measured) -> Rows:
        """The rows without the balances of joints whose torques show nothing."""
        dead = np.isin(np.arange(self.moving.shape[1]), measured.dead)
        return self._replace(moving=self.moving & ~dead)

    def where(self, keep: Array) -> Rows:
        """Some of the rows."""
        return Rows(*(field[keep] for field in self))


SHAPE_NAMES = ("coulomb", "viscous", "offset", "slow", "slower")
# Of coupled parts: an offset is that of a joint.
PART_SHAPES = ("coulomb", "viscous", "slow", "slower")


def unit_rows(
    mechanism: Mechanism, motions: Sequence[Motion], width: float = WIDTH, reversals: bool = False
) -> Rows:
    """Rows whose parameter vectors are the units of the base parameters: responses to them."""
    nb = len(mechanism.base_names)
    units = np.broadcast_to(np.eye(nb)[:, None], (nb, len(motions), nb))
    return rows_of(mechanism, motions, units, width=width, reversals=reversals)


def adaptive_rows(mechanism: Mechanism, motions: Sequence[Motion]) -> Rows:
    """Unit rows for the estimates: windows as short as the smoother's blur allows.

    Real friction is not quite Coulomb and viscous, so that least squares depend on which speeds and
    accelerations count. Without the reversals of `emps`, where friction is lower than at any speed,
    its Coulomb friction comes out 5 % higher and the viscous one 5 % lower; long windows take 1 %
    of its mass. Published values come from all samples. A noisy motion, however, is blurred, worst
    at reversals, where the acceleration jumps: at 60 Hz with 3 mrad, short windows and reversals
    cost 1 to 2 % of the inertias and 15 % of viscous friction (simulated), and are left out.
    """
    if is_blurred(motions):
        return unit_rows(mechanism, motions)
    width = max(_blur(motions) / SHARP, SHORTEST)
    return unit_rows(mechanism, motions, width=width, reversals=True)


def is_blurred(motions: Sequence[Motion]) -> bool:
    """Whether the smoother blurs the motions too much for shorter windows."""
    return _blur(motions) > SHARP * WIDTH


def _blur(motions: Sequence[Motion]) -> float:
    return float(np.median([m.blur.max() for m in motions]))


def rows_of(
    mechanism: Mechanism,
    motions: Sequence[Motion],
    parameters: Array,
    speeds: Speeds | None = None,
    width: float = WIDTH,
    reversals: bool = False,
) -> Rows:
    """Rows of all recordings, each window overlapping the next by half.

    Parameters
    ----------
    mechanism : Mechanism
    motions : sequence of R Motion
    parameters : array, shape (m, R, nb)
        Base parameters of each recording, m vectors side by side.
    speeds : Speeds, shape (R, m), optional
        Of each recording, where parts slide; by default those of all motions together.
    width : float [s] of a window; at least two samples
    reversals : bool
        Whether windows count in which a joint reverses quickly, at the mean of sgn(w).
    """
    samples = [len(motion.states.time) for motion in motions]
    first = np.cumsum([0, *(2 * count - 1 for count in samples)])  # node of each first sample
    stencil = np.concatenate(list(map(interval_stencil, samples, first[:-1])))
    nodes = [with_midpoints(*motion.states.motion) for motion in motions]
    _, q, w = (np.concatenate(x) for x in zip(*nodes, strict=True))
    time = np.concatenate([motion.states.time for motion in motions])
    dt = np.concatenate([np.diff(motion.states.time) for motion in motions])
    windows = _windows(motions, width)
    start, stop = time[windows.first], time[windows.last]

    def mean(integrals: Array) -> Array:
        """Means (..., K, n) over the windows of integrals (..., I, n) over the intervals."""
        zero = np.zeros_like(integrals[..., :1, :])
        sums = np.concatenate([zero, np.cumsum(integrals, axis=-2)], axis=-2)
        before, behind = windows.first - windows.recording, windows.last - windows.recording
        return np.asarray((sums[..., behind, :] - sums[..., before, :]) / (stop - start)[:, None])

    at = np.repeat(np.arange(len(motions)), np.diff(first))  # recording of each node
    balance = momentum_balance(mechanism.terms(parameters[:, at], q, w), stencil)
    acts = mechanism.friction_map
    rest, fast = (
        np.broadcast_to(v, (len(motions), len(acts)))
        for v in speeds or sliding_speeds(mechanism, motions)
    )
    shapes = interval_mean(_shapes(w @ acts.T, fast[at]), stencil) * dt[:, None]
    friction, n = np.moveaxis(mean(shapes), 0, -1), mechanism.n
    parts = [SHAPE_NAMES.index(name) for name in PART_SHAPES]
    reversal = REVERSAL if reversals else None
    ends = np.concatenate([motion.states.w for motion in motions]) @ acts.T
    sliding = _moving(ends, np.repeat(rest, samples, axis=0), windows, reversal)
    return Rows(
        inertia=np.moveaxis(mean(balance.end - balance.start), 0, -1),
        gravity=np.moveaxis(-mean(balance.force * dt[:, None]), 0, -1),
        friction=friction[:, :n],
        coupled=acts[n:].T[None, :, :, None] * friction[:, None, n:, parts],
        w=mean(interval_mean(w, stencil) * dt[:, None]),
        moving=~(~sliding @ (acts != 0)),
        recording=windows.recording,
        start=start,
        stop=stop,
    )


def sliding_speeds(mechanism: Mechanism, motions: Sequence[Motion]) -> Speeds:
    """Characteristic speeds (m,) where parts slide: of the joints, then of coupled parts."""
    if not mechanism.coupled:
        return speeds_of(motions)
    return speeds_of([mapped_motion(motion, mechanism.friction_map) for motion in motions])


class _Windows(NamedTuple):
    """K windows: recording, and first and last of the samples of all recordings end to end."""

    recording: Array
    first: Array
    last: Array


def _windows(motions: Sequence[Motion], width: float) -> _Windows:
    parts, first = [], 0
    for i, motion in enumerate(motions):
        time = motion.states.time
        interval = float(np.median(np.diff(time)))
        half = max(round(width / 2 / interval), 1)
        start = np.arange(0, len(time) - 2 * half, half)
        # a gap makes a window longer: Simpson's rule would guess what happened there
        kept = time[start + 2 * half] - time[start] < 2 * width + 1e-9
        kept |= interval * 2 * half > width
        start = first + start[kept]
        parts.append((np.full(len(start), i), start, start + 2 * half))
        first += len(time)
    return _Windows(*(np.concatenate(x) for x in zip(*parts, strict=True)))


def _shapes(w: Array, fast: Array) -> Array:
    """Friction shapes (F, S, n) at velocities w (S, n), see `SHAPE_NAMES`."""
    sign = np.sign(w)
    slow = [sign * np.exp(-np.abs(w) / (share * fast)) for share in SHAPES[::-1]]
    return np.stack([sign, w, np.ones_like(w), *slow])


def _moving(w: Array, rest: Array, windows: _Windows, reversal: float | None) -> Array:
    """Whether each part is faster than `rest` all through a window, in one direction.

    Or, with `reversal`, in any direction and but for that share of the window's samples; w, rest
    (T, m) of all samples.
    """

    def samples(flags: Array) -> Array:
        total = np.concatenate([np.zeros_like(w[:1]), np.cumsum(flags, axis=0)])
        return np.asarray(total[windows.last + 1] - total[windows.first])

    count = (windows.last - windows.first + 1)[:, None]
    up, down = samples(w > rest), samples(w < -rest)
    one_way = np.maximum(up, down) == count
    return one_way if reversal is None else one_way | (up + down >= (1 - reversal) * count)
