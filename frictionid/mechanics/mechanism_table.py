"""Mechanism and parameters of the [mechanism] table of a data set."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from frictionid.config import nearest, untrusted
from frictionid.errors import InputError

from .axes import linear_axis, two_mass_axis
from .mechanism import Mechanism
from .pendulum import pendulum
from .rigid_body.described import FORMATS
from .two_links import acrobot, double_pendulum

# From `module:function` to the function.
Code = Callable[[str], Any]

_KINDS: Mapping[str, Callable[..., Mechanism]] = {
    "acrobot": acrobot,
    "double_pendulum": double_pendulum,
    "linear_axis": linear_axis,
    "pendulum": pendulum,
    "two_mass_axis": two_mass_axis,
}


def mechanism_of(table: Mapping[str, Any], code: Code | None = None) -> Mechanism:
    """Mechanism of a [mechanism] table: its `kind`, with the options and parameters given there.

    A file that describes it, such as `urdf`, stands in place of the kind. A kind `module:function`
    is a function of one's own that gives a mechanism: code, which runs only where the caller says
    how it is imported.

    Parameters
    ----------
    table : mapping
    code : function from "module:function" to the function, optional

    Raises
    ------
    InputError
        For an unknown kind, option or parameter, with the nearest name.

    >>> mechanism_of({"kind": "pendulum", "parameters": {"mass": 0.5}})
    pendulum(mass=0.5)
    """
    kind, build = _kind(table, code)
    tables = ("kind", "parameters", "tolerances")
    options = {key: value for key, value in table.items() if key not in tables}
    mechanism = _built(build, kind, options)
    for name, what in (("parameters", "number"), ("tolerances", "percent")):
        entries = table.get(name, {})
        if not isinstance(entries, Mapping):
            raise InputError(f"[mechanism] {name} = {entries!r} must be a table: name = {what}")
    mechanism = replace(mechanism, kind=kind, options=options)
    mechanism = mechanism.with_values(table.get("parameters", {}))
    return replace(mechanism, tolerances=table.get("tolerances", {}))


def as_mechanism(mechanism: Any) -> Mechanism:
    """A mechanism as it is, and that of a [mechanism] table.

    Raises
    ------
    InputError
        For anything else, and as from `mechanism_of`.

    >>> as_mechanism(pendulum(mass=0.5))
    pendulum(mass=0.5)
    """
    if isinstance(mechanism, Mechanism):
        return mechanism
    if not isinstance(mechanism, Mapping):
        raise InputError(
            f"a mechanism must be one of frictionid.mechanics, such as pendulum(mass=0.4, "
            f"length=0.25), or a [mechanism] table, not {mechanism!r:.60}"
        )
    return mechanism_of(mechanism)


def _kind(table: Mapping[str, Any], code: Code | None) -> tuple[str, Callable[..., Mechanism]]:
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
    if ":" in kind:
        if code is None:
            raise InputError(f"[mechanism] kind = {untrusted(kind)}")
        build: Callable[..., Mechanism] = code(kind)
        if not callable(build):
            raise InputError(f"[mechanism] kind = {kind!r} is no function that gives a mechanism")
        return kind, build
    if kind not in _KINDS:
        raise InputError(
            f"[mechanism] kind = {kind!r} is unknown; {nearest(kind, _KINDS)}; or name the file "
            'that describes it: urdf = "arm.urdf"'
        )
    return kind, _KINDS[kind]


def _built(build: Callable[..., Mechanism], kind: str, options: Mapping[str, Any]) -> Mechanism:
    """What the function of a kind gives for the options of a table."""
    names = mechanism_options(build)
    for name in options:
        if name not in names:
            raise InputError(f"[mechanism] {kind} has no option {name!r}; {nearest(name, names)}")
    plain = kind in _KINDS or ":" in kind
    settings = {name: _frozen(name, v) if plain else v for name, v in options.items()}
    try:
        mechanism = build(**settings)
    except InputError:
        raise
    except Exception as error:
        if ":" in kind:
            said = f"{kind!r} failed, {type(error).__name__}: {error}"
            raise InputError(f"[mechanism] {said}") from error
        raise
    if not isinstance(mechanism, Mechanism):
        raise InputError(
            f"[mechanism] {kind!r} must give a mechanism, not a {type(mechanism).__name__}"
        )
    return mechanism


def mechanism_options(build: Callable[..., Mechanism]) -> dict[str, Any]:
    """Options of a kind with their defaults; keywords of its constructor are its parameters.

    >>> mechanism_options(pendulum)
    {'driven': True, 'motor': False}
    """
    arguments = inspect.signature(build).parameters.values()
    return {p.name: p.default for p in arguments if p.kind is not p.KEYWORD_ONLY}


def _frozen(name: str, value: Any) -> Any:
    entries = value if isinstance(value, list) else [value]
    if any(isinstance(e, list | Mapping) for e in entries):
        raise InputError(f"[mechanism] {name} = {value!r} must be a value or a list of values")
    return tuple(value) if isinstance(value, list) else value


def mechanism_kinds() -> Mapping[str, Callable[..., Mechanism]]:
    """Kinds of mechanisms, and the functions that build them of their options.

    >>> sorted(mechanism_kinds())
    ['acrobot', 'double_pendulum', 'linear_axis', 'pendulum', 'two_mass_axis']
    """
    return _KINDS
