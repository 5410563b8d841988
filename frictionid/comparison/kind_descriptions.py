"""Kinds of mechanisms, laws and identifiers with their parameters and settings.

Names, units, defaults and words are those of the classes that the program itself uses.
"""

import inspect
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.friction import Law
from frictionid.friction.laws.levels import SIDES
from frictionid.friction.model_files import LAWS
from frictionid.mechanics import Mechanism
from frictionid.mechanics.mechanism_table import mechanism_kinds, mechanism_options

from .registry import IDENTIFIERS, Choice, Kind

_ENTRY = re.compile(r"([a-z]\w*(?:, [a-z]\w*)*) : (.*)", re.IGNORECASE)
_SENTENCE = re.compile(r"(?<=[.:;]) (?=[A-Z`])")  # what stands between two
_SECTION = re.compile(r"[A-Z][a-z]+\n-{3,}$", re.MULTILINE)


def summary(documented: Any) -> str:
    """First sentence of a docstring, in one line.

    >>> from frictionid.friction.laws import Stribeck
    >>> summary(Stribeck)
    'Tf = (coulomb + peak exp(-(w/stribeck_velocity)^2)) sgn(w) + viscous w.'
    """
    return _one_line((inspect.getdoc(documented) or "").partition("\n\n")[0])


def details(documented: Any) -> list[str]:
    """Paragraphs of a docstring behind the first, without its entries and sections."""
    return _paragraphs(inspect.getdoc(documented) or "")[1:]


def meaning(documented: Any, name: str) -> str:
    """What a docstring, or that of a base class, says of a setting; "" where it says nothing.

    Entries count first, then the sentence that has the name between backticks.

    >>> from frictionid.fitting.identifiers import LeastSquares
    >>> meaning(LeastSquares, "iterations")
    'steps at most'
    """
    family = inspect.getmro(documented) if inspect.isclass(documented) else (documented,)
    docs = [inspect.cleandoc(part.__doc__ or "") for part in family if part is not object]
    for doc in docs:
        for names, text in _entries(doc):
            if name in names:
                return text
    sentences = (s for doc in docs for p in _paragraphs(doc) for s in _SENTENCE.split(p))
    return next((s for s in sentences if f"`{name}`" in s), "").removeprefix(f"`{name}` is ")


def _entries(doc: str) -> Iterator[tuple[list[str], str]]:
    """Names and text of the entries `names : text`, with the lines indented below them.

    Below a heading such as Parameters the text is a type, of which only values are kept.
    """
    lines = doc.splitlines()
    heading = next((i for i, line in enumerate(lines) if line.startswith("---")), len(lines))
    for i, line in enumerate(lines):
        entry = _ENTRY.fullmatch(line)
        if entry is None:
            continue
        below = []
        for later in lines[i + 1 :]:
            if not later.startswith("    "):
                break
            below.append(later)
        typed = i > heading and '"' not in entry[2]
        first = "" if typed else f"{entry[2]}:" if i > heading else entry[2]
        yield entry[1].split(", "), _one_line(" ".join([first, *below]))


def _paragraphs(doc: str) -> list[str]:
    """Paragraphs of a docstring, without its entries, examples and sections."""
    blocks = _SECTION.split(doc)[0].split("\n\n")
    prose = (b for b in blocks if not _ENTRY.match(b.lstrip()) and not b.startswith(">>>"))
    return [_one_line(block) for block in prose]


def _one_line(text: str) -> str:
    return " ".join(text.replace("``", "`").split())


class Entry(NamedTuple):
    """A parameter or setting: its default as TOML would have it ("" where it has none)."""

    name: str
    default: str
    unit: str
    meaning: str


class KindDescription(NamedTuple):
    """A kind: what it is, its parameters, which a fit finds or a machine has, and its settings.

    base : combinations of a mechanism's parameters that motion can identify
    """

    name: str
    summary: str
    details: tuple[str, ...]
    parameters: tuple[Entry, ...]
    settings: tuple[Entry, ...]
    base: tuple[Entry, ...] = ()


def mechanisms() -> list[KindDescription]:
    """Descriptions of the kinds of [mechanism].

    >>> [entry.meaning for entry in mechanisms()[3].parameters[1:3]]
    ['joint to centre of mass', 'inertia about the centre of mass']
    """
    return [_mechanism(name, build) for name, build in mechanism_kinds().items()]


def laws() -> list[KindDescription]:
    """Descriptions of the friction laws of model files.

    >>> next(law for law in laws() if law.name == "stribeck").parameters[2].unit
    'rad/s'
    """
    return [_described(name, Kind((law,))) for name, law in LAWS.items()]


def identifiers() -> list[KindDescription]:
    """Descriptions of the kinds of identifiers, for --identifier and the [[identifiers]] of suites.

    >>> [entry.default for entry in identifiers()[1].settings if entry.name == "iterations"]
    ['100']
    """
    return [_described(name, kind) for name, kind in IDENTIFIERS.items()]


