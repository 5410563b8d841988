"""Tables for people: one layout, written as Markdown, as LaTeX and for the terminal."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import groupby
from typing import Any, NamedTuple

from frictionid.errors import printable

from .numbers import (
    INFINITE,
    NOTHING,
    divergence_limit,
    fixed,
    percent,
    seconds,
    short,
    with_error,
)


class Cell(NamedTuple):
    """Text of a cell; the best of a column stands out.

    mark : what is wrong with it, on the page; "bound" or "unknown" of a value that is no estimate
    interval : its 95 % interval, on the page
    """

    text: str
    best: bool = False
    mark: str = ""
    interval: str = ""


class Column(NamedTuple):
    """Heading of a column with its unit, and of the group of columns that it belongs to."""

    name: str
    group: str = ""
    unit: str = ""
    note: str = ""  # what the numbers of the group are
    words: bool = False

    @property
    def above(self) -> str:
        """Heading of the group."""
        return f"{self.group} [{self.unit}]{self.note}" if self.unit else self.group

    @property
    def in_one_line(self) -> str:
        """Heading that says everything but the note."""
        name = f"{self.group} {self.name}" if self.group else self.name
        return f"{name} [{self.unit}]" if self.unit else name


class Line(NamedTuple):
    """Cells of a line; a rule separates blocks, whose title heads them where there is one."""

    cells: tuple[Cell, ...]
    block: str = ""
    title: str = ""


class Table(NamedTuple):
    """A table; `caption` is one sentence or two in plain text, `label` names it in LaTeX."""

    caption: str
    label: str
    columns: tuple[Column, ...]
    lines: tuple[Line, ...]

    def __rich_console__(self, console: Any, options: Any) -> Iterator[Any]:
        """Lines, and where a terminal is too narrow the other columns below, beside the first."""
        count = stop = len(self.columns)
        rows = for_terminal(self)
        while console.is_terminal and stop > 2 and rows[-1].cell_len > options.max_width:
            stop -= 1
            rows = for_terminal(_picked(self, range(stop)))
        yield from rows
        if stop < count:
            yield _picked(self, [0, *range(stop, count)])


Part = tuple[Column, Iterable[str | Cell]]  # heading, and cell of every line


def line(cells: Iterable[str | Cell], block: str = "", title: str = "") -> Line:
    """A line of cells, some of them plain text."""
    return Line(tuple(c if isinstance(c, Cell) else Cell(c) for c in cells), block, title)


def text_columns(*names: str) -> list[str | Column]:
    """Columns that hold words: they stand at the left of their cells."""
    return [Column(name, words=True) for name in names]


def table_of(
    heads: Iterable[str | Column],
    rows: Iterable[Line | Iterable[str | Cell]],
    caption: str = "",
    label: str = "",
) -> Table:
    """A table of its lines; a heading that is plain text is that of numbers."""
    columns = tuple(head if isinstance(head, Column) else Column(head) for head in heads)
    lines = tuple(row if isinstance(row, Line) else line(row) for row in rows)
    return Table(caption, label, columns, lines)


def _picked(table: Table, columns: Sequence[int]) -> Table:
    lines = (e._replace(cells=tuple(e.cells[i] for i in columns)) for e in table.lines)
    return table_of([table.columns[i] for i in columns], lines)


def by_columns(caption: str, label: str, parts: Sequence[Part]) -> Table:
    """A table of its columns with their cells."""
    columns, cells = zip(*parts, strict=True)
    return table_of(columns, zip(*cells, strict=True), caption, label)


def blocks(table: Table) -> list[list[Line]]:
    """Lines of each block."""
    return [list(lines) for _, lines in groupby(table.lines, key=lambda line: line.block)]


# --- Markdown ---------------------------------------------------------------------------------


def markdown(table: Table) -> str:
    """A table in GitHub's Markdown, its caption below."""
    head = [escape_markdown(column.in_one_line) for column in table.columns]
    rule = [":---" if column.words else "---:" for column in table.columns]
    body = [[_markdown_cell(cell) for cell in line.cells] for line in table.lines]
    lines = ["| " + " | ".join(row) + " |" for row in (head, rule, *body)]
    return "\n".join([*lines, "", f"*{escape_markdown(table.caption)}*", ""])


def _markdown_cell(cell: Cell) -> str:
    text = escape_markdown(cell.text)
    return f"**{text}**" if cell.best else text


def escape_markdown(text: str) -> str:
    r"""Text whose characters stand for themselves, also inside a table.

    >>> print(escape_markdown("a|b _c_ snake_case <i> *"))
    a\|b \_c\_ snake_case \<i> \*
    """
    text = re.sub(r"([\\|*`<~$]|\](?=[(\[:]))", r"\\\1", " ".join(text.split()))
    return re.sub(r"(?<![^\W_])_|_(?![^\W_])", r"\\_", text)  # within a word it means nothing


def code(name: str) -> str:
    """A name as it stands in code, in Markdown.

    >>> code("stribeck"), code("a`b")
    ('`stribeck`', '`` a`b ``')
    """
    name = " ".join(name.split())
    return f"`` {name} ``" if "`" in name else f"`{name}`"


# --- LaTeX ------------------------------------------------------------------------------------

_LATEX = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "±": r"$\pm$",
    "≈": r"$\approx$",
    "†": r"$\dagger$",
    "−": r"$-$",
    "²": r"$^2$",
    INFINITE: r"$\infty$",
    NOTHING: "--",
    **{c: "\\" + c for c in "&%$#_{}"},
}


