"""The page summary.md, for terminals and pull requests: verdict, tables, and where the rest is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from frictionid.comparison.results import Results
from frictionid.report.exhibits import Exhibits
from frictionid.report.provenance import folds_of, size_of
from frictionid.report.reliability import warning_lines, warnings_of
from frictionid.report.render import render
from frictionid.report.sections import Section
from frictionid.report.verdict import Verdict


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
        "warnings": warning_lines(warnings_of(results, sections)),
    }
    return render("summary.md.j2", context)
