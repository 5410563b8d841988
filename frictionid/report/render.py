"""Templates: text words in templates/*.j2, numbers from Python."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from frictionid.report.numbers import (
    divergence_limit,
    factor,
    fixed,
    percent,
    seconds,
    short,
    signed,
    with_error,
)
from frictionid.report.tables import code, escape_markdown, markdown

NUMBERS = (short, fixed, percent, factor, signed, seconds, divergence_limit, with_error)


def render_page(template: str, context: Mapping[str, Any]) -> str:
    """HTML of a template with the values of its context, in which every name is plain text."""
    return _environment(escape=True).get_template(template).render(context)


def lines_of(text: str) -> list[str]:
    """Points of a rendered list, one text each."""
    return [line.removeprefix("- ").strip() for line in text.splitlines() if line.strip()]


def render(template: str, context: Mapping[str, Any], *, markup: bool = True) -> str:
    """Text of a template with the values of its context.

    markup : whether names are marked as code and escaped for Markdown; else they stay plain
    """
    environment = _environment(escape=False)
    environment.globals["inf"] = float("inf")
    environment.filters |= {
        "text": escape_markdown if markup else str,
        "code": code if markup else str,
        "table": markdown,
    }
    return environment.get_template(template).render(context)


def _environment(*, escape: bool) -> Any:
    """The templates' environment, with the filters of numbers; text ends as its template does."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("frictionid.report"),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=not escape,
        autoescape=escape,
    )
    environment.filters |= {function.__name__: function for function in NUMBERS}
    return environment
