"""Attributes of an XML file changed in its text: comments, order and layout stay as they are."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers.expat import ExpatError, ParserCreate
from xml.sax.saxutils import quoteattr

from frictionid.errors import InputError
from frictionid.files import read_bytes

_ATTRIBUTE = re.compile(rb"""\s+([\w:.-]+)\s*=\s*("[^"]*"|'[^']*')""")
_NAME = re.compile(rb"<[^\s/>]+")


@dataclass
class Element:
    """An element, and where its tags stand in the file.

    start, end : bytes of its start tag
    close : where its end tag begins, `start` where it has none; after : where the element ends
    """

    tag: str
    attributes: Mapping[str, str]
    start: int
    end: int
    parent: "Element | None" = field(repr=False)
    close: int = 0
    after: int = 0
    children: "list[Element]" = field(default_factory=list, repr=False)

    @property
    def name(self) -> str:
        """Its attribute `name`, "" where it has none."""
        return self.attributes.get("name", "")

    @property
    def is_empty(self) -> bool:
        """Whether one tag opens and closes it."""
        return self.close == self.start


def read_xml(path: Path, kind: str, *roots: str) -> tuple[bytes, list[Element]]:
    """Text of a file of some kind, and its elements in its order, the first of which is a root.

    Raises
    ------
    InputError
        Where it cannot be read, is of another kind, no XML in UTF-8, or declares a document type.
    """
    text = read_bytes(path)
    listed = elements(text, str(path))
    if not listed or listed[0].tag not in roots:
        raise InputError(f"{path}: is no {kind}, its first element must be <{roots[0]}>")
    return text, listed


def elements(text: bytes, where: str) -> list[Element]:
    """Elements of a text in its order; `where` is named in errors.

    >>> [(e.tag, e.name) for e in elements(b'<a><!-- b --><b name="c"/></a>', "it")]
    [('a', ''), ('b', 'c')]
    """
    listed: list[Element] = []
    within: list[Element] = []
    parser = ParserCreate("utf-8")

    def begin(tag: str, attributes: dict[str, str]) -> None:
        start = parser.CurrentByteIndex
        parent = within[-1] if within else None
        element = Element(tag, attributes, start, _end_of_tag(text, start), parent)
        if parent is not None:
            parent.children.append(element)
        listed.append(element)
        within.append(element)

    def finish(_: str) -> None:
        element = within.pop()
        is_empty = text[element.end - 2 : element.end] == b"/>"
        element.close = element.start if is_empty else parser.CurrentByteIndex
        element.after = element.end if is_empty else text.index(b">", element.close) + 1

    def refuse(*_: Any) -> None:
        raise InputError(f"{where}: has a document type (<!DOCTYPE ...>): remove it")

    parser.StartElementHandler, parser.EndElementHandler = begin, finish
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except ExpatError as error:
        raise InputError(f"{where}: is no XML in UTF-8: {error}") from None
    return listed


def _end_of_tag(text: bytes, start: int) -> int:
    """Where a tag ends that begins at `start`: a > in quotes is none."""
    at = _NAME.match(text, start).end()  # type: ignore[union-attr]
    while match := _ATTRIBUTE.match(text, at):
        at = match.end()
    return text.index(b">", at) + 1


def with_attributes(tag: bytes, values: Mapping[str, str]) -> bytes:
    """A start tag with attributes set: those that it has in their place, others behind its last.

    >>> with_attributes(b'<joint name="a" damping = "1" />', {"damping": "2", "armature": "3"})
    b'<joint name="a" damping = "2" armature="3" />'
    """
    out, at, left = tag, _NAME.match(tag).end(), dict(values)  # type: ignore[union-attr]
    while match := _ATTRIBUTE.match(out, at):
        at, name = match.end(), match.group(1).decode()
        if name in left:
            new = quoteattr(left.pop(name)).encode()
            first, last = match.span(2)
            out, at = out[:first] + new + out[last:], first + len(new)
    rest = "".join(f" {name}={quoteattr(value)}" for name, value in left.items())
    return out[:at] + rest.encode() + out[at:]


def element(tag: str, values: Mapping[str, str]) -> bytes:
    """An empty element with attributes."""
    return with_attributes(f"<{tag}/>".encode(), values)


def replaced(text: bytes, changes: Iterable[tuple[int, int, bytes]]) -> bytes:
    """A text with parts from one byte to another changed for others.

    >>> replaced(b"abcd", [(1, 2, b"XY"), (4, 4, b"!")])
    b'aXYcd!'
    """
    for start, end, new in sorted(changes, reverse=True):
        text = text[:start] + new + text[end:]
    return text


def by_name(elements: Iterable[Element], names: Iterable[str], where: str) -> list[Element]:
    """Elements of these names, in their order.

    Raises
    ------
    InputError
        Where one is missing, or there are two of a name.
    """
    listed, out = list(elements), []
    for name in names:
        named = [e for e in listed if e.name == name]
        if len(named) != 1:
            others = ", ".join(sorted({e.name for e in listed if e.name}))
            count = f"{len(named)} joints" if named else "no joint"
            raise InputError(
                f"{where}: has {count} {name!r}, it has {others or 'none with a name'}; "
                "name the joints of the file in the model's order with --joints"
            )
        out += named
    return out


def stated_before(
    name: str, before: Mapping[str, str | None], new: Mapping[str, str]
) -> Iterator[str]:
    """A note on attributes of a joint that had other values, if there are any."""
    old = ", ".join(f"{k} {v}" for k, v in before.items() if v is not None and v != new.get(k, v))
    if old:
        yield f"{name} had {old}"
