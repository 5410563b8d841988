"""The outcome of a sensitivity study: a table, pictures, a short page, and all numbers as CSV."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from frictionid.comparison.search_space import Objective, text_of
from frictionid.comparison.tuning import Study, best_of, by_task, chosen_suite, own_modules
from frictionid.files import csv_text, file_names, json_text
from frictionid.outputs import replace_files

from .exhibits import NamedTable
from .figures.studies import (
    CHANGE,
    ERROR,
    LOSS,
    ROLLOUT,
    is_known,
    over_amounts,
    progress,
    summarised,
    tornado,
)
from .figures.style import drawing, rendered
from .numbers import NOTHING, decimals, fixed, mean_sd, short
from .tables import (
    Cell,
    Column,
    Line,
    Part,
    Table,
    by_columns,
    line,
    render,
    table_of,
    text_columns,
)

PAGE, FRAME, PROVENANCE = "summary.md", "sensitivity.csv", "provenance.json"


def studies(frame: pd.DataFrame) -> Iterator[tuple[Any, pd.DataFrame]]:
    """The summarised frame of each data set and identifier."""
    yield from summarised(frame).groupby(["dataset", "identifier"], sort=False)


def write_sensitivity(
    folder: Path, frame: pd.DataFrame, provenance: Mapping[str, Any], *, replace: bool
) -> Path:
    """Path of the page written, with sensitivity.csv, tables and pictures beside it.

    replace : write also over files that were changed since
    """
    contents = {
        FRAME: csv_text(frame).encode(),
        PROVENANCE: json_text(dict(provenance)).encode(),
    }
    parts = dict(studies(frame))
    stems = file_names(map("--".join, parts))
    shown = []
    with drawing():
        for key, part in parts.items():
            stem = stems["--".join(key)]
            table, lines = sensitivity_table(part), over_amounts(part)
            contents |= NamedTable(f"sensitivity--{stem}", table).files
            figures = {f"tornado--{stem}": tornado(part)}
            if lines is not None:
                figures[f"amounts--{stem}"] = lines
            for name, figure in figures.items():
                files = rendered(figure).items()
                contents |= {f"figures/{name}.{kind}": drawn for kind, drawn in files}
            shown.append((key, table, list(figures)))
    context = {"studies": shown, "provenance": provenance}
    contents[PAGE] = render("sensitivity.md.j2", context).encode()
    replace_files(folder, contents, replace=replace)
    return folder / PAGE


def sensitivity_table(frame: pd.DataFrame) -> Table:
    """Errors and changes of one data set and identifier, a block for each recipe.

    frame : summarised
    """
    dataset, identifier = frame.dataset.iloc[0], frame.identifier.iloc[0]
    measures = [CHANGE, *([ERROR] if is_known(frame) else []), ROLLOUT, LOSS]
    heads = [*text_columns("recipe", "what is wrong", "by"), *(label for _, label in measures)]
    words, numbers = frame[["recipe", "name", "text"]], frame[[column for column, _ in measures]]
    lines = [
        line([*texts, *(short(v, 3) if np.isfinite(v) else NOTHING for v in values)], texts[0])
        for texts, values in zip(words.astype(str).to_numpy(), numbers.to_numpy(), strict=True)
    ]
    caption = (
        f"{dataset}, {identifier}: fitted with one thing wrong, judged on held-out recordings that "
        "have it wrong, too. Curves: RMS over RMS, of the worst joint. Changes: against the fit "
        "with nothing wrong."
    )
    return table_of(heads, lines, caption, f"sensitivity-{dataset}-{identifier}")


def write_outcome(
    folder: Path,
    studies: Sequence[Study],
    objective: Objective,
    file: Path,
    *,
    replace: bool,
) -> Path:
    """Path of the page written, with trials.csv and a suite for each data set beside it.

    replace : write also over files that were changed since
    """
    texts = {"trials.csv": csv_text(trials_of(studies))}
    datasets = []
    by_dataset: dict[str, list[Study]] = {}
    for study in studies:
        by_dataset.setdefault(study.task.benchmark.dataset.name, []).append(study)
    for name, part in by_dataset.items():
        suite = folder / f"{file_names([name])[name]}.toml"
        texts[suite.name] = chosen_suite(file, part, suite, objective)
        datasets.append((name, [score_table(part, objective), *settings_tables(part)], suite.name))
    texts["summary.md"] = render("tuning.md.j2", {"datasets": datasets, "picture": "progress"})
    contents = {name: text.encode() for name, text in texts.items()} | own_modules(file)
    with drawing():
        files = rendered(progress(studies, objective))
    contents |= {f"progress.{kind}": picture for kind, picture in files.items()}
    replace_files(folder, contents, replace=replace)
    return folder / "summary.md"


def trials_of(studies: Sequence[Study]) -> pd.DataFrame:
    """All trials, one in a line: study, number, score on the inner folds, settings."""
    lines = [
        {
            **_names(study, "fit"),
            "sampler": study.sampler,
            "fold": "all" if study.fold is None else study.fold,
            "trial": number,
            "value": trial.value,
            **{key: text_of(value) for key, value in trial.settings.items()},
            "error": trial.error,
        }
        for study in studies
        for number, trial in enumerate(study.trials)
    ]
    return pd.DataFrame(lines)


def _names(study: Study, recipe: str) -> dict[str, Any]:
    """What was tuned: names of the data set, the identifier and, under a key, the recipe."""
    task = study.task
    return {
        "dataset": task.benchmark.dataset.name,
        "identifier": task.name,
        recipe: task.recipe.name,
    }


def outcome_json(studies: Sequence[Study], page: Path) -> str:
    """Scores and chosen settings of each study as JSON; its trials stand in trials.csv."""
    outcomes = [
        {
            **_names(study, "recipe"),
            "sampler": study.sampler,
            "fold": study.fold,
            "trials": len(study.trials),
            "settings": dict(study.best.settings),
            "value": study.best.value,
            "suite_value": study.suite_value,
            "held_out": study.held_out,
            "held_out_suite": study.held_out_suite,
        }
        for study in studies
    ]
    return json_text({"studies": outcomes, "written": [page, page.with_name("trials.csv")]})


def score_table(studies: Sequence[Study], objective: Objective) -> Table:
    """Scores of each sampler's choice, on inner folds and on recordings held out from tuning."""
    unit = "rad" if objective.horizon is not None else "rad/s"
    rows = [
        (whole, [s for s in task if s.sampler == whole.sampler and s.fold is not None])
        for task in by_task(studies)
        for whole in task
        if whole.fold is None
    ]
    shown = [s.held_out for _, nested in rows for s in nested]
    places = decimals([*shown, *(whole.best.value for whole, _ in rows)], 3)
    heads = [*text_columns("identifier", "sampler"), "trials"]
    heads += [Column(name, "inner folds", unit) for name in ("as in the suite", "best")]
    heads += [Column(name, "held out", unit) for name in ("as in the suite", "tuned", "gain")]
    caption = (
        f"{objective.words}. Inner folds: of all recordings; the best of many trials is "
        "optimistic. Held out: mean ± standard deviation over the outer folds, each tuned for "
        "itself without the recordings that judge it. Gain: mean ± standard error of the "
        "difference."
    )
    lines = [_score_line(whole, nested, places) for whole, nested in rows]
    return table_of(heads, lines, caption, "tuning-scores")


