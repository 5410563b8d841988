"""Torque left: what a model does not explain of the measured torque, per joint and together.

Over windows of 0.05 s, of the momentum balance along the smoothed motion,

    left = mean of G^-1 e = mean of (u - Tf - what the rigid bodies need)    [N m]

with the one-step residual e = r - G Tf [Gautier1991]. Windows in which a joint rests or reverses do
not count for it: there friction is whatever holds the joint. None counts within 0.1 s of one that
lacks three times the largest torque that was measured, or that 95 % of the windows lack: no
friction is so large, an angle jumped. Shares are of the root mean square of the measured torque in
the windows that count.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from frictionid.arrays import Array, solve
from frictionid.data.joint_scales import are_mixed
from frictionid.data.recordings import Dataset
from frictionid.fitting.one_step.residual import IN_TURN, Problem, stiction_mask
from frictionid.friction import Friction, along
from frictionid.mechanics import Mechanism

from .folds import Folds
from .prepared import Prepared, prepared_for, with_calibration
from .score_frame import Score

LEFT, NOMINAL, MEASURED = "torque_left", "torque_left_nominal", "torque_measured"
NOISE = "torque_left_noise"
_WINDOW = 0.05  # [s]
_NOTHING = 1e-300
_JUMP, _NEAR = 3.0, 2  # times the largest measured torque; windows beside
_SHOWN, _SPANS = 8.0, 240  # [s] about the middle of a recording, and spans in it
_COMPLETE = 0.5  # of the usual length: shorter windows, at gaps and ends of folds, do not count


def has_torque(dataset: Dataset) -> bool:
    """Whether torques were measured: some are not zero, and none follows from a servo's voltage."""
    return bool(dataset.actuated.any()) and not dataset.servos


def row_torques(problem: Problem, residual: Array, use: Array) -> Array:
    """Torques (2, k, n) [N m] of k rows: what a residual (k, n) leaves, and the measured one.

    use : (K,) true for the k rows of a momentum balance
    """
    n = residual.shape[-1]
    middle = problem.stencil[use, 1]  # where the mean torque of the interval stands
    u = problem.nodes.inputs.u[middle, :n]
    return np.stack([solve(problem.G[use][:, :n, :n], residual), u])


class TorqueWindows(NamedTuple):
    """Means over W windows: the torque left and the measured one (W, n) [N m], which count (W, n).

    What does not count is zero. recording, fold : (W,) of each
    """

    left: Array
    measured: Array
    counts: Array
    recording: Array
    fold: Array

    @property
    def error(self) -> Array:
        """The torque left (W, n) in units of the measured torque of all joints."""
        number = np.maximum(self.counts.sum(axis=0), 1)
        squares = (self.measured**2).sum(axis=0) / number
        return self.left / np.sqrt(np.maximum(squares.sum(), _NOTHING))


def torque_windows(
    torque: Array, problem: Problem, fold: Array, mechanism: Mechanism
) -> TorqueWindows:
    """Windows of torques (2, K, n), see `row_torques`; fold : (K,) of each row, -1 for none."""
    turns = mechanism.friction_map != 0
    rests = stiction_mask(problem, None, IN_TURN) @ turns
    number = np.floor(problem.time / _WINDOW + 1e-9).astype(int)
    rows = np.flatnonzero(fold >= 0)
    keys = np.stack([fold, problem.recording, number], axis=1)[rows]
    windows, place = np.unique(keys, axis=0, return_inverse=True)
    place, dt = place.reshape(-1), problem.dt[rows]
    n = torque.shape[-1]
    lacking = solve(problem.G[rows][:, :n, :n], problem.r[rows, :n])  # without any friction
    counts = np.ones((len(windows), n), dtype=bool)
    np.logical_and.at(counts, place, ~rests[rows])
    length = np.bincount(place, dt)
    counts &= (length >= _COMPLETE * np.median(length))[:, None]
    each = (*torque[:, rows], lacking)
    left, measured, lacking = (means_of(values, place, dt) for values in each)
    usual = np.quantile(np.abs(lacking), 0.95, axis=0)  # of motors that are off
    most = np.maximum(np.abs(torque[1, rows]).max(axis=0), usual)
    jumped = (np.abs(lacking) > _JUMP * most).any(axis=1)
    counts &= ~_beside(jumped, windows[:, 1])[:, None]
    left, measured = np.where(counts, [left, measured], 0.0)
    return TorqueWindows(left, measured, counts, windows[:, 1], windows[:, 0])


