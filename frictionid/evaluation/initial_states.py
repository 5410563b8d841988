"""Initial states of rollouts, the torque that follows, the reference, and the held-out fold."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, scatter, usual_step
from frictionid.data.integrals import averages, pieces_of
from frictionid.data.plants import Calibration, on_recorded_base
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import Servo, open_loop, seen_by_encoder
from frictionid.data.signals import Signal, sample
from frictionid.data.state_estimators import States
from frictionid.dynamics.closed_loop import Controllers, controllers_of
from frictionid.dynamics.state import State
from frictionid.errors import InputError
from frictionid.fitting.one_step.residual import GAP
from frictionid.fitting.shooting import SampleWindows, drive_of, intervals_of, solve_states
from frictionid.friction import Friction, Inputs, Nodes
from frictionid.friction.coordinates import at_places, of_last_joints, recorded_load
from frictionid.mechanics import Plant

from .folds import Folds


class InitialStates(NamedTuple):
    """Rollouts to be made, S side by side over at most T intervals; behind a recording's end: NaN.

    recording, index (S,): where each starts; q, w (S, n): states there; u (T, S, n) [N m];
    dt (T, S) [s]; measured (T + 1, S, n) [rad]; truth the same or None; horizons (H,) [s] and
    last (H, S): interval count that reaches each horizon, -1 where the recording is too short;
    nodes: motion of all recordings before, for the friction's memory; temperature (S, m) [degC] of
    parts with friction at the start, None where it is not known; servos: empty, or one for each,
    with time (S,) [s] and the play (S, n) [rad] of their encoders at the start; base_motion
    (T, S, 9) of a floating base in the intervals, None where it does not move.
    """

    recording: Array
    index: Array  # type: ignore[assignment]  # hides tuple.index, which nobody uses
    q: Array
    w: Array
    u: Array
    dt: Array
    measured: Array
    truth: Array | None
    horizons: Array
    last: Array
    nodes: Nodes
    temperature: Array | None = None
    servos: tuple[Servo, ...] = ()
    time: Array | None = None
    play: Array | None = None
    base_motion: Array | None = None

    @property
    def controllers(self) -> Controllers | None:
        """Controllers that act on the rollouts, None where recorded torque does."""
        if not self.servos or self.time is None:
            return None
        clock = np.concatenate([np.zeros((1, len(self.q))), np.cumsum(self.dt, axis=0)])
        return controllers_of(self.servos, self.time + clock, self.play)

    def take(self, rows: Array) -> "InitialStates":
        """Some (k,) of the rollouts, as often as they are asked for."""
        first = ("recording", "index", "q", "w", "temperature", "time", "play")
        second = ("u", "dt", "measured", "truth", "last", "base_motion")
        return self._replace(**side_by_side(self, rows, first, second))

    def with_rows(self, other: "InitialStates", rows: Array) -> "InitialStates":
        """The initial states with some (k,) of another calibration of the same data."""
        q, u, measured = self.q.copy(), self.u.copy(), self.measured.copy()
        q[rows], u[:, rows] = other.q[rows], other.u[:, rows]
        measured[:, rows] = other.measured[:, rows]
        new = self._replace(q=q, u=u, measured=measured)
        if self.play is None or other.play is None:
            return new
        play, servos = self.play.copy(), list(self.servos)
        play[rows] = other.play[rows]
        for row in rows:
            servos[row] = other.servos[row]
        return new._replace(play=play, servos=tuple(servos))


def make_initial_states(
    dataset: Dataset,
    states: Sequence[States],
    plant: Plant,
    horizons: Sequence[float],
    *,
    every: float,
    begin: float,
) -> InitialStates:
    """Initial states each `every` seconds of every recording from `begin` on, while a horizon fits.

    A horizon is reached at the sample nearest to it. `states` must be known from samples up to each
    time only (`KalmanFilter`) for a fair prediction.

    Raises
    ------
    InputError
        When no recording is long enough for a horizon, or none sampled fast enough.
    """
    horizons_ = np.unique(np.asarray(horizons, dtype=float))
    owner, index, last = _places(dataset.name, states, horizons_, every, begin)
    pairs = list(zip(owner, index, strict=True))
    T = int(last.max())
    each = list(zip(dataset.recordings, states, strict=True))
    torques = [averages(r.torque, s.time) for r, s in each]
    measured = [sample(r.angle, s.time) for r, s in each]
    true = true_states(dataset, states)
    steps = [np.diff(s.time)[:, None] for s in states]
    servos = servos_of(dataset)
    dt = _windows(steps, pairs, T, 1e-3)[..., 0]
    time, q, w = (_at(part, pairs) for part in zip(*(s.motion for s in states), strict=True))
    clock = time + np.concatenate([np.zeros((1, len(time))), np.cumsum(dt, axis=0)])
    heat = temperatures(dataset, [s.time for s in states])
    return InitialStates(
        recording=owner,
        index=index,
        q=q,
        w=w,
        u=_windows(torques, pairs, T, 0.0),
        dt=dt,
        measured=_windows(measured, pairs, T + 1, np.nan),
        truth=None if true is None else _windows([s.q for s in true], pairs, T + 1, np.nan),
        horizons=horizons_,
        last=last,
        nodes=_nodes(dataset, states, plant),
        temperature=None if heat is None else _at(heat, pairs),
        servos=tuple(servos[r] for r in owner) if servos else (),
        time=time,
        play=_at(_play(servos, dataset, states), pairs) if servos else None,
        base_motion=base_motion_between([dataset.recordings[r] for r in owner], clock),
    )


def base_motion_between(recordings: Sequence[Recording], time: Array) -> Array | None:
    """Motion (T, S, 9) of each recording's base midway between times (T + 1, S); None: at rest."""
    motions = [r.base_motion for r in recordings if r.base_motion is not None]
    if len(motions) < len(recordings):
        return None
    middle = (time[1:] + time[:-1]) / 2
    return np.stack([sample(m, t) for m, t in zip(motions, middle.T, strict=True)], axis=1)


