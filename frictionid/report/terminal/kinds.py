"""Kinds of mechanisms, laws and identifiers, for people in the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from frictionid.comparison.kind_descriptions import Entry, KindDescription
from frictionid.report.terminal.console import console


def show_kinds(kinds: Sequence[KindDescription], more: str) -> None:
    """Print each kind with the names and units of its parameters, and how to see `more`."""
    out = console()
    for kind in kinds:
        out.print(f"{kind.name}", style="bold", markup=False)
        out.print(f"  {kind.summary}", markup=False, soft_wrap=True)
        if kind.parameters:
            names = ", ".join(f"{p.name} [{p.unit}]" for p in kind.parameters)
            out.print(f"  parameters: {names}", markup=False, soft_wrap=True)
        elif kind.settings:
            names = ", ".join(setting.name for setting in kind.settings)
            out.print(f"  settings: {names}", markup=False, soft_wrap=True)
    out.print(f"\n{more}", markup=False, soft_wrap=True)


def show_kind(kind: KindDescription) -> None:
    """Print all of a kind: what it is, its parameters and its settings."""
    out = console()
    out.print(kind.name, style="bold", markup=False)
    for paragraph in filter(None, (kind.summary, *kind.details)):
        out.print(f"{paragraph}\n", markup=False, soft_wrap=True)
    for title, entries in (
        ("parameter", kind.parameters),
        ("setting", kind.settings),
        ("base parameter: what motion identifies", kind.base),
    ):
        if entries:
            out.print(_table(title, entries))


def _table(title: str, entries: Sequence[Entry]) -> object:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, padding=(0, 1), title_justify="left")
    columns = {
        title: [entry.name for entry in entries],
        "default": [entry.default for entry in entries],
        "unit": [entry.unit for entry in entries],
        "meaning": [entry.meaning for entry in entries],
    }
    shown = {name: cells for name, cells in columns.items() if any(cells)}
    for name in shown:
        table.add_column(name, header_style="bold")
    for cells in zip(*shown.values(), strict=True):
        table.add_row(*map(Text, cells))
    return table
