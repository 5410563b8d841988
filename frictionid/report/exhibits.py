"""Tables and pictures of a report: which there are, their names and their captions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import pandas as pd

from frictionid.files import file_names
from frictionid.report.estimates import estimates
from frictionid.report.figures.curves import curve_bands, friction_curves, spread_caption, spreads
from frictionid.report.figures.fits import correlation, correlation_caption
from frictionid.report.figures.loops import loop_pictures
from frictionid.report.figures.motion import example_motions, motions, speed_table, velocity_scatter
from frictionid.report.figures.scores import (
    error_over_complexity,
    loss_against,
    one_step_boxes,
    rollout_errors,
)
from frictionid.report.figures.studies import learning_curves
from frictionid.report.figures.style import Style, styles
from frictionid.report.fit_table import parameter_numbers, parameter_table
from frictionid.report.memory import loop_table
from frictionid.report.recommended import chosen_of
from frictionid.report.sections import Model, Section, SummaryData, rollout
from frictionid.report.shooting_results import (
    ShootingResults,
    interval_numbers,
    interval_table,
    shooting_results,
    window_numbers,
    window_table,
)
from frictionid.report.summary_table import caption_of, summary_of, summary_table
from frictionid.report.tables import Table
from frictionid.report.verdict import Verdict, verdict_of
from frictionid.report.verdict_table import difference_table, marked, verdict_numbers, verdict_table

BAND = "; band: 95 % interval of the prediction, by what leaving out each fold changes"


class Picture(NamedTuple):
    """A figure, the stem of its files, and its caption."""

    stem: str
    figure: Any
    caption: str


class NamedTable(NamedTuple):
    """A table, the stem of its files, its numbers where they are written as CSV, and a heading.

    heading : of the part of the page that unfolds; "" where the page shows it elsewhere
    """

    stem: str
    table: Table
    numbers: pd.DataFrame | None = None
    heading: str = ""


class Exhibits(NamedTuple):
    """Tables and pictures of one scored data set; the summary table is the first.

    shooting, shooting_pictures : those of the fit by shooting that predicts best
    linked, linked_pictures : those of the other fits, which the page does not show
    """

    tables: tuple[NamedTable, ...]
    pictures: tuple[Picture, ...]
    shooting: tuple[NamedTable, ...] = ()
    shooting_pictures: tuple[Picture, ...] = ()
    linked: tuple[NamedTable, ...] = ()
    linked_pictures: tuple[Picture, ...] = ()


class ShootingFit(NamedTuple):
    """A fit by shooting: stem of its files and facts of its result."""

    model: Model
    stem: str
    results: ShootingResults
    parameters: int
    identified: int


class Names(NamedTuple):
    """What names of files and styles are shared by all parts of a report.

    stems : by the data sets fitted and scored; fits : of the files about fits by shooting
    """

    stems: Mapping[tuple[str, str], str]
    fits: Mapping[Model, str]
    styles: Mapping[str, Style]


def names_of(sections: tuple[Section, ...]) -> Names:
    """Names of files, all different, and styles."""
    pairs = [(section.dataset, data.dataset) for section in sections for data in section.data]
    scored = [dataset for _, dataset in pairs]
    words = {
        pair: pair[1] if scored.count(pair[1]) == 1 else f"{pair[1]}-fitted-on-{pair[0]}"
        for pair in pairs
    }
    unique = file_names(words.values())
    stems = {pair: unique[word] for pair, word in words.items()}
    fits: dict[Model, str] = {}
    for section in sections:
        own = [model for model in section.models if model.refined is not None]
        several = len({model.recipe for model in own}) > 1
        name = stems[section.dataset, section.dataset]
        labels = {m: f"{name}--{m.label}" + f"--{m.recipe}" * several for m in own}
        unique = file_names(labels.values())
        fits |= {model: unique[label] for model, label in labels.items()}
    return Names(stems, fits, styles(model for section in sections for model in section.models))


def shooting_fits(section: Section, stems: Mapping[Model, str]) -> list[ShootingFit]:
    """The fits by shooting, the one that predicts best first."""
    fits = [model for model in section.models if model in stems and model.refined is not None]
    data = section.fitted
    first = data.best(fits, rollout(data.reported[-1])) if data.reported else None
    fits.sort(key=lambda model: model is not first)
    out = []
    for model in fits:
        document = model.refined or {}
        read = estimates(document, section.description)
        facts, known = shooting_results(document, read), sum(e.identified for e in read)
        out.append(ShootingFit(model, stems[model], facts, len(read), known))
    return out


def exhibits_of(section: Section, data: SummaryData, names: Names, verdict: Verdict) -> Exhibits:
    """Tables and pictures of one scored data set."""
    stem = names.stems[section.dataset, data.dataset]
    summary = summary_of(data, verdict.failed)
    table = summary_table(summary, caption_of(data, summary))
    tables = [NamedTable(f"summary--{stem}", table, summary.frame)]
    pictures = list(motion_pictures(section, data, names, stem))
    pictures += example_pictures(chosen_of(section, verdict), data, names, stem)
    if not data.held_out:
        return Exhibits(tuple(tables), tuple(pictures))
    if verdict.candidates:
        tables.append(standings_of(verdict, stem))
    tables += [t._replace(table=marked(t.table, verdict)) for t in fitted_tables(section, stem)]
    pictures = [*fitted_pictures(section, names, stem), *pictures]
    out = Exhibits(tuple(tables), tuple(pictures))
    fits = [fit.model for fit in shooting_fits(section, names.fits)]
    if not fits:
        return out
    first, *others = (list(fit_tables(section, model, names.fits[model])) for model in fits)
    shown, *linked = (correlation_picture(section, model, names) for model in fits)
    return out._replace(
        shooting=tuple(first),
        shooting_pictures=(shown, *band_pictures(section, fits, names, stem)),
        linked=tuple(table for own in others for table in own),
        linked_pictures=tuple(linked),
    )


# --- Tables ---------------------------------------------------------------------------------------


def standings_of(verdict: Verdict, stem: str) -> NamedTable:
    """How the models stand: the table behind the verdict."""
    numbers = verdict_numbers(verdict)
    heading = "Error against complexity, and how the models stand"
    return NamedTable(f"verdict--{stem}", verdict_table(verdict, numbers), numbers, heading)


def fitted_tables(section: Section, stem: str) -> Iterator[NamedTable]:
    """Tables about what was fitted to a data set, beside the summary."""
    differences = difference_table(section.fitted)
    if differences is not None:
        heading = "Differences between models, paired over the folds"
        yield NamedTable(f"differences--{stem}", differences, None, heading)
    numbers = parameter_numbers(section)
    if not numbers.empty:
        table = parameter_table(section, numbers)
        yield NamedTable(f"parameters--{stem}", table, numbers, "Parameters of the models")
    loops = loop_table(section)
    if loops is not None:
        yield NamedTable(f"loops--{stem}", loops, None, "Loops of friction over velocity")
        data = section.description
        if data.speeds is not None:
            table = speed_table(section.dataset, data, data.speeds)
            yield NamedTable(f"speeds--{stem}", table, None, "Speeds of the joints")


def fit_tables(section: Section, model: Model, stem: str) -> Iterator[NamedTable]:
    """Tables of a fit by shooting: parameters, and windows that do not count."""
    data, given = section.description, section.of_role("given")
    table = interval_table(model, section.dataset, data, given)
    yield NamedTable(f"shooting--{stem}", table, interval_numbers(model, data))
    windows = window_numbers(model.refined or {})
    if not windows.empty:
        table = window_table(model, section.dataset, windows)
        heading = "Windows that were left out or are not explained"
        yield NamedTable(f"windows--{stem}", table, windows, heading)


# --- Pictures -------------------------------------------------------------------------------------


def numbered(stem: str, figures: list[Any], caption: str) -> list[Picture]:
    """Pictures of one kind, numbered where there are several."""
    several = len(figures) > 1
    return [
        Picture(f"{stem}--{i + 1}" if several else stem, figure, caption)
        for i, figure in enumerate(figures)
    ]


def motion_pictures(
    section: Section, data: SummaryData, names: Names, stem: str
) -> Iterator[Picture]:
    """Predicted motion on one data set, under each recipe."""
    recipes = file_names(section.recipes)
    for recipe in section.recipes:
        models = [model for model in section.under(recipe) if model in data.models]
        beside = f", {recipe} recipe" if len(section.recipes) > 1 else ""
        figure = motions(models, data, names.styles, beside)
        if figure is not None:
            held = "held out" if data.held_out else "never seen"
            caption = f"Predicted over measured motion, {data.dataset}, {held}{beside}."
            yield Picture(f"motion--{stem}--{recipes[recipe]}", figure, caption)


def example_pictures(
    model: Model | None, data: SummaryData, names: Names, stem: str
) -> Iterator[Picture]:
    """Best, median and worst prediction of one model."""
    figure = model and example_motions(model, data, names.styles[model.label])
    if model is not None and figure is not None:
        held = "held out" if data.held_out else "never seen"
        caption = (
            f"Best, median and worst prediction of {model.name}, {data.dataset}, {held}"
            f"{BAND if data.held_out else ''}."
        )
        yield Picture(f"examples--{stem}", figure, caption)


def fitted_pictures(section: Section, names: Names, stem: str) -> Iterator[Picture]:
    """Pictures about what was fitted to a data set."""
    for draw in FITTED.values():
        yield from draw(section, names, stem)


def one_step_pictures(section: Section, names: Names, stem: str) -> Iterator[Picture]:
    """One-step losses over the folds."""
    caption = (
        f"One-step losses on {section.dataset} over the folds: median, quartiles, range, mean "
        "(diamond)."
    )
    yield Picture(f"one_step--{stem}", one_step_boxes(section, names.styles), caption)


def rollout_pictures(section: Section, names: Names, stem: str) -> Iterator[Picture]:
    """Rollout errors over the horizon."""
    errors = rollout_errors(section, names.styles)
    if errors is not None:
        caption = f"Rollout errors over the horizon, fitted on {section.dataset}."
        yield Picture(f"rollouts--{stem}", errors, caption)


def tradeoff_pictures(section: Section, names: Names, stem: str) -> Iterator[Picture]:
    """Errors of prediction and of the friction curve over the loss, where the truth is known."""
    if section.description.truth is not None and section.fitted.horizons:
        caption = (
            f"Errors of prediction and of the friction curve over the one-step loss, "
            f"{section.dataset}, held out; dashed: loss of the true friction."
        )
        yield Picture(f"tradeoff--{stem}", loss_against(section, names.styles), caption)


def complexity_pictures(section: Section, names: Names, stem: str) -> Iterator[Picture]:
    """Error of prediction over the complexity of the models."""
    verdict = verdict_of(section)
    drawn = error_over_complexity(verdict, names.styles)
    if drawn is not None:
        caption = (
            f"Error after {verdict.horizon:g} s over the effective parameters, {section.dataset}: "
            "mean of the folds, with the lowest and the highest. Star: recommended. Hollow: not "
            "plausible. Band: what makes no practical difference."
        )
        yield Picture(f"complexity--{stem}", drawn, caption)


def curve_pictures(section: Section, names: Names, stem: str) -> Iterator[Picture]:
    """Friction over velocity, all folds."""
    caption = f"Friction over velocity, fitted on {section.dataset}, all folds."
    yield from numbered(f"curves--{stem}", friction_curves(section, names.styles), caption)


def member_pictures(section: Section, names: Names, stem: str) -> Iterator[Picture]:
    """Ensembles and their members."""
    caption = f"Ensembles fitted on {section.dataset}; below, their members about the mean."
    caption += spread_caption(section)
    yield from numbered(f"members--{stem}", spreads(section, names.styles), caption)


def learning_pictures(section: Section, names: Names, stem: str) -> Iterator[Picture]:
    """Learning curves of networks."""
    models = section.of_role("fitted")
    learned = learning_curves(models, names.styles, "without friction = 1")
    if learned is not None:
        caption = f"Learning curves on {section.dataset}: the loss over the epochs, each fold."
        yield Picture(f"learning--{stem}", learned, caption)


def memory_pictures(section: Section, names: Names, stem: str) -> Iterator[Picture]:
    """Pictures of loops, and of the speeds beside them."""
    by_recipe: dict[str, list[Any]] = {}
    for recipe, figure in loop_pictures(section, names.styles):
        by_recipe.setdefault(recipe, []).append(figure)
    recipes = file_names(by_recipe)
    for recipe, figures in by_recipe.items():
        beside = f", {recipe} recipe" if recipe and len(section.recipes) > 1 else ""
        caption = (
            f"Friction along sinusoids, fitted on {section.dataset}{beside}: mean of the folds at "
            "three frequencies, each fold at the middle one. Friction that depends on the velocity "
            "alone shows a line, not a loop."
        )
        yield from numbered(f"loops--{stem}--{recipes[recipe]}", figures, caption)
    velocities = section.description.velocities
    if by_recipe and velocities is not None:
        figure = velocity_scatter(section.description, velocities)
        yield Picture(f"speeds--{stem}", figure, f"Velocities of {section.dataset}.")


def correlation_picture(section: Section, model: Model, names: Names) -> Picture:
    """The correlation of a fit's parameters."""
    data = section.description
    caption = correlation_caption(model, section.dataset, data)
    return Picture(f"correlation--{names.fits[model]}", correlation(model, data), caption)


def band_pictures(
    section: Section, fits: list[Model], names: Names, stem: str
) -> Iterator[Picture]:
    """Friction curves of the fits with intervals, with their bands."""
    ordered = [model for model in section.models if model in fits]
    schemes = " and ".join(dict.fromkeys(model.scheme for model in ordered))
    caption = (
        f"Friction by {schemes} on {section.dataset} with its 95 % bands; below, the bands alone, "
        "and the truth less the fit where it is known. Grey: velocities that were not measured."
    )
    figures = curve_bands(ordered, section.description, names.styles)
    yield from numbered(f"bands--{stem}", figures, caption)


# Pictures about what was fitted, in the order of the page.
FITTED: Mapping[str, Callable[[Section, Names, str], Iterator[Picture]]] = {
    "one_step": one_step_pictures,
    "rollouts": rollout_pictures,
    "complexity": complexity_pictures,
    "tradeoff": tradeoff_pictures,
    "curves": curve_pictures,
    "members": member_pictures,
    "learning": learning_pictures,
    "loops": memory_pictures,
}
