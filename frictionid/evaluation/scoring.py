"""Judging one friction on one data set: the same scores for whatever made it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset
from frictionid.data.states import KalmanFilter, States
from frictionid.dynamics.rollout import Rollout
from frictionid.errors import InputError
from frictionid.evaluation.curves import curve_error, curve_rows, curves, velocity_grid
from frictionid.evaluation.folds import Folds
from frictionid.evaluation.free_run import (
    Trajectory,
    free_run,
    free_run_rows,
    make_trajectory,
    powered,
    some_of,
    trajectory_folds,
)
from frictionid.evaluation.ground_truth import steady_state
from frictionid.evaluation.model_observer import PrecedingSamples, preceding_samples
from frictionid.evaluation.one_step import held_out_residual, one_step_rows
from frictionid.evaluation.protocol import Protocol
from frictionid.evaluation.rollout_starts import (
    InitialStates,
    initial_state_folds,
    make_initial_states,
    true_states,
)
from frictionid.evaluation.rollouts import predict, rollout_rows, true_start_rows
from frictionid.evaluation.score_rows import Row
from frictionid.friction import Friction
from frictionid.identifiers.formulation import (
    INTEGRAL,
    STUDY,
    Recipe,
    problem_of,
    states_of,
    training_problem,
)
from frictionid.identifiers.residual import Problem
from frictionid.mechanics import Plant, plant_of, unit_inertia_plant
from frictionid.mechanics.calibration import Calibration, calibrated_dataset, calibrated_plant


class Observed(NamedTuple):
    """Motion of a data set as its samples show it, whatever the mechanism's parameters."""

    backward: tuple[States, ...]
    smoothed: tuple[States, ...]
    causal: tuple[States, ...]


class Prepared(NamedTuple):
    """A data set made ready for judging under one set of mechanism parameters.

    true : starts at the true states, at the same times, where these are wanted and known
    """

    dataset: Dataset
    protocol: Protocol
    observed: Observed
    plant: Plant
    euler: Problem
    integral: Problem
    starts: InitialStates
    true: InitialStates | None
    trajectory: Trajectory | None
    preceding: PrecedingSamples | None
    grid: Array


def prepare(
    dataset: Dataset, protocol: Protocol, parameters: Mapping[str, float] | None = None
) -> Prepared:
    """A data set made ready for judging: problems, causal starts, velocities for the curves.

    `parameters` replace the mechanism's, for models that bring their own; with motor constants
    among them, torques that follow from voltages follow them.

    Raises
    ------
    InputError
        Where the recordings are too short for the protocol, or a parameter is unknown.
    """
    apart = protocol.sample_time
    estimators = (STUDY.states, INTEGRAL.states, KalmanFilter())
    plant = plant_of(dataset, parameters)
    return _prepared(
        powered(dataset, plant),
        protocol,
        Observed(*(states_of(dataset, estimator, apart) for estimator in estimators)),
        plant,
    )


def under(prepared: Prepared, parameters: Mapping[str, float]) -> Prepared:
    """The same data under other mechanism parameters; nothing is estimated anew."""
    if not parameters:
        return prepared
    plant = plant_of(prepared.dataset, parameters)
    dataset = powered(prepared.dataset, plant)
    return _prepared(dataset, prepared.protocol, prepared.observed, plant)


def without_physics(prepared: Prepared) -> Prepared:
    """The same data for models of all of the acceleration, see `unit_inertia_plant`."""
    dataset = prepared.dataset
    return _prepared(dataset, prepared.protocol, prepared.observed, unit_inertia_plant(dataset))


def prepared_for(prepared: Prepared, friction: Friction) -> Prepared:
    """The data under the mechanism, or its parameters, that a friction brings."""
    if friction.mechanism == "unit":
        return without_physics(prepared)
    return under(prepared, friction.parameters)


def with_calibration(prepared: Prepared, calibration: Calibration | None) -> Prepared:
    """The data corrected by a calibration, and prepared with its base parameters."""
    if calibration is None:
        return prepared
    dataset, protocol = prepared.dataset, prepared.protocol
    observed = Observed(*(_shifted(own, calibration.offset) for own in prepared.observed))
    return _prepared(
        calibrated_dataset(dataset, calibration),
        protocol,
        observed,
        calibrated_plant(dataset, calibration),
    )


def _shifted(states: tuple[States, ...], offset: Array) -> tuple[States, ...]:
    return tuple(s._replace(q=s.q - offset) for s in states)


def _prepared(dataset: Dataset, protocol: Protocol, observed: Observed, plant: Plant) -> Prepared:
    if dataset.truth is not None and steady_state(dataset.truth).n != plant.n:
        raise InputError(f"data set {dataset.name!r}: [truth] is not that of {plant.n} joints")
    told = dataset, plant
    limits = protocol.sample_time, protocol.history
    euler = problem_of(*told, STUDY, *limits, observed.backward)
    integral = problem_of(*told, INTEGRAL, *limits, observed.smoothed)
    starts = _starts(dataset, observed.causal, plant, protocol)
    true = true_states(dataset, observed.causal) if protocol.true_starts else None
    own = protocol.starts == "model"
    return Prepared(
        dataset=dataset,
        protocol=protocol,
        observed=observed,
        plant=plant,
        euler=euler,
        integral=integral,
        starts=starts,
        true=None if true is None else _starts(dataset, true, plant, protocol),
        trajectory=make_trajectory(dataset, observed.causal, protocol.history)
        if protocol.whole
        else None,
        preceding=preceding_samples(dataset, observed.causal, starts) if own else None,
        grid=velocity_grid(speeds(dataset, observed.smoothed)),
    )


