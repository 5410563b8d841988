"""Friction along prescribed sinusoids: loops over velocity, how wide they are, and how late.

Reversing motion is the study's [DeMeester2020]; there, the change of sign hides most of it. Motion
that never reverses is the test of frictional lag: what is open there is memory, or a torque clock
that is off.
"""

import math
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, rms
from frictionid.config import NonEmpty, Positive, Strict
from frictionid.errors import InputError
from frictionid.friction import Friction, Inputs, Nodes, along
from frictionid.friction.coordinates import at_places
from frictionid.mechanics import Plant

# Centre c and swing s of w = A (c + s sin): the second is never slower than a tenth of A.
KINDS = {"reversing": (0.0, 1.0), "offset": (0.6, 0.5)}
_SETTLE = 1.0  # [s] at least, before the period that is read
_FINE = 0.005  # [s] between nodes of memories that advance at any time
_POINTS = 120  # of a period, at least
_FLAT = 1e-4  # variation of a torque, in units of its size, below which nothing can be late
_TRIALS = 2048
SIGNIFICANT = 2.0  # standard deviations over the folds
LATEST = 1 / 12  # of a period: what closes later than that is no lag
NARROW = 0.01  # width of a loop, in units of the torque's size, below which it is none


class HysteresisSettings(Strict):
    """Sinusoids on which friction is shown.

    amplitude : [rad/s] of each joint; None takes 0.8 of the speed that 95 % of its motion is below
    frequency : [Hz] of each joint; None takes 1 Hz
    factors : of these frequencies, each is shown
    """

    amplitude: NonEmpty[Positive] | None = None
    frequency: NonEmpty[Positive] | None = None
    factors: NonEmpty[Positive] = [0.5, 1.0, 2.0]


class HysteresisLoop(NamedTuple):
    """One joint's friction over one period: velocity (T,) [rad/s], torque (F, T) [N m].

    width (F,) [N m]: the torque at rising less that at falling speed, mean over the speeds; where
    friction falls with speed and is late, it is positive. lag (F,) [s]: how much later velocity
    must be taken for the loop to close best, NaN where the torque does not vary.
    """

    joint: int
    kind: str
    frequency: float
    velocity: Array
    torque: Array
    width: Array
    lag: Array

    @property
    def folds(self) -> slice:
        """Where the folds stand; the friction of all data is last."""
        return slice(0, max(len(self.width) - 1, 1))

    @property
    def share(self) -> float:
        """Mean width over the folds in units of the torque's RMS."""
        width = abs(self.width[self.folds].mean())
        size = rms(self.torque[self.folds])
        return float(width / max(size, 1e-300))

    @property
    def verdict(self) -> str:
        """What the loop says: "late", "early", "open", "closed" or "scatter".

        open : wider than 1 % of the torque and two standard deviations over the folds; late or
        early : a lag of the velocity closes it, beyond two standard deviations and less than a
        twelfth of the period; scatter : wider than 1 %, but inside the scatter of the folds
        """
        width, lag = self.width[self.folds], self.lag[self.folds]
        if self.share < NARROW:
            return "closed"
        if abs(width.mean()) <= SIGNIFICANT * _sd(width):
            return "scatter"
        if np.isfinite(lag).all():
            late = SIGNIFICANT * _sd(lag) < abs(lag.mean()) < LATEST / self.frequency
            return ("late" if lag.mean() > 0 else "early") if late else "open"
        return "open"


def _sd(values: Array) -> float:
    return float(values.std(ddof=1)) if len(values) > 1 else 0.0


def hysteresis_loops(
    friction: Friction, plant: Plant, settings: HysteresisSettings, grid: Array, interval: float
) -> list[HysteresisLoop]:
    """Loops of a batch of frictions (F, n, P), each joint's on all kinds of motion.

    plant : of one recording, without batch axes; grid (V, n): velocities of the curves, see
    `velocity_grid`; interval : [s] between samples, for laws whose memory advances with them

    Raises
    ------
    InputError
        Where the settings are those of another number of joints.
    """
    for name in ("amplitude", "frequency"):
        values = getattr(settings, name)
        if values is not None and len(values) != friction.n:
            raise InputError(
                f"loops: {name} has {len(values)} entries, the mechanism has {friction.n} joints: "
                "give one for each"
            )
    amplitude = np.array(settings.amplitude or 0.8 * grid[-1])
    frequency = np.array(settings.frequency or (1.0,) * friction.n)
    out = []
    for kind in KINDS:
        for factor in settings.factors:
            usual = min(_FINE, 1.0 / (_POINTS * float((factor * frequency).max())))
            dt = usual if friction.law.sample_time is None else interval
            out += _loops_along(friction, plant, kind, amplitude, factor * frequency, dt)
    return sorted(out, key=lambda loop: loop.joint)


