"""Motion that the checks look at: smoothed states, and how uncertain they are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.kalman import likeliest_jerk_ratio, padded_series, rts_smoother
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal
from frictionid.data.states import States

# Finer samples are averaged: friction and rigid bodies show below 30 Hz, and each step costs time.
FINEST = 0.004


class Motion(NamedTuple):
    """Estimated motion of one recording.

    states : time (T,) [s], q (T, n) [rad], w (T, n) [rad/s]
    angle_noise : (n,) [rad] standard deviation of the measured angle about the smooth motion
    velocity_noise : (n,) [rad/s] standard deviation of w
    blur : (n,) [s] over which the smoother spreads a sudden change of acceleration, 1/w0 below
    """

    states: States
    angle_noise: Array
    velocity_noise: Array
    blur: Array


def motions_of(recordings: Sequence[Recording]) -> tuple[Motion, ...]:
    """Motion of each recording, by the smoother of `states.RTS` with its own uncertainty.

    In steady state the white-jerk smoother has the bandwidth w0 = (rho/dt)^(1/6) [rad/s] and leaves

    var q = s^2 dt w0 / 3,    var w = s^2 dt w0^3 / 6

    of the measurement variance s^2, from the integrals of its frequency response.

    Examples
    --------
    >>> t = np.arange(300) / 60
    >>> noise = 0.002 * np.random.default_rng(0).standard_normal((300, 1))
    >>> angle = Signal(t, np.sin(3 * t)[:, None] + noise)
    >>> motion = motions_of([Recording("swing", angle, Signal(t, 0 * noise))])[0]
    >>> float(motion.angle_noise[0].round(4))
    0.002
    """
    angles = [_averaged(recording.angle) for recording in recordings]
    series = padded_series(angles)
    rho = likeliest_jerk_ratio(series)
    mean = rts_smoother(series, rho)
    return tuple(
        _motion(angle, mean[: len(angle.time), own], rho[own])
        for angle, own in zip(angles, series.columns, strict=True)
    )


def _motion(angle: Signal, mean: Array, rho: Array) -> Motion:
    dt = float(np.median(np.diff(angle.time)))
    bandwidth = np.minimum((rho / dt) ** (1 / 6), np.pi / dt)
    rest = (angle.value - mean[..., 0]).var(axis=0)
    variance = rest / np.maximum(1.0 - dt * bandwidth / 3, 0.05)
    states = States(angle.time, mean[..., 0], mean[..., 1])
    velocity = np.sqrt(variance * dt * bandwidth**3 / 6)
    return Motion(states, np.sqrt(variance), velocity, 1.0 / bandwidth)


def _averaged(angle: Signal) -> Signal:
    """Means over neighbouring samples that are closer than FINEST, time and angle alike."""
    count = round(FINEST / float(np.median(np.diff(angle.time))))
    blocks = len(angle.time) // max(count, 1)
    if count < 2 or blocks < 2:
        return angle
    used = blocks * count
    value = angle.value[:used].reshape(blocks, count, -1).mean(axis=1)
    return angle._replace(time=angle.time[:used].reshape(blocks, count).mean(axis=1), value=value)
