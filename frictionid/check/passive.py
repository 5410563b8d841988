"""Tests of passivity: energy must fall without input, and friction must hold loads at rest."""

from collections.abc import Iterator, Mapping

import numpy as np
from scipy.ndimage import uniform_filter1d

from frictionid.arrays import Array, usual_step
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import run_edges, sample
from frictionid.mechanics import Mechanism

from .findings import Finding, finding, percent
from .hypothesis_tests import HypothesisTests
from .motion import Measured, Motion
from .regression import Estimate

# Shortest passive phase [s]; energy may seem to rise by this share of its range in it.
PHASE, RISE = 0.5, 0.25
# No torque acts where its mean over this time [s] is noise, and below this share of the largest.
MEAN, QUIET = 0.1, 0.01
# The range of energy in it exceeds the noise this many times.
SHOWS = 20.0
# A rise that smoothing and masses that are a little off make.
CLEAR = 0.05
# At rest the load stays below this many times the Coulomb level: break-away peaks are smaller.
BAND = 2.5
FEWEST = 10  # windows at rest that a statement needs


def passive_phases(recording: Recording, motion: Motion, top: float) -> list[slice]:
    """Samples of the motion without torque but a sensor's noise, for at least PHASE each.

    top : [N m] largest torque of all recordings
    """
    time, value = motion.states.time, recording.torque.value
    u = np.atleast_2d(sample(recording.torque, time))
    count = max(round(MEAN / usual_step(time)), 1)
    noise = np.median(np.abs(np.diff(value, axis=0, prepend=value[:1])), axis=0).max()
    level = np.clip(5.0 * noise / np.sqrt(count), 1e-3 * np.abs(value).max(), QUIET * top)
    mean = np.abs(uniform_filter1d(u, count, axis=0)).max(axis=1)
    quiet = (mean <= level) | (np.abs(u).max(axis=1) <= 1e-3 * np.abs(value).max())
    return [
        slice(int(a), int(b))
        for a, b in zip(*run_edges(quiet), strict=True)
        if time[b - 1] - time[a] >= PHASE
    ]


def top_torque(measured: Measured) -> float:
    """Largest torque of all recordings [N m]."""
    return max(float(np.abs(r.torque.value).max()) for r in measured.dataset.recordings)


def passive_time(measured: Measured) -> float:
    """Time [s] without torque in which something moves."""
    total, top = 0.0, top_torque(measured)
    for recording, motion in measured.pairs:
        for phase in passive_phases(recording, motion, top):
            moving = (np.abs(motion.states.w[phase]) > measured.speeds.threshold).any(1)
            total += float((np.gradient(motion.states.time[phase]) * moving).sum())
    return total


# Answer of a test: passed, failed or (None) not tested, with figures or the reason.
Answer = tuple[bool | None, str]


def energy_rises(measured: Measured) -> Iterator[tuple[float, str, float]]:
    """Rise of the nominal mechanism's energy in each passive phase in which energy shows.

    The largest, over the range of energy; recording and start [s] in it of the phase. None on a
    base that moves, which gives and takes energy.
    """
    if measured.mechanism.floating:
        return
    top = top_torque(measured)
    for p, (recording, motion) in zip(measured.nominal, measured.pairs, strict=True):
        since = motion.states.time - recording.angle.time[0]
        for phase in passive_phases(recording, motion, top):
            share = energy_rise(measured.mechanism, p, motion, phase)
            if share is not None:
                yield share, recording.name, float(since[phase.start])


def energy_test(measured: Measured) -> tuple[Answer, Finding | None]:
    """Whether energy falls without input, and a finding where it rises."""
    rises = list(energy_rises(measured))
    if not rises:
        return (None, "no passive phase in which the energy exceeds its noise"), None
    share, recording, start = max(rises)
    words = f"rises by at most {percent(share)} of its range, {len(rises)} passive phases"
    if share > RISE:
        where = {"share": share, "recording": recording, "start": start}
        return (False, words), finding("energy", {"rise": share}, where)
    if share > CLEAR:
        words = f"{words}: too much for a yes, too little for a wrong sign or unit"
    return (None if share > CLEAR else True, words), None


