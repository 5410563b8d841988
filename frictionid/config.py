"""TOML files and their tables: no unknown keys, no converted types, each mistake in one line."""

import difflib
import importlib
import importlib.util
import re
import reprlib
import sys
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar, dataclass_transform, get_type_hints

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    create_model,
    model_validator,
)

from frictionid.errors import InputError
from frictionid.files import regular_file

Checked = TypeVar("Checked", bound=BaseModel)
Settings = TypeVar("Settings")


# "10" is no number, 1 is no truth value, and nothing is infinite.
STRICT = ConfigDict(strict=True, allow_inf_nan=False)
_TABLES = ("model_type", "dataclass_type", "dataclass_exact_type")


def read_toml(path: Path, advice: str = "check it") -> dict[str, Any]:
    """Tables of a TOML file."""
    try:
        content = regular_file(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); {advice}") from None
    return parse_toml(content, str(path))


def parse_toml(text: str | bytes, where: str) -> dict[str, Any]:
    """Tables of a TOML text, which stands `where` the message says."""
    try:
        return tomllib.loads(text if isinstance(text, str) else text.decode("utf-8"))
    # ValueError: no UTF-8, no TOML, or an integer with thousands of digits
    except (ValueError, RecursionError) as error:
        model = "a model stands before the data" if where.endswith(".json") else "correct it"
        raise InputError(f"{where} is no TOML ({error}); {model}, or name another file") from None


def nearest(name: str, candidates: Iterable[str]) -> str:
    """Way out for an unknown name: the known one that looks most like it, or all of them.

    Examples
    --------
    >>> nearest("angel", ["time", "angle"])
    "did you mean 'angle'?"
    """
    names = list(candidates)
    close = difflib.get_close_matches(str(name), names, n=1)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(map(repr, names))}"


def imported(reference: str, folder: Path, where: str) -> Any:
    """What `module:name` names in a user's own code, in a folder or the current one.

    Raises
    ------
    InputError
        Saying where the reference stands, and what its module raised.

    Examples
    --------
    >>> imported("math:pi", Path(), "suite.toml").is_integer()
    False
    """
    module, _, name = reference.partition(":")
    for place in (str(folder.resolve()), str(Path.cwd())):
        if place not in sys.path:
            sys.path.append(place)
    try:
        return getattr(importlib.import_module(module), name)
    except Exception as error:  # whatever the user's own module raises
        reason = f"{type(error).__name__}: {error}"
        raise InputError(f"{where}: {reference!r} cannot be imported ({reason})") from None


def untrusted(reference: str) -> str:
    """Complaint about a file that names code, which is not trusted yet."""
    return (
        f"{reference!r} is code, which runs with your rights: read it, and give --trust "
        "(trust=True in Python) where it is harmless"
    )


def imported_for_suite(reference: str, folder: Path, where: str, *, trust: bool) -> Any:
    """What `module:name` names in a suite: in a module of the suite's folder, or installed.

    Raises
    ------
    InputError
        Without trust, and for a module from elsewhere, Python's own included, before any import.

    Examples
    --------
    >>> imported_for_suite("math:pi", Path(), "suite.toml", trust=True)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    frictionid.errors.InputError: suite.toml: 'math:pi' is neither in a module beside the file ...
    """
    if not trust:
        raise InputError(f"{where}: {untrusted(reference)}")
    top = reference.partition(":")[0].partition(".")[0]
    if str(folder.resolve()) not in sys.path:
        sys.path.append(str(folder.resolve()))
    if not (is_installed(top) or _is_beside(top, folder)):
        raise InputError(
            f"{where}: {reference!r} is neither in a module beside the file nor in an installed "
            "package: copy it there, or install it"
        )
    return imported(reference, folder, where)


def is_installed(module: str) -> bool:
    """Whether a module is of an installed package, which the standard library is not.

    >>> is_installed("numpy.linalg"), is_installed("os.path")
    (True, False)
    """
    top = module.partition(".")[0]
    return top == __name__.partition(".")[0] or top in _installed()


@cache
def _installed() -> frozenset[str]:
    """Modules of the installed packages; their metadata is many files to read."""
    return frozenset(packages_distributions())


def _is_beside(top: str, folder: Path) -> bool:
    """Whether a module that is not nested is a file or package in a folder, or a copy of it."""
    try:
        spec = importlib.util.find_spec(top)
    except (ImportError, ValueError):
        return False
    places = (folder / f"{top}.py", folder / top / "__init__.py")
    if spec is None or not spec.origin or not Path(spec.origin).is_file():
        return False
    content = Path(spec.origin).read_bytes()
    return any(path.is_file() and path.read_bytes() == content for path in places)


class Strict(BaseModel):
    """A table of a TOML file: no other keys, no conversion of types, no infinite numbers.

    settings : keys beside the fields, which a model that allows other keys takes
    """

    model_config = ConfigDict(extra="forbid", frozen=True, **STRICT)
    settings: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, table: Any) -> Any:
        if not isinstance(table, dict):
            return table
        keys = [*cls.model_fields, *cls.settings]
        strict = cls.settings or cls.model_config.get("extra") == "forbid"
        for key in table if strict else ():
            if key not in keys:
                raise ValueError(f"unknown key {key!r}; {nearest(key, keys)}")
        return table


