"""What a user names: laws, models, data sets, numbers; each mistake ends in one sentence."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import pandas as pd

from frictionid.comparison import kind_descriptions
from frictionid.comparison.kind_descriptions import KindDescription, described
from frictionid.comparison.registry import IDENTIFIERS, Part
from frictionid.comparison.suite import identifier_named
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.identifiers import Frictionless, LeastSquares, Published
from frictionid.friction import Friction, Law
from frictionid.friction.model_files import LAWS, load_model

OneLaw = str | Law | type[Law]
LawLike = OneLaw | Identifier | type[Identifier] | Friction | Sequence[OneLaw]
DatasetLike = Dataset | str | Path


def dataset_of(data: DatasetLike) -> Dataset:
    """A data set: as it is, or read from its folder, file or name."""
    if isinstance(data, Dataset):
        return data
    if isinstance(data, str | Path):
        return load_dataset(data)
    raise InputError(
        f"a {type(data).__name__} is no data set: make one by Dataset.from_frames or "
        "Dataset.from_arrays, or name a folder with a dataset.toml"
    )


def identifier_of(law: Any, settings: Mapping[str, Any] | None = None) -> Identifier:
    """Identifier of what fits a law: of a kind by its name, a law, a class, or a given friction.

    Parameters
    ----------
    law : str, Law, Identifier, a class of these, list of laws, or Friction
        A list has a law for each joint. A name as in `frictionid identifiers`; a law is fitted as
        its name would be, one's own by nonlinear least squares; a friction is given, and stays.
    settings : mapping, optional
        Settings of a name.

    Examples
    --------
    >>> from frictionid.friction.laws import Stribeck
    >>> identifier_of("stribeck") == identifier_of(Stribeck()) == identifier_of(Stribeck)
    True
    """
    if not isinstance(settings, Mapping | None):
        raise InputError(f"settings = {settings!r} must be a dict by names")
    if isinstance(law, list | tuple):
        return identifier_named("per_joint", {"laws": [*map(_part_name, law)], **(settings or {})})
    if isinstance(law, str):
        return identifier_named(law, settings or {})
    if settings:
        raise InputError(f"settings {', '.join(settings)} go with a name, not with {law!r}")
    if isinstance(law, type) and issubclass(law, Law | Identifier):
        law = _instance(law)
    if isinstance(law, Identifier):
        return law
    if isinstance(law, Law):
        return _fitting(law)
    friction = getattr(law, "friction", law)
    if isinstance(friction, Friction):
        return Published(friction)
    raise InputError(
        f"{law!r} is no law: give a name such as 'stribeck' (frictionid.identifiers() lists them), "
        "a law, or an identifier"
    )


def _part_name(law: Any) -> str:
    """Name of the law of one joint."""
    if isinstance(law, str):
        return law
    kind = law if isinstance(law, type) else type(law)
    names = [name for name, law_class in LAWS.items() if law_class is kind]
    if not names or (isinstance(law, Law) and law != kind()):
        raise InputError(
            f"the laws of single joints have names, such as ['stribeck', 'none']; {law!r} has none"
        )
    return names[0]


def _instance(kind: type[Law] | type[Identifier]) -> Law | Identifier:
    """An object of a class with its defaults."""
    settings: Any = fields(kind) if is_dataclass(kind) else ()
    needed = [f.name for f in settings if f.init and f.default is f.default_factory]
    if needed:
        raise InputError(f"{kind.__name__} needs {', '.join(needed)}: give {kind.__name__}(...)")
    return kind()


def _fitting(law: Law) -> Identifier:
    """Identifier that fits a law as suites do; one's own is fitted by nonlinear least squares."""
    if not law.names:
        return Frictionless()
    for _, parts in _forms():
        if parts[-1] is type(law):
            identifier = law
            for part in reversed(parts[:-1]):
                identifier = part(identifier)
            return identifier if isinstance(identifier, Identifier) else LeastSquares(law)
    return LeastSquares(law)


