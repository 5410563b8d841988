"""How much each recording's friction differs from a reference, by one linear fit per recording.

To the reference friction a change is added that is linear in four numbers of each joint,

    change = coulomb s + viscous w + stribeck exp(-(w/v)^2) s + asymmetry,   s = sgn(w)

and is fitted to the one-step residual of the momentum balance. What the sensors may have done
meanwhile is free beside it, so that it does not pass for wear: the torque's delay and gain, and the
offset of each angle, as of a camera that was tilted. Their priors are wide. That of a change is as
wide as friction is large. What a wrong inertia or the smoothing does to all recordings alike is the
same in the healthy ones, and cancels.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, times
from frictionid.data.calibration import Calibration
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset
from frictionid.evaluation import (
    EstimatedStates,
    Prepared,
    Protocol,
    screened,
    training_of,
    with_calibration,
)
from frictionid.fitting.one_step.formulation import INTEGRAL
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction import Friction, along

PARTS = ("coulomb", "viscous", "stribeck", "asymmetry")
# Standard deviations of what the sensors may have done since: delay [s], gain [1], offset [rad].
DELAY, GAIN, OFFSET = 0.02, 0.1, 0.05
_STEP = 1e-3  # of these numbers, for derivatives
_TUNING = 1.345  # Huber's, in standard deviations
_ROUNDS = 5


class Reference(NamedTuple):
    """What changes are measured against.

    friction : Friction, theta (n, P)
    calibration : of the machine and its sensors, or None
    speeds : (n, 3) slow, usual and fast speed of each joint [rad/s or m/s]; the slow one is v
    noise : (n,) standard deviation of the residual of each joint [rad/s]
    """

    friction: Friction
    calibration: Calibration | None
    speeds: Array
    noise: Array


class Changes(NamedTuple):
    """Changes of R recordings.

    parts : (R, n, 4) at the usual speed [N m]: coulomb, viscous, stribeck, asymmetry
    error : (R, n, 4) standard errors by the noise of the recording alone [N m]
    delay : (R,) [s]; gain, offset : (R, n) [1], [rad], against the reference
    covariates : (R, c), mean of each, or the parameter of the mechanism
    speeds : (R, n) 95 % quantile of each joint's speed [rad/s or m/s]
    seconds : (R,) length of each recording [s]
    """

    parts: Array
    error: Array
    delay: Array
    gain: Array
    offset: Array
    covariates: Array
    speeds: Array
    seconds: Array


def joined(several: Iterable[Changes]) -> Changes:
    """Changes of the recordings of several, one behind the other."""
    return Changes(*map(np.concatenate, zip(*several, strict=True)))


def curve_changes(parts: Array, speeds: Array) -> Array:
    """Changes (R, n, 4) of each joint's curve at its slow, usual and fast speed, and asymmetry.

    Parts are strongly correlated, as the data hardly tell one from the other; these are not.

    >>> curve_changes(np.array([[[0.1, 0.2, 0.0, 0.0]]]), np.array([[1.0, 5.0, 10.0]])).round(2)
    array([[[0.14, 0.3 , 0.5 , 0.  ]]])
    """
    coulomb, viscous, stribeck, asymmetry = np.moveaxis(parts, -1, 0)
    slow, usual = speeds[:, 0], speeds[:, 1]
    curve = [
        coulomb + viscous * v / usual + stribeck * np.exp(-((v / slow) ** 2)) for v in speeds.T
    ]
    return np.stack([*curve, asymmetry], axis=-1)


def usual_level(reference: Reference) -> Array:
    """Friction (n,) of each part at its usual speed [N m], at least a thousandth of the largest."""
    level = np.abs(np.diagonal(reference.friction.curve(reference.speeds[:, 1])))
    return np.asarray(np.maximum(level, 1e-3 * level.max() + 1e-12))


def prepared_data(dataset: Dataset) -> Prepared:
    """The data set prepared for one-step problems."""
    estimated, plant = EstimatedStates(dataset, None), plant_of(dataset)
    return Prepared(screened(dataset, plant, estimated), Protocol(), estimated, plant)


def recording_changes(
    prepared: Prepared, reference: Reference, covariates: tuple[str, ...]
) -> Changes:
    """Changes of each recording against a reference, see `covariate_means`."""
    dataset = prepared.dataset
    n, count = reference.friction.n, len(dataset.recordings)
    linear = _linearised(prepared, reference)
    m = 4 * n
    rows = [linear.recording == r for r in range(count)]
    fits = [_fitted(linear.residual[row], linear.columns[row], linear.prior) for row in rows]
    change, error = (np.stack(column) for column in zip(*fits, strict=True))
    joints = dataset.mechanism.n
    gain = np.zeros((count, joints))
    gain[:, linear.driven] = change[:, m + 1 : m + 1 + len(linear.driven)]
    speed = np.abs(linear.velocity)
    return Changes(
        parts=change[:, :m].reshape(count, n, 4),
        error=error[:, :m].reshape(count, n, 4),
        delay=change[:, m],
        gain=gain,
        offset=change[:, m + 1 + len(linear.driven) :],
        covariates=covariate_means(dataset, covariates),
        speeds=np.stack([np.quantile(speed[row], 0.95, axis=0) for row in rows]),
        seconds=np.array([np.ptp(r.angle.time) for r in dataset.recordings]),
    )


class _Linear(NamedTuple):
    """Residual (K, n) in standard deviations, and minus its derivatives (K, n, P)."""

    residual: Array
    columns: Array
    prior: Array
    recording: Array
    velocity: Array
    driven: Array


def _linearised(prepared: Prepared, reference: Reference) -> _Linear:
    """The residual of all recordings and its derivatives by changes, delay, gains and offsets."""
    n = prepared.dataset.mechanism.n
    calibration = reference.calibration or Calibration.ideal(n)
    driven = np.flatnonzero(prepared.dataset.mechanism.motors)

    def residual(calibration: Calibration) -> tuple[Problem, Array]:
        problem = training_of(with_calibration(prepared, calibration), INTEGRAL)
        return problem, problem.residual(along(reference.friction, problem.nodes))

    problem, e = residual(calibration)
    parts = -times(problem.G, problem.mean(_basis(problem.nodes.inputs.w, reference.speeds)))
    unit = np.eye(n)
    others = [
        replace(calibration, delay=calibration.delay + _STEP),
        *(replace(calibration, gain=calibration.gain * (1.0 + _STEP * unit[j])) for j in driven),
        *(replace(calibration, offset=calibration.offset + _STEP * unit[j]) for j in range(n)),
    ]
    sensors = np.stack([_matched(problem, e, *residual(c)) / _STEP for c in others])
    columns = np.moveaxis(np.concatenate([parts, sensors]), 0, -1)
    # a recording that does not show a part leaves it where it was, within all of friction
    level = usual_level(reference)
    wide = [*np.repeat(level, len(PARTS)), DELAY, *([GAIN] * len(driven)), *([OFFSET] * n)]
    size = reference.noise[:, None]
    w = problem.mean(problem.nodes.inputs.w)
    return _Linear(
        e / reference.noise, -columns / size, np.array(wide), problem.recording, w, driven
    )


def _matched(problem: Problem, e: Array, other: Problem, changed: Array) -> Array:
    """Change (K, n) of the residual in the same rows; zero in rows that only one of them has."""
    key, theirs = ((p.recording * 1e7 + p.time) for p in (problem, other))
    _, mine, yours = np.intersect1d(key, theirs, return_indices=True)
    out = np.zeros_like(e)
    out[mine] = changed[yours] - e[mine]
    return out


def _basis(w: Array, speeds: Array) -> Array:
    """Torques (4 n, S, n) of the four parts of each joint at velocities w (S, n), 1 N m each."""
    slow, usual = speeds[:, 0], speeds[:, 1]
    side = np.sign(w)
    shapes = (side, w / usual, np.exp(-((w / slow) ** 2)) * side, np.ones_like(w))
    out = np.zeros((w.shape[1], 4, *w.shape))
    for j in range(w.shape[1]):
        for k, shape in enumerate(shapes):
            out[j, k, :, j] = shape[:, j]
    return out.reshape(-1, *w.shape)


def _fitted(residual: Array, columns: Array, prior: Array) -> tuple[Array, Array]:
    """Robust change (P,) that explains a recording's residual (K, n), and its standard errors."""
    y, A = residual.reshape(-1), columns.reshape(-1, columns.shape[-1])
    shows = np.abs(A).max(axis=1) > 0  # joints at rest say nothing
    y, A = y[shows], A[shows]
    if not len(y):
        return np.zeros_like(prior), prior
    weight, x, inverse = np.ones_like(y), np.zeros(len(prior)), np.diag(prior**2)
    for _ in range(_ROUNDS):
        weighted = A * weight[:, None]
        inverse = np.linalg.inv(weighted.T @ A + np.diag(prior**-2))
        x = inverse @ (weighted.T @ y)
        left = y - A @ x
        scale = max(1.4826 * float(np.median(np.abs(left))), 1e-12)
        weight = np.minimum(1.0, _TUNING * scale / np.maximum(np.abs(left), 1e-12)) / scale**2
    return x, np.sqrt(np.diag(inverse))


def covariate_means(dataset: Dataset, names: Sequence[str]) -> Array:
    """Covariates (R, c) of each recording: the mean of a column, else a parameter of its mechanism.

    NaN where a recording has neither.
    """
    out = np.full((len(dataset.recordings), len(names)), np.nan)
    for r, recording in enumerate(dataset.recordings):
        for c, name in enumerate(names):
            if name in recording.covariates:
                out[r, c] = float(np.mean(recording.covariates[name].value))
            else:
                out[r, c] = dataset.mechanism.nominal(recording.parameters).get(name, np.nan)
    return out
