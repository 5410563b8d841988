"""Attributes of an XML file changed in its text: comments, order and layout stay as they are."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers.expat import ExpatError, ParserCreate
from xml.sax.saxutils import quoteattr

from frictionid.errors import InputError

_ATTRIBUTE = re.compile(rb"""\s+([\w:.-]+)\s*=\s*("[^"]*"|'[^']*')""")
_NAME = re.compile(rb"<[^\s/>]+")


@dataclass
class Element:
    """An element, and where its tags stand in the file.

    start, end : bytes of its start tag; close : where its end tag begins, `start` where it has none
    """

    tag: str
    attributes: Mapping[str, str]
    start: int
    end: int
    parent: Element | None = field(repr=False)
    close: int = 0
    children: list[Element] = field(default_factory=list, repr=False)

    @property
    def name(self) -> str:
        """Its attribute `name`, "" where it has none."""
        return self.attributes.get("name", "")

    @property
    def is_empty(self) -> bool:
        """Whether one tag opens and closes it."""
        return self.close == self.start


def read_xml(path: Path) -> tuple[bytes, list[Element]]:
    """Text of a file, and its elements in its order.

    Raises
    ------
    InputError
        Where it cannot be read, is no XML in UTF-8, or declares a document type.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    return text, elements(text, str(path))


def elements(text: bytes, where: str) -> list[Element]:
    """Elements of a text in its order; `where` is named in errors.

    >>> [(e.tag, e.name) for e in elements(b'<a><!-- b --><b name="c"/></a>', "it")]
    [('a', ''), ('b', 'c')]
    """
    found: list[Element] = []
    open_: list[Element] = []
    parser = ParserCreate("utf-8")

    def begin(tag: str, attributes: dict[str, str]) -> None:
        start = parser.CurrentByteIndex
        parent = open_[-1] if open_ else None
        own = Element(tag, attributes, start, _end_of_tag(text, start), parent)
        if parent is not None:
            parent.children.append(own)
        found.append(own)
        open_.append(own)

    def finish(_: str) -> None:
        own = open_.pop()
        empty = text[own.end - 2 : own.end] == b"/>"
        own.close = own.start if empty else parser.CurrentByteIndex

    def refuse(*_: Any) -> None:
        raise InputError(f"{where}: has a document type (<!DOCTYPE ...>): remove it")

    parser.StartElementHandler, parser.EndElementHandler = begin, finish
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except ExpatError as error:
        raise InputError(f"{where}: is no XML in UTF-8: {error}") from None
    return found


def _end_of_tag(text: bytes, start: int) -> int:
    """Where a tag ends that begins at `start`: a > in quotes is none."""
    at = _NAME.match(text, start).end()  # type: ignore[union-attr]
    while found := _ATTRIBUTE.match(text, at):
        at = found.end()
    return text.index(b">", at) + 1


def with_attributes(tag: bytes, values: Mapping[str, str]) -> bytes:
    """A start tag with attributes set: those that it has in their place, others behind its last.

    >>> with_attributes(b'<joint name="a" damping = "1" />', {"damping": "2", "armature": "3"})
    b'<joint name="a" damping = "2" armature="3" />'
    """
    out, at, left = tag, _NAME.match(tag).end(), dict(values)  # type: ignore[union-attr]
    while found := _ATTRIBUTE.match(out, at):
        at, name = found.end(), found.group(1).decode()
        if name in left:
            new = quoteattr(left.pop(name)).encode()
            first, last = found.span(2)
            out, at = out[:first] + new + out[last:], first + len(new)
    more = "".join(f" {name}={quoteattr(value)}" for name, value in left.items())
    return out[:at] + more.encode() + out[at:]


def replaced(text: bytes, changes: Iterable[tuple[int, int, bytes]]) -> bytes:
    """A text with parts from one byte to another changed for others.

    >>> replaced(b"abcd", [(1, 2, b"XY"), (4, 4, b"!")])
    b'aXYcd!'
    """
    for start, end, new in sorted(changes, reverse=True):
        text = text[:start] + new + text[end:]
    return text


def by_name(found: Iterable[Element], names: Iterable[str], where: str) -> list[Element]:
    """Elements of these names, in their order.

    Raises
    ------
    InputError
        Where one is missing, or there are two of a name.
    """
    listed = list(found)
    out = []
    for name in names:
        own = [e for e in listed if e.name == name]
        if len(own) != 1:
            known = ", ".join(sorted({e.name for e in listed if e.name})) or "none with a name"
            count = f"{len(own)} joints" if own else "no joint"
            raise InputError(
                f"{where}: has {count} {name!r}, it has {known}; name the joints of the file in "
                "the model's order with --joints"
            )
        out.append(own[0])
    return out
