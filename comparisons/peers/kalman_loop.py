"""The ordinary way to smooth an angle: a Kalman filter and RTS smoother, sample by sample in NumPy.

State (angle, velocity, acceleration), white jerk [RauchTungStriebel1965]; the ratio of its
intensity to the measurement noise maximises the likelihood of the innovations.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

DIFFUSE = np.diag([1e6, 1e14, 1e18])
DECADES = (-6.0, 14.0)  # of the jerk intensity over the measurement variance
KNOWN = 3  # samples that determine the state


def smoothed_velocity(time: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Velocities (T,) [rad/s] of one angle (T,) [rad] at times (T,) [s]."""
    found = minimize_scalar(
        lambda log: -_filtered(time, angle, 10.0**log)[2],
        bounds=DECADES,
        method="bounded",
        options={"xatol": 0.02},
    )
    means, covariances, _ = _filtered(time, angle, 10.0**found.x)
    smooth = means.copy()
    for k in range(len(time) - 2, -1, -1):
        F, Q = _transition(time[k + 1] - time[k], 10.0**found.x)
        ahead = F @ covariances[k] @ F.T + Q
        gain = np.linalg.solve(ahead, F @ covariances[k]).T
        smooth[k] += gain @ (smooth[k + 1] - F @ means[k])
    return smooth[:, 1]


def _transition(dt: float, rho: float) -> tuple[np.ndarray, np.ndarray]:
    F = np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    Q = [
        [dt**5 / 20, dt**4 / 8, dt**3 / 6],
        [dt**4 / 8, dt**3 / 3, dt**2 / 2],
        [dt**3 / 6, dt**2 / 2, dt],
    ]
    return F, rho * np.array(Q)


def _filtered(
    time: np.ndarray, angle: np.ndarray, rho: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Filtered means (T, 3), covariances (T, 3, 3), and the log likelihood of the innovations."""
    x, P = np.array([angle[0], 0.0, 0.0]), DIFFUSE
    means, covariances, innovations, variances = [], [], [], []
    for k, value in enumerate(angle):
        if k:
            F, Q = _transition(time[k] - time[k - 1], rho)
            x, P = F @ x, F @ P @ F.T + Q
        innovation, variance = value - x[0], P[0, 0] + 1.0
        gain = P[:, 0] / variance
        x, P = x + gain * innovation, P - np.outer(gain, P[0])
        means.append(x)
        covariances.append(P)
        innovations.append(innovation)
        variances.append(variance)
    e, s = np.array(innovations)[KNOWN:], np.array(variances)[KNOWN:]
    likelihood = -0.5 * (len(e) * np.log(np.mean(e**2 / s)) + np.log(s).sum())
    return np.array(means), np.array(covariances), float(likelihood)
