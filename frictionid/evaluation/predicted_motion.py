"""Predicted motion: its errors, examples to look at, and as a table beside what was measured.

Examples are from the same starts for all models, and from each model's own ones: those of its best,
its median and its worst prediction of motion over the longest horizon. They come with the band of
the prediction and, where the mechanism draws itself, lines.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from frictionid.arrays import Array, evenly
from frictionid.data.joint_scales import TURN, are_mixed, joint_sizes, norm_of
from frictionid.data.recordings import Dataset
from frictionid.dynamics.closed_loop import closed_loop
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.errors import InputError
from frictionid.fitting.shooting import SampleWindows
from frictionid.friction import Friction, Memory, memory_along
from frictionid.mechanics import Plant

from .free_run import free_run
from .initial_states import InitialStates, estimate_initial_states
from .prepared import Prepared, Protocol, calibrated_views, prepare, prepared_for
from .reference_model import StartErrors
from .score_frame import Score, parts_of, summarise_rollouts
from .statistics import FEWEST


def predict(
    plant: Plant,
    friction: Friction,
    initial: InitialStates,
    preceding: SampleWindows | None = None,
) -> State:
    """Motion from all initial states; plant and friction have one entry for each, theta (S, n, P).

    preceding : where each friction estimates its own initial states, see `state_estimator`

    A temperature is that of the start all along.
    """
    friction = friction.at_temperature(initial.temperature)
    if preceding is None:
        state = State(initial.q, initial.w, memory_at(friction, initial))
    else:
        state = estimate_initial_states(plant, friction, preceding, initial)
    controllers = initial.controllers
    if controllers is not None:
        return closed_loop(plant, friction, state, controllers, base_motion=initial.base_motion)
    return rollout(plant, friction, state, initial.u, initial.dt, base_motion=initial.base_motion)


def memory_at(friction: Friction, initial: InitialStates) -> Memory:
    """Memory at each initial state, from the motion before it."""
    if not friction.law.has_memory:
        return ()
    unique, back = np.unique(np.asarray(friction.theta), axis=0, return_inverse=True)
    back = np.reshape(back, -1)  # NumPy 2.0 gives it more axes
    steps = memory_along(Friction(friction.law, unique), initial.nodes)  # entries (U, R, n)
    parts = range(len(steps[0]))
    chosen = zip(initial.index, back, initial.recording, strict=True)
    rows = [[steps[k][m][u, r] for m in parts] for k, u, r in chosen]
    return tuple(np.stack([row[m] for row in rows]) for m in parts)


def rollout_scores(
    motion: State,
    initial: InitialStates,
    fold: Array,
    units: Sequence[str],
    *,
    true: bool = False,
) -> Iterator[Score]:
    """Scores for every horizon against the measured angles, and the true ones where they are known.

    units : of each joint's position, "rad" or "m"
    fold : (H, S) as `initial_state_folds` gives it, or zeros where nothing was fitted to these data
    true : whether the motion starts from true states, and is compared with the true angles only
    """
    angles = {"rollout_angle": initial.measured, "rollout_angle_truth": initial.truth}
    angles = {"rollout_true_start": initial.truth} if true else angles
    limit = joint_sizes(units, initial.truth if true else initial.measured)
    far = {str(j): float(size) for j, size in enumerate(limit, 1)}
    far["all"] = TURN if are_mixed(units) else float(limit.max())
    for score, reference in angles.items():
        for h, horizon in enumerate(initial.horizons):
            use = (initial.last[h] > 0) & (fold[h] >= 0)
            if reference is not None and use.any():
                at = initial.last[h, use], np.flatnonzero(use)
                error = motion.q[at] - reference[at]
                template = Score("all", score, horizon_s=float(horizon))
                for size, part in parts_of(error, fold[h, use], template, units, limit):
                    yield from summarise_rollouts(size, part, far[part.joint])


class HorizonErrors(NamedTuple):
    """Errors (H, S, n) of predictions after H horizons [s], from S starts, in units of what is far.

    That is the size of a joint, or of the largest one; not finite where a prediction has diverged.

    recording, fold : (S,) of each start; held_out : (H, S) where the error counts
    torque : (W, n) left over W windows of time, in units of the measured torque of all joints, none
        where none was measured; torque_recording, torque_fold : (W,) of each
    """

    horizons: Array
    recording: Array
    fold: Array
    held_out: Array
    error: Array
    torque: Array = np.empty((0, 1))
    torque_recording: Array = np.empty(0, dtype=int)
    torque_fold: Array = np.empty(0, dtype=int)

    def after(self, horizon: float) -> StartErrors:
        """The errors after the nearest horizon, of each recording; those of torque after none, NaN.

        Of each fold, where they are of fewer than three recordings.
        """
        if np.isnan(horizon):
            return _grouped(self.torque, self.torque_recording, self.torque_fold)
        nearest = int(np.argmin(np.abs(self.horizons - horizon)))
        used = self.held_out[nearest]
        return _grouped(self.error[nearest, used], self.recording[used], self.fold[used])


def read_errors(document: Mapping[str, Any]) -> HorizonErrors:
    """Errors of predictions by the document of them that a result folder has."""
    kinds = {"held_out": bool} | {
        f"{kind}{name}": int for kind in ("", "torque_") for name in ("recording", "fold")
    }
    arrays = {k: np.asarray(v, dtype=kinds.get(k, float)) for k, v in document.items()}
    return HorizonErrors(**arrays)


def _grouped(error: Array, recording: Array, fold: Array) -> StartErrors:
    few = len(np.unique(recording)) < FEWEST
    return StartErrors(error, fold if few else recording)


def horizon_errors(
    motion: State, initial: InitialStates, fold: Array, units: Sequence[str]
) -> HorizonErrors:
    """Errors of all predictions against the measured angles; `fold` as for `rollout_scores`."""
    limit = joint_sizes(units, initial.measured)
    held_out = (initial.last > 0) & (fold >= 0)
    error = (motion.q - initial.measured)[initial.last, np.arange(len(initial.recording))]
    error = np.where(held_out[..., None], error, 0.0)
    size = limit if are_mixed(units) else limit.max()
    owner = fold.max(axis=0)
    return HorizonErrors(initial.horizons, initial.recording, owner, held_out, error / size)


# --- Examples ---------------------------------------------------------------------------------

PLACES = {"best": 0.0, "median": 0.5, "worst": 1.0}  # ranks among all predictions
_WAY = 0.1
FRAMES = 61  # drawings of a motion at most


def common_examples(
    q: Array, initial: InitialStates, prepared: Prepared, use: Array, most: int = 3
) -> Iterator[dict[str, Any]]:
    """Predicted and measured motion over the longest horizon, of rollouts (S,) that may be used.

    q : (T + 1, S, n), what is predicted from the initial states
    """
    full = np.flatnonzero(use)
    chosen = full[np.linspace(0, len(full) - 1, most + 2).round().astype(int)[1:-1]]
    for s in np.unique(chosen):
        yield example(q, initial, prepared, int(s))


def ranked_examples(
    q: Array,
    initial: InitialStates,
    prepared: Prepared,
    use: Array,
    band: Callable[[Array], Array] | None = None,
) -> Iterator[dict[str, Any]]:
    """Motion from the best, the median and the worst start, with what is drawn of them.

    Of starts from which a joint moves, where there are so many: rest is predicted best.

    band : half the width (T + 1, k, n) of the band about the predictions from some starts (k,)
    """
    full, last = _moving(np.flatnonzero(use), initial, prepared), initial.last[-1]
    error = q[last[full], full] - initial.measured[last[full], full]
    units = prepared.position_units
    norm, unit = norm_of(error, units, joint_sizes(units, initial.measured))
    order = full[np.argsort(np.where(np.isfinite(norm), norm, np.inf), kind="stable")]
    rows = order[[round(rank * (len(order) - 1)) for rank in PLACES.values()]]
    widths = None if band is None else band(rows)
    for i, (place, s) in enumerate(zip(PLACES, rows, strict=True)):
        motion = example(q, initial, prepared, int(s))
        place_facts = {"place": place, "error": norm[full == s][0], "error_unit": unit}
        width = None if widths is None else widths[: last[s] + 1, i]
        yield {**motion, **place_facts, "band": width, **_drawing(prepared, motion)}


def _moving(full: Array, initial: InitialStates, prepared: Prepared) -> Array:
    """Starts (k,) from which a joint moves by a tenth of its size; all where few do."""
    measured = initial.measured[:, full]
    sizes = joint_sizes(prepared.position_units, initial.measured)
    way = np.nanmax(measured, axis=0) - np.nanmin(measured, axis=0)
    moving = full[(way > _WAY * sizes).any(axis=-1)]
    return moving if len(moving) >= len(PLACES) else full


def jackknife_width(values: Array) -> Array:
    """Half the width of 95 % intervals of numbers, from those (F, ...) without each fold.

    The delete-a-group jackknife [Shao1995] with Student's quantile of F - 1 degrees of freedom:

        se^2 = (F - 1)/F sum (x_f - mean)^2

    It is the interval of the mean, where each number is the mean of all values but a fold's own:

    >>> x = np.array([1.0, 2.0, 4.0])
    >>> mean_without = (x.sum() - x) / 2
    >>> bool(np.isclose(jackknife_width(mean_without), stdtrit(2, 0.975) * x.std(ddof=1) / 3**0.5))
    True
    """
    folds = len(values)
    with np.errstate(all="ignore"):
        scatter = ((values - values.mean(axis=0)) ** 2).sum(axis=0)
        return stdtrit(folds - 1, 0.975) * np.sqrt((folds - 1) / folds * scatter)


def example(q: Array, initial: InitialStates, prepared: Prepared, s: int) -> dict[str, Any]:
    """Predicted and measured motion of one rollout over the longest horizon that it reaches."""
    last, r = int(initial.last[-1, s]), int(initial.recording[s])
    return {
        "dataset": prepared.dataset.name,
        "recording": prepared.dataset.recordings[r].name,
        "start_s": float(prepared.causal[r].time[initial.index[s]]),
        "time": np.concatenate([[0.0], np.cumsum(initial.dt[:last, s])]),
        "measured": initial.measured[: last + 1, s],
        "predicted": q[: last + 1, s],
    }


def _drawing(prepared: Prepared, motion: dict[str, Any]) -> dict[str, Any]:
    """Lines of the mechanism (f, k, 2 or 3) at some of a motion's times; nothing without them."""
    time = motion["time"]
    frames = evenly(len(time), FRAMES)
    mechanism = prepared.dataset.mechanism
    measured, predicted = (
        mechanism.points(motion[name][frames]) for name in ("measured", "predicted")
    )
    if measured is None or predicted is None:
        return {}
    lines = {"measured": measured.round(5), "predicted": predicted.round(5)}
    return {"drawing": {"time": time[frames], **lines}}


