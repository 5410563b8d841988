"""Any regressor of scikit-learn, trained on the friction torques that the rows of a problem imply.

The torque of a row is the one whose residual is zero, G Tf = r. Its weight is its inverse variance:
the variance of Tf_j is that of the residuals times [(G'G)^-1]_jj.
"""

import importlib
import inspect
import warnings
from collections.abc import Mapping
from difflib import get_close_matches
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from frictionid.arrays import Array, times
from frictionid.config import is_installed, validated
from frictionid.errors import InputError, needs
from frictionid.friction import Friction, Inputs, at_rest
from frictionid.friction.laws.curves import Table
from frictionid.friction.laws.external import Predicted, features

from ..identifier import Identifier
from ..one_step.residual import Problem, normalised

_FIRST, _PER_DECADE = 0.01, 12  # [rad/s], speeds of a table
_WIDTH = 0.02  # [rad/s]
_SMALL = 1e-9


# What the regressor of one joint is trained on: inputs, torques (B,) [N m], weights (B,).
_Rows = tuple[Inputs, Array, Array]


class _Trained(NamedTuple):
    """A trained regressor of scaled features and torques."""

    estimator: Any
    centre: Array
    size: Array
    level: float
    scale: float

    def predict(self, table: Array) -> Array:
        """Torque (B,) [N m] at features (B, p)."""
        scaled = self.estimator.predict((table - self.centre) / self.size)
        return self.level + self.scale * scaled


@validated
class Regressor(Identifier):
    """Fits a scikit-learn regressor to the torques of each joint, a copy for each fold.

    inputs : of the regressor: the joint's velocity "w"; "q" and "u" on request
    bins : samples that a regressor of the velocity alone is trained on: means of the rows over
        ranges of velocity of equal weight, so that its cost does not grow with the data
    speeds : [rad/s] at which the curve is tabulated; None: twelve in each decade

    From the velocity only, friction is a `Table`, constant beyond the speeds of each joint. With
    other inputs friction keeps the regressors, and cannot be saved.

    Raises
    ------
    InputError
        For an estimator that is no regressor, settings out of range, and joints that do not slide.

    Examples
    --------
    >>> from sklearn.neighbors import KNeighborsRegressor
    >>> from frictionid.fitting.identifiers.check_identifier import synthetic_problem
    >>> problem = synthetic_problem(joints=1)
    >>> fit = Regressor(KNeighborsRegressor(3)).fit(problem, np.ones((1, len(problem.r))), seed=0)
    >>> fit[0].curve(np.array([-4.0, 4.0])).round(1)[:, 0]  # truth: 0.18
    array([-0.2,  0.2])
    """

    estimator: Any
    inputs: tuple[Literal["w", "q", "u"], ...] = ("w",)
    bins: Annotated[int, Field(ge=2)] = 200
    speeds: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        _check_estimator(self.estimator)
        if "w" not in self.inputs:
            raise InputError(f"sklearn: inputs = {list(self.inputs)} must include w")
        if self.speeds is not None:
            Table(self.speeds)  # checks them now, not after the first fit

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        weights = normalised(weights, problem)
        x, torque, slides = torques(problem)
        F, n = len(weights), x.w.shape[-1]
        pairs = np.ndindex(F, n)
        sets = [_rows_of(j, x, torque, slides, weights[f]) for f, j in pairs]
        trained = [self._trained(*rows, seed) for rows in sets]
        if self.inputs != ("w",):
            which = np.arange(F * n).reshape(F, n, 1) + 0.0
            return Friction(Predicted(tuple(trained), self.inputs), which)
        law = Table(self.speeds or _spread(problem))
        theta = [_tabulated(law, t, x.w) for t, (x, _, _) in zip(trained, sets, strict=True)]
        return Friction(law, np.reshape(theta, (F, n, -1)))

    def _trained(self, x: Inputs, torque: Array, weight: Array, seed: int) -> _Trained:
        """A copy of the estimator, fitted to scaled features and torques."""
        with needs("sindy"):
            from sklearn.base import clone

        if self.inputs == ("w",):
            x, torque, weight = _binned(x, torque, weight, self.bins)
        estimator = clone(self.estimator)
        if "random_state" in estimator.get_params():
            estimator.set_params(random_state=seed)
        table = np.stack(features(x, self.inputs, _WIDTH), axis=-1)
        centre, size = table.mean(0), table.std(0)
        size = np.where(size > _SMALL, size, 1.0)
        weight = weight / weight.mean()
        level = float(np.average(torque, weights=weight))
        spread = np.sqrt(np.average((torque - level) ** 2, weights=weight))
        scale = max(float(spread), _SMALL)
        trained = _Trained(estimator, centre, size, level, scale)
        takes_weights = "sample_weight" in inspect.signature(estimator.fit).parameters
        taken = {"sample_weight": weight} if takes_weights else {}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of convergence
                estimator.fit((table - centre) / size, (torque - level) / scale, **taken)
            trained.predict(table[:1])
        # some estimators refuse a setting for this number of samples only now
        except (TypeError, ValueError) as error:
            raise InputError(
                f"sklearn: {self.estimator} cannot learn from {len(table)} samples: {error}"
            ) from None
        return trained


