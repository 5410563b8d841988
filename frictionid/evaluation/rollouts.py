"""Rollout scores: the error of predictions from many initial states after given times."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.data.joint_scales import TURN, joint_sizes, norm_of
from frictionid.dynamics.rollout import Rollout, rollout
from frictionid.dynamics.state import State
from frictionid.evaluation.initial_state_estimator import estimate_initial_states
from frictionid.evaluation.initial_states import InitialStates
from frictionid.evaluation.score_frame import Score, summarise_rollouts
from frictionid.fitting.shooting import SampleWindows
from frictionid.friction import Friction, Memory, memory_along
from frictionid.mechanics import Plant


def predict(
    plant: Plant,
    friction: Friction,
    initial: InitialStates,
    preceding: SampleWindows | None = None,
) -> Rollout:
    """Motion from all initial states; plant and friction have one entry for each, theta (S, n, P).

    preceding : where each friction estimates its own initial states, see `state_estimator`

    A temperature is that of the start all along.
    """
    friction = friction.at_temperature(initial.temperature)
    if preceding is None:
        state = State(initial.q, initial.w, _memory(friction, initial))
    else:
        state = estimate_initial_states(plant, friction, preceding, initial)
    return rollout(plant, friction, state, initial.u, initial.dt)


def _memory(friction: Friction, initial: InitialStates) -> Memory:
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
    motion: Rollout,
    initial: InitialStates,
    fold: Array,
    position_units: Sequence[str] = (),
    *,
    true: bool = False,
) -> Iterator[Score]:
    """Scores for every horizon against the measured angles, and the true ones where they are known.

    position_units : of each joint, "rad" or "m"; all "rad" where there are none
    fold : (H, S) as `initial_state_folds` gives it, or zeros where nothing was fitted to these data
    true : whether the motion starts from true states, and is compared with the true angles only
    """
    angles = {"rollout_angle": initial.measured, "rollout_angle_truth": initial.truth}
    angles = {"rollout_true_start": initial.truth} if true else angles
    units = tuple(position_units) or ("rad",) * motion.q.shape[-1]
    limit = joint_sizes(units, initial.truth if true else initial.measured)
    for score, reference in angles.items():
        for h, horizon in enumerate(initial.horizons):
            use = (initial.last[h] > 0) & (fold[h] >= 0)
            if reference is not None and use.any():
                at = initial.last[h, use], np.flatnonzero(use)
                error = motion.q[at] - reference[at]
                of = Score("all", score, horizon_s=float(horizon))
                yield from _horizon_scores(error, fold[h, use], of, units, limit)


def _horizon_scores(
    error: Array, fold: Array, of: Score, units: Sequence[str], limit: Array
) -> Iterator[Score]:
    norm, unit = norm_of(error, units, limit)
    of, most = of._replace(unit=unit), TURN if unit == "1" else float(limit.max())
    for f in np.unique(fold):
        yield from summarise_rollouts(norm[fold == f], of._replace(fold=str(f)), most)
    yield from summarise_rollouts(norm, of, most)
    for j, (unit, own) in enumerate(zip(units, limit, strict=True)):
        joint = of._replace(joint=str(j + 1), unit=unit)
        yield from summarise_rollouts(np.abs(error[:, j]), joint, float(own))
