"""Coarse offset of a torque log against a motion, by cross-correlation over all offsets at once.

The torque asked for by the observed motion follows from the nominal mechanism: the observed minus
the predicted acceleration without a motor, times M. It is compared with the log at every offset.
What any friction could have done is projected out of both: its amount is irrelevant.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft  # scipy.signal takes a second to import
from scipy.linalg import orth

from frictionid.arrays import Array
from frictionid.check.motion import MIN_WINDOWS, WIDTH
from frictionid.check.partial_regression import partial_regression
from frictionid.data.integrals import integrals_of, window_means
from frictionid.data.signals import Signal, cut
from frictionid.errors import InputError
from frictionid.fitting.one_step.balances import Rows
from frictionid.mechanics import Mechanism

STEP = 0.01  # [s] between offsets
LONGEST = 1e5  # [s] of motion and log: more than a day
UNEQUAL = 500.0  # times as long as the other: in ms, where the other is in s
_SECONDS = (
    "convert the columns of time to s ([protocol] unit is that of the drive's lines, no log's)"
)
_OVERLAP, _NEARLY = 0.5, 0.9  # shares of the motion that the log must cover
_CANDIDATES, _SEPARATION = 8, 0.1  # best offsets that are refined, [s] between them
_NEAR = np.arange(-0.06, 0.0601, STEP)  # [s] around a candidate
# An offset is accepted where it leaves this share of the torque unexplained at most, and any other
# leaves this many times as much.
_EXPLAINS, _CLEAR = 0.6, 2.0


class CoarseOffset(NamedTuple):
    """Offset of the log's clock by cross-correlation.

    Attributes
    ----------
    offset : [s], added to the log's time
    unexplained : share of the asked torque that it leaves unexplained, with any friction
    runner_up : offset [s] and unexplained share of the next best
    reversed : largest share that any offset explains with the sign of the torque reversed
    offsets, explained : arrays, shape (D,), all offsets [s] and the share that each explains
    """

    offset: float
    unexplained: float
    runner_up: tuple[float, float]
    reversed: float
    offsets: Array
    explained: Array


def coarse_offset(
    mechanism: Mechanism, base: Array, rows: Rows, angle: Signal, torque: Signal
) -> CoarseOffset:
    """The offset at which a log explains a motion.

    Parameters
    ----------
    mechanism : Mechanism
    base : array, shape (nb,), nominal base parameters
    rows : unit rows of the motion
    angle : Signal, n columns
    torque : Signal, n columns, by the log's clock

    Raises
    ------
    InputError
        Where nothing moves, or the log explains the motion nowhere or in several places.
    """
    driven = np.array(mechanism.driven)
    if int((rows.moving & driven).sum()) < MIN_WINDOWS:
        raise InputError(
            "the driven joints hardly move: no motion to find in the log; record livelier motion"
        )
    if np.ptp(torque.value, axis=0).max() <= 0:
        raise InputError("the logged torque never changes: nothing to find in the motion")
    asked = rows.required(base[None])
    offsets, explained, reversed_ = correlate(rows, asked, torque, driven)
    peaks = _peaks(offsets, explained)
    if not len(peaks) and torque.duration < _OVERLAP * angle.duration:
        raise InputError(
            f"the log ({torque.duration:.3g} s) covers less than half of the motion "
            f"({angle.duration:.3g} s): log as long as the camera records"
        )
    if not len(peaks):
        raise InputError(
            "the driven joints slide too little, or not while the log was written, to find the "
            "motion in it: record livelier motion, such as the response to several pulses of torque"
        )
    refined = sorted(_refined(rows, base, angle, torque, float(p)) for p in peaks)
    best = refined[0]
    others = [r for r in refined[1:] if abs(r[1] - best[1]) > _SEPARATION]
    second = others[0] if others else (1.0, float("nan"))
    out = CoarseOffset(best[1], best[0], second[::-1], float(reversed_.max()), offsets, explained)
    _check(out)
    return out


def _check(offset: CoarseOffset) -> None:
    if offset.unexplained > _EXPLAINS:
        hint = (
            "the torque fits best with its sign reversed: check the signs of kt and gear, and the "
            "direction of the angles"
            if offset.reversed > 1.0 - 0.5 * offset.unexplained
            else "were both recorded at the same time, by this mechanism?"
        )
        raise InputError(
            f"no stretch of the log explains the motion (the best one leaves "
            f"{100 * offset.unexplained:.0f} % of the torque): {hint}"
        )
    if offset.runner_up[1] < _CLEAR * offset.unexplained:
        raise InputError(
            f"the log explains the motion as well with an offset of {offset.runner_up[0]:.3f} s as "
            f"with {offset.offset:.3f} s: use a torque that does not repeat itself, or a marker"
        )


def check_spans(motion: float, log: float) -> None:
    """Check that a motion and a log [s] can belong together, and fit into memory.

    Raises
    ------
    InputError
        With both spans: one of them is in another unit, or the log is that of another day.
    """
    if motion + log > LONGEST:
        raise InputError(
            f"the angles span {motion:.3g} s and the log {log:.3g} s, together more than "
            f"{LONGEST:.0f} s: {_SECONDS}, or cut the log to the motion"
        )
    if max(motion, log) > UNEQUAL * max(min(motion, log), STEP):
        raise InputError(
            f"the angles span {motion:.3g} s and the log {log:.3g} s, more than {UNEQUAL:.0f} "
            f"times as long or as short: {_SECONDS}, or cut one of them"
        )


def correlate(
    rows: Rows, asked: Array, torque: Signal, driven: Array
) -> tuple[Array, Array, Array]:
    """Offsets (D,) [s], and shares (D,) of the asked torque that the log explains at each.

    The third are the shares that it explains with its sign reversed; all are -inf where the log
    covers too little.

    With y the asked torque of the moving samples, x the log at an offset, Q an orthonormal basis of
    the shapes that friction may have, and P = 1 - Q Q',

        explained = 1 - |P (y - x)|^2 / |P y|^2 = (2 (P y).x - |x|^2 + |Q' x|^2) / |P y|^2

    in which each term is a correlation, summed over the driven joints.
    """
    middle = (rows.start + rows.stop) / 2
    check_spans(float(np.ptp(middle)), torque.duration)
    motion = np.arange(middle[0], middle[-1], STEP)
    log = np.arange(torque.time[0] + WIDTH / 2, torque.time[-1] - WIDTH / 2, STEP)
    if len(log) < 2:
        return np.zeros(0), np.zeros(0), np.zeros(1)
    sums = [_joint_sums(rows, asked, torque, motion, log, int(j)) for j in np.flatnonzero(driven)]
    cross, energy, covered, total, moving = (sum(parts) for parts in zip(*sums, strict=True))
    # of little motion, such as the response to one pulse, nearly all must be covered
    few = max(min(MIN_WINDOWS * WIDTH / 2 / STEP, _NEARLY * moving), MIN_WINDOWS)
    enough = (covered >= _OVERLAP * moving) & (covered >= few)
    scale = max(total, 1e-300)
    explained, reversed_ = (
        np.where(enough, (sign * 2 * cross - energy) / scale, -np.inf) for sign in (1.0, -1.0)
    )
    # entry i of a convolution with the reversed log pairs sample k of the motion with sample
    # k + len(log) - 1 - i of the log
    offsets = motion[0] - log[0] + STEP * (np.arange(len(explained)) - (len(log) - 1))
    return offsets, explained, reversed_


def _joint_sums(
    rows: Rows, asked: Array, torque: Signal, motion: Array, log: Array, j: int
) -> tuple[Any, ...]:
    """Sums of joint j over the overlap at each offset (D,), and of the whole motion.

    (P y).x; |P x|^2; number of moving samples that the log covers; |P y|^2; number of all moving.
    motion, log : even times of both, each by its clock
    """
    middle = (rows.start + rows.stop) / 2
    # the motion in a gap is unknown
    after = np.clip(np.searchsorted(middle, motion), 1, len(middle) - 1)
    dense = (middle[after] - middle[after - 1] < WIDTH).astype(float)
    free = np.interp(motion, middle, rows.moving[:, j].astype(float))
    moves = (free > 0.999) * dense

    def on_grid(values: Array) -> Array:
        return moves * np.interp(motion, middle, values)

    shapes = np.stack([on_grid(shape) for shape in rows.shapes(j).T], axis=1)
    size = np.sqrt((shapes**2).sum(axis=0))
    Q = orth(shapes / np.where(size > 0, size, 1.0), rcond=1e-6)
    y = on_grid(asked[:, j])
    y = y - Q @ (Q.T @ y)
    half, recording = STEP * round(WIDTH / 2 / STEP), np.zeros(len(log), dtype=int)
    logged = integrals_of([torque._replace(value=torque.value[:, [j]])])
    x = window_means(logged, recording, log - half, log + half)[::-1, 0]
    energy = _convolved(moves, x**2)
    for q in Q.T:
        energy -= _convolved(q, x) ** 2
    covered = _convolved(moves, np.ones(len(x)))
    return _convolved(y, x), energy, covered, float(y @ y), float(moves.sum())


def _convolved(a: Array, b: Array) -> Array:
    size = len(a) + len(b) - 1
    fast = next_fast_len(size)
    return irfft(rfft(a, fast) * rfft(b, fast), fast)[:size]


def _peaks(offsets: Array, explained: Array) -> Array:
    """Offsets [s] that explain most, apart from each other."""
    left = explained.copy()
    out: list[float] = []
    gap = round(_SEPARATION / STEP)
    while len(out) < _CANDIDATES and len(left) and np.isfinite(left.max()):
        k = int(np.argmax(left))
        out.append(float(offsets[k]))
        left[max(k - gap, 0) : k + gap + 1] = -np.inf
    return np.array(out)


def around(torque: Signal, start: float, stop: float) -> Signal:
    """The torque from `start` to `stop` and for a second on either side."""
    return cut(torque, start - 1.0, stop + 1.0)


def _refined(
    rows: Rows, base: Array, angle: Signal, torque: Signal, offset: float
) -> tuple[float, float]:
    """Share that the best offset near a candidate leaves unexplained, and that offset [s].

    By the exact torque integrals and a parabola through three.
    """
    moved = torque._replace(time=torque.time + offset)
    covered = (rows.start > moved.time[0]) & (rows.stop < moved.time[-1])
    if int(covered.sum()) < MIN_WINDOWS:
        return 1.0, offset
    kept = rows.where(covered)
    near = cut(angle, moved.time[0], moved.time[-1])
    late = kept.means(integrals_of([around(moved, near.time[0], near.time[-1])]), _NEAR)
    fit = partial_regression(kept, late[len(_NEAR) // 2], base[None])
    asked = kept.required(base[None])
    total = float((fit.residual(asked) ** 2).sum())
    left = (fit.residual(asked - late) ** 2).sum(-1) / max(total, 1e-300)
    k = min(max(int(np.argmin(left)), 1), len(left) - 2)
    before, here, behind = left[k - 1 : k + 2]
    curvature = max(before - 2 * here + behind, 1e-300)
    shift = float(np.clip(0.5 * (before - behind) / curvature, -1.0, 1.0))
    # on the grid two equally good offsets need not look so
    least = max(here - 0.25 * (before - behind) * shift, 0.1 * here)
    return float(least), offset + float(_NEAR[k]) + shift * STEP
