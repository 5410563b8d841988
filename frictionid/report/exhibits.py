"""Tables and pictures of a report: which there are, their names and their captions."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import pandas as pd

from frictionid.files import csv_text, file_names
from frictionid.friction.provenance import Estimates

from .figures.curves import curve_bands, friction_curves
from .figures.fits import correlation_caption, fit_correlation, friction_of_the_choice
from .figures.motion import (
    example_motions,
    motions,
    speed_table,
    torque_over_time,
    velocity_scatter,
)
from .figures.scores import errors_of_models, loss_against, one_step_boxes, rollout_errors
from .figures.studies import learning_curves
from .figures.style import Styles, styles
from .memory import loop_pictures, loop_table
from .model_tables import marked, parameter_numbers, parameter_table, verdict_numbers, verdict_table
from .sections import Model, Section, SummaryData
from .shooting_results import interval_numbers, interval_table, window_numbers, window_table
from .summary_table import (
    caption_of,
    summary_of,
    summary_table,
    torque_frames,
    torque_numbers,
    torque_table,
)
from .tables import Table, latex, markdown
from .verdict import chosen_of, verdict_of


class Picture(NamedTuple):
    """A figure, the stem of its files, and its caption; the page shows those not only linked."""

    stem: str
    figure: Any
    caption: str
    linked: bool = False


class NamedTable(NamedTuple):
    """A table, the stem of its files, its numbers where they are written as CSV, and a heading.

    heading : of the part of the page that unfolds; "" where the page shows it elsewhere
    linked : whether the page only links its file
    """

    stem: str
    table: Table
    numbers: pd.DataFrame | None = None
    heading: str = ""
    linked: bool = False

    @property
    def files(self) -> dict[str, bytes]:
        """The table as Markdown and LaTeX, and its numbers as CSV, by path."""
        texts = {"md": markdown(self.table), "tex": latex(self.table)}
        if self.numbers is not None:
            texts["csv"] = csv_text(self.numbers)
        return {f"tables/{self.stem}.{kind}": text.encode() for kind, text in texts.items()}


Exhibits = tuple[list[NamedTable], list[Picture]]  # the summary table is the first


class Names(NamedTuple):
    """What names of files and styles are shared by all parts of a report.

    stems : by the data sets fitted and scored; fits : of the files about fits by shooting
    """

    stems: Mapping[tuple[str, str], str]
    fits: Mapping[Model, str]
    styles: Styles


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
        several = len({model.recipe for model in section.shot}) > 1
        name = stems[section.dataset, section.dataset]
        labels = {m: f"{name}--{m.label}" + f"--{m.recipe}" * several for m in section.shot}
        unique = file_names(labels.values())
        fits |= {model: unique[label] for model, label in labels.items()}
    return Names(stems, fits, styles(model for section in sections for model in section.models))


def shooting_fits(section: Section) -> list[Model]:
    """The fits with intervals, the one that predicts best first."""
    first = section.fitted.best(section.shot, section.fitted.last_rollout)
    return sorted(section.shot, key=lambda model: model is not first)


def exhibits_of(section: Section, data: SummaryData, names: Names) -> Exhibits:
    """Tables and pictures of one scored data set."""
    stem = names.stems[section.dataset, data.dataset]
    summary = summary_of(data, verdict_of(section).failed)
    table = summary_table(summary, caption_of(data, summary))
    tables = [NamedTable(f"summary--{stem}", table, summary.frame)]
    frames = torque_frames(data)
    left = torque_table(frames, data.description.joints, data.dataset)
    if left is not None:
        heading = "Torque left, per joint"
        tables.append(NamedTable(f"torque--{stem}", left, torque_numbers(frames), heading))
    pictures = list(motion_pictures(section, data, names))
    if (chosen := chosen_of(section)) is not None:
        figure = example_motions(chosen, data, names.styles[chosen.label])
        band = "; band: 95 % interval of the prediction, by what leaving out each fold changes"
        caption = f"Best, median and worst prediction of {chosen.name}, {data.dataset}, "
        caption += f"{data.novelty}{band * data.held_out}."
        pictures += [] if figure is None else [Picture(f"examples--{stem}", figure, caption)]
    if data.held_out:
        tables += fitted_tables(section, stem)
        pictures = [*fitted_pictures(section, names), *pictures]
        for i, model in enumerate(shooting_fits(section)):
            tables += fit_tables(section, model, names.fits[model], i > 0)
            pictures.append(correlation_picture(section, model, names, linked=i > 0))
        pictures += kind_pictures(section, names, "bands")
    return tables, pictures


# --- Tables ---------------------------------------------------------------------------------------


def fitted_tables(section: Section, stem: str) -> Iterator[NamedTable]:
    """Tables about what was fitted to a data set, beside the summary."""
    verdict = verdict_of(section)
    if verdict.compared:
        numbers = verdict_numbers(verdict)
        heading = "Error against complexity, and how the models stand"
        yield NamedTable(f"verdict--{stem}", verdict_table(verdict, numbers), numbers, heading)
    parameters, loops = parameter_numbers(section), loop_table(section)
    parameter = None if parameters.empty else parameter_table(section, parameters)
    speeds = loops and speed_table(section.dataset, section.description)
    tables = {
        "parameters": ("Parameters of the models", parameter),
        "loops": ("Loops of friction over velocity", loops),
        "speeds": ("Speeds of the joints", speeds),
    }
    for kind, (heading, table) in tables.items():
        if table is not None:
            frame = parameters if kind == "parameters" else None
            yield NamedTable(f"{kind}--{stem}", marked(table, verdict), frame, heading)


def fit_tables(section: Section, model: Model, stem: str, linked: bool) -> Iterator[NamedTable]:
    """Tables of a fit by shooting: parameters, and windows that do not count."""
    data = section.description
    table = interval_table(model, section.dataset, data, section.of_role("given"))
    yield NamedTable(f"shooting--{stem}", table, interval_numbers(model, data), linked=linked)
    windows = window_numbers(model.refined or Estimates())
    if not windows.empty:
        table = window_table(model, section.dataset, windows)
        heading = "Windows that were left out or are not explained"
        yield NamedTable(f"windows--{stem}", table, windows, heading, linked)


# --- Pictures -------------------------------------------------------------------------------------

# Draws one figure, several, or nothing.
Draw = Callable[[Section, Styles], Any]
# Pictures about what was fitted, with their captions, in the order of the page.
FITTED: Mapping[str, tuple[Draw, str]] = {
    "choice": (
        friction_of_the_choice,
        "Friction of {chosen} over velocity, {dataset}; grey: the models it is compared with.",
    ),
    "errors": (
        errors_of_models,
        "{error}, {dataset}, held out: each model, each fold.",
    ),
    "one_step": (
        one_step_boxes,
        "One-step losses on {dataset} over the folds: median, quartiles, range, mean (diamond).",
    ),
    "rollouts": (rollout_errors, "Rollout errors over the horizon, fitted on {dataset}."),
    "torque": (
        torque_over_time,
        "Torque of {dataset} over time: measured, by {chosen} fitted to all data, and without its "
        "friction.",
    ),
    "tradeoff": (
        loss_against,
        "Errors of prediction and of the friction curve over the one-step loss, {dataset}, held "
        "out; dashed: loss of the true friction.",
    ),
    "curves": (friction_curves, "Friction over velocity, fitted on {dataset}, all folds."),
    "learning": (
        learning_curves,
        "Learning curves on {dataset}: the loss over the epochs, each fold.",
    ),
    "loops": (
        loop_pictures,
        "Friction along sinusoids, fitted on {dataset}{beside}: mean of the folds at three "
        "frequencies, each fold at the middle one. Friction that depends on the velocity alone "
        "shows a line, not a loop.",
    ),
    "speeds": (lambda section, _: velocity_scatter(section), "Velocities of {dataset}."),
    "bands": (
        curve_bands,
        "Friction by {schemes} on {dataset} with its 95 % bands; below, the bands alone, and the "
        "truth less the fit where it is known. Grey: velocities that were not measured.",
    ),
}


def fitted_pictures(section: Section, names: Names) -> Iterator[Picture]:
    """Pictures about what was fitted to a data set, but for those of fits with intervals."""
    for kind in FITTED:
        if kind != "bands":
            yield from kind_pictures(section, names, kind)


def kind_pictures(section: Section, names: Names, kind: str) -> Iterator[Picture]:
    """Pictures of one kind, numbered where there are several; by recipe where they are drawn so."""
    draw, caption = FITTED[kind]
    stem = f"{kind}--{names.stems[section.dataset, section.dataset]}"
    drawn = draw(section, names.styles)
    by_recipe = drawn if isinstance(drawn, dict) else {None: drawn}
    files = file_names(recipe for recipe in by_recipe if recipe is not None)
    chosen, error = chosen_of(section), verdict_of(section).measure.of_what
    for recipe, figures in by_recipe.items():
        shown = figures if isinstance(figures, list) else [figures]
        ending = "" if recipe is None else f"--{files[recipe]}"
        words = caption.format(
            dataset=section.dataset,
            chosen=chosen.name if chosen else "",
            beside=_beside(section, recipe),
            error=error[:1].upper() + error[1:],
            schemes=" and ".join(dict.fromkeys(model.scheme for model in section.shot)),
        )
        for number, figure in enumerate(shown, 1):
            if figure is not None:
                several = f"--{number}" if len(shown) > 1 else ""
                yield Picture(f"{stem}{ending}{several}", figure, words)


def _beside(section: Section, recipe: str | None) -> str:
    return f", {recipe} recipe" if recipe and len(section.recipes) > 1 else ""


def motion_pictures(section: Section, data: SummaryData, names: Names) -> Iterator[Picture]:
    """Predicted motion on one data set, under each recipe."""
    stem, files = names.stems[section.dataset, data.dataset], file_names(section.recipes)
    for recipe in section.recipes:
        models = [model for model in section.under(recipe) if model in data.models]
        beside = _beside(section, recipe)
        figure = motions(models, data, names.styles, beside)
        if figure is not None:
            caption = f"Predicted over measured motion, {data.dataset}, {data.novelty}{beside}."
            yield Picture(f"motion--{stem}--{files[recipe]}", figure, caption)


def correlation_picture(
    section: Section, model: Model, names: Names, *, linked: bool = False
) -> Picture:
    """The correlation of a fit's parameters."""
    figure = fit_correlation(model.refined or Estimates(), section.description.joints)
    caption = correlation_caption(model, section.dataset)
    return Picture(f"correlation--{names.fits[model]}", figure, caption, linked)