def _starts(
    dataset: Dataset, states: Sequence[States], plant: Plant, protocol: Protocol
) -> InitialStates:
    every, begin = protocol.every, protocol.history
    return make_initial_states(dataset, states, plant, protocol.horizons, every=every, begin=begin)


def training_of(prepared: Prepared, recipe: Recipe) -> Problem:
    """The problem that identifiers fit by a recipe."""
    seen = {STUDY.states: prepared.observed.backward, INTEGRAL.states: prepared.observed.smoothed}
    states = next((known for estimator, known in seen.items() if estimator == recipe.states), None)
    protocol = prepared.protocol
    limits = protocol.sample_time, protocol.history
    return training_problem(prepared.dataset, prepared.plant, recipe, *limits, states)


def speeds(dataset: Dataset, smoothed: Iterable[States]) -> Array:
    """True velocities where they are known, else smoothed ones, (K, n) [rad/s]."""
    true = [r.truth.velocity.value for r in dataset.recordings if r.truth is not None]
    return np.concatenate(true if true else [s.w for s in smoothed])


def judge_folds(
    friction: Friction, overall: Friction, prepared: Prepared, folds: Folds
) -> tuple[list[Row], list[dict[str, Any]]]:
    """Rows of held-out scores of the folds' frictions, and example motions.

    A friction with a calibration is judged on the data corrected by it.
    """
    views = list(_views(friction, prepared))
    rows: list[Row] = []
    for k, (score, problem) in enumerate(_problems(prepared)):
        held = folds.held_out(problem.recording, problem.time)
        residual = np.empty_like(problem.r)
        for own, view in views:
            use = np.isin(held, own)
            place = np.searchsorted(own, held[use])
            part = held_out_residual(friction[own], _problems(view)[k][1], use, place)
            residual[use] = part
        rows += one_step_rows(residual, held, score)
    fold = initial_state_folds(prepared.starts, folds, prepared.observed.causal)
    # whatever of a start is held out, is held out by one fold: its friction predicts
    owner = np.maximum(fold.max(axis=0), 0)
    seen = [(own, view.plant, view.starts, view.preceding) for own, view in views]
    starts, motion = _predicted(friction, seen, owner)
    rows += rollout_rows(motion, starts, fold, _angle_unit(prepared))
    if prepared.true is not None:
        known = [(own, v.plant, v.true, None) for own, v in views if v.true is not None]
        true, ideal = _predicted(friction, known, owner)
        rows += true_start_rows(ideal, true, fold, _angle_unit(prepared))
    if prepared.trajectory is not None:
        held = trajectory_folds(prepared.trajectory, folds)
        rows += free_run_rows(*_ran(friction, views, prepared.trajectory, held), held)
    rows += curve_scores(friction, overall, prepared)
    rows.append(_count(friction))
    shown = prepared._replace(starts=starts)
    return rows, _examples(motion.q, shown, fold[-1] >= 0, friction_of="fold")


def _views(friction: Friction, prepared: Prepared) -> Iterator[tuple[Array, Prepared]]:
    """Folds that see the data alike, and the data as they see them."""
    folds = np.arange(len(friction.theta))
    if friction.calibration is None:
        yield folds, prepared
        return
    alike: dict[bytes, list[int]] = {}
    for f in folds:
        parts = [
            np.asarray(x).tobytes() for x in vars(friction.calibration[f]).values() if x is not None
        ]
        alike.setdefault(b"".join(parts), []).append(int(f))
    for own in alike.values():
        yield np.array(own), with_calibration(prepared, friction.calibration[own[0]])


def _predicted(
    friction: Friction,
    seen: Sequence[tuple[Array, Plant, InitialStates, PrecedingSamples | None]],
    owner: Array,
) -> tuple[InitialStates, Rollout]:
    """Starts with the measured angles that their owners (S,) see, and the motion they predict.

    seen : folds that see the data alike, with plant, starts and preceding as they see them
    """
    _, first, starts, preceding = seen[0]
    starts = starts._replace(q=starts.q.copy(), u=starts.u.copy(), measured=starts.measured.copy())
    plant = first[starts.recording]
    p = np.array(plant.p)
    for own, theirs, view, before in seen:
        use = np.flatnonzero(np.isin(owner, own))
        starts.q[use], p[use] = view.q[use], theirs.p[starts.recording[use]]
        starts.u[:, use], starts.measured[:, use] = (x[:, use] for x in (view.u, view.measured))
        if preceding is not None and before is not None:
            preceding = preceding.mixed(before, np.isin(preceding.owner, use))
    return starts, predict(replace(plant, p=p), friction[owner], starts, preceding)


