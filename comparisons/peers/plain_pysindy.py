"""The ordinary way to use PySINDy: angles are differentiated, each fold is fitted anew."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pysindy as ps

from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset, Recording

# steady friction: level, viscous, and two Stribeck peaks
CANDIDATES = [
    lambda w: np.sign(w),
    lambda w: w,
    lambda w: np.sign(w) * np.exp(-((w / 1.0) ** 2)),
    lambda w: np.sign(w) * np.exp(-((w / 2.3) ** 2)),
]
LEAST = 3e-4  # coefficient that is kept, [N m] and [N m s/rad]
SMOOTHED = {"smoother_kws": {"window_length": 7, "polyorder": 3}}


def friction_curves(
    dataset: Dataset, training: Sequence[Recording], grid: np.ndarray
) -> np.ndarray:
    """Friction torques (V, n) at velocities (V, n), from torques that the mechanism lacks."""
    plant, derivative = plant_of(dataset)[0], ps.SmoothedFiniteDifference(**SMOOTHED)
    w, Tf = [], []
    for r in training:
        velocity = derivative(r.angle.value, r.angle.time)
        acceleration = derivative(velocity, r.angle.time)
        M, h = plant.dynamics(r.angle.value, velocity)
        left = (
            h + r.torque.value * plant.mechanism.motors - np.einsum("kij,kj->ki", M, acceleration)
        )
        w.append(velocity)
        Tf.append(left)
    return np.stack([_curve(w, Tf, grid, j) for j in range(grid.shape[1])], axis=1)


def _curve(w: list[np.ndarray], Tf: list[np.ndarray], grid: np.ndarray, j: int) -> np.ndarray:
    model = ps.SINDy(
        optimizer=ps.STLSQ(threshold=LEAST, alpha=1e-6),
        feature_library=ps.CustomLibrary(CANDIDATES),
    )
    model.fit([v[:, [j]] for v in w], t=1.0, x_dot=[T[:, [j]] for T in Tf])
    return np.asarray(model.predict(grid[:, [j]]))[:, 0]


def one_step_errors(
    training: Sequence[Recording], held_out: Sequence[Recording], dt: float
) -> np.ndarray:
    """Errors (K, n) [rad/s] of held-out velocities a sample later, without physics.

    States are angles and their backward differences.
    """
    library = ps.PolynomialLibrary(degree=2) + ps.FourierLibrary(n_frequencies=1)
    model = ps.SINDy(optimizer=ps.STLSQ(threshold=0.1), feature_library=library)
    states, torques = zip(*(_states(r, dt) for r in training), strict=True)
    model.fit(list(states), t=dt, u=list(torques))
    out = []
    for r in held_out:
        x, u = _states(r, dt)
        n = x.shape[1] // 2
        rate = np.asarray(model.predict(x[:-1], u=u[:-1]))[:, n:]
        out.append(x[:-1, n:] + dt * rate - x[1:, n:])
    return np.concatenate(out)


def _states(recording: Recording, dt: float) -> tuple[np.ndarray, np.ndarray]:
    q = recording.angle.value
    return np.hstack([q[1:], np.diff(q, axis=0) / dt]), recording.torque.value[1:]
