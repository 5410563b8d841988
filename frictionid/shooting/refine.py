"""Refining a friction by shooting: the one entry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset
from frictionid.data.states import States
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.mechanics import mechanism_of, parameters_of
from frictionid.mechanics.calibration import Calibration
from frictionid.shooting.covariance import Covariance, covariance_of
from frictionid.shooting.data_checks import complain, doubts
from frictionid.shooting.gauss_newton import Shot, settle
from frictionid.shooting.intervals import Track, track_of
from frictionid.shooting.linearise import Intervals, intervals_of
from frictionid.shooting.networks import as_given, combined, on_arrays
from frictionid.shooting.parameters.friction import FrictionBlock, on_support
from frictionid.shooting.parameters.parameter_block import Block, Guess
from frictionid.shooting.servo_intervals import driven_of, has_actuator, motored
from frictionid.shooting.settings import Settings

_UNEXPLAINED = 3.0  # [noise], root mean square of a window's residual


class Place(NamedTuple):
    """A stretch of a recording: its name, begin and end [s], and the residual's size [noise]."""

    recording: str
    begin: float
    end: float
    size: float


@dataclass(frozen=True)
class Diagnostics:
    """How a fit went.

    sigma : (n,) [rad], noise of the angles as the residuals show it
    windows : their number; left_out : those whose prediction jumps with their start state (a joint
        just misses or just reaches a stop) and so do not count; unexplained : those with residuals
        of three times the noise and more, which count little or not at all
    settled : whether it came to an end; iterations : how many that took
    doubts : sentences on what makes the numbers doubtful as a whole
    """

    sigma: Array
    windows: int
    left_out: tuple[Place, ...]
    unexplained: tuple[Place, ...]
    settled: bool
    iterations: int
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Refined:
    """What shooting found: friction with its calibration, their covariance, and how it went.

    fitted : the friction as a function of the free parameters, of a network that of a few
        combinations of its numbers
    """

    friction: Friction
    fitted: Friction
    covariance: Covariance
    diagnostics: Diagnostics
    mechanism: object

    @property
    def calibration(self) -> Calibration:
        """Base parameters, and what the sensors do."""
        assert self.friction.calibration is not None
        return self.friction.calibration

    def bands(self, w: Array, level: float = 0.95, seed: int = 0) -> tuple[Array, Array]:
        """Half-widths (V, n) [N m] of each joint's curve at velocities w (V, n).

        Pointwise, and simultaneous over all its velocities.
        """
        slope = self._slopes(w)
        covariance = self.covariance
        sure = np.isfinite(covariance.error)
        inner = covariance.matrix[np.ix_(sure, sure)]
        error = np.sqrt(np.einsum("vnd,de,vne->vn", slope[..., sure], inner, slope[..., sure]))
        point = stdtrit(covariance.freedom, 0.5 + level / 2) * error
        off = (covariance.draws(seed) - covariance.values)[:, sure]
        size = np.abs(np.einsum("vnd,bd->bvn", slope[..., sure], off))
        ratio = (size / np.maximum(error, 1e-300)).max(axis=1)
        return point, np.quantile(ratio, level, axis=0) * error

    def _slopes(self, w: Array) -> Array:
        """Derivatives (V, n, D) of each joint's curve in the free parameters."""
        covariance = self.covariance
        out = np.zeros((*w.shape, len(covariance.entries)))
        theta = np.asarray(self.fitted.theta, dtype=float)
        own = [k for k, e in enumerate(covariance.entries) if e.block == "friction"]
        for j in range(len(theta)):
            some = [k for k in own if covariance.entries[k].place[0] == j]
            if not some:
                continue
            step = np.zeros((len(some), *theta.shape))
            for i, k in enumerate(some):
                place = covariance.entries[k].place
                step[i][place] = 1e-6 * max(1e-3, abs(theta[place]))
            both = (
                replace(self.fitted, theta=theta + s * step, calibration=None) for s in (1.0, -1.0)
            )
            up, down = (friction.curve(w[:, j])[..., j] for friction in both)
            out[:, j, some] = ((up - down) / (2 * step.sum(axis=(1, 2))[:, None])).T
        return out


