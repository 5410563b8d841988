"""Mechanism and parameters of the [mechanism] table of a data set."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.mechanics.acrobot import acrobot
from frictionid.mechanics.double_pendulum import double_pendulum
from frictionid.mechanics.linear_axis import linear_axis
from frictionid.mechanics.mechanism import Mechanism
from frictionid.mechanics.pendulum import pendulum
from frictionid.mechanics.rigid_body.described import FORMATS

_KINDS: Mapping[str, Callable[..., Mechanism]] = {
    "acrobot": acrobot,
    "double_pendulum": double_pendulum,
    "linear_axis": linear_axis,
    "pendulum": pendulum,
}


def mechanism_of(table: Mapping[str, Any]) -> Mechanism:
    """Mechanism of a [mechanism] table: its `kind`, with the options and parameters given there.

    Raises
    ------
    InputError
        For an unknown kind, option or parameter, with the nearest name.

    >>> mechanism_of({"kind": "pendulum", "parameters": {"mass": 0.5}})
    pendulum(mass=0.5)
    """
    kind, build = _kind(table)
    given = {k: v for k, v in table.items() if k not in ("kind", "parameters")}
    options = given if kind in FORMATS else {k: _frozen(k, v) for k, v in given.items()}
    known = mechanism_options(build)
    for name in options:
        if name not in known:
            raise InputError(f"[mechanism] {kind} has no option {name!r}; {nearest(name, known)}")
    try:
        mechanism = build(**options)
    except ValueError as error:
        raise InputError(f"[mechanism] {error}") from None
    parameters = table.get("parameters", {})
    if not isinstance(parameters, Mapping):
        raise InputError(f"[mechanism] parameters = {parameters!r} must be a table: name = number")
    return replace(mechanism, options=given).with_values(parameters)


def _kind(table: Mapping[str, Any]) -> tuple[str, Callable[..., Mechanism]]:
    """Name of the kind of a table, and what builds it; a file's format is a kind as well."""
    described = [name for name in FORMATS if name in table]
    if described and "kind" in table or len(described) > 1:
        raise InputError(
            f"[mechanism] names {' and '.join([*described, *('kind',) * ('kind' in table)])}; "
            "a mechanism is one of them: remove the others"
        )
    if described:
        return described[0], FORMATS[described[0]]
    kind = str(table.get("kind", ""))
    if kind not in _KINDS:
        raise InputError(
            f"[mechanism] kind = {kind!r} is unknown; {nearest(kind, _KINDS)}; or name the file "
            'that describes it: urdf = "arm.urdf"'
        )
    return kind, _KINDS[kind]


def as_mechanism(given: Any) -> Mechanism:
    """A mechanism as it is, and that of a [mechanism] table.

    Raises
    ------
    InputError
        For anything else, and as from `mechanism_of`.

    >>> as_mechanism(pendulum(mass=0.5))
    pendulum(mass=0.5)
    """
    if isinstance(given, Mechanism):
        return given
    if not isinstance(given, Mapping):
        raise InputError(
            f"a mechanism must be one of frictionid.mechanics, such as pendulum(mass=0.4, "
            f"length=0.25), or a [mechanism] table, not {given!r:.60}"
        )
    return mechanism_of(given)


def mechanism_options(build: Callable[..., Mechanism]) -> dict[str, Any]:
    """Options of a kind with their defaults; keywords of its constructor are its parameters.

    >>> mechanism_options(pendulum)
    {'driven': True, 'motor': False}
    """
    known = inspect.signature(build).parameters.values()
    return {p.name: p.default for p in known if p.kind is not p.KEYWORD_ONLY}


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