def servos_of(dataset: Dataset) -> tuple[Servo, ...]:
    """Servos of all recordings, none where no recording has one.

    Recordings without servo among others have one that makes their torque, whatever the motion.
    """
    if not dataset.servos:
        return ()
    return tuple(r.servo or open_loop(r.torque) for r in dataset.recordings)


def _play(servos: Sequence[Servo], dataset: Dataset, states: Sequence[States]) -> list[Array]:
    """Play (T_i, n) [rad] of encoders at the times of states, by the motion before."""
    play = []
    for servo, recording, s in zip(servos, dataset.recordings, states, strict=True):
        angle = recording.angle
        seen = seen_by_encoder(servo, angle, Signal(s.time, s.q, "linear"))
        lag = Signal(angle.time, angle.value - seen.value, "linear")
        play.append(sample(lag, s.time))
    return play


def true_states(dataset: Dataset, states: Sequence[States]) -> list[States] | None:
    """True states at the times of others; None where some recording's motion is not known."""
    out = []
    for recording, s in zip(dataset.recordings, states, strict=True):
        if recording.truth is None:
            return None
        angle, velocity = recording.truth.angle, recording.truth.velocity
        out.append(s._replace(q=sample(angle, s.time), w=sample(velocity, s.time)))
    return out


def _places(
    name: str, states: Sequence[States], horizons: Array, every: float, begin: float
) -> tuple[Array, Array, Array]:
    """Recording, index (S,) and reached intervals (H, S) of all that reach a horizon."""
    chosen = [_indices(s.time, horizons[0], every, begin) for s in states]
    owner = np.repeat(np.arange(len(chosen)), [len(c) for c in chosen])
    index = np.concatenate(chosen)
    usual = [usual_step(s.time) if len(s.time) > 1 else 0.0 for s in states]
    reached = [
        _reach(states[int(r)].time, k, horizons, usual[int(r)])
        for r, k in zip(owner, index, strict=True)
    ]
    last = np.array(reached, dtype=int).reshape(len(index), len(horizons)).T
    fits = (last > 0).any(axis=1)
    if not fits.all():
        horizon = horizons[np.argmin(fits)]
        raise InputError(
            f"data set {name!r}: no recording holds {begin + horizon:g} s of motion sampled finely "
            f"enough for a rollout of {horizon:g} s: choose other horizons"
        )
    use = (last > 0).any(axis=0)
    return owner[use], index[use], last[:, use]


