"""The report of a comparison: tables, pictures, summary and page, made anew from its results.

The page index.html needs no other file. On the screen Plotly draws what one wants to point at; on
paper and without scripts the figures of the report stand in its place.
"""

import base64
import json
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import count
from typing import Any, TypeVar
from urllib.parse import quote

import numpy as np

from frictionid.arrays import rms
from frictionid.comparison.processes import side_by_side
from frictionid.comparison.results import Results, reduction
from frictionid.evaluation import Split
from frictionid.files import json_sha256, plain
from frictionid.outputs import replace_files

from .candidates import family_table
from .charts import Chart, animation, friction_charts, motion_chart, plotly_script
from .exhibits import Exhibits, NamedTable, Names, Picture, exhibits_of, names_of, shooting_fits
from .figures.motion import examples_of
from .figures.style import Style, drawing, rendered
from .memory import memory_analysis
from .model_tables import equation_of, horizons_of, marked, parameter_rows
from .sections import Model, Section, SummaryData, rollout, sections_of
from .shooting_results import shooting_words
from .summary_table import MEDIANS, caption_of, summary_of, summary_table
from .tables import Cell, Column, Table, lines_of, render, render_page
from .verdict import Verdict, chosen_of, verdict_json, verdict_of

ROOM = 3_200_000  # bytes of figures inside the page
FEW = 10  # figures, which take as long as a process takes to begin drawing
Named = TypeVar("Named", Picture, NamedTable)


def build(results: Results, *, replace: bool = False, jobs: int = 1) -> None:
    """Write scores.csv, models/, verdict.json, summary.md, tables/ and figures/; fits nothing.

    replace : write also over files that were changed since, or are not of the comparison
    jobs : processes that draw figures

    Raises
    ------
    InputError
        Where a file is the user's own, or the folder cannot be written.
    """
    replace_files(results.folder, _contents(results, jobs), replace=replace)


def _contents(results: Results, jobs: int) -> dict[str, bytes]:
    """Content of all files of a report, by path."""
    sections = sections_of(results)
    names = names_of(sections)
    with drawing():
        exhibits = {
            (section.dataset, data.dataset): exhibits_of(section, data, names)
            for section in sections
            for data in section.data
        }
    contents = reduction(results)
    for table in (table for tables, _ in exhibits.values() for table in tables):
        contents |= table.files
    figures = figure_files([p for _, shown in exhibits.values() for p in shown], jobs)
    for stem, files in figures.items():
        contents |= {f"figures/{stem}.{kind}": content for kind, content in files.items()}
    parts = [
        {"folds": folds_of(results, section), **_part(section, exhibits, names)}
        for section in sections
    ]
    drawn = {stem: files["svg"] for stem, files in figures.items()}
    context = {
        "title": results.provenance.get("title") or results.provenance["suite"],
        "parts": parts,
        "warnings": warning_lines(results, sections),
        "provenance": results.provenance,
        "digest": json_sha256,
        "recipes": {m.recipe: m for s in sections for m in s.models if m.recipe},
        "identifiers": {m.identifier: m for s in sections for m in s.models},
        "plotly": base64.b64encode(plotly_script()).decode(),
        "number": count(1).__next__,
        "document": document_of,
        "fits": names.fits,
        "colours": {label: style.colour for label, style in names.styles.items()},
        "images": _images(exhibits, drawn),
    }
    texts = {
        "verdict.json": verdict_json(list(map(verdict_of, sections))),
        "index.html": render_page("index.html.j2", context),
        "summary.md": render("summary.md.j2", context),
    }
    return contents | {name: text.encode() for name, text in texts.items()}


