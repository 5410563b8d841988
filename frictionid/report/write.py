"""The report of a result folder: tables, pictures and summary, made anew from the tasks' files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from frictionid.comparison.results import reduce
from frictionid.files import file_names, remove_others, write_bytes, write_text
from frictionid.report.figures.boxplots import one_step_boxes
from frictionid.report.figures.curves import friction_curves
from frictionid.report.figures.ensembles import spread_words, spreads
from frictionid.report.figures.horizons import rollout_errors
from frictionid.report.figures.learning import learning_curves
from frictionid.report.figures.loops import loop_pictures, loop_table
from frictionid.report.figures.motion import motions
from frictionid.report.figures.speeds import speed_table, velocity_scatter
from frictionid.report.figures.style import Look, drawing, looks, rendered
from frictionid.report.figures.tradeoff import loss_against
from frictionid.report.load import Evidence, Section, gather
from frictionid.report.paired import differences
from frictionid.report.parameters import parameter_numbers, parameter_table
from frictionid.report.scoreboard import board, caption_of, summary_table
from frictionid.report.shooting_section import Found, drawn_of_shooting, found, stems
from frictionid.report.shooting_tables import (
    interval_numbers,
    interval_table,
    window_numbers,
    window_table,
)
from frictionid.report.summary import Part, Picture, summary
from frictionid.report.tables import Table, latex, markdown
from frictionid.report.text import matter

Drawn = tuple[str, Any, str]  # name of a file, figure, caption


def build(folder: Path) -> None:
    """Write scores.csv, models/, summary.md, tables/ and figures/ of a result folder; fits nothing.

    Raises
    ------
    InputError
        Where the folder holds no comparison, or none of its tasks is finished.
    """
    evidence = gather(folder)
    reduce(folder)
    written: list[Path] = []
    parts = {}
    names = _file_names(evidence)
    with drawing():
        for section in evidence.sections:
            for dataset in (section.dataset, *section.tests):
                part, files = _part(folder, evidence, section, dataset, names)
                parts[section.dataset, dataset] = part
                written += files
    write_text(folder / "summary.md", summary(evidence, parts))
    remove_others(folder / "tables", written)
    remove_others(folder / "figures", written)


def _file_names(evidence: Evidence) -> dict[tuple[str, str], str]:
    """Ending of the names of files about what was fitted on one and scored on another data set."""
    pairs = [(s.dataset, d) for s in evidence.sections for d in (s.dataset, *s.tests)]
    scored = [dataset for _, dataset in pairs]
    words = {
        (fitted, dataset): dataset
        if scored.count(dataset) == 1
        else f"{dataset}-fitted-on-{fitted}"
        for fitted, dataset in pairs
    }
    unique = file_names(words.values())
    return {pair: unique[word] for pair, word in words.items()}


def _part(
    folder: Path,
    evidence: Evidence,
    section: Section,
    dataset: str,
    names: dict[tuple[str, str], str],
) -> tuple[Part, list[Path]]:
    """Tables and pictures of one scored data set, written, and what the page shows of them."""
    name, about = names[section.dataset, dataset], evidence.about[dataset]
    scores = board(section.entries, dataset, evidence.horizons, about)
    table = summary_table(scores, caption_of(scores, section))
    files = _write_table(folder, f"summary--{name}", table, scores.frame)
    details, shot = [], None
    if dataset == section.dataset:
        extra = differences(section, evidence.horizons, about["angle_unit"])
        if extra:
            details.append(("Differences between models, paired over the folds", extra))
            files += _write_table(folder, f"differences--{name}", extra, None)
        numbers = parameter_table(section, about["joints"])
        if numbers:
            details.append(("Parameters of the models", numbers))
            frame = parameter_numbers(section)
            files += _write_table(folder, f"parameters--{name}", numbers, frame)
        for title, stem, more in _memory(section, about):
            details.append((title, more))
            files += _write_table(folder, f"{stem}--{name}", more, None)
        shot, own = _shooting(folder, evidence, section, name)
        files += own
    pictures = []
    for stem, figure, words in _drawn(evidence, section, dataset, name):
        files += _write_picture(folder, stem, figure)
        pictures.append(Picture(f"figures/{stem}", words))
    return Part(table, tuple(pictures), tuple(details), shot), files


def _memory(section: Section, about: Any) -> Iterator[tuple[str, str, Table]]:
    """Tables of loops, and of the speeds beside them, where models remember."""
    loops = loop_table(section, about)
    if loops is not None:
        yield "Loops of friction over velocity", "loops", loops
        if "speeds" in about:
            yield "How fast the joints were", "speeds", speed_table(section.dataset, about)


def _shooting(
    folder: Path, evidence: Evidence, section: Section, name: str
) -> tuple[Found | None, list[Path]]:
    """Tables and pictures of the fits by shooting, written, and what the page says of them."""
    about, files = evidence.about[section.dataset], []
    for entry, stem in stems(section, name).items():
        table = interval_table(entry, section.dataset, about, section.of_role("given"))
        numbers = interval_numbers(entry, about)
        files += _write_table(folder, f"shooting--{stem}", table, numbers)
        windows = window_table(entry, section.dataset)
        if windows is not None:
            files += _write_table(folder, f"windows--{stem}", windows, window_numbers(entry))
    every = looks(entry for part in evidence.sections for entry in part.entries)
    for stem, figure in drawn_of_shooting(section, about, name, every):
        files += _write_picture(folder, stem, figure)
    told = matter(section, section.dataset, evidence.horizons, about)
    return found(told, about, name), files


def _write_picture(folder: Path, stem: str, figure: Any) -> list[Path]:
    """Write a figure in all its formats."""
    paths = []
    for kind, content in rendered(figure).items():
        paths.append(folder / "figures" / f"{stem}.{kind}")
        write_bytes(paths[-1], content)
    return paths


def _write_table(folder: Path, stem: str, table: Table, frame: pd.DataFrame | None) -> list[Path]:
    """Write a table as Markdown and LaTeX, and its numbers as CSV where there are any."""
    texts = {"md": markdown(table), "tex": latex(table)}
    if frame is not None:
        texts["csv"] = frame.to_csv(index=False, float_format="%.9g")
    paths = []
    for kind, text in texts.items():
        paths.append(folder / "tables" / f"{stem}.{kind}")
        write_text(paths[-1], text)
    return paths


def _drawn(evidence: Evidence, section: Section, dataset: str, name: str) -> Iterator[Drawn]:
    """Pictures about one scored data set, each with the name of its file and its caption."""
    about = evidence.about[dataset]
    every = looks(entry for part in evidence.sections for entry in part.entries)
    if dataset == section.dataset:
        yield from _drawn_of_fits(evidence, section, name, every)
    recipes = file_names(section.recipes)
    for recipe in section.recipes:
        entries = [entry for entry in section.under(recipe) if dataset in entry.scores]
        beside = f", {recipe} recipe" if len(section.recipes) > 1 else ""
        figure = motions(entries, dataset, about, every, beside)
        if figure is not None:
            stem = f"motion--{name}--{recipes[recipe]}"
            held = "held-out" if dataset == section.dataset else "never seen"
            yield stem, figure, f"Predicted over measured motion, {dataset}, {held}{beside}."


def _drawn_of_fits(
    evidence: Evidence, section: Section, name: str, every: dict[str, Look]
) -> Iterator[Drawn]:
    dataset, about = section.dataset, evidence.about[section.dataset]
    unit = about["angle_unit"]
    boxes = one_step_boxes(section, every, unit)
    words = (
        f"One-step losses on {dataset} over the folds: median, quartiles, range, mean (diamond)."
    )
    yield f"one_step--{name}", boxes, words
    errors = rollout_errors(section, evidence.horizons, every, unit)
    if errors is not None:
        words = f"Rollout errors over the horizon, fitted on {dataset}."
        yield f"rollouts--{name}", errors, words
    if about["truth"] is not None and errors is not None:
        figure = loss_against(section, evidence.horizons[-1], about, every)
        words = (
            f"Does a lower one-step loss come with a better model? {dataset}, held out; the dashed "
            "line is the loss of the true friction."
        )
        yield f"tradeoff--{name}", figure, words
    pictures = friction_curves(section, about, every)
    for i, figure in enumerate(pictures):
        number = f"--{i + 1}" if len(pictures) > 1 else ""
        words = f"Friction over velocity, fitted on {dataset}, all folds."
        words += spread_words(section, about)
        yield f"curves--{name}{number}", figure, words
    pictures = spreads(section, about, every)
    for i, figure in enumerate(pictures):
        number = f"--{i + 1}" if len(pictures) > 1 else ""
        words = f"Ensembles fitted on {dataset}, and below their members about the mean."
        words += spread_words(section, about)
        yield f"members--{name}{number}", figure, words
    yield from _drawn_of_memory(section, about, name, every)


def _drawn_of_memory(
    section: Section, about: Any, name: str, every: dict[str, Look]
) -> Iterator[Drawn]:
    """Pictures of learning, of loops, and of the speeds beside them."""
    dataset = section.dataset
    learned = learning_curves(section.of_role("fitted"), every, "without friction = 1")
    if learned is not None:
        words = f"Learning curves on {dataset}: the loss over the epochs, each fold."
        yield f"learning--{name}", learned, words
    pictures = loop_pictures(section, about, every)
    stems = file_names(recipe for recipe, _ in pictures)
    for i, (recipe, figure) in enumerate(pictures):
        more = f"--{i + 1}" if [r for r, _ in pictures].count(recipe) > 1 else ""
        beside = f", {recipe} recipe" if recipe and len(section.recipes) > 1 else ""
        words = (
            f"Friction along sinusoids, fitted on {dataset}{beside}: mean of the folds at three "
            "frequencies, each fold at the middle one. Friction that depends on the velocity alone "
            "shows a line, not a loop."
        )
        yield f"loops--{name}--{stems[recipe]}{more}", figure, words
    if pictures and "velocities" in about:
        yield f"speeds--{name}", velocity_scatter(about), f"Velocities of {dataset}."
