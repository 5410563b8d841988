"""Free runs: whole recordings simulated from their initial state, without any correction.

Where a servo drives, it drives the simulation, too: the firmware acts on the *simulated* angle and
the back-EMF is that of the simulated velocity, as in the position errors of [Duclusaud2025]; under
the recorded voltage it would drift away within a second, because nothing pulls it back to the goal.
All other recordings run under their recorded torque.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, usual_step
from frictionid.data.integrals import averages
from frictionid.data.joint_scales import joint_sizes, norm_of
from frictionid.data.recordings import Dataset
from frictionid.data.servo import Servo, servo_torque
from frictionid.data.signals import sample
from frictionid.data.state_estimators import States
from frictionid.dynamics.closed_loop import closed_loop, controllers_of
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.mechanics import Plant

from .folds import Folds
from .initial_states import base_motion_between, padded, servos_of, side_by_side, temperatures
from .score_frame import Score, parts_of

_AT_ONE_TEMPERATURE = 100  # intervals


class Trajectory(NamedTuple):
    """Whole recordings side by side, R over at most T intervals.

    names; time (T + 1, R) [s]; q, w (R, n): initial states; u (T, R, n) [N m] recorded torque;
    measured (T + 1, R, n) [rad], NaN behind a recording's end; servos: see `servos_of`;
    temperature (T + 1, R, m) [degC] of parts with friction, None where it is not known;
    base_motion (T, R, 9) of a floating base in the intervals, None where it does not move.
    """

    names: tuple[str, ...]
    time: Array
    q: Array
    w: Array
    u: Array
    measured: Array
    servos: tuple[Servo, ...]
    temperature: Array | None = None
    base_motion: Array | None = None

    @property
    def dt(self) -> Array:
        """Length of each interval, (T, R) [s]."""
        return np.diff(self.time, axis=0)

    def take(self, rows: Array) -> "Trajectory":
        """Some of the recordings."""
        second = ("time", "u", "measured", "temperature", "base_motion")
        chosen = side_by_side(self, rows, ("q", "w"), second)
        return self._replace(names=tuple(self.names[r] for r in rows), **chosen)


def with_motor_torque(dataset: Dataset, plant: Plant) -> Dataset:
    """The data set with the torque that the plant's motors make of its voltages.

    It is the same where the plant has no motor constants, or a recording knows no servo.
    """
    if "kt" not in plant.parameters:
        return dataset
    pairs = zip(plant.parameters["kt"], plant.parameters["R"], strict=True)
    recordings = list(dataset.recordings)
    for i, (recording, (kt, R)) in enumerate(zip(dataset.recordings, pairs, strict=True)):
        if recording.servo is not None and kt > 0 and R > 0:
            servo = recording.servo.with_motor(kt, R)
            torque = servo_torque(servo, recording.angle)
            recordings[i] = replace(recording, servo=servo, torque=torque)
    return replace(dataset, recordings=tuple(recordings))


def make_trajectory(dataset: Dataset, states: Sequence[States], begin: float = 0.0) -> Trajectory:
    """All recordings from `begin` [s] after their first sample to their end.

    The states (`KalmanFilter`, for a fair prediction) give the initial state.
    """
    first = [int(np.searchsorted(s.time, s.time[0] + begin - 1e-9)) for s in states]
    times = [s.time[k:] for s, k in zip(states, first, strict=True)]
    for r, time in zip(dataset.recordings, times, strict=True):
        if len(time) < 2:
            raise InputError(
                f"recording {r.name!r} ends within the history of {begin:g} s: shorten the "
                "history, or leave the recording out"
            )
    T = max(map(len, times)) - 1
    clocks = [_lengthened(time, T + 1) for time in times]
    clock = np.stack(clocks, axis=1)
    each, pairs = temperatures(dataset, clocks), list(zip(dataset.recordings, times, strict=True))
    return Trajectory(
        names=dataset.names,
        time=clock,
        q=np.stack([s.q[k] for s, k in zip(states, first, strict=True)]),
        w=np.stack([s.w[k] for s, k in zip(states, first, strict=True)]),
        u=padded([averages(r.torque, time) for r, time in pairs], T, 0.0),
        measured=padded([sample(r.angle, time) for r, time in pairs], T + 1, np.nan),
        servos=servos_of(dataset),
        temperature=None if each is None else np.stack(each, axis=1),
        base_motion=base_motion_between(dataset.recordings, clock),
    )


def _lengthened(time: Array, length: int) -> Array:
    """A clock that ticks on behind its end at its usual interval."""
    after = np.arange(1, length - len(time) + 1) * usual_step(time)
    return np.concatenate([time, time[-1] + after])


def free_run(plant: Plant, friction: Friction, trajectory: Trajectory) -> Array:
    """Angles (T + 1, R, n) [rad] of all recordings, simulated from their initial state only.

    plant, friction : with one batch entry for each recording, or one for all
    """
    start, along = State(trajectory.q, trajectory.w), trajectory.base_motion
    if trajectory.servos:
        controllers = controllers_of(trajectory.servos, trajectory.time)
        return closed_loop(plant, friction, start, controllers, trajectory.temperature, along).q
    if friction.law.uses_temperature:
        return _warming(plant, friction, trajectory)
    return rollout(plant, friction, start, trajectory.u, trajectory.dt, base_motion=along).q


def _warming(plant: Plant, friction: Friction, trajectory: Trajectory) -> Array:
    """Angles (T + 1, R, n) where friction depends on the temperature: a piece at a time.

    Friction of each piece is that at the temperature of its start. Such laws have no memory.
    """
    q, state = [trajectory.q[None]], State(trajectory.q, trajectory.w)
    T = trajectory.temperature
    for begin in range(0, len(trajectory.u), _AT_ONE_TEMPERATURE):
        rows = slice(begin, begin + _AT_ONE_TEMPERATURE)
        there = friction.at_temperature(None if T is None else T[begin])
        along = None if trajectory.base_motion is None else trajectory.base_motion[rows]
        u, dt = trajectory.u[rows], trajectory.dt[rows]
        motion = rollout(plant, there, state, u, dt, base_motion=along)
        state = State(motion.q[-1], motion.w[-1])
        q.append(motion.q[1:])
    return np.concatenate(q)


def trajectory_folds(trajectory: Trajectory, folds: Folds) -> Array:
    """Fold that holds out each whole recording (R,), -1 where none does.

    Raises
    ------
    InputError
        When no fold holds out any recording as a whole.
    """
    last = np.isfinite(trajectory.measured[..., 0]).sum(axis=0) - 1
    held = [
        folds.whole(r, trajectory.time[0, r], trajectory.time[k, r]) for r, k in enumerate(last)
    ]
    if all(fold is None for fold in held):
        raise InputError(
            'whole = true: no fold holds out a whole recording: set folds.kind = "recordings"'
        )
    return np.array([-1 if fold is None else fold for fold in held])


def free_run_scores(
    q: Array, trajectory: Trajectory, fold: Array, units: Sequence[str]
) -> Iterator[Score]:
    """Mean and RMS position errors of free runs q (T + 1, R, n), in the joints' units.

    Both are taken over each recording, then over the recordings: of each fold (R,), and of all that
    a fold holds out; a recording's own stand under the statistic "mean NAME" and "rms NAME".
    """
    error = q - trajectory.measured
    error = np.where(np.isfinite(error), error, np.inf)
    error[~np.isfinite(trajectory.measured).all(-1)] = np.nan
    held, sizes = np.flatnonzero(fold >= 0), joint_sizes(units, trajectory.measured)
    for size, part in parts_of(error[:, held], fold[held], Score("all", "free_run"), units, sizes):
        yield from _pooled(size, part)
    norm, unit = norm_of(error, units, sizes)
    for r in held:
        name = f" {trajectory.names[r]}"
        yield from _pooled(norm[:, [r]], Score("all", "free_run", unit=unit), name)


def _pooled(error: Array, score: Score, name: str = "") -> Iterator[Score]:
    mean, square = (np.nanmean(error**power, axis=0) for power in (1, 2))
    values = {"mean": float(mean.mean()), "rms": float(np.sqrt(square.mean()))}
    for statistic, value in values.items():
        yield score._replace(statistic=f"{statistic}{name}", value=value)
