"""Tests of passivity: energy must fall without input, and friction must hold loads at rest."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, usual_step
from frictionid.data.clock_facts import run_edges
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import sample
from frictionid.mechanics import Mechanism

from .findings import Finding, finding, percent
from .hypothesis_tests import HypothesisTests
from .motion import Measured, Motion
from .regression import Estimate

# Shortest passive phase [s]; energy may seem to rise by this share of its range in it.
PHASE, RISE = 0.5, 0.25
# The range of energy in it exceeds the noise this many times.
SHOWS = 20.0
# A rise that smoothing and masses that are a little off make.
CLEAR = 0.05
# At rest the load stays below this many times the Coulomb level: break-away peaks are smaller.
BAND = 2.5
FEWEST = 10  # windows at rest that a statement needs


def passive_phases(recording: Recording, motion: Motion) -> list[slice]:
    """Samples of the motion without torque, for at least PHASE each."""
    level = 1e-3 * float(np.abs(recording.torque.value).max())
    u = np.abs(sample(recording.torque, motion.states.time)).max(axis=1)
    time = motion.states.time
    return [
        slice(int(a), int(b))
        for a, b in zip(*run_edges(u <= level), strict=True)
        if time[b - 1] - time[a] >= PHASE
    ]


def passive_time(measured: Measured) -> float:
    """Time [s] without torque in which something moves."""
    total = 0.0
    for recording, motion in zip(measured.dataset.recordings, measured.motions, strict=True):
        for phase in passive_phases(recording, motion):
            moving = (np.abs(motion.states.w[phase]) > measured.speeds.threshold).any(1)
            total += float((np.gradient(motion.states.time[phase]) * moving).sum())
    return total


# Answer of a test: passed, failed or (None) not tested, with figures or the reason.
Answer = tuple[bool | None, str]


class Rise(NamedTuple):
    """Largest rise of energy in a passive phase, over its range; recording and start [s]."""

    share: float
    recording: str
    start: float


def energy_rises(measured: Measured) -> list[Rise]:
    """Rise of the nominal mechanism's energy in each passive phase in which energy shows.

    None on a base that moves, which gives and takes energy.
    """
    out: list[Rise] = []
    if measured.mechanism.floating:
        return out
    for p, recording, motion in zip(
        measured.nominal, measured.dataset.recordings, measured.motions, strict=True
    ):
        for phase in passive_phases(recording, motion):
            share = energy_rise(measured.mechanism, p, motion, phase)
            if share is not None:
                out.append(Rise(share, recording.name, float(motion.states.time[phase.start])))
    return out


def energy_answer(measured: Measured) -> Answer:
    """Whether energy falls without input."""
    rises = energy_rises(measured)
    if not rises:
        return None, "no passive phase in which the energy exceeds its noise"
    share = max(rises).share
    words = f"rises by at most {percent(share)} of its range, {len(rises)} passive phases"
    if CLEAR < share <= RISE:
        return None, f"{words}: too much for a yes, too little for a wrong sign or unit"
    return share <= RISE, words


def energy_findings(measured: Measured) -> Iterator[Finding]:
    """A finding where the nominal mechanism's energy rises in passive phases."""
    worst = max(energy_rises(measured), default=Rise(0.0, "", 0.0))
    if worst.share > RISE:
        words = {"recording": worst.recording, "start": worst.start}
        yield finding("energy", {"rise": worst.share}, words)


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


class RestLoad(NamedTuple):
    """Load [N m] of a joint at rest: what 90 % of the windows stay below, and what it may be.

    possible : the load if torque and gravity added up, which the band must exceed to say anything
    """

    joint: int
    level: float
    high: float
    band: float
    possible: float


def rest_answers(tests: HypothesisTests, estimate: Estimate) -> list[Answer]:
    """Whether each joint's friction can hold the loads under which it rests."""
    out: list[Answer] = []
    for load in _rest_loads(tests, estimate):
        if isinstance(load, str):
            out.append((None, load))
            continue
        words = f"|torque - gravity| up to {load.high:.2g}, Coulomb {load.level:.2g}"
        if load.high <= load.band and load.possible <= load.band:
            out.append((None, f"no load that friction could not hold: {words}"))
        else:
            out.append((load.high <= load.band, words))
    return out


