"""Predicted motion as a table: angles and velocities beside those that were measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation.free_run import free_run
from frictionid.evaluation.initial_states import InitialStates
from frictionid.evaluation.prepared import Prepared, calibrated_views, prepare, prepared_for
from frictionid.evaluation.protocol import Protocol
from frictionid.evaluation.rollouts import predict
from frictionid.friction import Friction

_NEVER = 1e9  # [s] to the next start


def predicted_motion(
    friction: Friction,
    dataset: Dataset,
    horizon: float = 1.0,
    every: float | None = None,
    *,
    start: float | None = None,
    whole: bool = False,
) -> pd.DataFrame:
    """Motion that a model predicts under the recorded torques, a line for each sample.

    Each prediction starts from a state estimated from the samples before it. A model with a
    calibration sees, and predicts, angles corrected by it.

    Parameters
    ----------
    friction : Friction, theta (n, P)
    dataset : Dataset
    horizon : float [s], how far ahead
    every : float [s] between two starts; None: one prediction begins where the one before ends
    start : float [s]
        One prediction, from so long after the first sample; None: as many as there is motion for.
    whole : bool
        Simulate whole recordings from their start instead, see `free_run`.

    Returns
    -------
    DataFrame
        Columns recording, start_s, time_s, ahead_s; for each joint j the angle predicted qj, the
        velocity predicted wj (not of whole recordings) and the angle measured measured_qj; SI.

    Raises
    ------
    InputError
        Where model and data have different joints, or recordings are too short.

    Examples
    --------
    >>> from frictionid.friction.laws import CoulombViscous
    >>> from frictionid.simulate import Camera, Curve, Rig, Run, Stribeck, simulate
    >>> rig = Rig("demo", {"kind": "pendulum", "parameters": {"mass": 1.0, "length": 0.3}},
    ...           Stribeck(Curve((0.1,), (0.1,), (0.0,))), Camera(100), (Run("a", (1.0,)),))
    >>> friction = Friction(CoulombViscous(), np.array([[0.1, 0.0]]))
    >>> table = predicted_motion(friction, simulate(rig), 0.5)
    >>> float((table.q1 - table.measured_q1).abs().max().round(2))
    0.0
    """
    joints = len(dataset.mechanism.friction_names)
    if friction.theta.ndim != 2 or friction.n != joints:
        raise InputError(
            f"data set {dataset.name!r} has {joints} joints, the model has {friction.n}: give a "
            "model of the same mechanism"
        )
    if start is not None and (whole or every is not None):
        raise InputError("start does not go with whole or every: it is that of one prediction")
    if start is not None:
        _check_start(dataset, start, horizon)
    protocol = Protocol(horizons=(horizon,), every=every or horizon, whole=whole)
    if start is not None:
        protocol = replace(protocol, every=_NEVER, history=start)
    prepared = prepared_for(prepare(dataset, protocol), friction)
    batch = friction[None]
    data = calibrated_views(prepared, batch.calibration, 1)[0].data
    parts = _whole(data, batch) if whole else _pieces(data, batch)
    return pd.concat([pd.DataFrame(part) for part in parts], ignore_index=True)


def _check_start(dataset: Dataset, start: float, horizon: float) -> None:
    if not start >= 0:
        raise InputError(f"start = {start} must be 0 s or more after the first sample")
    longest = max(float(np.ptp(r.angle.time)) for r in dataset.recordings)
    if start + horizon > longest + 1e-9:
        raise InputError(
            f"data set {dataset.name!r}: no recording has {horizon:g} s of motion from {start:g} s "
            f"after its first sample, the longest is {longest:g} s: begin earlier"
        )


def _pieces(data: Prepared, friction: Friction) -> Iterator[dict[str, Any]]:
    initial: InitialStates = data.initial_states
    owner = np.zeros(len(initial.recording), dtype=int)
    motion = predict(data.plant[initial.recording], friction[owner], initial)
    for s, r in enumerate(initial.recording):
        last = int(initial.last[-1, s])
        start = float(data.causal[r].time[initial.index[s]])
        ahead = np.concatenate([[0.0], np.cumsum(initial.dt[:last, s])])
        yield {
            **_lines(data.dataset.recordings[r].name, start, ahead),
            **_columns("q", motion.q[: last + 1, s]),
            **_columns("w", motion.w[: last + 1, s]),
            **_columns("measured_q", initial.measured[: last + 1, s]),
        }


def _whole(data: Prepared, friction: Friction) -> Iterator[dict[str, Any]]:
    trajectory = data.trajectory
    assert trajectory is not None
    owner = np.zeros(len(trajectory.names), dtype=int)
    q = free_run(data.plant, friction[owner], trajectory)
    for r, name in enumerate(trajectory.names):
        count = int(np.isfinite(trajectory.measured[:, r]).all(axis=-1).sum())
        time = trajectory.time[:count, r]
        yield {
            **_lines(name, float(time[0]), time - time[0]),
            **_columns("q", q[:count, r]),
            **_columns("measured_q", trajectory.measured[:count, r]),
        }


def _lines(recording: str, start: float, ahead: Array) -> dict[str, Any]:
    return {
        "recording": recording,
        "start_s": start,
        "time_s": start + ahead,
        "ahead_s": ahead,
    }


def _columns(name: str, values: Array) -> dict[str, Array]:
    return {f"{name}{j + 1}": values[:, j] for j in range(values.shape[1])}
