"""Regressors of scikit-learn by name, with settings that suit friction curves."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from typing import Any

from frictionid.errors import InputError


def _gradient_boosting() -> tuple[type, dict[str, Any]]:
    from sklearn.ensemble import GradientBoostingRegressor

    return GradientBoostingRegressor, {"max_depth": 2, "min_samples_leaf": 5}


def _random_forest() -> tuple[type, dict[str, Any]]:
    from sklearn.ensemble import RandomForestRegressor

    return RandomForestRegressor, {"n_estimators": 50, "min_samples_leaf": 5}


def _kernel_ridge() -> tuple[type, dict[str, Any]]:
    from sklearn.kernel_ridge import KernelRidge

    return KernelRidge, {"kernel": "rbf", "gamma": 1.0, "alpha": 0.1}


def _svr() -> tuple[type, dict[str, Any]]:
    from sklearn.svm import SVR

    return SVR, {"C": 10.0, "epsilon": 0.05}


def _knn() -> tuple[type, dict[str, Any]]:
    from sklearn.neighbors import KNeighborsRegressor

    return KNeighborsRegressor, {"n_neighbors": 9}


def _gaussian_process() -> tuple[type, dict[str, Any]]:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, WhiteKernel

    return GaussianProcessRegressor, {"kernel": 1.0 * RBF([1.0, 1.0]) + WhiteKernel(0.01)}


NAMED: Mapping[str, Callable[[], tuple[type, dict[str, Any]]]] = {
    "gradient_boosting": _gradient_boosting,
    "random_forest": _random_forest,
    "kernel_ridge": _kernel_ridge,
    "svr": _svr,
    "knn": _knn,
    "gaussian_process": _gaussian_process,
}


def estimator_named(name: str, settings: Mapping[str, Any]) -> Any:
    """Regressor of a name in `NAMED`, or of a class "package.module:Class" or "package.Class".

    Raises
    ------
    InputError
        For unknown names and settings.

    >>> estimator_named("knn", {"n_neighbors": 5})
    KNeighborsRegressor()
    """
    made, usual = NAMED[name]() if name in NAMED else (_imported(name), {})
    try:
        found = made(**{**usual, **settings})
    except (TypeError, ValueError) as error:
        raise InputError(f"sklearn: estimator {name!r}: {error}") from None
    _check_settings(found, name)
    return found


def _imported(name: str) -> Any:
    module, _, last = name.partition(":") if ":" in name else name.rpartition(".")
    if not module:
        near = get_close_matches(name, list(NAMED), n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise InputError(
            f"sklearn: estimator {name!r} is unknown; {hint}known are {', '.join(NAMED)}, and "
            'classes such as "sklearn.svm.LinearSVR"'
        )
    try:
        return getattr(importlib.import_module(module), last)
    except (ImportError, AttributeError) as error:
        raise InputError(f"sklearn: estimator {name!r} cannot be imported ({error})") from None


def _check_settings(estimator: Any, name: str) -> None:
    """Have scikit-learn look at the settings now, and not in the first fit."""
    check = getattr(estimator, "_validate_params", None)
    try:
        if check is not None:
            check()
    except ValueError as error:
        raise InputError(f"sklearn: estimator {name!r}: {error}") from None
