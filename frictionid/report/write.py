"""The report of a comparison: tables, pictures and summary, made anew from its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from frictionid.comparison.processes import side_by_side
from frictionid.comparison.result_folder import readable
from frictionid.comparison.results import Results, reduction
from frictionid.outputs import replace_files
from frictionid.report.exhibits import Exhibits, NamedTable, Picture, exhibits_of, names_of
from frictionid.report.figures.style import drawing, rendered
from frictionid.report.page_content import index_html
from frictionid.report.provenance import folds_of, size_of
from frictionid.report.reliability import warning_lines
from frictionid.report.sections import Section, sections_of
from frictionid.report.sensitivity import beside
from frictionid.report.tables import latex, markdown, render
from frictionid.report.verdict import Verdict, verdict_of
from frictionid.report.verdict_table import verdict_json


def summary_markdown(
    results: Results,
    sections: Sequence[Section],
    verdicts: Sequence[Verdict],
    exhibits: Mapping[tuple[str, str], Exhibits],
) -> str:
    """Markdown of the summary; exhibits by the data sets fitted and scored."""
    parts = [
        {
            "section": section,
            "verdict": verdict,
            "size": size_of(section.description),
            "folds": folds_of(results, section),
            "tables": [exhibits[section.dataset, d.dataset].tables[0].table for d in section.data],
        }
        for section, verdict in zip(sections, verdicts, strict=True)
    ]
    context = {
        "title": results.provenance.get("title") or results.provenance["suite"],
        "parts": parts,
        "warnings": warning_lines(results, sections),
    }
    return render("summary.md.j2", context)


_FEW = 10  # figures, which take as long as a process takes to begin drawing


def build(results: Results, *, replace: bool = False, jobs: int = 1) -> None:
    """Write scores.csv, models/, verdict.json, summary.md, tables/ and figures/; fits nothing.

    replace : write also over files that were changed since, or are not of the comparison
    jobs : processes that draw figures

    Raises
    ------
    InputError
        Where a file is the user's own, or the folder cannot be written.
    """
    with readable(results.folder, sealed=results.is_sealed):
        contents = _contents(results, jobs)
    replace_files(results.folder, contents, replace=replace)


def _contents(results: Results, jobs: int) -> dict[str, bytes]:
    """Content of all files of a report, by path."""
    sections = sections_of(results)
    verdicts = [verdict_of(section) for section in sections]
    names = names_of(sections)
    exhibits: dict[tuple[str, str], Exhibits] = {}
    with drawing():
        for section, verdict in zip(sections, verdicts, strict=True):
            for data in section.data:
                shown = exhibits_of(section, data, names, verdict)
                if data.held_out:
                    studies = beside(results, section, names)
                    shown = shown._replace(pictures=(*shown.pictures, *studies))
                exhibits[section.dataset, data.dataset] = shown
    contents = reduction(results)
    for table in (table for shown in exhibits.values() for table in shown.tables):
        contents |= _table_files(table)
    figures = figure_files([p for shown in exhibits.values() for p in shown.pictures], jobs)
    for stem, files in figures.items():
        contents |= {f"figures/{stem}.{kind}": content for kind, content in files.items()}
    drawn = {stem: files["svg"] for stem, files in figures.items()}
    texts = {
        "verdict.json": verdict_json(verdicts),
        "index.html": index_html(results, sections, verdicts, exhibits, names, drawn),
        "summary.md": summary_markdown(results, sections, verdicts, exhibits),
    }
    return contents | {name: text.encode() for name, text in texts.items()}


def figure_files(pictures: Sequence[Picture], jobs: int) -> dict[str, Mapping[str, bytes]]:
    """The figures' files, by their stems and endings, the same however many jobs draw them."""
    jobs = min(jobs, len(pictures) // _FEW)
    files = dict(side_by_side(_drawn, [(picture.figure,) for picture in pictures], jobs))
    return {picture.stem: files[i] for i, picture in enumerate(pictures)}


def _drawn(figure: Any) -> dict[str, bytes]:
    with drawing():
        return rendered(figure, ("svg", "pdf"))


def _table_files(named: NamedTable) -> dict[str, bytes]:
    """A table as Markdown and LaTeX, and its numbers as CSV where there are any, by path."""
    texts = {"md": markdown(named.table), "tex": latex(named.table)}
    if named.numbers is not None:
        texts["csv"] = named.numbers.to_csv(index=False, float_format="%.9g")
    return {f"tables/{named.stem}.{kind}": text.encode() for kind, text in texts.items()}