def _indices(time: Array, shortest: float, every: float, begin: float) -> Array:
    if len(time) < 2 or time[0] + begin > time[-1] - shortest + 1e-9:
        return np.empty(0, dtype=int)
    step = max(every, float(np.diff(time).min()))  # no two at one sample
    wanted = np.arange(time[0] + begin, time[-1] - shortest + 1e-9, step)
    return np.unique(np.searchsorted(time, wanted - 1e-9))


def _reach(time: Array, index: int, horizons: Array, interval: float) -> Array:
    """Intervals from a start to the sample nearest each horizon, -1 where none is near.

    That is beyond the recording's end, in or behind a gap, or before the next sample.

    interval : [s], usual one of the recording
    """
    end = np.searchsorted(time, time[index] + horizons[-1] + 2 * interval, side="right") + 1
    ahead = time[index : int(end)] - time[index]
    nearest = np.searchsorted((ahead[1:] + ahead[:-1]) / 2, horizons)
    off = np.abs(ahead[nearest] - horizons)
    inside = horizons <= ahead[-1] + 0.5 * interval
    gaps = np.flatnonzero(np.diff(ahead) > GAP * interval)
    whole = nearest <= (gaps[0] if len(gaps) else len(ahead))
    return np.where(inside & whole & (nearest > 0) & (off <= interval), nearest, -1)


def _at(series: Sequence[Array], pairs: Sequence[tuple[int, int]]) -> Array:
    """Rows (S, ...) of the recordings' series, by recording and index."""
    return np.stack([series[r][k] for r, k in pairs])


def _windows(
    series: Sequence[Array], pairs: Sequence[tuple[int, int]], length: int, fill: float
) -> Array:
    return padded([series[r][k : k + length] for r, k in pairs], length, fill)


def side_by_side(
    motions: Any, rows: Array, first: Sequence[str], second: Sequence[str]
) -> dict[str, Any]:
    """Fields of some (k,) motions: servos, and arrays along whose first or second axis they are."""
    chosen: dict[str, Any] = {"servos": tuple(motions.servos[i] for i in rows if motions.servos)}
    for axis, names in enumerate((first, second)):
        for name in names:
            values = getattr(motions, name)
            chosen[name] = None if values is None else np.take(values, rows, axis)
    return chosen


def padded(parts: Sequence[Array], length: int, fill: float) -> Array:
    """Parts (T_i, n) side by side, shape (length, S, n), with a number behind their ends."""
    out = np.full((length, len(parts), parts[0].shape[1]), fill)
    for i, part in enumerate(parts):
        out[: len(part), i] = part
    return out


def temperatures(dataset: Dataset, times: Sequence[Array]) -> list[Array] | None:
    """Temperatures (T_i, m) [degC] of all parts at times of recordings; None: one is not known."""
    machine, pairs = dataset.mechanism, zip(dataset.recordings, times, strict=True)
    each = [recording.temperature_at(time, machine.joints) for recording, time in pairs]
    measured = [of_last_joints(machine, T) for T in each if T is not None]
    return measured if len(measured) == len(each) else None


def _nodes(dataset: Dataset, states: Sequence[States], plant: Plant) -> Nodes:
    sizes = [len(s.time) for s in states]
    u, load = [], []
    for i, (recording, s) in enumerate(zip(dataset.recordings, states, strict=True)):
        u.append(sample(recording.torque, s.time))
        machine = on_recorded_base(plant[i], recording, s.time)
        load.append(recorded_load(machine, *s.motion, u[-1]))
    time, q, w = (
        np.concatenate(column) for column in zip(*(s.motion for s in states), strict=True)
    )
    inputs = at_places(plant.mechanism, Inputs(q, w, np.concatenate(u), np.concatenate(load)))
    return Nodes(inputs, time, np.concatenate([[0], np.cumsum(sizes)]))