def mistake(invalid: ValidationError) -> str:
    """The first complaint of pydantic in one line: which key, which rule, what was given.

    One mistake at a time, as the first one often causes the others; but all missing keys at once.
    """
    errors = invalid.errors(include_url=False)
    error, place = errors[0], place_of(errors[0])
    missing = [place_of(e)[1:] for e in errors if e["type"].startswith("missing")]
    if place[1:] in missing:
        if len(missing) > 1:
            names = ", ".join(map(repr, missing[:-1]))
            return f"the keys {names} and {missing[-1]!r} are missing; add them"
        is_worded = error["type"] != "missing"
        return error["msg"] if is_worded else f"the key {place[1:]!r} is missing; add it"
    reason = error["msg"].removeprefix("Value error, ").replace("Input should", "it should")
    reason = re.sub("'str' instances .*", "it should be a valid list", reason)
    reason = re.sub("valid (tuple|array|sequence)", "valid list", reason)
    reason = re.sub(r"\w+ (should .* items?) after validation, not \d+", r"it \1", reason)
    if error["type"] in _TABLES:  # pydantic's words name our classes
        reason = "it should be one table of keys and values"
    if error["type"] == "value_error" and reason.startswith(f"{place[1:]}: "):
        return reason
    if error["type"] != "value_error":
        reason += f", not {reprlib.repr(error['input'])}"
    return f"{place[1:]}: {reason}" if place else reason


def place_of(error: Any, tags: Collection[str] = ()) -> str:
    """Where a complaint of pydantic is, such as ".columns.angle[1]", without types of a union.

    tags : of unions, which are no keys either
    """
    types = re.compile(r"constrained-|(tuple|list|sequence)\[")
    keys = [key for key in error["loc"] if key not in tags and not types.match(str(key))]
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys)


def checked(model: type[Checked], document: Mapping[str, Any], where: str) -> Checked:
    """The document as a model of its keys."""
    try:
        return model.model_validate(document)
    except ValidationError as invalid:
        raise InputError(f"{where}: {mistake(invalid)}") from None


def unknown(setting: str, settings: Iterable[str]) -> str:
    """Complaint about a setting that is none of the known ones.

    >>> unknown("widht", ["width", "shape"])
    "unknown setting 'widht'; did you mean 'width'?"
    """
    names = list(settings)
    return f"unknown setting {setting!r}; {nearest(setting, names) if names else 'it has none'}"


def distinct(names: Sequence[str], what: str) -> None:
    """Check that all names differ."""
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"two {what} are called {twice[0]!r}: give one of them another name")


# Types of settings, for the fields of dataclasses that `check_settings` validates.
Positive = Annotated[float, Field(gt=0, lt=1e20)]  # squares of settings are numbers, too
NotNegative = Annotated[float, Field(ge=0, lt=1e20)]
Count = Annotated[int, Field(ge=1)]
_T = TypeVar("_T")
NonEmpty = Annotated[list[_T], Field(min_length=1)]


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def validated(settings: type[Settings]) -> type[Settings]:
    """A frozen dataclass whose fields are validated by their annotated types when it is made.

    A list for a field that is a tuple becomes one; nothing else is converted. Fields that hold
    objects of other classes are not checked. What `__post_init__` checks comes afterwards.

    Examples
    --------
    >>> @validated
    ... class Training:
    ...     rate: Positive = 0.1
    >>> Training(rate=0.0)
    Traceback (most recent call last):
    frictionid.errors.InputError: rate: it should be greater than 0, not 0.0
    """
    others: Any = getattr(settings, "__post_init__", None)

    def check(self: Any) -> None:
        check_settings(self)
        if others is not None:
            others(self)

    settings.__post_init__ = check  # type: ignore[attr-defined]
    return dataclass(frozen=True)(settings)


def check_settings(settings: Any) -> None:
    """Validate the fields of a dataclass by their annotated types, see `validated`."""
    model = _model_of(settings.__class__)
    for name in model.model_fields:
        value = getattr(settings, name)
        if isinstance(value, list):
            object.__setattr__(settings, name, tuple(value))
    try:
        model.model_validate({name: getattr(settings, name) for name in model.model_fields})
    except ValidationError as invalid:
        raise InputError(mistake(invalid)) from None


def check_arguments(function: Callable[..., Any], arguments: Mapping[str, Any], where: str) -> None:
    """Validate arguments of a function by their annotated types; `where` is named in errors."""
    try:
        _model_of(function).model_validate(arguments)
    except ValidationError as invalid:
        raise InputError(f"{where}: {mistake(invalid)}") from None


@cache
def _model_of(settings: Callable[..., Any]) -> type[BaseModel]:
    """Model of the fields of a dataclass, or arguments of a function, that hold no objects."""
    types = get_type_hints(settings, include_extras=True)
    types.pop("return", None)
    names = [f.name for f in fields(settings)] if is_dataclass(settings) else types
    kinds = {name: types[name] for name in names}
    plain = (bool, int, float, str)
    checkable: Any = {
        k: (t, ...) for k, t in kinds.items() if t in plain or not isinstance(t, type)
    }
    return create_model(settings.__name__, __config__=STRICT, **checkable)
