"""Which stretch of a torque log belongs to a motion: the coarse offset, by cross-correlation.

The torque that the told mechanism asks for along the observed motion (observed acceleration minus
the one predicted without a motor, times M) is looked for in the log at every offset at once. What
any friction could have done is taken off both, so that it is no matter how much there is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft  # scipy.signal takes a second to import

from frictionid.arrays import Array
from frictionid.check.balance_windows import MIN_WINDOWS, WIDTH, Rows
from frictionid.check.partial_regression import partial_regression
from frictionid.data.integrals import averages, integrals_of
from frictionid.data.signals import Array as Values
from frictionid.data.signals import Signal, cut
from frictionid.errors import InputError
from frictionid.mechanics import Mechanism

STEP = 0.01  # [s] of the offsets that are tried
_OVERLAP, _NEARLY = 0.5, 0.9  # shares of the motion that the log must cover
_CANDIDATES, _APART = 8, 0.1  # best offsets that are looked at closely, [s] between them
_NEAR = np.arange(-0.06, 0.0601, STEP)
# An offset is found where it leaves this share of the torque unexplained at most, and any other
# leaves this many times as much.
_EXPLAINS, _CLEAR = 0.6, 2.0


class Match(NamedTuple):
    """A coarse offset.

    offset : [s], added to the log's time; left : share of the asked torque that it leaves
    unexplained, with any friction; second : (offset, left) of the next best
    turned : most that any offset explains with the torque's sign turned
    offsets (D,), explained (D,) : all that were tried, and what share of the torque they explain
    """

    offset: float
    left: float
    second: tuple[float, float]
    turned: float
    offsets: Array
    explained: Array


def match(mechanism: Mechanism, told: Array, rows: Rows, angle: Signal, torque: Signal) -> Match:
    """The offset at which a log explains a motion.

    told : (nb,) base parameters; rows : unit rows of the motion; torque : n columns, by the log's
    clock

    Raises
    ------
    InputError
        Where nothing moves, the log explains the motion nowhere, or in several places.
    """
    driven = np.array(mechanism.description.driven)
    if int((rows.moving & driven).sum()) < MIN_WINDOWS:
        raise InputError(
            "the driven joints hardly move: no motion to find in the log; record livelier motion"
        )
    if np.ptp(torque.value, axis=0).max() <= 0:
        raise InputError("the logged torque never changes: nothing to find in the motion")
    asked = rows.required(told[None])
    offsets, explained, turned = _correlated(rows, asked, torque, driven)
    peaks = _peaks(offsets, explained)
    if not len(peaks):
        raise InputError(_uncovered(float(np.ptp(angle.time)), float(np.ptp(torque.time))))
    found = sorted(_closely(rows, asked, told, angle, torque, float(p)) for p in peaks)
    best = found[0]
    others = [f for f in found[1:] if abs(f[1] - best[1]) > _APART / 2]
    second = others[0] if others else (1.0, float("nan"))
    out = Match(best[1], best[0], (second[1], second[0]), turned, offsets, explained)
    _check(out)
    return out


def _uncovered(motion: float, log: float) -> str:
    if log < _OVERLAP * motion:
        return (
            f"the log ({log:.3g} s) covers less than half of the motion ({motion:.3g} s): log as "
            "long as the camera records"
        )
    return (
        "the driven joints slide too little, or not while the log was written, to find the motion "
        "in it: record livelier motion, such as the answers to several pulses of torque"
    )


def _check(found: Match) -> None:
    if found.left > _EXPLAINS:
        sign = found.turned > 1.0 - 0.5 * found.left
        way = (
            "the torque fits best with its sign turned: check the signs of kt and gear, and the "
            "direction of the angles"
            if sign
            else "were both recorded at the same time, by this mechanism?"
        )
        raise InputError(
            f"no stretch of the log explains the motion (the best one leaves "
            f"{100 * found.left:.0f} % of the torque): {way}"
        )
    if found.second[1] < _CLEAR * found.left:
        raise InputError(
            f"the log explains the motion as well with an offset of {found.second[0]:.3f} s as "
            f"with {found.offset:.3f} s: use a torque that does not repeat itself, or a marker"
        )


def _correlated(
    rows: Rows, asked: Array, torque: Signal, driven: Values
) -> tuple[Array, Array, float]:
    """Offsets, the share of the asked torque that the log explains at each, and with turned sign.

    With P, which takes the friction columns Q out, and the log x at an offset:
    |P(y - x)|^2 = |Py|^2 - 2 Py.x + |x|^2 - |Q'x|^2, each a correlation.
    """
    middle = (rows.start + rows.stop) / 2
    grid = np.arange(middle[0], middle[-1], STEP)
    clock = np.arange(torque.time[0] + WIDTH / 2, torque.time[-1] - WIDTH / 2, STEP)
    if len(clock) < 2:
        return np.zeros(0), np.zeros(0), 0.0
    # nothing is known of what happened in a gap
    after = np.clip(np.searchsorted(middle, grid), 1, len(middle) - 1)
    near = (middle[after] - middle[after - 1] < WIDTH).astype(float)
    size, all_of_it, moving = len(grid) + len(clock) - 1, 0.0, 0.0
    cross, energy, covered = (np.zeros(size) for _ in range(3))
    for j in np.flatnonzero(driven):
        seen = (np.interp(grid, middle, rows.moving[:, j].astype(float)) > 0.999) * near
        y = seen * np.interp(grid, middle, asked[:, j])
        shapes = [seen * np.interp(grid, middle, f) for f in rows.friction[:, j].T]
        Q = _basis(np.stack(shapes, axis=1))
        y = y - Q @ (Q.T @ y)
        x = _means(torque._replace(value=torque.value[:, [j]]), clock)[::-1]
        all_of_it += float(y @ y)
        moving += float(seen.sum())
        cross += _convolved(y, x)
        energy += _convolved(seen, x**2)
        for q in Q.T:
            energy -= _convolved(q, x) ** 2
        covered += _convolved(seen, np.ones(len(x)))
    # entry i of a convolution has the grid's sample k beside the clock's k + len(x) - 1 - i
    offsets = grid[0] - clock[0] + STEP * (np.arange(size) - (len(clock) - 1))
    enough = covered >= _OVERLAP * moving
    # of little sliding, such as the answer to one pulse, nearly all
    enough &= covered >= max(min(MIN_WINDOWS * WIDTH / 2 / STEP, _NEARLY * moving), MIN_WINDOWS)
    scale = max(all_of_it, 1e-300)
    explained, turned = ((sign * 2 * cross - energy) / scale for sign in (1.0, -1.0))
    known = np.where(enough, explained, -np.inf)
    return offsets, known, float(np.where(enough, turned, -np.inf).max())


def _convolved(a: Array, b: Array) -> Array:
    size = len(a) + len(b) - 1
    fast = next_fast_len(size)
    return np.asarray(irfft(rfft(a, fast) * rfft(b, fast), fast)[:size])


def _basis(columns: Array) -> Array:
    """Orthonormal basis of some columns."""
    size = np.sqrt((columns**2).sum(axis=0))
    U, s, _ = np.linalg.svd(columns / np.where(size > 0, size, 1.0), full_matrices=False)
    return np.asarray(U[:, s > 1e-6 * s[0]])


def _means(torque: Signal, clock: Array) -> Array:
    """Mean torque over a window round each time of an even clock."""
    half = round(WIDTH / 2 / STEP)
    edges = clock[0] + STEP * (np.arange(len(clock) + 2 * half) - half)
    fine = averages(torque, np.append(edges, edges[-1] + STEP))[:, 0]
    sums = np.concatenate([[0.0], np.cumsum(fine)])
    return np.asarray((sums[2 * half :] - sums[: -2 * half])[: len(clock)] / (2 * half))


def _peaks(offsets: Array, explained: Array) -> Array:
    """Offsets that explain most, apart from each other."""
    left = explained.copy()
    out: list[float] = []
    gap = round(_APART / STEP)
    while len(out) < _CANDIDATES and len(left) and np.isfinite(left.max()):
        k = int(np.argmax(left))
        out.append(float(offsets[k]))
        left[max(k - gap, 0) : k + gap + 1] = -np.inf
    return np.array(out)


def around(torque: Signal, start: float, stop: float, margin: float = 1.0) -> Signal:
    """The torque from `start` to `stop`, and for a margin [s] on either side."""
    return cut(torque, start - margin, stop + margin)


def _closely(
    rows: Rows, asked: Array, told: Array, angle: Signal, torque: Signal, offset: float
) -> tuple[float, float]:
    """Share left unexplained, with any friction, near an offset, and the best offset there."""
    moved = torque._replace(time=torque.time + offset)
    known = (rows.start > moved.time[0]) & (rows.stop < moved.time[-1])
    if int(known.sum()) < MIN_WINDOWS:
        return 1.0, offset
    kept = rows.where(known)
    near = cut(angle, moved.time[0], moved.time[-1])
    late = kept.means(integrals_of([around(moved, near.time[0], near.time[-1])]), _NEAR)
    fit = partial_regression(kept, late[len(_NEAR) // 2], told[None])
    none = (fit.residual(asked[known]) ** 2).sum()
    left = (fit.residual(asked[known] - late) ** 2).sum(-1) / max(float(none), 1e-300)
    k = min(max(int(np.argmin(left)), 1), len(left) - 2)
    before, here, behind = left[k - 1 : k + 2]
    bend = max(before - 2 * here + behind, 1e-300)
    shift = float(np.clip(0.5 * (before - behind) / bend, -1.0, 1.0))
    # on the grid two equally good offsets need not look so
    least = max(here - 0.25 * (before - behind) * shift, 0.1 * here)
    return float(least), offset + float(_NEAR[k]) + shift * STEP