def rest_findings(tests: HypothesisTests, estimate: Estimate) -> Iterator[Finding]:
    """Findings of joints that rest under loads which their friction could not hold."""
    for load in _rest_loads(tests, estimate):
        if isinstance(load, RestLoad) and load.high > load.band:
            numbers = {"load": load.high, "band": load.band}
            yield finding("gravity_at_rest", numbers, {"level": load.level}, load.joint)


def _rest_loads(tests: HypothesisTests, estimate: Estimate) -> list[RestLoad | str]:
    """Load of each joint over the windows in which all rest, or why there is none to test."""
    nominal = tests.rows.at(tests.measured.nominal)
    gravity, torque = nominal.gravity[..., 0], tests.rows.means(tests.measured.torque)
    still, top = _still(tests, nominal.inertia[..., 0], gravity), np.abs(gravity).max(0)
    out: list[RestLoad | str] = []
    for j in range(tests.measured.mechanism.n):
        level, error = estimate.at(f"coulomb_{j + 1}")
        push, weight = torque[still, j], gravity[still, j]
        if len(push) < FEWEST:
            out.append("it hardly rests under load")
        elif not np.isfinite(error) or level < 4 * error:
            out.append("its Coulomb friction is not known well enough")
        else:
            high, possible = (
                float(np.quantile(load, 0.9))
                for load in (np.abs(push - weight), np.abs(push) + np.abs(weight))
            )
            band = BAND * (level + 2 * error) + 0.02 * float(top[j])
            out.append(RestLoad(j + 1, level, high, band, possible))
    return out


def _still(tests: HypothesisTests, inertia: Array, gravity: Array) -> Array:
    """Windows (K,) in which all joints rest."""
    slow = (np.abs(tests.rows.w) < tests.measured.speeds.threshold).all(1)
    # a joint that swings through a reversal is slow on average, too: look at the acceleration
    steady = (np.abs(inertia) < 0.02 * np.abs(gravity).max(0) + 1e-12).all(1)
    out: Array = slow & ~tests.rows.moving.any(1) & steady
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
    for j in np.flatnonzero(measured.mechanism.driven).tolist():
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


class _Log(NamedTuple):
    """Some samples (S,) of a recording's torques, with the angles that a controller knew then.

    torque (S, n) ; q (2, S, n) : angles at these samples, and at the samples before
    """

    name: str
    torque: Array
    q: Array


def gravity_shares(dataset: Dataset) -> GravityShares:
    """Torques that equal a gravity model, and the share of each that it leaves.

    Shares are of most samples, so that a few glitches make neither the torque nor the model.
    """
    out: dict[tuple[str, int], float] = {}
    logs: list[_Log] = []
    for recording in dataset.recordings:
        if len(recording.torque.time) >= _FEWEST:
            logs.append(_log(recording))
        if sum(log.q[..., 0].size for log in logs) >= _TOGETHER:
            out |= _shares(dataset, logs)
            logs = []
    return out | _shares(dataset, logs) if logs else out


def _log(recording: Recording) -> _Log:
    torque = recording.torque
    keep = slice(None, None, max(len(torque.time) // _SAMPLES, 1))
    time, dt = torque.time[keep], usual_step(torque.time)
    q = np.stack([sample(recording.angle, time - late) for late in (0.0, dt)])
    return _Log(recording.name, torque.value[keep], q)


def _shares(dataset: Dataset, logs: list[_Log]) -> dict[tuple[str, int], float]:
    mechanism, n = dataset.mechanism, dataset.mechanism.n
    q = np.concatenate([log.q.reshape(-1, n) for log in logs])
    still, any_base = np.zeros_like(q), np.ones((1, len(mechanism.base_names)))
    gravity = mechanism.partials(any_base, q, still, still).by_p
    ends = np.cumsum([log.q[..., 0].size for log in logs])[:-1]
    out = {}
    for log, terms in zip(logs, np.split(gravity, ends), strict=True):
        for j in np.flatnonzero(mechanism.driven).tolist():
            # a controller computes from the sample before or from this one
            share = _share(log.torque[:, j], np.split(terms[:, j], 2))
            if share is not None:
                out[log.name, j] = share
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
