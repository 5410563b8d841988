"""Mechanism and parameters of the [mechanism] table of a data set."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.mechanics.acrobot import acrobot
from frictionid.mechanics.double_pendulum import double_pendulum
from frictionid.mechanics.linear_axis import linear_axis
from frictionid.mechanics.mechanism import Mechanism
from frictionid.mechanics.pendulum import pendulum

_LARGEST = 1e9  # of a parameter, in SI units

_KINDS: Mapping[str, Callable[..., Mechanism]] = {
    "acrobot": acrobot,
    "double_pendulum": double_pendulum,
    "linear_axis": linear_axis,
    "pendulum": pendulum,
}


def mechanism_of(table: Mapping[str, Any]) -> Mechanism:
    """Mechanism of a [mechanism] table: its `kind`, with the options of that kind.

    Raises
    ------
    InputError
        For an unknown kind, option or parameter, with the nearest name.

    >>> mechanism_of({"kind": "pendulum", "parameters": {"mass": 0.5}}).n
    1
    """
    kind = str(table.get("kind", ""))
    if kind not in _KINDS:
        raise InputError(f"[mechanism] kind = {kind!r} is unknown; {nearest(kind, _KINDS)}")
    build = _KINDS[kind]
    options = {k: _frozen(k, v) for k, v in table.items() if k not in ("kind", "parameters")}
    known = inspect.signature(build).parameters
    for name in options:
        if name not in known:
            raise InputError(f"[mechanism] {kind} has no option {name!r}; {nearest(name, known)}")
    try:
        mechanism = build(**options)
    except ValueError as error:
        raise InputError(f"[mechanism] {error}") from None
    _check(table.get("parameters", {}), mechanism)
    return mechanism


def parameters_of(table: Mapping[str, Any], overrides: Mapping[str, float]) -> dict[str, float]:
    """Physical parameters of the table's mechanism, overrides applied; SI.

    Masses and lengths that the kind requires have no default; rotors, gears and gravity do.

    Raises
    ------
    InputError
        Where one is unknown, missing or negative, or where they make an inertia negative.

    >>> parameters_of({"kind": "pendulum", "parameters": {"mass": 0.5}}, {"length": 0.2})["length"]
    0.2
    """
    mechanism = mechanism_of(table)
    _check(overrides, mechanism)
    given = {**table.get("parameters", {}), **overrides}
    _check_complete(given, mechanism)
    values = {**mechanism.defaults, **given}
    _check_positive(values, mechanism)
    return values


def with_defaults(table: Mapping[str, Any]) -> dict[str, Any]:
    """The table with the default of each required parameter that it does not give.

    For machines that exist in a simulation only; those of recordings are what they are.

    >>> with_defaults({"kind": "pendulum", "parameters": {"mass": 0.5}})["parameters"]
    {'length': 1.0, 'mass': 0.5}
    """
    mechanism = mechanism_of(table)
    given = table.get("parameters", {})
    known = mechanism.description.parameters
    filled = {str(p.symbol): p.default for p in known if p.required and str(p.symbol) not in given}
    return {**table, "parameters": {**filled, **given}} if filled else dict(table)


def _check_complete(given: Mapping[str, float], mechanism: Mechanism) -> None:
    description = mechanism.description
    missing = [
        f"{p.symbol} [{p.unit}] ({p.meaning})"
        for p in description.parameters
        if p.required and str(p.symbol) not in given
    ]
    if missing:
        raise InputError(
            f"[mechanism] {description.kind} needs {', '.join(missing)}: "
            "give it in [mechanism.parameters]; no machine has a usual mass or length"
        )


def _check_positive(values: Mapping[str, float], mechanism: Mechanism) -> None:
    """Refuse negative masses and rotors, and an inertia matrix that is not positive definite."""
    description = mechanism.description
    rotors = {str(s) for inertia, _ in description.rotors for s in inertia.free_symbols}
    for name, _, unit, *_ in description.parameters:
        if (unit == "kg" or str(name) in rotors) and values[str(name)] < 0:
            raise InputError(
                f"[mechanism] {description.kind}: {name} = {values[str(name)]:g} {unit} is "
                "negative; masses and rotor inertias are 0 or more"
            )
    q = np.linspace(0.0, np.pi, 7)[:, None] * np.arange(mechanism.n)
    inertia = mechanism.dynamics(mechanism.base(values), q, np.zeros_like(q))[0]
    least = np.linalg.eigvalsh(inertia).min()
    if not least > 0:
        raise InputError(
            f"[mechanism] {description.kind}: these parameters give no inertia to a direction of "
            f"motion (smallest eigenvalue of M: {least:.3g}); correct masses, lengths and inertias"
        )


def _check(parameters: Any, mechanism: Mechanism) -> None:
    if not isinstance(parameters, Mapping):
        raise InputError(f"[mechanism] parameters = {parameters!r} must be a table: name = number")
    for name, value in parameters.items():
        known = mechanism.defaults
        kind = mechanism.description.kind
        if name not in known:
            raise InputError(
                f"[mechanism] {kind} has no parameter {name!r}; {nearest(name, known)}"
            )
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and math.isfinite(value)):
            raise InputError(f"[mechanism] {kind}: {name} = {value!r} must be a finite number")
        if abs(value) > _LARGEST:
            raise InputError(
                f"[mechanism] {kind}: {name} = {value:g} is more than any machine has: correct it"
            )


def _frozen(name: str, value: Any) -> Any:
    entries = value if isinstance(value, list) else [value]
    if any(isinstance(e, list | Mapping) for e in entries):
        raise InputError(f"[mechanism] {name} = {value!r} must be a value or a list of values")
    return tuple(value) if isinstance(value, list) else value


def mechanism_kinds() -> Mapping[str, Callable[..., Mechanism]]:
    """Kinds of mechanisms, and the functions that build them of their options.

    >>> sorted(mechanism_kinds())
    ['acrobot', 'double_pendulum', 'linear_axis', 'pendulum']
    """
    return _KINDS
