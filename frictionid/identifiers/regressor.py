"""Any regressor of scikit-learn, taught the torque that the rows of a problem leave to friction.

The torque of a row is what takes its residual away, G Tf = r, and counts by how well it is known:
the variance of Tf_j is that of the residuals times [(G'G)^-1]_jj.
"""

from __future__ import annotations

import inspect
import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, times
from frictionid.errors import InputError
from frictionid.friction import Friction, Inputs, at_rest
from frictionid.friction.laws.sklearn_law import Predicted, features
from frictionid.friction.laws.table import Table
from frictionid.identifiers.identifier import Identifier
from frictionid.identifiers.residual import Problem
from frictionid.identifiers.row_weights import normalised

INPUTS = ("w", "q", "u")
_SPEEDS = 24
_WIDTH = 0.02  # [rad/s]
_SMALL = 1e-9


class Lesson(NamedTuple):
    """What the regressor of one joint learns: inputs, torque [N m] and share (B,) of each line."""

    x: Inputs
    torque: Array
    share: Array


class Taught(NamedTuple):
    """A fitted regressor, with the scales of what it was taught."""

    estimator: Any
    centre: Array
    size: Array
    level: float
    scale: float

    def predict(self, table: Array) -> Array:
        """Torque (B,) [N m] at features (B, p)."""
        found = self.estimator.predict((table - self.centre) / self.size)
        return np.asarray(self.level + self.scale * found)


@dataclass(frozen=True)
class Regressor(Identifier):
    """Fits a scikit-learn regressor to the torques of each joint, a copy for each fold.

    inputs : what it sees: the joint's velocity "w"; "q" and "u" on request
    bins : lines that it is taught where it sees the velocity only: means of the rows over ranges of
        velocity that tell equally much; its cost then does not grow with the data
    speeds : [rad/s] at which the curve is tabulated; None spreads 24 over those of the data

    From the velocity only, friction is a `Table`, the curve held beyond the speeds of each joint.
    With other inputs it keeps the regressors, and cannot be saved.

    Raises
    ------
    InputError
        For what is no regressor or no input, and for folds in which a joint never slides.

    Examples
    --------
    >>> from sklearn.neighbors import KNeighborsRegressor
    >>> from frictionid.identifiers.synthetic_problem import synthetic_problem
    >>> problem = synthetic_problem(joints=1)
    >>> fit = Regressor(KNeighborsRegressor(3)).fit(problem, np.ones((1, len(problem.r))), seed=0)
    >>> fit[0].curve(np.array([-4.0, 4.0])).round(1)[:, 0]  # truth: 0.18
    array([-0.2,  0.2])
    """

    estimator: Any
    inputs: tuple[str, ...] = ("w",)
    bins: int = 200
    speeds: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "inputs", tuple(self.inputs))
        if not all(callable(getattr(self.estimator, m, None)) for m in ("fit", "predict")):
            raise InputError(f"sklearn: {self.estimator!r} is no regressor with fit and predict")
        _check_kind(self.estimator)
        if "w" not in self.inputs or not set(self.inputs) <= set(INPUTS):
            raise InputError(f"sklearn: inputs = {list(self.inputs)} must be w, with q and u if so")
        if self.bins < 2:
            raise InputError(f"sklearn: bins = {self.bins} must be at least 2")
        if self.speeds is not None:
            Table(self.speeds)  # now, and not after the first fit

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        weights = normalised(weights, problem)
        x, torque, known = torques(problem)
        taught = [
            [
                self._taught(_lesson(x, torque, known, w, j), seed, (f, j))
                for j in range(x.w.shape[-1])
            ]
            for f, w in enumerate(weights)
        ]
        F, n = len(weights), x.w.shape[-1]
        if self.inputs != ("w",):
            models = tuple(model for row in taught for model, _ in row)
            return Friction(Predicted(models, self.inputs), np.arange(F * n).reshape(F, n, 1) + 0.0)
        law = Table(self.speeds or _spread(problem))
        theta = np.array([[_tabulated(law, *one) for one in row] for row in taught])
        return Friction(law, theta)

    def _taught(self, lesson: Lesson, seed: int, place: tuple[int, int]) -> tuple[Taught, Lesson]:
        if not lesson.share.sum() > 0:
            fold, joint = place
            raise InputError(
                f"joint {joint + 1} slides in no row of fold {fold}: give recordings in which it "
                "moves, or use fewer folds"
            )
        lines = _binned(lesson, self.bins) if self.inputs == ("w",) else lesson
        return _learnt(self.estimator, lines, self.inputs, seed), lesson


