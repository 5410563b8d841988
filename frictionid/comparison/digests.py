"""Digests of all that a result depends on: equal for equal data, settings and code."""

from __future__ import annotations

import hashlib
import platform
import sys
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

_PACKAGES = (
    *("frictionid", "numpy", "scipy", "sympy", "pandas", "scikit-learn", "pysindy", "torch"),
    *("array-api-compat", "joblib", "pyarrow", "pydantic"),
)


def digest_of(value: Any) -> str:
    """SHA-256 of a value made of arrays, mappings, sequences, numbers, texts and dataclasses.

    >>> digest_of({"a": 1, "b": np.zeros(2)}) == digest_of({"b": np.zeros(2), "a": 1})
    True
    """
    digest = hashlib.sha256()
    for part in _parts(value):
        digest.update(part)
    return digest.hexdigest()


def _parts(value: Any) -> Iterator[bytes]:
    """Bytes that are equal for equal values, in this process and the next."""
    if isinstance(value, np.ndarray):
        yield f"array {value.dtype.str} {value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, Mapping):
        yield f"map {len(value)}".encode()
        for key in sorted(value, key=repr):
            yield from _parts((key, value[key]))
    elif isinstance(value, list | tuple):
        yield f"list {len(value)}".encode()
        for entry in value:
            yield from _parts(entry)
    elif value is None or isinstance(value, str | bytes | bool | int | float | np.generic):
        yield f"{type(value).__name__} {value!r};".encode()
    else:
        kind = type(value) if not hasattr(value, "__qualname__") else value
        yield f"{kind.__module__}.{kind.__qualname__}".encode()
        names = (
            [f.name for f in fields(value)]
            if is_dataclass(value)
            else getattr(value, "__dict__", ())
        )
        yield from _parts({} if kind is value else {name: getattr(value, name) for name in names})


def versions() -> dict[str, str]:
    """Versions of Python, this package, and those that its numbers come from."""
    return {"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}


@cache
def package_digest() -> str:
    """SHA-256 of this package's sources: another version may find other numbers."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def foreign_source(part: Any) -> bytes:
    """Source of an identifier, and of its law, from outside this package."""
    name = type(part).__module__
    place = getattr(sys.modules.get(name), "__file__", None)
    foreign = place is not None and name.partition(".")[0] not in ("frictionid", "builtins")
    source = Path(place).read_bytes() if foreign and place else b""
    inner = (getattr(part, f.name) for f in fields(part)) if is_dataclass(part) else ()
    return source + b"".join(foreign_source(value) for value in inner if is_dataclass(value))