def energy_rise(mechanism: Mechanism, p: Array, motion: Motion, phase: slice) -> float | None:
    """Largest rise of energy between two moments of a phase, over its range; noise taken off.

    None where the range is below SHOWS times the noise: nothing could be seen to rise or fall.
    """
    q, w = motion.states.q[phase], motion.states.w[phase]
    terms = mechanism.terms(p, q, w)
    span = float(np.ptp(terms.energy))
    sigma = motion.velocity_noise
    kinetic = np.abs(terms.momentum) @ sigma + 0.5 * np.abs(terms.M @ sigma) @ sigma
    noise = float(np.median(kinetic + np.abs(terms.dLdq) @ motion.angle_noise))
    if span < SHOWS * noise or span == 0.0:
        return None
    rise = float((terms.energy - np.minimum.accumulate(terms.energy)).max())
    return max(rise - 4.0 * noise, 0.0) / span


def rest_tests(
    tests: HypothesisTests, estimate: Estimate
) -> Iterator[tuple[Answer, Finding | None]]:
    """Whether each joint's friction can hold the loads under which it rests, a finding where not.

    The load [N m] is what 90 % of the windows in which the joint rests stay below; if torque and
    gravity added up, it must exceed the band of friction to say anything.
    """
    nominal = tests.rows.at(tests.measured.nominal)
    gravity, torque = nominal.gravity[..., 0], tests.rows.means(tests.measured.torque)
    still, top = _still(tests, nominal.inertia[..., 0], gravity), np.abs(gravity).max(0)
    for j in range(tests.measured.mechanism.n):
        level, error = estimate.at(f"coulomb_{j + 1}")
        push, weight = torque[still[:, j], j], gravity[still[:, j], j]
        if len(push) < FEWEST:
            yield (None, "it hardly rests under load"), None
            continue
        if not np.isfinite(error) or level < 4 * error:
            yield (None, "its Coulomb friction is not known well enough"), None
            continue
        load, possible = (
            float(np.quantile(sizes, 0.9))
            for sizes in (np.abs(push - weight), np.abs(push) + np.abs(weight))
        )
        band = BAND * (level + 2 * error) + 0.02 * float(top[j])
        words = f"|torque - gravity| up to {load:.2g}, Coulomb {level:.2g}"
        if load > band:
            numbers = {"load": load, "band": band}
            yield (False, words), finding("gravity_at_rest", numbers, {"level": level}, j + 1)
        elif possible > band:
            yield (True, words), None
        else:
            yield (None, f"no load that friction could not hold: {words}"), None


def _still(tests: HypothesisTests, inertia: Array, gravity: Array) -> Array:
    """Windows (K, n) in which each joint rests, and those with which parts of it turn."""
    slow = np.abs(tests.rows.w) < tests.measured.speeds.threshold
    # a joint that swings through a reversal is slow on average, too: look at the acceleration
    steady = np.abs(inertia) < 0.02 * np.abs(gravity).max(0) + 1e-12
    acts = tests.measured.mechanism.friction_map != 0
    out: Array = ~(~(slow & ~tests.rows.moving & steady) @ (acts.T @ acts))
    return out


# Residual of most samples over the torque's own size: friction and inertia leave more in any
# measurement. A few samples may differ (the controller's start and end, glitches).
EQUAL, MOST = 0.02, 0.8
_SAMPLES = 500  # of a recording that are used
_FEWEST = 30  # of a recording that a statement needs
_TOGETHER = 50_000  # samples whose gravity is evaluated in one go

# Share of a torque that b + sum of gravity terms leaves, by recording and joint (from 0), of those
# torques that are such a function.
GravityShares = Mapping[tuple[str, int], float]