# --- As a table -------------------------------------------------------------------------------

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
    """Motion that a model predicts under recorded torques or servos, a line for each sample.

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
    check_joints(friction, dataset)
    if start is not None and (whole or every is not None):
        raise InputError("start does not go with whole or every: it is that of one prediction")
    protocol = Protocol(horizons=(horizon,), every=every or horizon, whole=whole)
    if start is not None:
        longest = max(r.angle.duration for r in dataset.recordings)
        if not start >= 0:
            raise InputError(f"start = {start} must be 0 s or more after the first sample")
        if start + horizon > longest + 1e-9:
            raise InputError(
                f"data set {dataset.name!r}: no recording has {horizon:g} s of motion from "
                f"{start:g} s after its first sample, the longest is {longest:g} s: begin earlier"
            )
        protocol = replace(protocol, every=_NEVER, history=start)
    prepared = prepared_for(prepare(dataset, protocol), friction)
    batch = friction[None]
    (_, data), *_ = calibrated_views(prepared, batch.calibration, 1)
    parts = _whole(data, batch) if whole else _pieces(data, batch)
    return pd.concat(parts, ignore_index=True)


def check_joints(friction: Friction, dataset: Dataset) -> None:
    """Refuse a friction that is not of as many joints as the data."""
    joints = len(dataset.mechanism.friction_names)
    if friction.theta.ndim != 2 or friction.n != joints:
        raise InputError(
            f"data set {dataset.name!r} has {joints} joints, the model has {friction.n}: give a "
            "model of the same mechanism"
        )


def _pieces(data: Prepared, friction: Friction) -> Iterator[pd.DataFrame]:
    initial = data.initial_states
    owner = np.zeros(len(initial.recording), dtype=int)
    motion = predict(data.plant[initial.recording], friction[owner], initial)
    for s in range(len(owner)):
        seen = example(motion.q, initial, data, s)
        values = {
            "q": seen["predicted"],
            "w": motion.w[: len(seen["time"]), s],
            "measured_q": seen["measured"],
        }
        yield _table(seen["recording"], seen["start_s"], seen["time"], values)


def _whole(data: Prepared, friction: Friction) -> Iterator[pd.DataFrame]:
    trajectory = data.trajectory
    assert trajectory is not None
    owner = np.zeros(len(trajectory.names), dtype=int)
    q = free_run(data.plant, friction[owner], trajectory)
    for r, name in enumerate(trajectory.names):
        count = int(np.isfinite(trajectory.measured[:, r]).all(axis=-1).sum())
        time = trajectory.time[:count, r]
        values = {"q": q[:count, r], "measured_q": trajectory.measured[:count, r]}
        yield _table(name, float(time[0]), time - time[0], values)


def _table(recording: str, start: float, ahead: Array, values: Mapping[str, Array]) -> pd.DataFrame:
    """A motion, a line for each time `ahead` (T,) of its start; values (T, n) of the joints."""
    time = {"recording": recording, "start_s": start, "time_s": start + ahead, "ahead_s": ahead}
    columns = {
        f"{name}{j}": column
        for name, joints in values.items()
        for j, column in enumerate(joints.T, 1)
    }
    return pd.DataFrame(time | columns)
