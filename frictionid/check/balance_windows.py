"""Momentum balances over short windows: what all checks of the mechanics are computed from.

Over a window [a, b] of length L, and for each joint on its own,

    (M w)|b - (M w)|a - integral of dL/dq dt = integral of (u - Tf) dt      [N m s]

needs no acceleration. Divided by L it is a balance of mean torques, linear in the base parameters:
the left side is kept as its response to given parameter vectors.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.motion import Motion
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
# Where the motion is seen sharply (blur below this share of a window), windows may be shorter, down
# to this [s], and may hold a turn of the joint, in up to this share of which it may be at rest.
SHARP, SHORTEST, TURN = 1 / 30, 0.05, 0.3
# Speeds of the Stribeck shapes that stand for unknown friction, as shares of the fast speed.
SHAPES = (0.04, 0.15)
# Windows in which a joint slides that anything said of it needs.
FEWEST = 20
# A joint moves where its fast speed is this many times the noise.
ABOVE = 6.0


class Rows(NamedTuple):
    """K windows of all recordings; torques are means over the window [N m].

    inertia, gravity (K, n, m) : means of d(M w)/dt and -dL/dq for each of m parameter vectors
    friction (K, n, F) : friction shapes per joint, see `SHAPE_NAMES`
    w (K, n) [rad/s] mean velocity ; free (K, n) : the joint's own balance says something of its
    sliding friction: it neither rests nor, as a rule, turns round
    recording (K,) ; start, stop (K,) [s]
    """

    inertia: Array
    gravity: Array
    friction: Array
    w: Array
    free: Array
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
    def phi(self) -> Array:
        """The whole left side for each parameter vector, (K, n, m)."""
        return self.inertia + self.gravity


SHAPE_NAMES = ("coulomb", "viscous", "offset", "slow", "slower")


class Speeds(NamedTuple):
    """Speeds (..., n) [rad/s] of each joint that set scales.

    rest : below it a joint may be at rest (noise, or 2 % of fast motion), infinite for a joint that
    never rises from the noise ; fast : exceeded in 5 % of the time
    """

    rest: Array
    fast: Array


def speeds_of(motions: Sequence[Motion]) -> Speeds:
    """Speeds of the joints over all motions, (n,) each."""
    noise = np.median([m.velocity_noise for m in motions], axis=0)
    fast = np.quantile(np.abs(np.concatenate([m.states.w for m in motions])), 0.95, axis=0)
    rest = np.where(fast < ABOVE * noise, np.inf, np.maximum(3.0 * noise, 0.02 * fast))
    return Speeds(rest, np.maximum(fast, 1e-12))


def unit_rows(
    mechanism: Mechanism, motions: Sequence[Motion], width: float = WIDTH, turns: bool = False
) -> Rows:
    """Rows whose parameter vectors are the units of the base parameters: responses to them."""
    nb = len(mechanism.base_names)
    units = np.broadcast_to(np.eye(nb)[:, None], (nb, len(motions), nb))
    return rows_of(mechanism, motions, units, width=width, turns=turns)


def sharp_rows(mechanism: Mechanism, motions: Sequence[Motion]) -> Rows:
    """Unit rows that leave out as little of the motion as its blur allows: for the estimates.

    Real friction is not quite Coulomb and viscous: what least squares make of it depends on which
    speeds and accelerations count. Leaving out all turns of `emps`, where friction is lower than
    at any speed, takes its Coulomb friction 5 % up and the viscous one 5 % down; long windows take
    1 % of its mass. Published values come from all samples. Yet a noisy motion is blurred, worst
    where a joint turns round and its acceleration jumps: at 60 Hz with 3 mrad, short windows and
    turns cost 1 to 2 % of the inertias and 15 % of viscous friction (simulated); they stay out.
    """
    blur = float(np.median([m.blur.max() for m in motions]))
    if blur > SHARP * WIDTH:
        return unit_rows(mechanism, motions)
    return unit_rows(mechanism, motions, width=max(blur / SHARP, SHORTEST), turns=True)


def rows_of(
    mechanism: Mechanism,
    motions: Sequence[Motion],
    parameters: Array,
    speeds: Speeds | None = None,
    width: float = WIDTH,
    turns: bool = False,
) -> Rows:
    """Rows of all recordings, each window overlapping the next by half.

    Parameters
    ----------
    mechanism : Mechanism
    motions : sequence of R Motion
    parameters : array, shape (m, R, nb)
        Base parameters of each recording, m vectors side by side.
    speeds : Speeds, shape (R, n), optional
        Of each recording; by default those of all motions together.
    width : float [s] of a window; at least two samples
    turns : bool
        Whether windows count in which a joint turns round swiftly, at the mean of sgn(w).
    """
    samples = [len(motion.states.time) for motion in motions]
    first = np.cumsum([0, *(2 * count - 1 for count in samples)])  # node of each first sample
    stencil = np.concatenate(list(map(interval_stencil, samples, first[:-1])))
    nodes = [with_midpoints(*motion.states) for motion in motions]
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
    rest, fast = (
        np.broadcast_to(v, (len(motions), v.shape[-1])) for v in speeds or speeds_of(motions)
    )
    shapes = interval_mean(_shapes(w, fast[at]), stencil) * dt[:, None]
    ends = np.concatenate([motion.states.w for motion in motions])
    return Rows(
        inertia=np.moveaxis(mean(balance.end - balance.start), 0, -1),
        gravity=np.moveaxis(-mean(balance.force * dt[:, None]), 0, -1),
        friction=np.moveaxis(mean(shapes), 0, -1),
        w=mean(interval_mean(w, stencil) * dt[:, None]),
        free=_free(ends, np.repeat(rest, samples, axis=0), windows, TURN if turns else None),
        recording=windows.recording,
        start=start,
        stop=stop,
    )


def mapped_motion(motion: Motion, map_: Array) -> Motion:
    """Motion after a linear map (n, n) of angles and velocities."""
    s = motion.states
    angle, velocity = (np.sqrt(map_**2 @ v**2) for v in (motion.angle_noise, motion.velocity_noise))
    blur = ((map_ != 0) * motion.blur).max(1)
    return Motion(s._replace(q=s.q @ map_.T, w=s.w @ map_.T), angle, velocity, blur)


class _Windows(NamedTuple):
    """K windows: recording, and first and last of the samples of all recordings end to end."""

    recording: Array
    first: Array
    last: Array


def _windows(motions: Sequence[Motion], width: float) -> _Windows:
    parts, first = [], 0
    for i, motion in enumerate(motions):
        time = motion.states.time
        half = max(round(width / 2 / float(np.median(np.diff(time)))), 1)
        start = np.arange(0, len(time) - 2 * half, half)
        # a gap makes a window longer: Simpson's rule would guess what happened there
        kept = time[start + 2 * half] - time[start] < 2 * width + 1e-9
        kept |= np.median(np.diff(time)) * 2 * half > width
        start = first + start[kept]
        parts.append((np.full(len(start), i), start, start + 2 * half))
        first += len(time)
    return _Windows(*(np.concatenate(x) for x in zip(*parts, strict=True)))


def _shapes(w: Array, fast: Array) -> Array:
    """Friction shapes (F, S, n) at velocities w (S, n), see `SHAPE_NAMES`."""
    sign = np.sign(w)
    slow = [sign * np.exp(-np.abs(w) / (share * fast)) for share in SHAPES[::-1]]
    return np.stack([sign, w, np.ones_like(w), *slow])


def _free(w: Array, rest: Array, windows: _Windows, turn: float | None) -> Array:
    """Whether each joint is faster than `rest` all through a window, in one direction.

    Or, with `turn`, in any direction and but for that share of the window's samples; w, rest (T, n)
    of all samples.
    """

    def samples(flags: Array) -> Array:
        total = np.concatenate([np.zeros_like(w[:1]), np.cumsum(flags, axis=0)])
        return np.asarray(total[windows.last + 1] - total[windows.first])

    count = (windows.last - windows.first + 1)[:, None]
    up, down = samples(w > rest), samples(w < -rest)
    one_way = np.maximum(up, down) == count
    return one_way if turn is None else one_way | (up + down >= (1 - turn) * count)