def _forms() -> Iterator[tuple[str, tuple[Part, ...]]]:
    """Name and parts of each kind of identifier, also of those that settings choose."""
    for name, kind in IDENTIFIERS.items():
        yield name, kind.parts
        yield from ((name, choice.parts) for choice in kind.choices)


def name_of(law: Any) -> str:
    """Name of an identifier or law in tables: that of its kind, or of its class.

    >>> from frictionid.fitting.identifiers import SINDy
    >>> name_of("stribeck"), name_of(SINDy())
    ('stribeck', 'sindy')
    """
    if isinstance(law, list | tuple):
        return "per_joint"
    if isinstance(law, str):
        return law.rpartition(":")[2]
    if isinstance(law, type):
        law = _instance(law) if issubclass(law, Law | Identifier) else law
    if isinstance(getattr(law, "friction", law), Friction):
        return "published"
    chain = _chain(law if isinstance(law, Identifier) else identifier_of(law))
    for name, parts in _forms():
        if tuple(part for part in parts if isinstance(part, type)) == chain[: len(parts)]:
            return name
    return chain[-1].__name__


def _chain(part: Any) -> tuple[type, ...]:
    """Classes of an object and of what is in it, from the outside in."""
    inner = [getattr(part, f.name) for f in fields(part)][:1] if is_dataclass(part) else []
    deeper = [value for value in inner if isinstance(value, Law | Identifier)]
    return (type(part), *(kind for value in deeper for kind in _chain(value)))


def friction_of(model: Any, laws: Sequence[type[Law]] = ()) -> Friction:
    """Friction of a model: a `Fit`, a `Friction`, or a model file.

    laws : classes of one's own laws, where a file has one
    """
    if isinstance(model, str | Path):
        return load_model(Path(model), laws)
    friction = getattr(model, "friction", model)
    if isinstance(friction, Friction):
        return friction
    raise InputError(
        f"a {type(model).__name__} is no model: give what frictionid.fit returns, or a model file"
    )


def number(name: str, value: Any) -> float:
    """A number.

    >>> number("horizon", 1)
    1.0
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InputError(f"{name} = {value!r} must be a number")
    return float(value)


def numbers(name: str, values: Any) -> list[float]:
    """Numbers of a list, or of one number.

    >>> numbers("windows", 0.1), numbers("windows", [0.1, 0.3])
    ([0.1], [0.1, 0.3])
    """
    listed = [values] if isinstance(values, str) or not isinstance(values, Iterable) else values
    return [number(name, value) for value in listed]


def count(name: str, value: Any) -> int:
    """A whole number that is not negative.

    >>> count("seed", 3)
    3
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 0:
        raise InputError(f"{name} = {value!r} must be a whole number, 0 or more")
    return int(value)


# --- What can be named ----------------------------------------------------------------------------


def laws(name: str = "") -> pd.DataFrame:
    """The friction laws of model files, with equations, parameters and units; or all of one.

    Examples
    --------
    >>> laws("coulomb_viscous").loc["viscous", "unit"]
    'N m s/rad'
    """
    return _frame(kind_descriptions.laws(), name)


def identifiers(name: str = "") -> pd.DataFrame:
    """What `fit` and `compare` can name, with parameters and settings; or all of one."""
    return _frame(kind_descriptions.identifiers(), name)


def _frame(kinds: Sequence[KindDescription], name: str) -> pd.DataFrame:
    if name:
        kind = described(kinds, name)
        entries = [*(("parameter", e) for e in kind.parameters)]
        entries += [*(("setting", e) for e in kind.settings)]
        rows = [(e.name, part, e.unit, e.default, e.meaning) for part, e in entries]
        columns = ["name", "part", "unit", "default", "meaning"]
        return pd.DataFrame(rows, columns=columns).set_index("name")
    lines = [
        (
            kind.name,
            kind.summary,
            ", ".join(f"{p.name} [{p.unit}]" for p in kind.parameters),
            ", ".join(s.name for s in kind.settings),
        )
        for kind in kinds
    ]
    columns = ["name", "summary", "parameters", "settings"]
    return pd.DataFrame(lines, columns=columns).set_index("name")
