"""Temperatures on which friction depends: whether they are there, and are in degC."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction.law import Law

_COLDEST, _HOTTEST = -100.0, 200.0  # [degC] of a machine; in kelvin a cold one is above
_LEAST = 1.0  # [K]: who changes less shows no dependence


def check_temperature(law: Law, temperature: Array | float | None, *, fitted: bool = False) -> None:
    """Refuse recorded motion without a temperature in degC, for a law that depends on it.

    fitted : whether the law is fitted to it, so that it must change

    Raises
    ------
    InputError
        Where there is none, it is no number, not in degC, or hardly changes.
    """
    if not law.uses_temperature:
        return
    name = type(law).__name__.lower()
    if temperature is None:
        raise InputError(
            f"{name}: friction depends on the temperature, and not all recordings have one: name "
            'its column, e.g. columns.covariates = {temperature = "T"}, in degC'
        )
    T: Array = np.asarray(temperature, dtype=float)
    if not np.isfinite(T).all():
        raise InputError(f"{name}: a temperature is {T[~np.isfinite(T)][0]}: give it in degC")
    low, high = float(T.min()), float(T.max())
    if low < _COLDEST or high > _HOTTEST:
        raise InputError(
            f"{name}: temperatures from {low:g} to {high:g} cannot be in degC: convert the column, "
            "from kelvin less 273.15"
        )
    if fitted and high - low < _LEAST:
        raise InputError(
            f"{name}: the temperature changes by {high - low:.2g} K only, which shows nothing of "
            "what it does: record a warm-up, or fit the law without temperature"
        )


def refuse_temperature(law: Law, what: str) -> None:
    """Raise InputError for a law that depends on the temperature, where one must be chosen."""
    if law.uses_temperature:
        raise InputError(
            f"{what} knows no temperature, on which this friction depends: take it at one, by "
            "--temperature 30 of frictionid export, or fit.friction.at_temperature(30) in Python"
        )