def torques(problem: Problem) -> tuple[Inputs, Array, Array]:
    """Inputs, torques [N m] and weights of the rows, (K, n) each: see the top of this file.

    Weights are inverse variances, but for a factor; zero where a joint does not slide.
    """
    inverse = np.linalg.pinv(problem.G, rcond=_SMALL)
    variance = (inverse**2).sum(-1)
    slides = (np.abs(problem.G).max(axis=1) > 0) & (variance > 0)
    weight = np.where(slides, 1.0 / np.where(slides, variance, 1.0), 0.0)
    x = problem.nodes.inputs.each(problem.mean)
    return x, times(inverse, problem.r), weight


def _rows_of(joint: int, x: Inputs, torque: Array, slides: Array, weight: Array) -> _Rows:
    """Rows of a joint under the weights (K,) of a fold; without friction where it rests in it."""
    if not slides[:, joint].any():
        raise InputError(
            f"joint {joint + 1} slides in no row: give recordings in which it moves, or lock it"
        )
    weight, torque = weight * slides[:, joint], torque[:, joint]
    if not weight.any():
        weight, torque = slides[:, joint], 0.0 * torque
    rows = weight > 0
    inputs = x.each(lambda part: part[rows, joint])
    return inputs, torque[rows], weight[rows] / weight.max()


def _binned(x: Inputs, torque: Array, weight: Array, bins: int) -> _Rows:
    """Means over ranges of velocity of equal weight, none of them across zero."""
    order = np.argsort(x.w, kind="stable")
    weight = weight[order]
    cumulated = np.cumsum(weight) - 0.5 * weight
    label = np.minimum((cumulated / weight.sum() * bins).astype(int), bins - 1)
    _, bin_of = np.unique(label * 2 + (x.w[order] > 0), return_inverse=True)
    total = np.bincount(bin_of, weight)
    x = x.each(lambda part: np.bincount(bin_of, weight * part[order]) / total)
    return x, np.bincount(bin_of, weight * torque[order]) / total, total


def _check_estimator(estimator: Any) -> None:
    """Refuse what has no fit and predict, or is no regressor by scikit-learn's own word."""
    with needs("sindy"):
        from sklearn.base import BaseEstimator, is_regressor

    if not all(callable(getattr(estimator, name, None)) for name in ("fit", "predict")):
        raise InputError(f"sklearn: {estimator!r} is no regressor with fit and predict")
    if isinstance(estimator, BaseEstimator) and not is_regressor(estimator):
        raise InputError(
            f"sklearn: {estimator} is no regressor: choose one, such as sklearn.svm.LinearSVR"
        )


