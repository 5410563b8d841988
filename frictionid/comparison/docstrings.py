"""What docstrings say of a class or function, and of each of its settings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any

_ENTRY = re.compile(r"([a-z]\w*(?:, [a-z]\w*)*) : (.*)", re.IGNORECASE)
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
    text = _SECTION.split(inspect.getdoc(documented) or "")[0]
    blocks = text.split("\n\n")[1:]
    return [_one_line(block) for block in blocks if not _ENTRY.match(block.lstrip())]


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
    said = (sentence for doc in docs for sentence in _sentences(doc) if f"`{name}`" in sentence)
    return next(said, "").removeprefix(f"`{name}` is ")


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


def _sentences(doc: str) -> list[str]:
    blocks = _SECTION.split(doc)[0].split("\n\n")
    paragraphs = [block for block in blocks if not _ENTRY.match(block.lstrip())]
    return [s for p in paragraphs for s in re.split(r"(?<=[.:;]) (?=[A-Z`])", _one_line(p))]


def _one_line(text: str) -> str:
    return " ".join(text.replace("``", "`").split())