def _sinusoids(
    kind: str, amplitude: Array, frequency: Array, dt: float
) -> tuple[Array, Array, Array, Array]:
    """Steps (n,) a period of each joint's sinusoid, time (T,), sampled each dt [s], q and w (T, n).

    w = A (c + s sin(2 pi f t)),    q = A (c t - s (cos(2 pi f t) - 1)/(2 pi f))

    A second or more, then a period of the slowest joint; each period is a number of steps.
    """
    steps = np.maximum(np.round(1.0 / (frequency * dt)).astype(int), 8)
    longest = int(steps.max())
    count = (math.ceil(_SETTLE / (dt * longest)) + 1) * longest
    time = dt * np.arange(count)
    phase = 2 * np.pi * (np.arange(count)[:, None] % steps) / steps
    rate = 2 * np.pi / (steps * dt)
    centre, swing = KINDS[kind]
    w = amplitude * (centre + swing * np.sin(phase))
    q = centre * amplitude * time[:, None]
    q = q - swing * amplitude / rate * (np.cos(phase) - 1.0)
    return steps, time, q, w


def _loops_along(
    friction: Friction, plant: Plant, kind: str, amplitude: Array, frequency: Array, dt: float
) -> list[HysteresisLoop]:
    """Each joint's loop over the last whole period of its sinusoid."""
    steps, time, q, w = _sinusoids(kind, amplitude, frequency, dt)
    zero, count = np.zeros_like(w), len(time)
    at, still = (value[:, : plant.n] for value in (q, zero))
    load = plant.load(at, w[:, : plant.n], still)
    x = at_places(plant.mechanism, Inputs(at, still, still, load))._replace(q=q, w=w)
    torque = np.asarray(along(friction, Nodes(x, time, np.array([0, count]))))
    out = []
    for j, size in enumerate(steps):
        last = (count // size - 1) * size + np.arange(size)
        friction_torque, period = torque[:, last, j], size * dt
        measured = loop_width(w[last, j], friction_torque), loop_lag(friction_torque, period)
        out.append(
            HysteresisLoop(j, kind, float(1.0 / period), w[last, j], friction_torque, *measured)
        )
    return out


def loop_width(velocity: Array, torque: Array) -> Array:
    """Mean over the speeds of rising less falling branch (...), of a closed loop (..., T) [N m].

    >>> w = 3 + np.sin(np.linspace(0, 2 * np.pi, 400, endpoint=False))
    >>> float(loop_width(w, np.roll(w, 10)).round(3))  # late, and rising with speed: lower
    -0.246
    """
    turned = velocity * np.roll(torque, -1, axis=-1) - np.roll(velocity, -1) * torque
    return -0.5 * turned.sum(axis=-1) / np.ptp(velocity)


def loop_lag(torque: Array, period: float) -> Array:
    """How late a torque (..., T) follows a velocity that is a sine from its first sample on [s].

    A function of the velocity alone is the same before and after the velocity's highest point. The
    lag is by how much the torque's own axis of symmetry comes later, at most a quarter period.

    >>> t = np.arange(200) / 200
    >>> late = np.tanh(0.5 + np.sin(2 * np.pi * (t - 0.015)))
    >>> float(loop_lag(late, period=1.0).round(4))
    0.015
    """
    size = torque.shape[-1]
    level = rms(torque, -1)
    c = np.fft.rfft(torque - torque.mean(axis=-1, keepdims=True), axis=-1)[..., 1:] / size
    k = np.arange(1, c.shape[-1] + 1)
    shift = np.linspace(-0.25, 0.25, _TRIALS + 1)  # of a period
    # mean of T(x) T(pi + 2 shift - x), highest where both halves agree
    turn = np.exp(1j * k[:, None] * (np.pi + 4 * np.pi * shift))
    agree = np.real(np.einsum("...k,ks->...s", c**2, turn))
    at = np.clip(agree.argmax(axis=-1), 1, _TRIALS - 1)
    low, top, high = (
        np.take_along_axis(agree, (at + d)[..., None], -1)[..., 0] for d in (-1, 0, 1)
    )
    bend = low - 2 * top + high
    part = np.where(bend < 0, 0.5 * (low - high) / np.where(bend < 0, bend, 1.0), 0.0)
    lag = (shift[at] + np.clip(part, -0.5, 0.5) * (shift[1] - shift[0])) * period
    moves = np.sqrt(2 * np.sum(np.abs(c) ** 2, axis=-1)) > _FLAT * np.maximum(level, 1e-300)
    return np.where(moves, lag, np.nan)
