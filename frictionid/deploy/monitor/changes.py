"""What each recording says of all that may have changed, by a linear fit about a reference.

To the reference friction a change is added that is linear in four numbers of each joint,

    change = coulomb s + viscous w + stribeck exp(-(w/v)^2) s + asymmetry,   s = sgn(w)

and is fitted to the one-step residual of the momentum balance, together with a payload's inertia,
the torque's delay and gain, and the offset of each angle, as of a camera that was tilted: what
`effects_of` lists, with wide priors. Each recording keeps the curvature of its fit, so that
recordings that tell less count less. Stretches that no constant change explains, such as a push,
are left out and named.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import MAD, Array, huber_weight, joined, picked, times, usual_step
from frictionid.data.plants import Calibration, plant_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import holds, run_edges
from frictionid.evaluation import (
    EstimatedStates,
    Prepared,
    Protocol,
    protocol_for,
    screened,
    training_of,
    with_calibration,
)
from frictionid.fitting.one_step.recipe import INTEGRAL
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction import Friction, along
from frictionid.friction.provenance import Segment
from frictionid.mechanics import Mechanism

from .effects import (
    DELAY,
    PARTS,
    PAYLOAD,
    Effect,
    motion_of,
    parts_at,
    payloads,
    shares,
)

_STEP = 1e-3  # of the sensors' numbers and of masses, for derivatives
_SHIFT = 5e-3  # [s] of a held torque, to either side, or a sample
_TURNS, _FITS = 8, 0.95  # about another delay, which leaves less of the residual than this
_SLOPES = -1.0, -0.1  # of what is left of a delay over what is taken for it
_TUNING, _ROUNDS = 1.345, 5  # Huber's, in standard deviations, and of his weights
_PIECES, _PIECE = 40, 0.5  # of a recording at most, and [s] of each at least, whose scatter counts
_WINDOW, _DISTURBED = 0.1, 1.5  # [s], of a disturbance, and times the largest residual over it
_SPEEDS = 40  # of a friction curve
_PASSES = 8  # at most, each with what the one before found left out


class Reference(NamedTuple):
    """What changes are measured against.

    friction : Friction, theta (n, P), with the calibration of the machine and its sensors
    speeds : (n, 3) slow, usual and fast speed of each joint [rad/s or m/s]; the slow one is v
    noise : (n,) standard deviation of the residual of each joint [rad/s]
    effects : what may change, D of them
    """

    friction: Friction
    speeds: Array
    noise: Array
    effects: tuple[Effect, ...]

    @property
    def level(self) -> Array:
        """Friction (n,) at the usual speed [N m], at least a thousandth of the largest."""
        level = np.abs(self.friction.curve(self.speeds[None, :, 1])[0])
        return np.maximum(level, 1e-3 * level.max() + 1e-12)


class Changes(NamedTuple):
    """What R recordings say.

    value : (R, D) of the effects
    inverse : (R, D, D) inverse of the curvature, priors among it: their covariance, if rows were
        independent
    excess : (R, D) mean square of the scores of stretches, over what independent rows would have
    motion : (R, n, 2), see `motion_of`
    peak : (R, n) largest residual over a tenth of a second [standard deviations of a sample, / s]
    covariates : (R, c), mean of each, or the parameter of the mechanism
    """

    value: Array
    inverse: Array
    excess: Array
    motion: Array
    peak: Array
    covariates: Array

    @property
    def disturbed(self) -> Array:
        """Residual (n,) over a tenth of a second from which on a stretch is disturbed."""
        return _DISTURBED * self.peak.max(axis=0)


def with_others_held(changes: Changes, middle: Array, free: Array) -> Changes:
    """The changes with all effects but the free ones (columns) held at the middle (D,)."""
    held = np.setdiff1d(np.arange(len(middle)), free)
    covariance = changes.inverse
    slopes = covariance[:, :, held] @ np.linalg.inv(covariance[:, held][:, :, held])
    off = changes.value[:, held] - middle[held]
    return changes._replace(value=changes.value - (slopes @ off[..., None])[..., 0])


def in_proportion(reference: Reference) -> Array:
    """Effects (n, D) that change the friction of each joint in proportion to itself."""
    n, places = len(reference.level), np.arange(len(reference.level))
    w = np.linspace(-1.0, 1.0, _SPEEDS)[:, None] * reference.speeds[:, 2]
    curves = reference.friction.curve(w).T
    shapes = parts_at(w, reference.speeds).reshape(n, len(PARTS), _SPEEDS, n)[places, :, :, places]
    out = np.zeros((n, n, len(PARTS)))
    out[places, places] = (np.linalg.pinv(shapes.swapaxes(1, 2)) @ curves[..., None])[..., 0]
    return np.pad(out.reshape(n, -1), ((0, 0), (0, len(reference.effects) - out[0].size)))


def prepared_data(dataset: Dataset) -> Prepared:
    """The data set prepared for one-step problems, of a fast log with the usual protocol's samples.

    Between those there is only noise.
    """
    protocol = protocol_for(Protocol(), [(dataset, None)])
    estimated, plant = EstimatedStates(dataset, protocol.sample_time), plant_of(dataset)
    return Prepared(screened(dataset, plant, estimated), protocol, estimated, plant)


def recording_changes(
    prepared: Prepared,
    reference: Reference,
    covariates: tuple[str, ...],
    most: Array | float = np.inf,
    payload: Array | None = None,
) -> tuple[Changes, tuple[Segment, ...]]:
    """What each recording says against a reference, and the stretches that were left out.

    most : (n,) residual over a tenth of a second that no change of friction leaves, as in `peak`
    payload : (D,) at which derivatives are taken, see `shares`
    """
    payload = np.zeros(len(reference.effects)) if payload is None else payload
    reference = _carrying(prepared.dataset.mechanism, reference, payload)
    fits = enumerate(_each(prepared, reference, most, 0.0))
    settled = (_at_its_delay(prepared, r, fit, reference, most) for r, fit in fits)
    changes, left_out, _ = zip(*settled, strict=True)
    out, means = joined(changes), covariate_means(prepared.dataset, covariates)
    share = shares(reference.effects, payload)
    value, inverse = payload + out.value / share, out.inverse / (share[:, None] * share)
    return out._replace(value=value, inverse=inverse, covariates=means), tuple(chain(*left_out))


def _carrying(mechanism: Mechanism, reference: Reference, payload: Array) -> Reference:
    """The reference with the base parameters of a payload (D,)."""
    usual = reference.friction.calibration or Calibration.ideal(mechanism.n)
    base = mechanism.nominal_base if usual.base is None else usual.base
    base = base + payload[[e.cause == PAYLOAD for e in reference.effects]] @ payloads(mechanism)[1]
    friction = replace(reference.friction, calibration=replace(usual, base=base))
    return reference._replace(friction=friction)


# changes of one recording, stretches that were left out, and the mean size of what is left
_Fit = tuple[Changes, list[Segment], float]


def _each(prepared: Prepared, reference: Reference, most: Array | float, late: float) -> list[_Fit]:
    """The fit of each recording, by derivatives at torques that are late by some [s]."""
    linear, delay = _linearised(prepared, reference, late), _place_of_delay(reference)
    prior, fits = np.array([e.size for e in reference.effects]), []
    for r, recording in enumerate(prepared.dataset.recordings):
        rows = picked(linear, linear.recording == r)
        value, inverse, excess, peak, used = _undisturbed(rows, prior, most)
        misfit = float(np.abs(rows.left(value)).mean())
        value[delay] += late
        motion = motion_of(rows.time, rows.velocity, reference.speeds[:, 0])
        parts = (value, inverse, excess, motion, peak, value[:0])
        since = rows.time - recording.angle.time[0]
        changes = Changes(*(x[None] for x in parts))
        left_out = [
            Segment(recording.name, float(since[a]), float(since[b - 1]), float(b - a))
            for a, b in zip(*run_edges(~used), strict=True)
        ]
        fits.append((changes, left_out, misfit))
    return fits


def _place_of_delay(reference: Reference) -> int:
    return [e.name for e in reference.effects].index("delay")


def _at_its_delay(
    prepared: Prepared, r: int, fit: _Fit, reference: Reference, most: Array | float
) -> _Fit:
    """The fit of a recording by derivatives at the delay that it has, by the secant method.

    A torque that is held, and jumps, is linear in its delay within a sample only.
    """
    if not holds(prepared.dataset.recordings[r].torque):
        return fit
    first, delay, late, slope = fit, _place_of_delay(reference), 0.0, -1.0
    gap = float(fit[0].value[0, delay])
    for _ in range(_TURNS):
        step = -gap / slope
        if gap**2 < fit[0].inverse[0, delay, delay] or abs(late + step) > DELAY:
            break
        late += step
        (fit,) = _each(_single(prepared, r), reference, most, late)
        before, gap = gap, float(fit[0].value[0, delay]) - late
        slope = float(np.clip((gap - before) / step, *_SLOPES))
    return fit if fit[-1] < _FITS * first[-1] else first


def _single(prepared: Prepared, r: int) -> Prepared:
    """One of the recordings; its states are known."""
    dataset = replace(prepared.dataset, recordings=(prepared.dataset.recordings[r],))
    computed = prepared.estimated.computed.items()
    states: dict[Any, tuple[Any, ...]] = {by: (several[r],) for by, several in computed}
    estimated = replace(prepared.estimated, dataset=dataset, computed=states)
    return replace(prepared, dataset=dataset, estimated=estimated, plant=plant_of(dataset))


class _Rows(NamedTuple):
    """Residual (K, n) in standard deviations, minus its derivatives (K, n, D), and where it is."""

    residual: Array
    columns: Array
    time: Array
    dt: Array
    velocity: Array
    recording: Array

    def left(self, change: Array) -> Array:
        """The residual (K, n) beside a change (D,)."""
        return self.residual - self.columns @ change


def _linearised(prepared: Prepared, reference: Reference, late: float) -> _Rows:
    """The residual of all recordings and its derivatives by all effects, at a late torque."""
    calibration = reference.friction.calibration or Calibration.ideal(prepared.dataset.mechanism.n)
    calibration = replace(calibration, delay=calibration.delay + late)

    def residual(calibration: Calibration) -> tuple[Problem, Array]:
        problem = training_of(with_calibration(prepared, calibration), INTEGRAL)
        return problem, problem.residual(along(reference.friction, problem.nodes))

    problem, e = residual(calibration)
    w = problem.nodes.inputs.w
    parts = -times(problem.G, problem.mean(parts_at(w, reference.speeds)))

    def slope(step: float, *others: Calibration) -> Array:
        changed = [_matched(problem, e, *residual(c)) for c in others]
        return (changed[0] - sum(changed[1:], np.zeros_like(e))) / step

    sensors = np.stack([slope(*stepped) for stepped in _stepped(prepared, calibration)])
    columns = np.moveaxis(np.concatenate([parts, sensors]), 0, -1)
    scaled = e / reference.noise, -columns / reference.noise[:, None]
    return _Rows(*scaled, problem.time, problem.dt, problem.mean(w), problem.recording)


def _stepped(
    prepared: Prepared, calibration: Calibration
) -> Iterator[tuple[float, *tuple[Calibration, ...]]]:
    """A step of each effect beside friction, in their order, and the calibration after it.

    Of the delay also that before it: a torque that jumps changes otherwise to either side.
    """
    mechanism, base = prepared.dataset.mechanism, calibration.base
    unit, driven = np.eye(mechanism.n), np.flatnonzero(mechanism.motors)
    for direction in payloads(mechanism)[1]:
        yield _STEP, replace(calibration, base=base + _STEP * direction)
    torque = prepared.dataset.recordings[0].torque
    shift = max(_SHIFT, usual_step(torque.time)) if holds(torque) else _STEP
    shifted = (replace(calibration, delay=calibration.delay + x) for x in (shift, -shift))
    yield 2.0 * shift, *shifted
    for j in driven:
        yield _STEP, replace(calibration, gain=calibration.gain * (1.0 + _STEP * unit[j]))
    for row in unit:
        yield _STEP, replace(calibration, offset=calibration.offset + _STEP * row)


def _matched(problem: Problem, e: Array, other: Problem, changed: Array) -> Array:
    """Change (K, n) of the residual in the same rows; zero in rows that only one of them has."""
    key, theirs = ((p.recording * 1e7 + p.time) for p in (problem, other))
    _, mine, yours = np.intersect1d(key, theirs, return_indices=True)
    out = np.zeros_like(e)
    out[mine] = changed[yours] - e[mine]
    return out


def _undisturbed(
    rows: _Rows, prior: Array, most: Array | float
) -> tuple[Array, Array, Array, Array, Array]:
    """Value, inverse, excess and peak of what is not disturbed, and which rows (K,) that is."""
    used = np.ones(len(rows.time), dtype=bool)
    for _ in range(_PASSES):
        value, inverse, excess, left = _fitted(rows, used, prior)
        mean = _local_means(left, rows)
        pushed = np.asarray((np.abs(mean) > most).any(axis=1))
        # anew: a push bends the first fit elsewhere, too
        before, used = used, ~_widened(pushed, rows.time)
        if np.array_equal(before, used):
            break
    peak = np.abs(mean[used]).max(axis=0, initial=0.0)
    return value, inverse, excess, peak, used


def _fitted(rows: _Rows, used: Array, prior: Array) -> tuple[Array, Array, Array, Array]:
    """Robust change (D,), inverse curvature, excess, and the residual (K, n) that it leaves."""
    A, y = rows.columns[used], rows.residual[used]
    shows = np.abs(A).max(axis=-1) > 0  # joints at rest say nothing
    weight, x, inverse = shows.astype(float), np.zeros(len(prior)), np.diag(prior**2)
    for _ in range(_ROUNDS if shows.any() else 0):
        weighted = A * weight[..., None]
        H = np.einsum("kip,kiq->pq", weighted, A, optimize=True)
        inverse = np.linalg.inv(H + np.diag(prior**-2))
        x = inverse @ np.einsum("kip,ki->p", weighted, y)
        left = np.abs(y - A @ x)
        scale = _scale(left[shows], float(np.trace(inverse @ H)), len(prior))
        weight = shows * huber_weight(left, _TUNING * scale) / scale**2
    scores = (A * (weight * (y - A @ x))[..., None]).sum(axis=1)
    excess = _excess(scores, rows.time[used], (A**2 * weight[..., None]).sum(axis=(0, 1)))
    return x, inverse, excess, rows.left(x)


def _scale(left: Array, fitted: float, count: int) -> float:
    """Standard deviation of what a fit of so many numbers left, robust.

    One, that of the reference, counts as `count` more: few rows hardly tell it.
    """
    squares = len(left) * (MAD * float(np.median(left))) ** 2
    return float(np.sqrt((squares + count) / (len(left) - fitted + count)))


def _excess(scores: Array, time: Array, curvature: Array) -> Array:
    """Squares (D,) of the scores (K, D) of stretches, over the curvature (D,) of all rows.

    One where rows are independent; more where what is left lasts, less where it alternates.
    """
    if len(time) < 2:
        return np.ones(len(curvature))
    span = float(time[-1] - time[0])
    pieces = max(1, min(_PIECES, int(span / _PIECE)))
    label = np.minimum((pieces * (time - time[0]) / max(span, 1e-12)).astype(int), pieces - 1)
    sums = np.zeros((pieces, len(curvature)))
    np.add.at(sums, label, scores)
    shows = curvature > 0
    ratio = (sums**2).sum(axis=0) / np.where(shows, curvature, 1.0)
    return np.where(shows, ratio, 1.0)


def _local_means(left: Array, rows: _Rows) -> Array:
    """The residual (K, n) over a tenth of a second about each row, for each second of it."""
    time = rows.time  # at both ends as long a window: half of one scatters more
    begin = np.searchsorted(time, np.minimum(time - _WINDOW / 2, time[-1:] - _WINDOW))
    last = np.maximum(time + _WINDOW / 2, time[:1] + _WINDOW)
    end = np.searchsorted(time, last, side="right")
    both = np.column_stack([left, rows.dt])
    total = np.concatenate([np.zeros((1, both.shape[1])), np.cumsum(both, axis=0)])
    within = total[end] - total[begin]
    return within[:, :-1] / within[:, -1:]


def _widened(pushed: Array, time: Array) -> Array:
    """Rows within a window of those that are pushed."""
    at = time[pushed]
    after = np.searchsorted(at, time)
    padded = np.concatenate([[-np.inf], at, [np.inf]])
    near = np.minimum(time - padded[after], padded[after + 1] - time)
    return near <= _WINDOW


def covariate_means(dataset: Dataset, names: Sequence[str]) -> Array:
    """Covariates (R, c) of each recording: the mean of a column, else a parameter of its mechanism.

    NaN where a recording has neither.
    """

    def mean(recording: Recording, name: str) -> float:
        if name in recording.covariates:
            return float(np.mean(recording.covariates[name].value))
        return dataset.mechanism.nominal(recording.parameters).get(name, np.nan)

    rows = [[mean(r, name) for name in names] for r in dataset.recordings]
    return np.array(rows, dtype=float)
