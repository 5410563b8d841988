"""Regressors of scikit-learn by name, with settings that suit friction curves."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any

from frictionid.config import is_installed
from frictionid.errors import InputError


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

    Raises
    ------
    InputError
        For unknown names and settings.

    >>> estimator_named("knn", {"n_neighbors": 5})
    KNeighborsRegressor()
    """
    name, defaults = NAMED.get(estimator, (estimator, {}))
    made = _imported(name)
    usual = {key: value() if callable(value) else value for key, value in defaults.items()}
    try:
        regressor = made(**{**usual, **settings})
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
        found = getattr(importlib.import_module(module), last)
    except (ImportError, AttributeError) as error:
        raise InputError(f"sklearn: estimator {name!r} cannot be imported ({error})") from None
    if not (isinstance(found, type) and hasattr(found, "fit") and hasattr(found, "predict")):
        raise InputError(f"sklearn: estimator {name!r} is no class with fit and predict")
    return found