def gravity_findings(measured: Measured, shares: GravityShares) -> Iterator[Finding]:
    """Findings of joints whose torque is a function of the angles, b + sum of gravity terms."""
    for j in measured.dataset.driven_joints:
        acts = [r.name for r in measured.dataset.recordings if r.torque.value[:, j].any()]
        commands = {name: shares[name, j] for name in acts if (name, j) in shares}
        if not commands:
            continue
        everywhere = len(commands) == len(acts)
        names = ", ".join(repr(name) for name in list(commands)[:3])
        where = f" in {names}{' and others' if len(commands) > 3 else ''}"
        yield finding(
            "commanded_torque",
            {"recordings": float(len(commands)), "remainder": max(commands.values())},
            {"where": "" if everywhere else where},
            j + 1,
            level="" if everywhere else "doubtful",
        )


# Name of a recording, some samples (S, n) of its torques, and the angles (2, S, n) that a
# controller knew then: at these samples, and at the samples before.
_Log = tuple[str, Array, Array]


def gravity_shares(dataset: Dataset) -> GravityShares:
    """Torques that equal a gravity model, and the share of each that it leaves.

    Shares are of most samples, so that a few glitches make neither the torque nor the model.
    """
    out: dict[tuple[str, int], float] = {}
    logs: list[_Log] = []
    for recording in dataset.recordings:
        if len(recording.torque.time) >= _FEWEST:
            logs.append(_log(recording))
        if sum(q[..., 0].size for _, _, q in logs) >= _TOGETHER:
            out |= _shares(dataset, logs)
            logs = []
    return out | _shares(dataset, logs) if logs else out


def _log(recording: Recording) -> _Log:
    torque = recording.torque
    keep = slice(None, None, max(len(torque.time) // _SAMPLES, 1))
    time, dt = torque.time[keep], usual_step(torque.time)
    q = np.stack([sample(recording.angle, time - late) for late in (0.0, dt)])
    return recording.name, torque.value[keep], q


def _shares(dataset: Dataset, logs: list[_Log]) -> dict[tuple[str, int], float]:
    mechanism, n = dataset.mechanism, dataset.mechanism.n
    q = np.concatenate([q.reshape(-1, n) for _, _, q in logs])
    still, any_base = np.zeros_like(q), np.ones((1, len(mechanism.base_names)))
    gravity = mechanism.partials(any_base, q, still, still).by_p
    ends = np.cumsum([q[..., 0].size for _, _, q in logs])[:-1]
    out = {}
    for (name, torque, _), terms in zip(logs, np.split(gravity, ends), strict=True):
        for j in dataset.driven_joints:
            # a controller computes from the sample before or from this one
            share = _share(torque[:, j], np.split(terms[:, j], 2))
            if share is not None:
                out[name, j] = share
    return out


def _share(torque: Array, gravity: list[Array]) -> float | None:
    """Share of a torque (S,) that the best of some gravity terms (S, nb) leaves, None if much."""
    size, varies = _most(np.abs(torque)), _most(np.abs(torque - np.median(torque)))
    if size < 1e-9 or varies < 0.05 * size:
        return None
    share = min(_residual(terms, torque) for terms in gravity) / size
    return share if share < EQUAL else None


def _residual(gravity: Array, torque: Array) -> float:
    """Residual [N m] of most samples after a robust fit of gravity terms (S, nb)."""
    columns = np.column_stack([gravity[:, np.abs(gravity).max(0) > 0], np.ones(len(torque))])
    use = np.ones(len(torque), dtype=bool)
    for _ in range(4):  # trimmed least squares: the samples that fit best decide
        x = np.linalg.lstsq(columns[use], torque[use], rcond=1e-10)[0]
        left = np.abs(torque - columns @ x)
        use = left <= _most(left)
    return _most(left)


def _most(sizes: Array) -> float:
    """Size that most samples do not exceed."""
    place = int(MOST * (len(sizes) - 1))
    return float(np.partition(sizes, place)[place])