def means_of(values: Array, place: Array, weight: Array) -> Array:
    """Means (G, n) of the rows of values (K, n) at each of G places (K,), each row by its weight.

    >>> means_of(np.array([[1.0], [2.0], [6.0]]), np.array([0, 1, 1]), np.array([1.0, 3.0, 1.0]))
    array([[1.],
           [3.]])
    """
    total = np.bincount(place, weight)
    sums = np.zeros((len(total), values.shape[-1]))
    np.add.at(sums, place, values * weight[:, None])
    return sums / total[:, None]


def _beside(windows: Array, recording: Array) -> Array:
    """The windows of a mask (W,), and those beside them in the same recording.

    >>> _beside(np.arange(6) == 0, np.array([0, 0, 0, 0, 1, 1])).astype(int)
    array([1, 1, 1, 0, 0, 0])
    """
    out = windows.copy()
    for k in range(1, _NEAR + 1):
        same = recording[k:] == recording[:-k]
        out[k:] |= windows[:-k] & same
        out[:-k] |= windows[k:] & same
    return out


def torque_scores(
    windows: TorqueWindows, mechanism: Mechanism, name: str = LEFT
) -> Iterator[Score]:
    """Torque left in each joint, [N m] and as a share, and together, of each fold and of all."""
    mean, counts, owner = np.stack(windows[:2]), windows.counts, windows.fold
    number = np.maximum(counts.sum(axis=0), 1)
    left, measured = np.sqrt((mean**2).sum(axis=1) / number)
    for j in np.flatnonzero(counts.any(axis=0)):
        joint, unit = str(j + 1), mechanism.torque_units[j]
        yield Score("all", name, "rms", joint=joint, value=float(left[j]), unit=unit)
        if measured[j] > 0:
            yield Score("all", name, "share", joint=joint, value=float(left[j] / measured[j]))
            yield Score("all", MEASURED, "rms", joint=joint, value=float(measured[j]), unit=unit)
    mixed = are_mixed(mechanism.torque_units)
    for label, rows in (*((str(f), owner == f) for f in np.unique(owner)), ("all", owner >= 0)):
        value = _together((mean[:, rows] ** 2).sum(axis=1), mixed)
        if np.isfinite(value):
            yield Score(label, name, "share", value=value)


def torque_parts(problem: Problem, residual: Array) -> dict[str, Array]:
    """Torques (T, n) [N m] at times (T,) [s] of the first recording, means over equal spans.

    time, measured; model : by rigid bodies and friction, rigid : by rigid bodies alone

    residual : (K, n) of the momentum balance
    """
    rows = problem.recording == 0
    n, time, dt = residual.shape[-1], problem.time[rows], problem.dt[rows]
    left, measured = row_torques(problem, residual[rows], rows)
    friction_and_left, _ = row_torques(problem, problem.r[rows, :n], rows)
    middle, half = float(np.mean(time[[0, -1]])), _SHOWN / 2
    span = np.floor((time - middle + half) / (_SHOWN / _SPANS)).astype(int)
    inside = (span >= 0) & (span < _SPANS)
    _, place = np.unique(span[inside], return_inverse=True)
    each = {
        "time": time[:, None],
        "measured": measured,
        "model": measured - left,
        "rigid": measured - friction_and_left,
    }
    parts = {name: means_of(values[inside], place, dt[inside]) for name, values in each.items()}
    return {**parts, "time": parts["time"][:, 0]}


def _together(squares: Array, mixed: bool) -> float:
    """Share of all motors' torques by sums of squares (2, n); of joints of two kinds the mean."""
    left, measured = squares[:, squares[1] > 0]
    if not len(left):
        return float("nan")
    return float(np.sqrt(np.mean(left / measured) if mixed else left.sum() / measured.sum()))


