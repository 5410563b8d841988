"""Smoothing, and one-step residuals, beside textbook loops and physics evaluated again."""

from __future__ import annotations

import numpy as np
from case import Case, Part, Side
from samples import acrobot

from frictionid.arrays import solve
from frictionid.data.plants import plant_of
from frictionid.data.state_estimators import RTS
from frictionid.fitting.one_step.recipe import STUDY, problem_of, states_of
from frictionid.friction import Friction, along
from frictionid.friction.laws import Stribeck

THETA = np.array([[0.16, 0.05, 1.5, 0.004], [0.05, 0.03, 1.5, 0.001]])


def smoother() -> Part:
    """Velocities of all recordings, the noise ratio of each by maximum likelihood."""
    from kalman_loop import smoothed_velocity

    recordings = acrobot().recordings
    few = recordings[:1]

    def off(some: tuple, velocities: list[np.ndarray]) -> float:
        errors = [v - r.truth.velocity.value for v, r in zip(velocities, some, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))

    def ours() -> float:
        return off(recordings, [s.w for s in RTS()([r.angle for r in recordings])])

    def textbook() -> float:
        columns = [[smoothed_velocity(r.angle.time, a) for a in r.angle.value.T] for r in few]
        return off(few, [np.stack(c, axis=-1) for c in columns])

    peer = Side(
        "textbook Kalman and RTS loop in NumPy, SciPy's minimize_scalar",
        textbook,
        ("numpy", "scipy.optimize"),
        share=len(few) / len(recordings),
    )
    own = Side("frictionid, all series in compiled loops", ours)
    return Part((Case("smoother, 25 recordings", own, peer, "velocity [rad/s]"),), 3)


def residual() -> Part:
    """One-step residuals of all rows for given friction, as a fit needs them again and again."""
    dataset = acrobot()
    plant, friction = plant_of(dataset)[0], Friction(Stribeck(), THETA)
    problem = problem_of(dataset, plant_of(dataset), STUDY)
    x = problem.nodes.inputs
    states = states_of(dataset, STUDY.states, None)
    q, w, w1, u, dt = _rows(dataset, states)

    def ours() -> np.ndarray:
        return problem.residual(along(friction, problem.nodes))

    def again() -> np.ndarray:
        M, h = plant.dynamics(q, w)
        Tf = friction.torque(x._replace(q=q, w=w, u=u, load=0.0 * w), ())
        return w + dt * solve(M, h + u * plant.mechanism.motors - Tf) - w1

    right = ours()
    own = Side("frictionid, r and G known", lambda: float(np.abs(ours() - right).max()))
    peer = Side("physics in each evaluation, NumPy", lambda: float(np.abs(again() - right).max()))
    name = f"one-step residual, {len(right)} rows"
    return Part((Case(name, own, peer, "difference of the two [rad/s]"),), 8)


def _rows(dataset: object, states: tuple) -> tuple[np.ndarray, ...]:
    """q, w, next w, u (K, n) and dt (K, 1) of all intervals."""
    from frictionid.data.integrals import averages

    parts = [
        (s.q[:-1], s.w[:-1], s.w[1:], averages(r.torque, s.time), np.diff(s.time)[:, None])
        for r, s in zip(dataset.recordings, states, strict=True)
    ]
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))
