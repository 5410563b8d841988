"""Ten folds at once, beside SciPy and PySINDy fold by fold.

The peers fit one fold, which is a tenth of the work.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from case import Case, Part, Side
from samples import RATE, acrobot
from scipy.optimize import least_squares

from frictionid.data.plants import plant_of, unit_inertia_plant
from frictionid.data.recordings import Recording
from frictionid.evaluation import (
    Split,
    curve_error,
    make_folds,
    steady_state,
    velocity_grid,
)
from frictionid.fitting.identifiers import LeastSquares, SINDy, SparseDynamics
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY, problem_of, training_problem
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction import Friction, Law, along
from frictionid.friction.laws import CoulombViscous, Spline, Stribeck

FOLDS = 10
SCIPY = ("numpy", "scipy.optimize")
OURS = ("frictionid.fitting", "frictionid.friction.laws")


class Folds(NamedTuple):
    """A problem, and weights (F, K) of its rows in the training of each fold."""

    problem: Problem
    weights: np.ndarray

    def cost(self, friction: Friction) -> float:
        """Size of the training residuals of the first fold [rad/s]."""
        e = self.problem.residual(along(friction, self.problem.nodes))
        return float(np.sqrt(np.average((e**2).sum(-1), weights=self.weights[0])))

    def held_out(self, e: np.ndarray) -> float:
        """Mean size of residuals e (K, n) in the rows that the first fold leaves out [rad/s]."""
        return float(np.linalg.norm(e, axis=1)[self.weights[0] == 0].mean())


@cache
def ten_folds() -> Folds:
    """Ten folds of whole recordings by our recipe, without the rows of joints at rest."""
    dataset = acrobot()
    return _folds_of(training_problem(dataset, plant_of(dataset), INTEGRAL))


def _folds_of(problem: Problem) -> Folds:
    folds = make_folds(acrobot().recordings, Split(count=FOLDS))
    return Folds(problem, folds.training(problem.recording, problem.time))


def parametric() -> Part:
    """Laws by least squares."""
    start = np.tile([0.05, 0.01, 1.5, 0.001], 2)
    return Part(
        (
            _against_scipy("coulomb_viscous", CoulombViscous(), np.tile([0.05, 0.001], 2)),
            _against_scipy("spline", Spline(), 0.01 + np.zeros(2 * len(Spline().names))),
            _against_scipy("stribeck", Stribeck(), start),
        ),
        3,
    )


def _against_scipy(name: str, law: Law, start: np.ndarray) -> Case:
    folds = ten_folds()
    own = Side(
        "frictionid, all folds at once",
        lambda: folds.cost(LeastSquares(law).fit(folds.problem, folds.weights, 0)[0]),
        OURS,
    )
    peer = Side("SciPy's least_squares, fold by fold", _scipy(folds, law, start), SCIPY, 1 / FOLDS)
    return Case(f"{name}, ten folds", own, peer, "training residual [rad/s]")


def _scipy(folds: Folds, law: Law, start: np.ndarray) -> Callable[[], float]:
    problem, root = folds.problem, np.sqrt(folds.weights[0])[:, None]
    low, high = (np.tile([b[i] for b in law.bounds], 2) for i in (0, 1))

    def friction(theta: np.ndarray) -> Friction:
        return Friction(law, theta.reshape(2, -1))

    def residual(theta: np.ndarray) -> np.ndarray:
        return (problem.residual(along(friction(theta), problem.nodes)) * root).ravel()

    def fit() -> float:
        found = least_squares(residual, start, bounds=(low, high))
        return folds.cost(friction(found.x))

    return fit


def sparse() -> Part:
    """Sparse sums: of friction, and of accelerations without physics."""
    return Part((_sindy(), _sparse_dynamics()), 3)


def _sindy() -> Case:
    from plain_pysindy import friction_curves

    folds, dataset = ten_folds(), acrobot()
    grid = velocity_grid(folds.problem.nodes.inputs.w)
    true = steady_state(dataset.truth).curve(grid)

    def off(found: np.ndarray) -> float:
        return 100 * float(curve_error(found, true, grid).mean())

    def ours() -> float:
        return off(SINDy().fit(folds.problem, folds.weights, 0)[0].curve(grid))

    def theirs() -> float:
        return off(friction_curves(dataset, _recordings()[0], grid))

    return Case(
        "sindy, ten folds",
        Side("frictionid, sets searched on one-step residuals", ours, (*OURS, "pysindy")),
        Side("plain PySINDy on differentiated angles", theirs, ("pysindy",), 1 / FOLDS),
        "friction curve [%]",
    )


def _sparse_dynamics() -> Case:
    from plain_pysindy import one_step_errors

    dataset = acrobot()
    problem = problem_of(dataset, unit_inertia_plant(dataset), STUDY)
    folds = _folds_of(problem)

    def ours() -> float:
        friction = SparseDynamics().fit(problem, folds.weights, 0)[0]
        return folds.held_out(problem.residual(along(friction, problem.nodes)))

    def theirs() -> float:
        return float(np.linalg.norm(one_step_errors(*_recordings(), 1 / RATE), axis=1).mean())

    return Case(
        "no physics, sparse dynamics, ten folds",
        Side("frictionid, monomials searched", ours, (*OURS, "pysindy")),
        Side("plain PySINDy, one threshold", theirs, ("pysindy",), 1 / FOLDS),
        "held-out step [rad/s]",
    )


def _recordings() -> tuple[list[Recording], list[Recording]]:
    """Recordings that the first fold trains on, and those that it leaves out."""
    recordings = acrobot().recordings
    labels = make_folds(recordings, Split(count=FOLDS)).labels
    pairs = [(r, bool((label == 0).all())) for r, label in zip(recordings, labels, strict=True)]
    return [r for r, out in pairs if not out], [r for r, out in pairs if out]