def nominal_torque_scores(prepared: Prepared, folds: Folds | None = None) -> Iterator[Score]:
    """Torque that the mechanism leaves without friction, and at most noise of the angles alone.

    prepared : the uncorrected data; folds : on the rows that they hold out, on all by default
    """
    problem, mechanism = prepared.integral, prepared.plant.mechanism
    if has_torque(prepared.dataset):
        held = np.zeros(len(problem.r), dtype=int)
        held = held if folds is None else folds.held_out(problem.recording, problem.time)
        left = {NOMINAL: problem.r[:, : mechanism.n], NOISE: _velocity_noise(prepared)}
        for name, residual in left.items():
            scores = _scores(problem, residual, held, mechanism, name)
            yield from (score for score in scores if score.score == name and score.fold == "all")


def _scores(
    problem: Problem, residual: Array, held: Array, mechanism: Mechanism, name: str = LEFT
) -> Iterator[Score]:
    """Torque left by residuals (K, n) of the momentum balance, held out by folds (K,)."""
    torque = row_torques(problem, residual, held >= 0)
    return torque_scores(torque_windows(torque, problem, held, mechanism), mechanism, name)


def _velocity_noise(prepared: Prepared) -> Array:
    """What noise alone would leave (K, n) [rad/s], were it free from sample to sample: at most."""
    problem, n = prepared.integral, prepared.plant.mechanism.n
    size = np.array([np.broadcast_to(states.noise, n) for states in prepared.smoothed])
    draw = np.random.default_rng(0).standard_normal((len(problem.r) + 1, n))
    return np.diff(draw, axis=0) * size[problem.recording]


def torque_left(friction: Friction, prepared: Prepared) -> Iterator[Score]:
    """Torque that one friction (n, P) leaves of data, and that of the mechanism without friction.

    Parameters as in `score_model`; `prepared` is the uncorrected data.
    """
    if friction.mechanism or not has_torque(prepared.dataset):
        return
    problem, residual = _balance(friction, prepared)
    every = np.zeros(len(residual), dtype=int)
    yield from _scores(problem, residual, every, prepared.plant.mechanism)
    yield from nominal_torque_scores(prepared)


def torque_example(friction: Friction, prepared: Prepared) -> dict[str, Any] | None:
    """Torque over time, measured and by one friction (n, P); None where none was measured.

    Parameters as in `torque_left`.
    """
    if friction.mechanism or not has_torque(prepared.dataset):
        return None
    problem, residual = _balance(friction, prepared)
    name = prepared.dataset.recordings[0].name
    return {"recording": name, **torque_parts(problem, residual)}


def _balance(friction: Friction, prepared: Prepared) -> tuple[Problem, Array]:
    """The momentum balance of data corrected for a friction (n, P), and what it leaves (K, n)."""
    data = with_calibration(prepared_for(prepared, friction), friction.calibration)
    problem = data.integral
    return problem, problem.residual(along(sliding(friction), problem.nodes))[:, : data.plant.n]


def sliding(friction: Friction) -> Friction:
    """The friction without numerical smoothing, which slow joints that slide would seem to lack."""
    return replace(friction, law=friction.law.sharpened())


_FRAME = {
    "measured_rms": (MEASURED, "rms"),
    "left_rms": (LEFT, "rms"),
    "left": (LEFT, "share"),
    "nominal_rms": (NOMINAL, "rms"),
    "nominal": (NOMINAL, "share"),
    "noise": (NOISE, "share"),
}


def torque_frame(scores: Iterable[Sequence[Any]]) -> pd.DataFrame:
    """Torque left by the scores of one model: a line for each joint, and one for all; or none.

    Joints that never slide are left out. Columns: joint, unit, measured_rms, left_rms, left,
    nominal_rms, nominal (without friction, by the mechanism as the data set has it), noise (what
    that of the angles alone leaves, at most); `left`, `nominal`, `noise` are shares of the measured
    torque.
    """
    values = {
        (s.score, s.statistic, s.joint): s
        for s in (Score(*row) for row in scores)
        if s.fold == "all"
    }
    joints = sorted(
        (joint for score, rms, joint in values if (score, rms) == (LEFT, "rms")), key=int
    )
    none = Score("all", "")
    lines = []
    for joint in [*joints, *["all"] * bool(joints)]:
        numbers = [values.get((*kind, joint), none) for kind in _FRAME.values()]
        unit = "" if joint == "all" else numbers[1].unit
        lines.append((joint, unit, *(s.value for s in numbers)))
    return pd.DataFrame(lines, columns=["joint", "unit", *_FRAME])