def _spread(problem: Problem) -> tuple[float, ...]:
    """Speeds [rad/s] of a table, beyond the fastest motion.

    On a grid that no data shift: how fast held-out recordings are changes no level of a fold.
    """
    each = np.abs(problem.nodes.inputs.w).max(axis=0)
    each = each[each > 0] if each.any() else np.ones(1)
    # whole decades finer for joints below 1 rad/s, so that the slowest has two of its own
    first = _FIRST * 10.0 ** min(0.0, np.floor(np.log10(each.min())))
    last = int(np.ceil(_PER_DECADE * np.log10(max(float(each.max()) / first, 10.0))))
    return tuple(float(f"{first * 10 ** (k / _PER_DECADE):.4g}") for k in range(last + 1))


def _tabulated(law: Table, trained: _Trained, velocity: Array) -> Array:
    """Levels (P,) at the law's speeds; beyond those of the data (B,) the last one holds."""
    levels = []
    for side in (1.0, -1.0):
        fastest = max(float((side * velocity).max()), 0.0)
        w = side * np.minimum(np.array(law.speeds), fastest)
        table = np.stack(features(at_rest(w), ("w",), _WIDTH), axis=-1)
        levels.append(np.maximum(side * trained.predict(table), 0.0))
    return np.concatenate(levels)


def _smooth_and_noise() -> Any:
    from sklearn.gaussian_process.kernels import RBF, WhiteKernel

    return 1.0 * RBF([1.0, 1.0]) + WhiteKernel(0.01)


# Class and default settings of each name; what is callable is made when it is needed.
NAMED: Mapping[str, tuple[str, Mapping[str, Any]]] = MappingProxyType(
    {
        "gradient_boosting": (
            "sklearn.ensemble.GradientBoostingRegressor",
            {"max_depth": 2, "min_samples_leaf": 5},
        ),
        "random_forest": (
            "sklearn.ensemble.RandomForestRegressor",
            {"n_estimators": 50, "min_samples_leaf": 5},
        ),
        "kernel_ridge": (
            "sklearn.kernel_ridge.KernelRidge",
            {"kernel": "rbf", "gamma": 1.0, "alpha": 0.1},
        ),
        "svr": ("sklearn.svm.SVR", {"C": 10.0, "epsilon": 0.05}),
        "knn": ("sklearn.neighbors.KNeighborsRegressor", {"n_neighbors": 9}),
        "gaussian_process": (
            "sklearn.gaussian_process.GaussianProcessRegressor",
            {"kernel": _smooth_and_noise},
        ),
    }
)


def estimator_named(estimator: str, settings: Mapping[str, Any] = MappingProxyType({})) -> Any:
    """Regressor of a name in `NAMED`, or of a class "package.module:Class" or "package.Class".

    estimator : gradient_boosting, random_forest, kernel_ridge, svr, knn, gaussian_process, or a
        class such as "sklearn.svm.LinearSVR"
    settings : arguments of the regressor's constructor

    >>> estimator_named("knn", {"n_neighbors": 5})
    KNeighborsRegressor()
    """
    name, defaults = NAMED.get(estimator, (estimator, {}))
    build = _imported(name)
    usual = {key: value() if callable(value) else value for key, value in defaults.items()}
    try:
        regressor = build(**{**usual, **settings})
        if hasattr(regressor, "_validate_params"):  # of scikit-learn: now, not in the first fit
            regressor._validate_params()
    except (TypeError, ValueError) as error:
        raise InputError(f"sklearn: estimator {estimator!r}: {error}") from None
    return regressor


def _imported(name: str) -> Any:
    module, _, last = name.partition(":") if ":" in name else name.rpartition(".")
    if not module:
        near = get_close_matches(name, list(NAMED), n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise InputError(
            f"sklearn: estimator {name!r} is unknown; {hint}known are {', '.join(NAMED)}, and "
            'classes such as "sklearn.svm.LinearSVR"'
        )
    if not is_installed(module):
        raise InputError(f"sklearn: estimator {name!r} is of no installed package: install it")
    try:
        kind = getattr(importlib.import_module(module), last)
    except (ImportError, AttributeError) as error:
        raise InputError(f"sklearn: estimator {name!r} cannot be imported ({error})") from None
    if not (isinstance(kind, type) and hasattr(kind, "fit") and hasattr(kind, "predict")):
        raise InputError(f"sklearn: estimator {name!r} is no class with fit and predict")
    return kind