def refine(
    friction: Friction,
    dataset: Dataset,
    blocks: Sequence[Block] = (FrictionBlock(),),
    settings: Settings | None = None,
    *,
    sample_time: float | None = None,
    states: tuple[States, ...] | None = None,
) -> Refined:
    """Friction, and whatever else the blocks free, from the measured angles themselves.

    Windows of the recordings are predicted from free start states by the physics step, and all
    parameters are those for which the predicted angles come closest to the measured ones, in units
    of the angle noise [Bock1983]. It starts from the given friction, its calibration and the data
    set's mechanism.

    states : of the recordings by the RTS smoother, where they have been asked for before

    Raises
    ------
    InputError
        For combinations of blocks that no data can tell apart, data too short for windows, wrapped
        angles, and friction of joints that never move.
    """
    settings = settings or Settings()
    track = track_of(dataset, sample_time, states)
    intervals, guess = begin(friction, track, on_support(blocks, friction), settings)
    shot = settle(intervals, guess, np.ones(len(track.dt), dtype=bool))
    return refined(intervals, shot, friction)


def begin(
    friction: Friction, track: Track, blocks: Sequence[Block], settings: Settings
) -> tuple[Intervals, Guess]:
    """What a fit to a track needs, and where it starts."""
    table = track.dataset.mechanism
    mechanism = mechanism_of(table)
    base = mechanism.base(parameters_of(table, friction.parameters))
    calibration = friction.calibration or Calibration.ideal(mechanism.n)
    calibration = calibration if calibration.base is not None else replace(calibration, base=base)
    network = friction.law.is_network
    friction = on_arrays(friction)
    if network:
        friction, blocks = combined(friction, mechanism, calibration, track, blocks)
    guess = Guess(friction, calibration, mechanism)
    guess = motored(guess, track.dataset) if has_actuator(blocks) else guess
    check_blocks(blocks, guess, track)
    made = driven_of if has_actuator(blocks) else intervals_of
    intervals = made(track, guess, blocks, settings)
    complain(track, intervals.parts, settings.windows[-1])
    return intervals, guess


def refined(intervals: Intervals, shot: Shot, given: Friction) -> Refined:
    """The result of a fit that began with a given friction."""
    fitted = replace(shot.guess.friction, calibration=shot.guess.calibration, parameters={})
    return Refined(
        as_given(fitted, given),
        fitted,
        covariance_of(intervals, shot),
        _diagnostics(intervals, shot),
        shot.guess.mechanism,
    )


def check_blocks(blocks: Sequence[Block], guess: Guess, track: Track) -> None:
    """Complain about blocks that no data, or not these data, can tell apart."""
    names = [b.name for b in blocks]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"block {name!r} is given twice")
    entries = {b.name: b.entries(guess) for b in blocks}
    everything = len(guess.mechanism.base_names)
    scale = len(entries.get("inertia", ())) == everything and "friction" in entries
    known = any(np.isfinite(e.prior) for own in entries.values() for e in own)
    torque = any(np.any(r.torque.value) for r in track.dataset.recordings)
    way = (
        "fix one base parameter that you are sure of, such as "
        f"{guess.mechanism.base_names[-1]!r}, or give a prior"
    )
    if scale and not known and not torque:
        raise InputError(
            "block 'inertia': without motor torque only the ratios of inertia, gravity and "
            f"friction show in the motion: {way}"
        )
    if scale and not known and "gain" in entries and torque:
        raise InputError(
            "blocks 'gain' and 'inertia' with all base parameters free: a larger gain with larger "
            f"inertias and friction gives the same motion: {way}"
        )
    if not torque:
        for name in ("gain", "delay"):
            if name in entries:
                raise InputError(f"block {name!r}: no recording has any motor torque; leave it out")


def _diagnostics(intervals: Intervals, shot: Shot) -> Diagnostics:
    share = shot.share[..., None] * np.ones_like(shot.residual)
    square = (shot.residual / shot.sigma) ** 2 * share
    size = np.sqrt(square.sum(axis=(1, 2)) / np.maximum(share.sum(axis=(1, 2)), 1e-12))
    wild = size > _UNEXPLAINED
    return Diagnostics(
        shot.sigma,
        len(shot.windows),
        _places(intervals, shot, ~shot.closed & ~wild, size),
        _places(intervals, shot, wild, size),
        shot.settled,
        shot.iterations,
        tuple(doubts(intervals, shot)),
    )


def _places(intervals: Intervals, shot: Shot, which: Array, size: Array) -> tuple[Place, ...]:
    track = intervals.track
    out = []
    for w in np.flatnonzero(which):
        rows = shot.windows[w][shot.windows[w] >= 0]
        name = track.dataset.recordings[int(track.recording[rows[0]])].name
        end = float(track.time[rows[-1]] + track.dt[rows[-1]])
        out.append(Place(name, float(track.time[rows[0]]), end, float(size[w])))
    return tuple(out)