def _score_line(whole: Study, nested: Sequence[Study], places: int) -> Line:
    suite, tuned = (
        np.array([getattr(study, name) for study in nested], dtype=float)
        for name in ("held_out_suite", "held_out")
    )
    failed = sum(math.isnan(trial.value) for trial in whole.trials)
    cells = [
        f"{whole.task.name} ({whole.task.recipe.name})",
        whole.sampler,
        f"{len(whole.trials)}" + (f" ({failed} failed)" if failed else ""),
        fixed(whole.suite_value, places),
        fixed(whole.best.value, places),
        mean_sd(suite, places),
        mean_sd(tuned, places),
        _gain(suite - tuned, places + 1),
    ]
    return line(cells, whole.task.title)


def _gain(values: Any, places: int) -> str:
    """Mean ± standard error of the finite differences (F,)."""
    finite = values[np.isfinite(values)]
    if len(finite) < 2:
        return NOTHING
    error = float(finite.std(ddof=1) / np.sqrt(len(finite)))
    return f"{fixed(float(finite.mean()), places)} ± {fixed(error, places)}"


def settings_tables(studies: Sequence[Study]) -> list[Table]:
    """Settings of each tuning task: what was searched, what the suite has, what was chosen."""
    return list(map(_settings_table, by_task(studies)))


def _settings_table(studies: Sequence[Study]) -> Table:
    task, first = studies[0].task, best_of(studies)
    whole = [study for study in studies if study.fold is None]
    nested = [study for study in studies if study.fold is not None]
    suite = {key: text_of(value) for key, value in task.suite_settings.items()}
    parts: list[Part] = [
        (Column("setting", words=True), task.search),
        (Column("searched", words=True), [space.words for space in task.search.values()]),
        (Column("suite"), [suite.get(key, NOTHING) for key in task.search]),
    ]
    for study in whole:
        cells = [Cell(_shown(study.best.settings[key]), study is first) for key in task.search]
        parts.append((Column(study.sampler, "chosen on all data"), cells))
    if nested:
        ranges = [_range([study.best.settings[key] for study in nested]) for key in task.search]
        parts.append((Column("chosen in the training folds", words=True), ranges))
    caption = f"{task.title}: settings searched and chosen; in bold those of the written suite."
    return by_columns(caption, "tuning-settings", parts)


def _shown(value: Any) -> str:
    return short(value, 3) if isinstance(value, float) else text_of(value)


def _range(values: Sequence[Any]) -> str:
    """Lowest to highest of numbers, or each choice with how often it was made."""
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        low, high = min(values), max(values)
        middle = sorted(values)[len(values) // 2]
        return f"{_shown(low)} to {_shown(high)}, median {_shown(middle)}"
    counts = Counter(map(text_of, values))
    return ", ".join(f"{name} ({times}×)" for name, times in counts.most_common())
