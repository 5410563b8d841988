"""The page index.html: verdict, tables and charts of a comparison in one file that needs no other.

On the screen Plotly draws what one wants to point at; on paper and without scripts the figures of
the report stand in its place.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from typing import NamedTuple
from urllib.parse import quote

from frictionid.comparison.results import Results
from frictionid.files import plain
from frictionid.report.candidates import family_table
from frictionid.report.charts import Chart, friction_charts, plotly_script
from frictionid.report.exhibits import (
    Exhibits,
    NamedTable,
    Names,
    Picture,
    ShootingFit,
    shooting_fits,
)
from frictionid.report.figures.motion import examples_of
from frictionid.report.figures.style import Style
from frictionid.report.memory import memory_analysis
from frictionid.report.motion_chart import animation, motion_chart
from frictionid.report.provenance import folds_of, provenance_of, size_of
from frictionid.report.recommended import (
    Horizon,
    Row,
    chosen_of,
    equation_of,
    horizons_of,
    parameter_rows,
)
from frictionid.report.reliability import warning_lines, warnings_of
from frictionid.report.sections import Model, Section, SummaryData
from frictionid.report.summary_table import MEDIANS, caption_of, summary_of, summary_table
from frictionid.report.tables import Cell, Column, Table, lines_of, render, render_page
from frictionid.report.verdict import Verdict
from frictionid.report.verdict_table import marked

ROOM = 3_200_000  # bytes of figures inside the page


class Example(NamedTuple):
    """Motion from one initial state: heading, the animation if there is one, and the lines."""

    heading: str
    charts: tuple[Chart, ...]


class Scored(NamedTuple):
    """A scored data set: its table, motions of the chosen model, figures and tables by kind."""

    data: SummaryData
    table: Table
    examples: tuple[Example, ...]
    pictures: Mapping[str, list[Picture]]
    tables: Mapping[str, list[NamedTable]]


class Part(NamedTuple):
    """What the page shows of one data set that was fitted.

    chosen : the model that the verdict names, else the best predictor, with its equation,
        parameters and errors; fit : facts of the fit by shooting that predicts best
    scored : the fitted data, and then data that no fit has seen
    """

    anchor: str
    section: Section
    verdict: Verdict
    folds: str
    chosen: Model | None
    equation: str
    rows: list[Row]
    horizons: list[Horizon]
    fit: list[str]
    others: list[ShootingFit]
    charts: list[Chart]
    scored: list[Scored]
    families: Table | None
    notes: list[tuple[str, list[str]]]
    memory: list[str]


def index_html(
    results: Results,
    sections: Sequence[Section],
    verdicts: Sequence[Verdict],
    exhibits: Mapping[tuple[str, str], Exhibits],
    names: Names,
    drawn: Mapping[str, bytes],
) -> str:
    """The page as HTML.

    exhibits : by the data sets fitted and scored; drawn : SVG of each figure by its stem
    """
    context = {
        "title": results.provenance.get("title") or results.provenance["suite"],
        "parts": [
            part_of(results, section, verdict, exhibits, names)
            for section, verdict in zip(sections, verdicts, strict=True)
        ],
        "warnings": warning_lines(warnings_of(results, sections)),
        "provenance": provenance_of(results, sections),
        "plotly": base64.b64encode(plotly_script()).decode(),
        "number": count(1).__next__,
        "document": document_of,
        "size": size_of,
        "colours": {label: style.colour for label, style in names.styles.items()},
        "images": _images(exhibits, drawn),
    }
    return render_page("index.html.j2", context)


def _images(
    exhibits: Mapping[tuple[str, str], Exhibits], drawn: Mapping[str, bytes]
) -> dict[str, str]:
    """Addresses of the figures that are part of the page, by their stems, as long as there is room.

    The page links the others, and those of all models' motion.
    """
    out, room = {}, ROOM
    for own in exhibits.values():
        for picture in (*own.pictures, *own.shooting_pictures):
            text = quote(drawn[picture.stem], safe=" /:;=,()!?@+*-._~$[]'")
            if len(text) <= room and not picture.stem.startswith("motion--"):
                out[picture.stem] = f"data:image/svg+xml,{text}"
                room -= len(text)
    return out


def document_of(chart: Chart) -> str:
    r"""A chart as JSON that stands inside a script, which no name in it can end.

    >>> document_of(Chart("", "", [{"name": "</script>"}], {}))
    '{"data":[{"name":"\\u003c/script\\u003e"}],"layout":{},"frames":[]}'
    """
    text = json.dumps(plain(chart.document, infinity=None), allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def part_of(
    results: Results,
    section: Section,
    verdict: Verdict,
    exhibits: Mapping[tuple[str, str], Exhibits],
    names: Names,
) -> Part:
    """What the page shows of one data set that was fitted."""
    data, chosen = section.fitted, chosen_of(section, verdict)
    families = family_table(section)
    return Part(
        anchor=names.stems[section.dataset, section.dataset],
        section=section,
        verdict=verdict,
        folds=folds_of(results, section),
        chosen=chosen,
        equation=equation_of(chosen) if chosen else "",
        rows=parameter_rows(chosen, data) if chosen else [],
        horizons=horizons_of(data, chosen) if chosen else [],
        fit=_fit_lines(section, names),
        others=shooting_fits(section, names.fits)[1:],
        charts=friction_charts(section, names.styles, chosen),
        scored=[
            _scored(own, verdict, chosen, exhibits[section.dataset, own.dataset], names)
            for own in section.data
        ],
        families=families and marked(families, verdict),
        notes=_notes(section),
        memory=_memory_lines(data),
    )


def _scored(
    data: SummaryData, verdict: Verdict, chosen: Model | None, own: Exhibits, names: Names
) -> Scored:
    pictures: dict[str, list[Picture]] = {}
    for picture in (*own.pictures, *own.shooting_pictures):
        pictures.setdefault(picture.stem.partition("--")[0], []).append(picture)
    tables: dict[str, list[NamedTable]] = {}
    for table in (*own.tables, *own.shooting):
        tables.setdefault(table.stem.partition("--")[0], []).append(table)
    shown = () if chosen is None else tuple(_examples(chosen, data, names.styles[chosen.label]))
    return Scored(data, _table(data, verdict, chosen), shown, pictures, tables)


def _examples(model: Model, data: SummaryData, style: Style) -> Iterator[Example]:
    for example in examples_of(model, data):
        moving = animation(example, style)
        lines = motion_chart(example, data.description, style)
        heading = f"{example['place']}: {example['recording']}, from {example['start_s']:.2f} s"
        yield Example(heading, (*([moving] if moving else []), lines))


def _table(data: SummaryData, verdict: Verdict, chosen: Model | None) -> Table:
    """The summary table; of the fitted data with how each model stands."""
    summary = summary_of(data, verdict.failed)
    table = summary_table(summary, caption_of(data, summary), detail=MEDIANS, sd=False)
    standings = {c.model: c.standing for c in verdict.candidates}
    lines = []
    for model, line in zip(data.models, table.lines, strict=True):
        standing = standings.get(model, "")
        own = Cell("recommended" if model.name == verdict.recommended else standing)
        cells = (line.cells[0], *[own] * data.held_out, *line.cells[1:])
        lines.append(line._replace(cells=cells, block="chosen" if model is chosen else ""))
    column = Column("standing", words=True)
    heads = (table.columns[0], *[column] * data.held_out, *table.columns[1:])
    return table._replace(columns=heads, lines=tuple(lines))


def _fit_lines(section: Section, names: Names) -> list[str]:
    """Facts of the fit by shooting that predicts best."""
    for fit in shooting_fits(section, names.fits):
        found = {"found": fit.results}
        texts = [render(f"shooting_{p}.j2", found, markup=False) for p in ("head", "terminal")]
        return [f"What {fit.model.name} identifies", *lines_of("\n".join(texts).replace("`", ""))]
    return []


def _memory_lines(data: SummaryData) -> list[str]:
    """What the advantage of memory consists of, where models with and without it are compared."""
    found = memory_analysis(data)
    if found is None:
        return []
    context = {"m": found, "unit": data.description.angle_unit}
    return lines_of(render("memory.j2", context, markup=False))


def _notes(section: Section) -> list[tuple[str, list[str]]]:
    """Lines that models tell of themselves, under their names."""
    out = []
    for model in section.models:
        own = model.document.get("provenance", {})
        lines = [*own.get("equation", ()), *own.get("inclusion", ())]
        if lines:
            out.append((model.name, lines))
    return out
