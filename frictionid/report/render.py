"""Templates: text whose words stand in templates/*.j2 and whose numbers come from Python."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from frictionid.report import numbers
from frictionid.report.tables import code, escape_markdown, markdown


def render(template: str, context: Mapping[str, Any], *, markup: bool = True) -> str:
    """Text of a template with the values of its context.

    markup : whether names are marked as code and escaped for Markdown; else they stay plain
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("frictionid.report"),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,
    )
    environment.globals["inf"] = float("inf")
    environment.filters |= {
        "text": escape_markdown if markup else str,
        "code": code if markup else str,
        "table": markdown,
        **{name: getattr(numbers, name) for name in ("short", "fixed", "percent", "factor")},
        **{
            name: getattr(numbers, name)
            for name in ("signed", "seconds", "divergence_limit", "with_error")
        },
    }
    return environment.get_template(template).render(context)
