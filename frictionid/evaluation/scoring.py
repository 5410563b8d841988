"""Score a friction model on a data set: one step ahead, rollouts, free runs, curves.

A model may consist of several frictions, one for each fold. Every row of a one-step problem, every
rollout and every whole recording is then predicted by the friction of the fold that holds it out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from frictionid.arrays import Array, rms
from frictionid.dynamics.state import State
from frictionid.errors import InputError
from frictionid.fitting.one_step.residual import Problem
from frictionid.fitting.shooting import SampleWindows
from frictionid.friction import Friction, Law, along, along_own, present

from .curves import curve_error, curve_scores, dissipated, steady_state
from .folds import Folds
from .free_run import free_run, free_run_scores, trajectory_folds
from .initial_states import InitialStates, initial_state_folds
from .predicted_motion import (
    HorizonErrors,
    common_examples,
    horizon_errors,
    jackknife_width,
    predict,
    ranked_examples,
    rollout_scores,
)
from .prepared import CalibratedView, Prepared, calibrated_views
from .score_frame import Score, parts_of, score_frame
from .statistics import FEWEST
from .torque_left import (
    TorqueWindows,
    has_torque,
    row_torques,
    sliding,
    torque_scores,
    torque_windows,
)


def held_out_residual(friction: Friction, problem: Problem, use: Array, fold: Array) -> Array:
    """Residuals (k, n) [rad/s] of some rows, each by the friction that has not seen it.

    friction : batch of F frictions; use : (K,) true for the k rows; fold : (k,) friction of each.
    """
    rows = np.flatnonzero(use)
    whole = problem.of_rows(rows)
    owner = np.zeros(len(whole.nodes.first) - 1, dtype=int)
    owner[whole.recording] = fold
    undivided = (owner[whole.recording] == fold).all()
    if undivided and friction.law.has_memory and type(friction.law).relaxation is Law.relaxation:
        return whole.residual(along_own(friction[owner], whole.nodes))
    out = np.empty((len(rows), problem.r.shape[-1]))
    for f in np.unique(fold):
        held = problem.of_rows(rows[fold == f])
        out[fold == f] = held.residual(along(friction[int(f)], held.nodes))
    return out


def one_step_scores(
    residual: Array, fold: Array, score: str, units: Sequence[str], sizes: Array
) -> Iterator[Score]:
    """Scores of residuals (K, n): of their norm over the joints in each fold and pooled, of joints.

    Mean, rms, median and 90 % quantile of their sizes, all finite.

    units : of the joints' velocities ; sizes : (n,) of the joints, see `joint_scales`
    """
    for errors, part in parts_of(residual, fold, Score("all", score), units, sizes):
        statistics = {
            "mean": np.mean(errors),
            "rms": rms(errors),
            "median": np.median(errors),
            "q90": np.quantile(errors, 0.9),
        }
        for name, value in statistics.items():
            yield part._replace(statistic=name, value=float(value))


class Evaluation(NamedTuple):
    """Scores of a model, and some of the motions that it predicts.

    scores : score frame, see `frictionid.evaluation.score_frame`
    motions : predicted and measured angles over the longest horizon, as result files have them
    errors : of its predictions from each start
    curves : (F + 1, V, n) [N m] of the folds and of all data; NaN of black boxes, which have none
    """

    scores: pd.DataFrame
    motions: list[dict[str, Any]]
    errors: HorizonErrors
    curves: Array


class HeldOut(NamedTuple):
    """The fold that holds out each thing that is scored, -1 where none does: that is not scored.

    rows : (K,) of both one-step problems; rollouts : (H, S) up to each horizon; recordings : (R,)
    """

    rows: tuple[Array, Array]
    rollouts: Array
    recordings: Array


class _Model(NamedTuple):
    """F frictions (F, n, P), and the data as each of them sees them."""

    friction: Friction
    views: Sequence[CalibratedView]

    @property
    def first(self) -> Prepared:
        """The data as the first of them sees them."""
        return self.views[0][1]

    def owned(self, owner: Array) -> Iterator[tuple[Prepared, Array]]:
        """The data, and which of the things that friction `owner` (N,) predicts are seen so."""
        for folds, data in self.views:
            yield data, np.flatnonzero(np.isin(owner, folds))


def score_folds(
    friction: Friction,
    overall: Friction,
    prepared: Prepared,
    folds: Folds,
    views: Sequence[CalibratedView] | None = None,
) -> Evaluation:
    """Held-out scores of the frictions (F, n, P) of the folds.

    A friction with a calibration is scored on the data corrected by it.

    Parameters
    ----------
    friction, overall : of the folds, and of all data, which has a curve error
    prepared : the uncorrected data
    folds : of the same recordings
    views : `calibrated_views` of the frictions' calibrations, where they have been made before;
        those of further folds are left out
    """
    euler, integral = (
        folds.held_out(problem.recording, problem.time)
        for problem in (prepared.euler, prepared.integral)
    )
    held_out = HeldOut(
        (euler, integral),
        initial_state_folds(prepared.initial_states, folds, prepared.causal),
        np.zeros(0, dtype=int)
        if prepared.trajectory is None
        else trajectory_folds(prepared.trajectory, folds),
    )
    count = len(friction.theta)
    views = views or calibrated_views(prepared, friction.calibration, count)
    fitted = [(alike[alike < count], data) for alike, data in views]
    model = _Model(friction, [(alike, data) for alike, data in fitted if len(alike)])
    return _scored(model, overall, prepared, held_out, "fold")


def score_model(friction: Friction, prepared: Prepared) -> Evaluation:
    """Scores of one friction (n, P) on data that it was not fitted to.

    A friction with a calibration is scored on the data corrected by it.

    Raises
    ------
    InputError
        Where the friction is not that of one mechanism with as many joints.
    """
    n = prepared.plant.parts
    if friction.theta.ndim != 2 or friction.n != n:
        raise InputError(
            f"data set {prepared.dataset.name!r} has {n} joints, the model's theta has shape "
            f"{tuple(friction.theta.shape)}: it must be ({n}, {len(friction.law.names)})"
        )
    recordings = 0 if prepared.trajectory is None else len(prepared.trajectory.names)
    everything = HeldOut(
        (np.zeros(len(prepared.euler.r), int), np.zeros(len(prepared.integral.r), int)),
        np.where(prepared.initial_states.last > 0, 0, -1),
        np.zeros(recordings, dtype=int),
    )
    batch = friction[None]
    model = _Model(batch, calibrated_views(prepared, batch.calibration, 1))
    return _scored(model, friction, prepared, everything, "all")


def _scored(
    model: _Model, overall: Friction, prepared: Prepared, held_out: HeldOut, friction_of: str
) -> Evaluation:
    """All that is scored; friction of "all" data has no scores of folds."""
    # where any horizon of a rollout is held out, one fold holds it out: its friction predicts
    owner = np.maximum(held_out.rollouts.max(axis=0), 0)
    initial, motion = _rollouts(model, owner)
    scores, windows = _one_step_scores(model, held_out)
    held, units, grid = held_out.rollouts, prepared.position_units, prepared.grid
    scores += rollout_scores(motion, initial, held, units)
    if prepared.true_initial_states is not None:
        true, ideal = _rollouts(model, owner, true=True)
        scores += rollout_scores(ideal, true, held, units, true=True)
    if prepared.trajectory is not None:
        scores += _free_run_scores(model, held_out.recordings)
    lines = np.concatenate([model.friction.curve(grid), overall.curve(grid)[None]])
    if overall.mechanism:
        lines = np.full_like(lines, np.nan)
    elif prepared.dataset.truth is not None:
        true_curves = steady_state(prepared.dataset.truth).curve(grid)
        scores += curve_scores(curve_error(lines, true_curves, grid))
    scores.append(_parameter_count(model.friction))
    if friction_of == "all":
        scores = [score for score in scores if score.fold == "all"]
    shown = motion.q, initial, prepared, held[-1] >= 0
    band = partial(_band, model) if len(model.friction.theta) >= FEWEST else None
    motions = [*common_examples(*shown), *ranked_examples(*shown, band)]
    motions = [{**example, "friction_of": friction_of} for example in motions]
    errors = horizon_errors(motion, initial, held, units)
    if windows is not None:
        errors = errors._replace(
            torque=windows.error, torque_recording=windows.recording, torque_fold=windows.fold
        )
    return Evaluation(score_frame(scores), motions, errors, lines)


def _one_step_scores(model: _Model, held_out: HeldOut) -> tuple[list[Score], TorqueWindows | None]:
    """Scores of one step, and the torque that it leaves, where torques were measured."""
    data, sharp = model.first, sliding(model.friction)
    scores: list[Score] = []
    units, sizes = data.plant.mechanism.velocity_units, data.dataset.scales.size
    for name, held in zip(("euler", "integral"), held_out.rows, strict=True):
        residual, energy = np.empty((len(held), data.plant.n)), np.zeros((2, len(held)))
        torque = np.zeros((2, *residual.shape))
        for folds, data in model.views:
            use = np.isin(held, folds)
            place = np.searchsorted(folds, held[use])
            problem: Problem = getattr(data, name)
            unexplained = held_out_residual(model.friction[folds], problem, use, place)
            residual[use] = unexplained[:, : data.plant.n]  # coupled parts add no rows
            energy[:, use] = dissipated(problem, residual[use], use)
            if name == "integral":
                if sharp.law is not model.friction.law:
                    unexplained = held_out_residual(sharp[folds], problem, use, place)
                torque[:, use] = row_torques(problem, unexplained[:, : data.plant.n], use)
        scores += one_step_scores(residual, held, f"one_step_{name}", units, sizes)
    if model.friction.mechanism:
        return scores, None
    scores += _energy_scores(energy, held)  # of the momentum balance, the last one
    if not has_torque(data.dataset):
        return scores, None
    windows = torque_windows(torque, data.integral, held, data.plant.mechanism)
    return [*scores, *torque_scores(windows, data.plant.mechanism)], windows


def _energy_scores(energy: Array, fold: Array) -> Iterator[Score]:
    """Energy that the model's friction takes, in units of what the motion implies (2, K).

    Of all folds only where the motion of each implies that friction takes some: else it is the
    balance that is off.
    """
    parts = [(str(f), energy[:, fold == f].sum(axis=1)) for f in np.unique(fold)]
    if all(implied > 0 for _, (implied, _) in parts):
        parts.append(("all", energy.sum(axis=1)))
    for name, (implied, taken) in parts:
        if implied > 0:
            yield Score(name, "dissipated_energy", "ratio", value=float(taken / implied))


def _rollouts(
    model: _Model, owner: Array, *, rows: Array | None = None, true: bool = False
) -> tuple[InitialStates, State]:
    """Initial states with the angles as their owners (S,) see them, and the motion they predict.

    rows : (S,) which of the initial states, all by default; true : from the true states
    """
    first = model.first
    initial, preceding = _starts(first, rows, true)
    plant = first.plant[initial.recording]
    p = np.array(plant.p)
    for data, starts in model.owned(owner):
        if data is first:
            continue
        calibrated, before = _starts(data, rows, true)
        initial = initial.with_rows(calibrated, starts)
        p[starts] = data.plant.p[initial.recording[starts]]
        if preceding is not None and before is not None:
            preceding = preceding.with_rows(before, np.isin(preceding.owner, starts))
    plant = replace(plant, p=p)
    return initial, predict(plant, model.friction[owner], initial, preceding)


def _band(model: _Model, rows: Array) -> Array:
    """Half the width (T + 1, k, n) of 95 % intervals of predictions from some initial states (k,).

    By what the folds' frictions predict from there, each less the angles as it sees them.
    """
    folds = len(model.friction.theta)
    owner = np.repeat(np.arange(folds), len(rows))
    initial, motion = _rollouts(model, owner, rows=np.tile(rows, folds))
    error = motion.q - initial.measured
    each = error.reshape(len(error), folds, len(rows), error.shape[-1])
    return jackknife_width(np.swapaxes(each, 0, 1))


def _starts(
    data: Prepared, rows: Array | None, true: bool
) -> tuple[InitialStates, SampleWindows | None]:
    """Initial states of some rows, true ones or with the samples before them."""
    initial = data.true_initial_states if true else data.initial_states
    preceding = None if true else data.preceding
    assert initial is not None
    if rows is None:
        return initial, preceding
    return initial.take(rows), preceding and preceding.take(rows)


def _free_run_scores(model: _Model, held: Array) -> Iterator[Score]:
    """Scores of whole recordings (R,), each simulated by the friction that has not seen it."""
    trajectory = model.first.trajectory
    assert trajectory is not None
    owner = np.maximum(held, 0)
    measured, q = np.empty_like(trajectory.measured), np.empty_like(trajectory.measured)
    for data, rows in model.owned(owner):
        if len(rows) and data.trajectory is not None:
            trajectories = data.trajectory.take(rows)
            measured[:, rows] = trajectories.measured
            q[:, rows] = free_run(data.plant[rows], model.friction[owner[rows]], trajectories)
    units = model.first.position_units
    yield from free_run_scores(q, trajectory._replace(measured=measured), held, units)


def _parameter_count(friction: Friction) -> Score:
    """Number of fitted parameters, with those that shooting freed beside friction."""
    size = float(present(friction.law, friction.theta).sum(axis=(-2, -1)).mean())
    refined = friction.provenance.refined
    size += 0 if refined is None else refined.beside_friction
    return Score("all", "n_parameters", "count", value=size)