def _ran(
    friction: Friction, views: Sequence[tuple[Array, Prepared]], trajectory: Trajectory, held: Array
) -> tuple[Array, Trajectory]:
    """Simulated angles of whole recordings, each by the friction that has not seen it."""
    owner = np.maximum(held, 0)
    measured, q = np.empty_like(trajectory.measured), np.empty_like(trajectory.measured)
    for own, view in views:
        assert view.trajectory is not None
        use = np.isin(owner, own)
        measured[:, use] = view.trajectory.measured[:, use]
        if len(views) == 1:
            return free_run(view.plant, friction[owner], view.trajectory), view.trajectory
        part = some_of(view.trajectory, np.flatnonzero(use))
        q[:, use] = free_run(view.plant[np.flatnonzero(use)], friction[owner[use]], part)
    return q, trajectory._replace(measured=measured)


def judge(friction: Friction, prepared: Prepared) -> tuple[list[Row], list[dict[str, Any]]]:
    """Rows of scores of one friction (n, P) on data that it was not fitted to, and examples.

    Raises
    ------
    InputError
        Where the friction is not that of one mechanism with as many joints.
    """
    n = prepared.plant.n
    if friction.theta.ndim != 2 or friction.n != n:
        raise InputError(
            f"data set {prepared.dataset.name!r} has {n} joints, the model's theta has shape "
            f"{tuple(friction.theta.shape)}: it must be ({n}, {len(friction.law.names)})"
        )
    prepared = with_calibration(prepared, friction.calibration)
    calibration, friction = friction.calibration, replace(friction, calibration=None)
    rows: list[Row] = []
    batch = friction[None]
    for score, problem in _problems(prepared):
        whole = np.zeros(len(problem.r), dtype=int)
        residual = held_out_residual(batch, problem, whole == 0, whole)
        rows += _pooled(one_step_rows(residual, whole, score))
    starts = prepared.starts
    everyone = np.zeros(len(starts.recording), dtype=int)
    plant = prepared.plant[starts.recording]
    motion = predict(plant, batch[everyone], starts, prepared.preceding)
    everywhere = np.zeros_like(starts.last)
    rows += _pooled(rollout_rows(motion, starts, everywhere, _angle_unit(prepared)))
    if prepared.true is not None:
        ideal = predict(plant, batch[everyone], prepared.true)
        rows += _pooled(true_start_rows(ideal, prepared.true, everywhere, _angle_unit(prepared)))
    if prepared.trajectory is not None:
        all_ = np.zeros(len(prepared.trajectory.names), dtype=int)
        q = free_run(
            prepared.plant, replace(batch[all_], calibration=calibration), prepared.trajectory
        )
        rows += _pooled(free_run_rows(q, prepared.trajectory, all_))
    rows += _pooled(curve_scores(batch, friction, prepared))
    rows.append(_count(friction))
    return rows, _examples(motion.q, prepared, starts.last[-1] > 0, friction_of="all")


def _angle_unit(prepared: Prepared) -> str:
    return prepared.plant.mechanism.description.angle_unit


def _problems(prepared: Prepared) -> tuple[tuple[str, Problem], ...]:
    return ("one_step_euler", prepared.euler), ("one_step_integral", prepared.integral)


def curve_scores(friction: Friction, overall: Friction, prepared: Prepared) -> list[Row]:
    """Curve errors, where the truth is known and friction is a torque."""
    if prepared.dataset.truth is None or friction.mechanism:
        return []
    true = curves(steady_state(prepared.dataset.truth), prepared.grid)
    each = curve_error(curves(friction, prepared.grid), true, prepared.grid)
    return list(curve_rows(each, curve_error(curves(overall, prepared.grid), true, prepared.grid)))


def _pooled(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if row.fold == "all"]


def _count(friction: Friction) -> Row:
    size = float(np.prod(friction.theta.shape[-2:]))
    if friction.law.is_sparse:  # zeros are terms that it does not have
        size = float(np.count_nonzero(np.asarray(friction.theta), axis=(-2, -1)).mean())
    return Row("all", "n_parameters", "count", None, "all", size, "1")


def _examples(
    q: Array, prepared: Prepared, use: Array, friction_of: str, most: int = 3
) -> list[dict[str, Any]]:
    """Predicted and measured motion over the longest horizon, from starts (S,) that may be used."""
    starts = prepared.starts
    full = np.flatnonzero(use)
    chosen = full[np.linspace(0, len(full) - 1, most + 2).round().astype(int)[1:-1]]
    out = []
    for s in np.unique(chosen):
        last = int(starts.last[-1, s])
        r = starts.recording[s]
        out.append(
            {
                "dataset": prepared.dataset.name,
                "recording": prepared.dataset.recordings[r].name,
                "start_s": float(prepared.observed.causal[r].time[starts.index[s]]),
                "friction_of": friction_of,
                "time": np.concatenate([[0.0], np.cumsum(starts.dt[:last, s])]),
                "measured": starts.measured[: last + 1, s],
                "predicted": q[: last + 1, s],
            }
        )
    return out