def escape_latex(text: str) -> str:
    r"""Text whose characters stand for themselves in LaTeX.

    >>> print(escape_latex("a_b & 5 % ± ∞ – \\ {x} <~^|>"))  # doctest: +ELLIPSIS
    a\_b \& 5 \% $\pm$ $\infty$ -- \textbackslash{} \{x\} \textless{}\textasciitilde{}...
    >>> print(escape_latex("^|>"))
    \textasciicircum{}\textbar{}\textgreater{}
    """
    return "".join(_LATEX.get(c, c) for c in " ".join(text.split()))


def latex(table: Table) -> str:
    """A table for a LaTeX document that uses the package booktabs."""
    groups, at = [], 1
    for name, members in groupby(table.columns, key=lambda column: column.above):
        width = len(list(members))
        groups.append((escape_latex(name), width, at))
        at += width
    context = {
        "table": table,
        "label": re.sub(r"[^A-Za-z0-9.-]+", "-", table.label),
        "groups": groups if any(name for name, *_ in groups) else [],
        "blocks": [[_latex_row(line) for line in lines] for lines in blocks(table)],
        "latex": escape_latex,
    }
    return render("table.tex.j2", context)


def _latex_row(line: Line) -> str:
    """A row; after an end of line a star or a bracket would be taken for its own argument."""
    texts = ((escape_latex(cell.text), cell.best) for cell in line.cells)
    row = " & ".join(rf"\textbf{{{text}}}" if best else text for text, best in texts)
    return "{}" + row if row.startswith(("*", "[")) else row


# --- Terminal ---------------------------------------------------------------------------------

GAP = 2


def for_terminal(table: Table) -> list[Any]:
    """Lines of the table as rich texts: groups head their columns, titles their blocks."""
    from rich.cells import cell_len
    from rich.text import Text

    indent = 1 + any(line.title for line in table.lines)
    widths = [
        max(map(cell_len, [column.name, *(line.cells[i].text for line in table.lines)]))
        for i, column in enumerate(table.columns)
    ]
    top = _group_heads(table.columns, widths, indent)
    names = [Cell(column.name) for column in table.columns]
    heads = [top] * bool(top.plain) + [_aligned(names, table.columns, widths, indent)]
    rule = Text("─" * max(len(line.plain) for line in heads), style="dim")
    out = [*heads, rule]
    for lines in blocks(table):
        if lines[0].title:
            out.append(Text(f" {printable(lines[0].title)}", style="italic"))
        out += [_aligned(line.cells, table.columns, widths, indent) for line in lines]
        out.append(rule)
    return out


def terminal_text(table: Table) -> str:
    """The table as plain text."""
    return "\n".join(text.plain for text in for_terminal(table))


def _aligned(
    cells: Sequence[Cell], columns: Sequence[Column], widths: Sequence[int], indent: int
) -> Any:
    """Cells in columns: words at the left, numbers at the right."""
    from rich.cells import cell_len
    from rich.text import Text

    row = Text(" " * indent)
    for cell, width, column in zip(cells, widths, columns, strict=True):
        space = " " * (width - cell_len(cell.text))
        before, after = ("", space) if column.words else (space, "")
        row.append(before).append(printable(cell.text), "bold" if cell.best else "")
        row.append(after + " " * GAP)
    row.rstrip()
    return row


def _group_heads(columns: Sequence[Column], widths: list[int], indent: int) -> Any:
    """Headings of the groups; one wider than its columns widens the last of them."""
    from rich.text import Text

    top, at = Text(" " * indent), 0
    for group, members in groupby(columns, key=lambda column: column.above):
        count = len(list(members))
        width = sum(widths[at : at + count]) + GAP * (count - 1)
        at += count
        widths[at - 1] += max(0, len(group) - width)
        width = max(width, len(group))
        ruled = group and width > len(group) + 3
        top.append(f" {group} ".center(width, "─") if ruled else group.center(width), "dim")
        top.append(" " * GAP)
    top.rstrip()
    return top


NUMBERS = (short, fixed, percent, seconds, divergence_limit, with_error)


def render_page(template: str, context: Mapping[str, Any]) -> str:
    """HTML of a template with the values of its context, in which every name is plain text."""
    return environment(escape=True).get_template(template).render(context)


def lines_of(text: str) -> list[str]:
    """Points of a rendered list, one text each."""
    return [line.removeprefix("- ").strip() for line in text.splitlines() if line.strip()]


def render(
    template: str,
    context: Mapping[str, Any],
    *,
    markup: bool = True,
    filters: Mapping[str, Callable[..., Any]] | None = None,
) -> str:
    """Text of a template with the values of its context.

    markup : whether names are marked as code and escaped for Markdown; else they stay plain
    filters : by their names, beside those of numbers
    """
    names = {"text": escape_markdown, "code": code} if markup else {"text": str, "code": str}
    named = tuple({**names, "table": markdown, **(filters or {})}.items())
    return environment(filters=named).get_template(template).render(context)


Named = tuple[tuple[str, Callable[..., Any]], ...]


@cache  # with the templates that it has compiled
def environment(
    package: str = "frictionid.report",
    *,
    escape: bool = False,
    filters: Named = (),
) -> Any:
    """Environment of a room's templates, with the filters of numbers; text ends as they do."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    templates = Environment(
        loader=PackageLoader(package),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=not escape,
        autoescape=escape,
    )
    templates.globals["inf"] = float("inf")
    templates.filters |= {function.__name__: function for function in NUMBERS} | dict(filters)
    return templates