def described(kinds: Iterable[KindDescription], name: str) -> KindDescription:
    """The description of a name among others."""
    by_name = {kind.name: kind for kind in kinds}
    if name not in by_name:
        raise InputError(f"{name!r} is unknown; {nearest(name, by_name)}")
    return by_name[name]


def _mechanism(name: str, build: Callable[..., Mechanism]) -> KindDescription:
    mechanism = build()
    parameters = [
        Entry(p.name, "" if p.required else f"{p.default:g}", p.unit, p.meaning)
        for p in mechanism.parameters
    ]
    base = zip(mechanism.base_names, mechanism.base_units, mechanism.base_meanings, strict=True)
    options = [
        Entry(option, _toml(default), "", meaning(build, option))
        for option, default in mechanism_options(build).items()
    ]
    return KindDescription(
        name,
        summary(build),
        tuple(details(build)),
        tuple(parameters),
        tuple(options),
        tuple(Entry(name, "", unit, text) for name, unit, text in base),
    )


def _parameters(law: Any) -> tuple[Entry, ...]:
    """Parameters of a law; none of networks and libraries, which have hundreds."""
    if not (inspect.isclass(law) and issubclass(law, Law)):
        return ()
    if any(f.default is MISSING and f.default_factory is MISSING for f in fields(law)):
        return ()  # they depend on a setting that must be given
    example = law()
    if example.is_network or example.is_sparse:
        return ()
    pairs = zip(example.names, example.units, strict=True)
    return tuple(Entry(name, "", unit, _of_parameter(law, name)) for name, unit in pairs)


def _of_parameter(law: type, name: str) -> str:
    """Meaning of a parameter; one direction, or one of a series, is explained by their name."""
    side = next((end for end in SIDES if name.endswith(end)), "")
    series = re.sub(r"_[\d.]+$", "", name.removesuffix(side))
    said = _said(law, name) or _said(law, series)
    return f"w {'>' if side == SIDES[0] else '<'} 0: {said}" if side and said else said


def _described(name: str, kind: Kind) -> KindDescription:
    defaults = kind.defaults({})
    settings = []
    for setting in kind.settings:
        choices = [choice for choice in kind.choices if choice.key == setting]
        is_choice = choices and setting not in defaults
        settings.append(_choice(kind, setting, choices) if is_choice else _setting(kind, setting))
    *outer, law = kind.parts
    words = (*map(summary, outer), *details(law))
    return KindDescription(name, summary(law), words, _parameters(law), tuple(settings))


def _first_default(kind: Kind, setting: str) -> Any:
    """Default of a setting in the first form of the kind that has it."""
    for part in filter(is_dataclass, kind.parts):
        for f in fields(part):
            if f.name == setting and f.default_factory is not MISSING:
                return f.default_factory()
    tables: list[Mapping[str, Any]] = [{}, *({c.key: c.value} for c in kind.choices)]
    forms = map(kind.defaults, tables)
    return next((form[setting] for form in forms if setting in form), MISSING)


def _choice(kind: Kind, name: str, choices: list[Choice]) -> Entry:
    """A setting that chooses the law, or how it is fitted."""
    differ = {choice.parts[-1] for choice in choices} != {kind.parts[-1]}
    said = [f"{_toml(c.value)}: {summary(c.parts[-1 if differ else 0])}" for c in choices]
    usual = [c.value for c in choices if c.parts == kind.parts]
    usual += [not c.value for c in choices if isinstance(c.value, bool)]
    return Entry(name, _toml(usual[0]) if usual else "", "", " ".join(said))


def _setting(kind: Kind, name: str) -> Entry:
    default, parts = _first_default(kind, name), [part for form in kind.forms for part in form]
    said = next(filter(None, (_said(part, name) for part in parts)), "")
    allowed = next(filter(None, (_allowed(part, name) for part in parts)), "")
    words = said if not allowed or allowed in said else f"{allowed}; {said}".strip("; ")
    return Entry(name, "" if default is MISSING else _toml(default), "", words)


_REFERENCE = re.compile(r"as in `\w+`")


def _said(part: Any, name: str) -> str:
    """What a part says of a name, or another one to which it refers: "as in `MLP`"."""
    said = meaning(part, name)
    if said and not _REFERENCE.fullmatch(said):
        return said
    doc = inspect.getdoc(part) or ""
    parts: dict[Any, None] = dict.fromkeys(p for k in IDENTIFIERS.values() for p in k.parts)
    others = [p for p in (*LAWS.values(), *parts) if p is not part and f"`{p.__name__}`" in doc]
    meanings = (meaning(other, name) for other in others)
    return next((m for m in meanings if m and not _REFERENCE.fullmatch(m)), "")


def _allowed(part: Any, name: str) -> str:
    """The values that a setting may have, where they are listed by its type."""
    kind = get_type_hints(part).get(name)
    return " or ".join(map(_toml, get_args(kind))) if get_origin(kind) is Literal else ""


def _toml(value: Any) -> str:
    """A value as TOML has it; "none" stands for a setting that is left out."""
    if value is None:
        return "none"
    return json.dumps(value) if isinstance(value, int | float | str | tuple | dict) else str(value)
