"""Problems whose friction is known exactly, and what fits of them are compared with."""

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from frictionid.arrays import times
from frictionid.friction import Friction, along
from frictionid.identifiers.linearised import Rows
from frictionid.identifiers.practice import practice_problem


def explained_by(law, theta, noise=0.0, rng=None):
    """Problem whose r a friction explains, but for noise [rad/s]; theta (n, P)."""
    theta = np.asarray(theta, dtype=float)
    problem = practice_problem(len(theta))
    torque = along(Friction(law, theta), problem.nodes)
    r = times(problem.G, problem.mean(torque))
    return replace(problem, r=r if rng is None else r + noise * rng.standard_normal(r.shape))


def everything(problem):
    """Weights of one fold that has all rows."""
    return np.ones((1, len(problem.r)))


def cost(problem, weights, friction):
    """Weighted squares of each fold, (F,) [rad^2/s^2]."""
    residual = problem.residual(along(friction, problem.nodes))
    return np.einsum("fk,fki->f", weights, residual**2)


def started_at(law, start):
    """The law with one start only."""
    return type("Started", (type(law),), {"initial": (tuple(start),)})(**vars(law))


def standard_errors(law, theta, problem, noise):
    """Standard errors (n, P) of least squares at the true theta, rows of independent noise."""
    J = Rows(law, problem).slopes(np.ravel(theta)[None]).reshape(-1, np.size(theta))
    return noise * np.sqrt(np.diag(np.linalg.inv(J.T @ J))).reshape(np.shape(theta))


def by_scipy(law, problem, weights, start, jac="2-point"):
    """Parameters (n, P) of one fold by scipy.optimize.least_squares; jac="ours" uses our slopes."""
    low, high = Rows(law, problem).bounds
    root = np.sqrt(weights)[:, None]

    def residual(theta):
        friction = Friction(law, theta.reshape(np.shape(start)))
        return (root * problem.residual(along(friction, problem.nodes))).ravel()

    def ours(theta):
        slopes = Rows(law, problem).slopes(theta[None])[0].reshape(*problem.r.shape, -1)
        return -(root[..., None] * slopes).reshape(-1, theta.size)

    tight = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "max_nfev": 500}
    begin = np.clip(np.ravel(start), low + 1e-9, high)
    found = least_squares(
        residual,
        begin,
        jac=ours if jac == "ours" else jac,
        bounds=(low, high),
        x_scale="jac",
        **tight,
    )
    return found.x.reshape(np.shape(start))


def stationarity(law, problem, weights, theta):
    """How far theta (n, P) is from a minimum within the bounds, relative, (n, P); 0 at one.

    The part of the gradient that no bound holds, over the size of residual and slopes.
    """
    low, high = (b.reshape(np.shape(theta)) for b in Rows(law, problem).bounds)
    rows, flat = Rows(law, problem), np.ravel(theta)[None]
    root = np.sqrt(weights)[:, None]
    J = (rows.slopes(flat)[0].reshape(*problem.r.shape, -1) * root[..., None]).reshape(
        -1, flat.size
    )
    e = (rows.residual(flat)[0] * root).ravel()
    size = np.linalg.norm(J, axis=0) * np.linalg.norm(e) + 1e-300
    downhill = (J.T @ e / size).reshape(np.shape(theta))
    held = ((theta <= low) & (downhill < 0)) | ((theta >= high) & (downhill > 0))
    return np.where(held, 0.0, downhill)