def initial_state_folds(initial: InitialStates, folds: Folds, states: Sequence[States]) -> Array:
    """Fold that holds out each rollout up to each horizon, (H, S); -1 where none does.

    Raises
    ------
    InputError
        When no fold holds out any rollout over one of the horizons.
    """
    out = np.full(initial.last.shape, -1)
    for h, s in np.argwhere(initial.last > 0):
        r, k = int(initial.recording[s]), int(initial.index[s])
        time = states[r].time
        fold = folds.whole(r, time[k], time[k + initial.last[h, s]])
        out[h, s] = -1 if fold is None else fold
    held = (out >= 0).any(axis=1)
    if not held.all():
        raise InputError(
            f"no fold holds out {initial.horizons[np.argmin(held)]:g} s of motion in one piece: "
            "choose shorter horizons or fewer folds"
        )
    return out


SAMPLES = 20
_PIECE = 0.009  # [s] of the physics step away from rest
_LOST = 0.3  # [rad]


def preceding_samples(
    dataset: Dataset, states: Sequence[States], initial: InitialStates
) -> SampleWindows:
    """Up to 20 samples before each initial state, with filtered states (`KalmanFilter`)."""
    intervals = intervals_of(dataset, states=tuple(states))
    sizes = np.array([len(s.time) for s in states])
    place = np.full(int(sizes.sum()), -1)
    first = np.concatenate([[0], np.cumsum(sizes)])
    place[first[intervals.recording] + intervals.index] = np.arange(len(intervals.time))
    rows, windows = [], np.full((len(initial.index), SAMPLES), -1)
    count = 0
    for s, (r, k) in enumerate(zip(initial.recording, initial.index, strict=True)):
        samples = place[first[r] + max(0, k - SAMPLES) : first[r] + k]
        gaps = np.flatnonzero(samples < 0) + 1
        samples = samples[max(gaps, default=0) :]  # behind a gap
        windows[s, : len(samples)] = count + np.arange(len(samples))
        rows.append(samples)
        count += len(samples)
    index = np.concatenate(rows).astype(int)
    part = intervals.take(index)
    pieces = int(np.ceil(float(np.median(part.dt)) / _PIECE - 1e-6))
    share = np.arange(max(pieces, 1) + 1) / max(pieces, 1)
    ideal = Calibration.ideal(intervals.n)
    drive = drive_of(intervals, ideal, dataset.mechanism)
    edges = part.time[:, None] + part.dt[:, None] * share
    u = pieces_of(drive.torque, part.recording, edges).mean
    loop = None if drive.loop is None else drive.loop.feedback[index]
    sigma = scatter(intervals.before - intervals.q)
    return SampleWindows(part, windows, u * dataset.actuated, np.maximum(sigma, 1e-6), loop)


def estimate_initial_states(
    plant: Plant, friction: Friction, preceding: SampleWindows, initial: InitialStates
) -> State:
    """Initial states (S, n), with memory, of frictions (S, n, P) on plants with one entry each.

    Where a model finds no motion that leads to the initial state, that of the filter stands.
    """
    intervals = preceding.intervals
    end, gap = solve_states(preceding, plant, friction)
    preceded = preceding.windows[:, 0] >= 0
    last = preceding.windows[preceded].max(axis=1)
    near = np.abs(end.q - intervals.after[last]).max(axis=-1) < _LOST
    near &= gap < 10.0 * preceding.sigma.max()
    for entry in (end.q, end.w, *end.memory):
        near &= np.isfinite(entry).all(-1)
    zero = 0.0 * initial.q
    x = at_places(plant.mechanism, Inputs(initial.q, initial.w, zero, zero))
    first = friction.law.start(friction.theta, x)
    memory = (np.array(np.broadcast_to(z, x.q.shape)) for z in first)
    state = State(initial.q.copy(), initial.w.copy(), tuple(memory))
    good = np.flatnonzero(preceded)[near]
    pairs = zip((state.q, state.w, *state.memory), (end.q, end.w, *end.memory), strict=True)
    for whole, entry in pairs:
        whole[good] = entry[near]
    return state