def figure_files(pictures: Sequence[Picture], jobs: int) -> dict[str, Mapping[str, bytes]]:
    """The figures' files, by their stems and endings, the same however many jobs draw them."""
    jobs = min(jobs, len(pictures) // FEW)
    files = dict(side_by_side(_drawn, [(picture.figure,) for picture in pictures], jobs))
    return {picture.stem: files[i] for i, picture in enumerate(pictures)}


def _drawn(figure: Any) -> dict[str, bytes]:
    with drawing():
        return rendered(figure, ("svg", "pdf"))


# --- What summary and page show -------------------------------------------------------------------


def _images(exhibits: Mapping[Any, Exhibits], drawn: Mapping[str, bytes]) -> dict[str, str]:
    """Addresses of the figures that are part of the page, by their stems, as long as there is room.

    The page links the others, and those of all models' motion.
    """
    out, room = {}, ROOM
    for picture in (p for _, shown in exhibits.values() for p in shown if not p.linked):
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
    drawn = {key: getattr(chart, key) for key in ("data", "layout", "frames")}
    text = json.dumps(plain(drawn, infinity=None), allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _part(
    section: Section, exhibits: Mapping[tuple[str, str], Exhibits], names: Names
) -> dict[str, Any]:
    """What the page shows of one data set that was fitted.

    chosen : the model that the verdict names, else the best predictor, with its equation,
        parameters and errors; fit : facts of the fit by shooting that predicts best
    scored : the fitted data, and then data that no fit has seen
    """
    data, chosen, verdict = section.fitted, chosen_of(section), verdict_of(section)
    families = family_table(section)
    return {
        "anchor": names.stems[section.dataset, section.dataset],
        "section": section,
        "verdict": verdict,
        "tables": [
            named.table
            for d in section.data
            for named in exhibits[section.dataset, d.dataset][0]
            if named.stem.startswith(("summary--", "torque--"))
        ],
        "chosen": chosen,
        "equation": equation_of(chosen) if chosen else "",
        "rows": parameter_rows(chosen, data) if chosen else [],
        "horizons": horizons_of(data, chosen) if chosen else [],
        "fit": _fit_lines(section),
        "others": shooting_fits(section)[1:],
        "charts": friction_charts(section, names.styles, chosen),
        "scored": [
            _scored(scored, verdict, chosen, exhibits[section.dataset, scored.dataset], names)
            for scored in section.data
        ],
        "families": families and marked(families, verdict),
        "notes": _notes(section),
        "memory": _memory_lines(data),
    }


def _scored(
    data: SummaryData, verdict: Verdict, chosen: Model | None, exhibits: Exhibits, names: Names
) -> dict[str, Any]:
    """A scored data set: its table, motions of the chosen model, figures and tables by kind."""
    tables, pictures = exhibits
    return {
        "data": data,
        "table": _table(data, verdict, chosen),
        "examples": [] if chosen is None else _examples(chosen, data, names.styles[chosen.label]),
        "pictures": _by_kind(pictures),
        "tables": _by_kind(tables),
    }


def _by_kind(named: Iterable[Named]) -> dict[str, list[Named]]:
    """What the page does not only link, by what its stem begins with."""
    out: dict[str, list[Named]] = {}
    for shown in named:
        if not shown.linked:
            out.setdefault(shown.stem.partition("--")[0], []).append(shown)
    return out


def _examples(model: Model, data: SummaryData, style: Style) -> list[dict[str, Any]]:
    """Motions from one initial state each: heading, the animation if there is one, and lines."""
    out = []
    for example in examples_of(model, data):
        charts = animation(example, style), motion_chart(example, data.description, style)
        heading = f"{example['place']}: {example['recording']}, from {example['start_s']:.2f} s"
        out.append({"heading": heading, "charts": [chart for chart in charts if chart]})
    return out


def _table(data: SummaryData, verdict: Verdict, chosen: Model | None) -> Table:
    """The summary table; of the fitted data with how each model stands."""
    summary = summary_of(data, verdict.failed)
    table = summary_table(summary, caption_of(data, summary), detail=MEDIANS, sd=False)
    standings = {c.model: c.standing for c in verdict.candidates}
    lines = []
    for model, line in zip(data.models, table.lines, strict=True):
        recommended = model.name == verdict.recommended
        standing = Cell("recommended" if recommended else standings.get(model, ""))
        cells = (line.cells[0], *[standing] * data.held_out, *line.cells[1:])
        lines.append(line._replace(cells=cells, block="chosen" if model is chosen else ""))
    column = Column("standing", words=True)
    heads = (table.columns[0], *[column] * data.held_out, *table.columns[1:])
    return table._replace(columns=heads, lines=tuple(lines))


def _fit_lines(section: Section) -> list[str]:
    """Facts of the fit by shooting that predicts best."""
    for model in shooting_fits(section)[:1]:
        assert model.refined is not None
        texts = "\n".join(shooting_words(model.refined, section.description))
        return [f"What {model.name} identifies", *lines_of(texts.replace("`", ""))]
    return []


def _memory_lines(data: SummaryData) -> list[str]:
    """What the advantage of memory consists of, where models with and without it are compared."""
    analysis = memory_analysis(data)
    if analysis is None:
        return []
    context = {"m": analysis, "unit": data.description.angle_unit}
    return lines_of(render("memory.j2", context, markup=False))


def _notes(section: Section) -> list[tuple[str, list[str]]]:
    """Lines that models tell of themselves, under their names."""
    sources = [(model.name, model.provenance) for model in section.models]
    lines = [(name, [*s.equation, *s.inclusion]) for name, s in sources]
    return [(name, notes) for name, notes in lines if notes]


# --- Warnings -------------------------------------------------------------------------------------


KINDS = {
    "recordings": "whole recordings",
    "blocks": "contiguous blocks",
    "stretches": "stretches of each recording",
    "shuffled": "shuffled samples",
}
LOOSE = 0.5  # scatter of a parameter over the folds, in units of its mean
ASTRAY = 0.02  # distance of the fit to all data from the folds' mean curve, in units of its size


def warning_lines(results: Results, sections: Sequence[Section]) -> list[str]:
    """Warnings on a comparison, one text each."""
    context = {
        "results": results,
        "fitted": [section.fitted for section in sections],
        "scored": [data for section in sections for data in section.data],
        "folds": partial(fold_settings, results.provenance),
        "diverged": _diverged,
        "infinite": _infinite,
        "fitted_that": lambda data, test: list(filter(test, data.of_role("fitted"))),
        "astray": astray,
        "loose": loose,
    }
    return lines_of(render("warnings.j2", context, markup=False))


def fold_settings(provenance: Mapping[str, Any], dataset: str) -> Mapping[str, Any]:
    """The settings of folds that a suite has for a data set, else those of all data sets."""
    settings = provenance.get("settings", {})
    for entry in settings.get("datasets", ()):
        name = entry.get("name") or str(entry.get("path", "")).rpartition("/")[2]
        if name == dataset and entry.get("folds"):
            return dict(entry["folds"])
    return dict(settings.get("folds", {}))


def folds_of(results: Results, section: Section) -> str:
    """The folds of a data set in words."""
    settings = fold_settings(results.provenance, section.dataset)
    if "count" not in settings:
        return "judged on held-out data"
    kind = Split(kind=settings.get("kind")).kind_of(section.description.recordings)
    gaps = f" with gaps of {settings['gap']:g} s" if kind in ("blocks", "stretches") else ""
    return f"{settings['count'] or ''} folds of {KINDS[kind]}{gaps}".strip()


def _diverged(data: SummaryData, *roles: str) -> list[float]:
    """Shares of predictions that diverged after the last reported horizon, of models of roles."""
    column = rollout(data.reported[-1], "diverged") if data.reported else ""
    return [data.value(model, column) for model in data.of_role(*roles)]


def _infinite(data: SummaryData) -> list[str]:
    """Names of models with an infinite score."""
    lost = [frame[np.isinf(frame).any(axis=1)] for frame in (data.level, data.folds)]
    tasks = {task for frame in lost for task in frame.index.get_level_values("task")}
    return [model.name for model in data.models if model.task in tasks]


def astray(model: Model) -> bool:
    """Whether a joint's curve from all data is further from the folds' mean than every fold's."""
    folds, overall = model.curves[:-1], model.curves[-1]
    if len(folds) < 2 or not np.isfinite(model.curves).all():
        return False
    mean = folds.mean(axis=0)
    size, off = rms(mean, -2), rms(overall - mean, -2)
    return bool(((off > rms(folds - mean, -2).max(axis=0)) & (off > ASTRAY * size)).any())


def loose(model: Model) -> int:
    """How many parameters scatter over the folds by more than half their mean.

    Those of networks and of models without physics do, whatever they are worth: they count as none.
    """
    if len(model.theta) < 2 or "joints" not in model.document or model.document.get("mechanism"):
        return 0
    sd, mean = model.theta.std(axis=0, ddof=1), np.abs(model.theta.mean(axis=0))
    return int((sd > LOOSE * mean).sum())
