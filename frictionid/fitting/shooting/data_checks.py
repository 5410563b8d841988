"""Blocks and data that shooting cannot use are refused; what makes a result doubtful is said."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import compress
from math import lgamma

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr  # scipy.stats takes half a second to import

from frictionid.arrays import Array, rows_by, scatter, usual_step
from frictionid.data.recordings import Dataset
from frictionid.data.signals import holds
from frictionid.errors import InputError
from frictionid.friction.coordinates import of_parts, turns_of
from frictionid.friction.provenance import OddRecording
from frictionid.mechanics.plant import base_by_rotors

from ..fit import UNEXPLAINED, Covariance
from ..parameter_block import Estimate, Parameter, ParameterBlock, have_prior
from .sample_intervals import Intervals, cut_windows
from .windows import Solution

_FEW = 4  # windows: of fewer, no interval is worth the name
_STILL = 10.0  # [noise]: a joint that moves less does not move
_FOLLOWED = 0.01  # of third differences: the smoother takes off nothing
_MORE = 8.0  # times what the smoother takes off, which is some 0.6 of the noise
_FAR = 100.0  # the same, of predictions that say nothing
_EARLY = 0.001  # [s] that a torque acts before it was logged
_MANY = 12  # base parameters
_ROUNDING = 1e-9  # of what a rotor changes
_SCALE = 10.0  # times the nominal base parameters


def check_blocks(
    blocks: Sequence[ParameterBlock], estimate: Estimate, intervals: Intervals
) -> None:
    """Refuse blocks that no data, or not these data, can tell apart."""
    names = [b.name for b in blocks]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"block {name!r} is given twice")
    parameters = {b.name: b.parameters(estimate) for b in blocks}
    everything = len(estimate.mechanism.base_names)
    scale = len(parameters.get("inertia", ())) == everything and "friction" in parameters
    informed = have_prior(parameters)
    torque = intervals.dataset.actuated.any()
    remedy = (
        "fix one base parameter that you are sure of, such as "
        f"{estimate.mechanism.base_names[-1]!r}, or give a prior"
    )
    if scale and not informed and not torque:
        raise InputError(
            "block 'inertia': without motor torque only the ratios of inertia, gravity and "
            f"friction show in the motion: {remedy}"
        )
    if scale and not informed and "gain" in parameters and torque:
        raise InputError(
            "blocks 'gain' and 'inertia' with all base parameters free: a larger gain with larger "
            f"inertias and friction gives the same motion: {remedy}"
        )
    if not torque:
        for name in ("gain", "delay"):
            if name in parameters:
                raise InputError(f"block {name!r}: no recording has any motor torque; leave it out")


def telling(
    blocks: tuple[ParameterBlock, ...],
    offered: Sequence[ParameterBlock],
    estimate: Estimate,
    intervals: Intervals,
) -> tuple[ParameterBlock, ...]:
    """The blocks, and the offered ones that these data can tell beside them and each other.

    Of many base parameters only the rotors are offered. Where only ratios of inertia, gravity and
    friction show, the largest moment of gravity is held.
    """
    for block in offered:
        block = _of_rotors(block, estimate, bool(intervals.dataset.servos))
        for choice in (block, _held_scale(block, estimate)):
            try:
                if choice.parameters(estimate):
                    check_blocks((*blocks, choice), estimate, intervals)
                    blocks = (*blocks, choice)
                    break
            except InputError:
                continue
    return blocks


def _of_rotors(block: ParameterBlock, estimate: Estimate, has_servos: bool) -> ParameterBlock:
    """A block of many base parameters with those held that are no rotor's inertia.

    A robot's bodies are known from its description, its motors often are not; and predictions of
    windows hardly tell so many apart. Rotors that nobody has given may be part of an inertia that
    is named after a body. With a measured torque (no servos) such inertias stay: its noise looks
    like more of them.
    """
    mechanism, names = estimate.mechanism, estimate.mechanism.base_names
    if block.enters != "base" or len(names) <= _MANY:
        return block
    values, free = mechanism.nominal(), set[str]()
    for rotor, change in base_by_rotors(mechanism, values).items():
        missing = has_servos and values[rotor] == 0
        free |= {rotor, *compress(names, missing * np.abs(change) > _ROUNDING)}
    return replace(block, fixed=(*block.fixed, *(name for name in names if name not in free)))


def _held_scale(block: ParameterBlock, estimate: Estimate) -> ParameterBlock:
    """A block of base parameters with the largest moment of gravity held; others as they are."""
    if block.enters != "base":
        return block
    moments = [p for p in block.parameters(estimate) if p.unit in ("N m", "N")]
    held = max(moments, key=lambda p: abs(p.value), default=None)
    return block if held is None else replace(block, fixed=(*block.fixed, held.name))


def check_data(intervals: Intervals, parameters: Sequence[Parameter], seconds: float) -> None:
    """Refuse data with too few windows of so many seconds, wrapped angles, or joints at rest."""
    mechanism = intervals.dataset.mechanism
    _check_unwrapped(intervals.dataset)
    _check_length(intervals, len(parameters), seconds)
    still = _still(intervals)
    for parameter in parameters:
        if parameter.block == "friction" and parameter.place and still[parameter.place[0]]:
            raise InputError(
                f"data set {intervals.dataset.name!r}: joint {parameter.place[0] + 1} of the "
                f"{mechanism.kind} never moves by more than the noise of its angle, so "
                f"{parameter.name!r} does not show: give recordings in which it moves, or a "
                "mechanism without it"
            )


def wraps(dataset: Dataset) -> list[NDArray[np.bool_]]:
    """At which steps (T - 1, n) of each recording an angle is wrapped at a turn.

    It jumps by more than half a turn and yet never leaves a span of one.
    """
    values = [r.angle.value for r in dataset.recordings]
    span = np.ptp(np.concatenate(values), axis=0)
    turns = np.array([unit == "rad" for unit in dataset.mechanism.position_units])
    within = (span <= 2 * np.pi + 0.1) & turns
    return [(np.abs(np.diff(value, axis=0)) > np.pi) & within for value in values]


def _check_unwrapped(dataset: Dataset) -> None:
    for recording, jumps in zip(dataset.recordings, wraps(dataset), strict=True):
        if jumps.any():
            k, j = np.argwhere(jumps)[0]
            low, high = recording.angle.value[k : k + 2, j]
            raise InputError(
                f"recording {recording.name!r}: angle {j + 1} jumps by "
                f"{high - low:+.2f} rad at {recording.angle.time[k]:.2f} s and "
                "never leaves one turn: it is wrapped at half a turn; unwrap it (numpy.unwrap)"
            )


def _check_length(intervals: Intervals, count: int, seconds: float) -> None:
    windows = cut_windows(intervals, np.ones(len(intervals.dt), dtype=bool), seconds)
    lengths = (windows >= 0).sum(axis=1) + 1
    # a window's own initial state takes up two samples
    left = int(((lengths - 2) * intervals.n).sum())
    if len(windows) < _FEW or left < 2 * count:
        raise InputError(
            f"data set {intervals.dataset.name!r}: {int(lengths.sum())} samples make "
            f"{len(windows)} windows of {seconds:.2g} s, too few for {count} free parameters and "
            "their intervals: give longer recordings, or free less"
        )


def _still(intervals: Intervals) -> Array:
    """Joints, and other parts (m,), that never move in any recording."""
    turns = turns_of(intervals.dataset.mechanism, intervals.q)
    travel = [np.ptp(of_parts(s.q, turns), axis=0) for s in intervals.states]
    noise = of_parts(angle_noise(intervals), None if turns is None else np.abs(turns))
    return np.max(travel, axis=0) <= _STILL * noise


def angle_noise(intervals: Intervals) -> Array:
    """Noise (n,) [rad] of the angles: what the smoother took off, or their sensor's if it is more.

    Where a motion is so fast that the smoother follows its noise, the third differences of angles,
    to which the motion adds.
    """
    taken = scatter(intervals.before - intervals.q)
    runs = intervals.dataset.recordings
    rough = np.concatenate([np.diff(r.angle.value, 3, axis=0) for r in runs])
    most = scatter(rough) / np.sqrt(20.0)  # 1 + 9 + 9 + 1
    noise = np.maximum(np.where(taken < _FOLLOWED * most, most, taken), intervals.rounding)
    sensor = [
        np.median(np.atleast_2d(r.angle.sigma), axis=0) for r in runs if r.angle.sigma is not None
    ]
    return np.maximum(noise, np.median(sensor, axis=0)) if sensor else noise


def warnings_of(solution: Solution) -> Iterator[str]:
    """Sentences on what makes the numbers of a fit doubtful as a whole."""
    about = (_coarse, _clocks, _scaled)
    said = [sentence for words in about for sentence in words(solution)]
    yield from said
    if said:
        yield (
            "`frictionid check` looks for wrong signs, late clocks, wrapped angles and other "
            "mistakes in the data, `frictionid quick` for another law."
        )


def explained(solution: Solution) -> bool:
    """Whether all angles are predicted about as well as they are measured."""
    return bool((_worse(solution) <= _MORE).all())


def is_astray(solution: Solution) -> bool:
    """Whether predictions are farther off, or base parameters run farther, than in any fit."""
    return bool(_worse(solution).max() > _FAR) or base_runs_off(solution)


def base_runs_off(solution: Solution) -> bool:
    """Whether base parameters are far larger or smaller than their nominal values."""
    return any(_scaled(solution))


def _worse(solution: Solution) -> Array:
    """How many times worse than measured the angles (n,) are predicted."""
    return solution.sigma / np.maximum(angle_noise(solution.problem.intervals), 1e-12)


def _coarse(solution: Solution) -> Iterator[str]:
    off = _worse(solution)
    worst = int(np.argmax(off))
    if not explained(solution):
        yield (
            f"Angle {worst + 1} is predicted {off[worst]:.0f} times worse than it is measured: "
            f"{UNEXPLAINED}. Intervals hold what windows of other lengths would change."
        )


def _clocks(solution: Solution) -> Iterator[str]:
    delay = float(solution.estimate.calibration.delay)
    for p in (p for p in solution.problem.parameters if p.block == "delay"):
        if not p.low < delay < p.high:
            yield (
                f"The torque delay ends at {delay:+.2g} s, as far as it may go: the clocks may be "
                "further apart, or the logs do not belong together."
            )
        if delay < -_EARLY:
            torques = [r.torque for r in solution.problem.intervals.dataset.recordings]
            held = any(holds(t) and -delay < usual_step(t.time) for t in torques)
            samples = 'it is no held one (torque = "linear" under [hold]), ' if held else ""
            yield (
                f"The torque seems to act {-1e3 * delay:.1f} ms before it was logged: {samples}"
                "its clock is late, or friction sets in later than the law says, as behind a gap "
                "(law 'play')."
            )


def _scaled(solution: Solution) -> Iterator[str]:
    nominal = solution.estimate.mechanism.nominal_base
    base = np.asarray(solution.estimate.calibration.base)
    size = float(np.median(np.abs(base) / np.maximum(np.abs(nominal), 1e-12)))
    if not 1 / _SCALE < size < _SCALE:
        yield (
            f"The base parameters are {size:.2g} times the nominal ones: the motion does not show "
            "the logged torque."
        )


_MOST_SPEEDS = 0.95
_AS_FAST = 0.5  # of these speeds: a Stribeck velocity that leaves no plateau


def no_plateau(solution: Solution) -> Iterator[str]:
    """Coulomb levels that end at zero as the Stribeck velocity is as large as the speeds."""
    friction = solution.estimate.friction
    names, theta = friction.law.names, np.asarray(friction.theta)
    if "stribeck_velocity" not in names:
        return
    w = solution.problem.intervals.w
    speeds = np.abs(of_parts(w, turns_of(solution.estimate.mechanism, w)))
    usual = np.quantile(speeds, _MOST_SPEEDS, axis=0)
    for p in solution.problem.parameters:
        if p.block != "friction" or not names[p.place[1]].startswith("coulomb"):
            continue
        joint, falls = p.place[0], theta[p.place[0], names.index("stribeck_velocity")]
        if theta[p.place] == p.low == 0.0 and falls > _AS_FAST * usual[joint]:
            unit = friction.law.units[names.index("stribeck_velocity")]
            yield (
                f"{p.name[0].upper()}{p.name[1:]} ends at 0: friction falls off over all speeds of "
                f"the recordings (Stribeck velocity {falls:.2g} {unit}, 95 % of the speeds are "
                f"below {usual[joint]:.2g}), so that level, peak and viscous friction show only "
                "together, as one curve."
            )


def wanders(solution: Solution, covariance: Covariance) -> Iterator[str]:
    """Why a fit has not converged."""
    friction = np.array([p.block == "friction" for p in solution.problem.parameters], dtype=bool)
    unknown = int((friction & ~covariance.identified).sum())
    if solution.converged or not unknown or solution.estimate.friction.law.is_network:
        return
    yield (
        f"It has not converged, as the recordings do not tell {unknown} of the "
        f"{int(friction.sum())} parameters of friction, and these wander: take a law with fewer, "
        "or hold some (`fixed`)."
    )


_WILD = 20.0  # [noise]: residuals count as so large at most
_FEWEST = 5  # recordings: among fewer none can be told from the others
_CLEAR = 0.01  # p-value, times the choices of recordings
_WORTH = 1.5  # times the usual size of the residuals: what is worth a word
_MOST = 4  # one recording in so many may be odd


def odd_recordings(solution: Solution) -> tuple[OddRecording, ...]:
    """The recordings that are not explained as the others are, largest residuals first.

    Without windows that are left out as their predictions jump.
    """
    smooth, intervals = ~solution.kinked, solution.problem.intervals
    owner = intervals.recording[solution.windows[smooth, 0]]
    residual = np.minimum(np.abs(solution.residual[smooth]) / solution.sigma, _WILD)
    share = solution.share[smooth, :, None] * np.ones_like(residual)
    sizes = np.array(
        [
            np.sqrt((residual[windows] ** 2 * share[windows]).sum() / share[windows].sum())
            for windows in rows_by(owner)
        ]
    )
    names = [intervals.dataset.recordings[int(row)].name for row in np.unique(owner)]
    return odd_among(sizes, names)


def odd_among(sizes: Array, names: Sequence[str]) -> tuple[OddRecording, ...]:
    """Recordings whose sizes (R,) stand off from the rest, by the generalised test of [Rosner1983].

    The k largest are odd where the smallest of them stands off from the mean of the R - k others:

        t = (x_k - mean) / (s (1 + 1/(R - k))^1/2),    x = log(size),    with R - k - 1 freedoms

    for the largest such k, with p-values times the number of choices of k recordings.
    """
    count, order = len(sizes), np.argsort(-sizes)
    x = np.log(np.maximum(sizes[order], 1e-300))
    for k in range(count // _MOST if count >= _FEWEST else 0, 0, -1):
        rest = x[k:]
        scale = max(float(rest.std(ddof=1)), 1e-9) * np.sqrt(1.0 + 1.0 / len(rest))
        off = (x[:k] - rest.mean()) / scale
        tail = np.maximum(stdtr(len(rest) - 1, -off), 1e-300)
        # of the number of choices of k out of so many: of thousands it is no float
        choices = lgamma(count + 1) - lgamma(k + 1) - lgamma(count - k + 1)
        p = np.exp(np.minimum(0.0, np.log(tail) + choices))
        usual = float(np.exp(rest.mean()))
        if p[k - 1] < _CLEAR and sizes[order[k - 1]] > _WORTH * usual:
            return tuple(
                OddRecording(names[i], float(sizes[i]), usual, float(p_value))
                for i, p_value in zip(order[:k], p, strict=True)
            )
    return ()


def odd_sentences(odd: Sequence[OddRecording]) -> tuple[str, ...]:
    """What is odd, for people."""
    return tuple(
        f"Recording {recording.recording!r} is not explained as the others are: its angles "
        f"are off by {recording.size:.2g} times the noise, theirs by {recording.usual:.2g} (p = "
        f"{recording.p_value:.1g}). "
        "Was it disturbed, or did it have another load? Leave it out, or give it that load."
        for recording in odd
    )