def torques(problem: Problem) -> tuple[Inputs, Array, Array]:
    """Inputs, torques and their shares of the rows, (K, n) each: see the top of this file.

    Shares are inverse variances, but for a factor; zero where a joint does not slide.
    """
    back = np.linalg.pinv(problem.G, rcond=_SMALL)
    variance = (back**2).sum(-1)
    slides = (np.abs(problem.G).max(axis=1) > 0) & (variance > 0)
    share = np.where(slides, 1.0 / np.where(slides, variance, 1.0), 0.0)
    x = Inputs(*(problem.mean(part) for part in problem.nodes.inputs))
    return x, times(back, problem.r), share


def _lesson(x: Inputs, torque: Array, known: Array, weights: Array, joint: int) -> Lesson:
    share = weights * known[:, joint]
    rows = share > 0
    own = Inputs(*(part[rows, joint] for part in x))
    return Lesson(own, torque[rows, joint], share[rows] / max(share.max(), 1e-300))


def _binned(lesson: Lesson, bins: int) -> Lesson:
    """Means over ranges of velocity that weigh the same, none of them across rest."""
    w = lesson.x.w
    order = np.argsort(w, kind="stable")
    share = lesson.share[order]
    passed = np.cumsum(share) - 0.5 * share
    label = np.minimum((passed / share.sum() * bins).astype(int), bins - 1) * 2 + (w[order] > 0)
    _, cell = np.unique(label, return_inverse=True)
    total = np.bincount(cell, share)
    x = Inputs(*(np.bincount(cell, share * part[order]) / total for part in lesson.x))
    return Lesson(x, np.bincount(cell, share * lesson.torque[order]) / total, total)


def _learnt(estimator: Any, lesson: Lesson, inputs: tuple[str, ...], seed: int) -> Taught:
    """A copy of the estimator, fitted to scaled features and torques."""
    from sklearn.base import clone

    copy = clone(estimator)
    if "random_state" in copy.get_params():
        copy.set_params(random_state=seed)
    table = np.stack(features(lesson.x, inputs, _WIDTH), axis=-1)
    centre, size = table.mean(0), table.std(0)
    size = np.where(size > _SMALL, size, 1.0)
    share = lesson.share / lesson.share.mean()
    level = float(np.average(lesson.torque, weights=share))
    scale = max(float(np.sqrt(np.average((lesson.torque - level) ** 2, weights=share))), _SMALL)
    weighs = "sample_weight" in inspect.signature(copy.fit).parameters
    taught = Taught(copy, centre, size, level, scale)
    # what a setting is to the number of lines, some estimators only say when they fit or predict
    with warnings.catch_warnings():  # of the estimator's own convergence
        warnings.simplefilter("ignore")
        try:
            copy.fit(
                (table - centre) / size,
                (lesson.torque - level) / scale,
                **({"sample_weight": share} if weighs else {}),
            )
            taught.predict(table[:1])
        except (TypeError, ValueError) as error:
            raise InputError(
                f"sklearn: {estimator} cannot learn from {len(table)} lines: {error}"
            ) from None
    return taught


def _check_kind(estimator: Any) -> None:
    """Refuse what scikit-learn itself says is something else than a regressor."""
    from sklearn.base import BaseEstimator, is_regressor

    if isinstance(estimator, BaseEstimator) and not is_regressor(estimator):
        raise InputError(
            f"sklearn: {estimator} is no regressor: choose one, such as sklearn.svm.LinearSVR"
        )


def _spread(problem: Problem) -> tuple[float, ...]:
    """Speeds [rad/s] of a table, from where joints slide to their fastest motion."""
    fastest = float(np.abs(problem.nodes.inputs.w).max())
    speeds = np.geomspace(min(0.2, fastest / 10), fastest, _SPEEDS)
    return tuple(float(f"{v:.4g}") for v in speeds)


def _tabulated(law: Table, taught: Taught, lesson: Lesson) -> Array:
    """Levels (P,) at the law's speeds; beyond the lesson's the last one holds."""
    levels = []
    for side in (1.0, -1.0):
        reached = (side * lesson.x.w)[side * lesson.x.w > 0]
        last = float(reached.max()) if reached.size else 0.0
        w = side * np.minimum(np.array(law.speeds), last)
        table = np.stack(features(at_rest(w), ("w",), _WIDTH), axis=-1)
        levels.append(np.maximum(side * taught.predict(table), 0.0))
    return np.concatenate(levels)
