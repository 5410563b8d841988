"""frictionid.compare: friction models on identical folds, in memory or in a result folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from frictionid.api.fit import Fit
from frictionid.api.methods import method_of
from frictionid.api.models import DatasetLike, dataset_of, identifier_of, name_of
from frictionid.arrays import Array
from frictionid.comparison.cross_validate import (
    Benchmark,
    PreparedBenchmark,
    Result,
    prepare_benchmark,
)
from frictionid.comparison.methods import Method
from frictionid.comparison.registry import LAWS
from frictionid.comparison.results import (
    Results,
    load_results,
    model_document_of,
    results_in_memory,
)
from frictionid.comparison.suite_identifiers import NamedIdentifier
from frictionid.comparison.suite_tasks import tasks_on
from frictionid.comparison.tasks import Task, results_of
from frictionid.config import distinct, nearest
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import Folds, Protocol, Split, make_folds, score_value
from frictionid.friction import Friction, Law
from frictionid.friction.model_files import read_model
from frictionid.report import show_summary
from frictionid.report.console import printed
from frictionid.report.figures.style import drawn
from frictionid.report.page import Picture
from frictionid.report.sections import Section, sections_of
from frictionid.report.summary_table import MEDIANS, caption_of, summary_of, summary_table
from frictionid.report.tables import html
from frictionid.report.terminal import verdict
from frictionid.report.write import (
    FITTED,
    Names,
    band_pictures,
    correlation_picture,
    motion_pictures,
    names_of,
)

USUAL = (0.1, 0.25, 0.5, 1.0)  # [s], horizons
PLOTS = (*FITTED, "motion", "bands", "correlation")


@dataclass(frozen=True, eq=False)
class Shown:
    """A text that shows itself as it is, and in a notebook as HTML."""

    text: str
    html: str

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return self.html


@dataclass(frozen=True, eq=False, repr=False)
class ComparedModel:
    """One model of a comparison, by one recipe.

    Attributes
    ----------
    name, recipe : str
    friction : Friction, theta (n, P), fitted to all data
    folds : Friction, theta (F, n, P), of the folds
    scores : DataFrame of held-out scores; columns fold, score, statistic, horizon_s, joint, value
    velocity, curves : arrays (V, n), and (F + 1, V, n) with that of all data last
    data : Dataset or None, where the comparison was loaded from a folder
    """

    name: str
    recipe: str
    friction: Friction
    folds: Friction
    scores: pd.DataFrame
    velocity: Array
    curves: Array
    data: Dataset | None = None

    def __repr__(self) -> str:
        return f"{self.name} by {self.recipe}, {len(self.folds.theta)} folds\n{self.friction}"

    @property
    def fit(self) -> Fit:
        """The friction of all data, as `frictionid.fit` gives it."""
        return Fit(self.friction, self.data)

    @property
    def overall(self) -> Friction:
        """The friction of all data, by its earlier name."""
        return self.friction

    def value(
        self, score: str, statistic: str, horizon: float | None = None, joint: str = "all"
    ) -> float:
        """One held-out score, pooled over the folds.

        Raises
        ------
        InputError
            Where there is no such score.
        """
        return score_value(self.scores, score, statistic, horizon, joint)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Mapping[tuple[str, str], ComparedModel]):
    """Models compared on identical folds.

    A mapping of (name, recipe) to `ComparedModel`; where there is one recipe the name is enough, as
    in `bench["stribeck"]`.

    Attributes
    ----------
    results : Results, all that tables and pictures need
    dataset : Dataset or None, where they were loaded from a folder
    laws : classes of one's own laws that the results may name
    fitted : mapping of (name, recipe) to the results in memory
    """

    results: Results
    dataset: Dataset | None = None
    laws: tuple[type[Law], ...] = ()
    fitted: Mapping[tuple[str, str], Result] | None = None

    def __repr__(self) -> str:
        return str(self.summary())

    def _repr_html_(self) -> str:
        return self.summary().html

    def __iter__(self) -> Iterator[tuple[str, str]]:
        return iter(self._tasks)

    def __len__(self) -> int:
        return len(self._tasks)

    def __getitem__(self, key: str | tuple[str, str]) -> ComparedModel:
        """A model by its name and recipe, or by its name where it has one recipe."""
        hits = [key] if key in self._tasks else [k for k in self._tasks if k[0] == key]
        if len(hits) != 1:
            known = ", ".join(repr(k if len(hits) else k[0]) for k in hits or self._tasks)
            rule = "has several recipes; name one" if hits else "is no model of the comparison"
            raise InputError(f"{key!r} {rule}: {known}")
        return self._model(hits[0])

    def __contains__(self, key: object) -> bool:
        return key in self._tasks or any(k[0] == key for k in self._tasks)

    @property
    def frame(self) -> pd.DataFrame:
        """Scores of the models, a line for each: held out, and on data sets that only test.

        Columns dataset, identifier, recipe, role, one_step_euler_mean [rad/s],
        one_step_integral_rms [rad/s], rollout_angle_median_1s [rad] ..., n_parameters.
        """
        frames = [
            summary_of(data).frame.assign(dataset=data.dataset)
            for section in self._sections
            for data in section.data
        ]
        whole = pd.concat(frames, ignore_index=True).dropna(axis=1, how="all")
        return whole[["dataset", *(c for c in whole.columns if c != "dataset")]]

    @property
    def scores(self) -> pd.DataFrame:
        """All scores, one for each line, as in scores.csv of a result folder."""
        return self.results.scores.reset_index(drop=True)

    def summary(self) -> Shown:
        """The summary tables and the verdict, as they stand in a terminal."""
        text = printed(partial(show_summary, self.results)).rstrip("\n")
        parts = []
        for section in self._sections:
            for data in section.data:
                own = summary_of(data)
                parts.append(html(summary_table(own, caption_of(data, own), detail=MEDIANS)))
            parts.append(f"<p>{escape(verdict(section))}</p>")
        return Shown(text, "".join(parts))

    @property
    def plots(self) -> tuple[str, ...]:
        """Kinds of pictures that `plot` draws."""
        return PLOTS

    def plot(self, kind: str = "rollouts", dataset: str | None = None) -> Any:
        """A Matplotlib figure of the report.

        Parameters
        ----------
        kind : str
            "rollouts", errors over the horizon; "curves", friction over velocity; "one_step",
            losses of the folds; "tradeoff", errors over the loss where the truth is known;
            "motion", predicted over measured; "bands" and "correlation" of fits by shooting;
            "members" of ensembles, "learning" of networks, "loops" of laws with memory.
        dataset : str, optional
            Where several were fitted.

        Raises
        ------
        InputError
            For unknown kinds, and those that these models do not have.
        """
        return drawn(lambda: self._pictures(kind, dataset)[0].figure)

    def figures(self, dataset: str | None = None) -> dict[str, Any]:
        """All figures of the report by their names, which are those of its files."""
        section = self._section(dataset)
        out: dict[str, Any] = {}

        def draw() -> Any:
            found = [picture for kind in PLOTS for picture in self._drawn(kind, section)]
            out.update({picture.stem: picture.figure for picture in found})
            return found[0].figure

        drawn(draw)
        return out

    def _pictures(self, kind: str, dataset: str | None) -> list[Picture]:
        names = [k for k in PLOTS if k.rstrip("s") == kind.rstrip("s")]
        if not names:
            raise InputError(f"plot: kind = {kind!r} is unknown; {nearest(kind, PLOTS)}")
        found = list(self._drawn(names[0], self._section(dataset)))
        if not found:
            raise InputError(f"plot: these models have no picture of kind {kind!r}")
        return found

    def _drawn(self, kind: str, section: Section) -> Iterator[Picture]:
        names: Names = names_of(self._sections)
        stem = names.stems[section.dataset, section.dataset]
        shot = [model for model in section.models if model in names.fits]
        if kind in FITTED:
            yield from FITTED[kind](section, names, stem)
        elif kind == "motion":
            yield from motion_pictures(section, section.fitted, names, stem)
        elif kind == "bands" and shot:
            yield from band_pictures(section, shot, names, stem)
        elif kind == "correlation":
            yield from (correlation_picture(section, model, names) for model in shot)

    @cached_property
    def _sections(self) -> tuple[Section, ...]:
        return sections_of(self.results)

    def _section(self, dataset: str | None) -> Section:
        by_name = {section.dataset: section for section in self._sections}
        if dataset is None:
            return self._sections[0]
        if dataset not in by_name:
            raise InputError(f"{dataset!r} was not fitted; {nearest(dataset, by_name)}")
        return by_name[dataset]

    @cached_property
    def _tasks(self) -> dict[tuple[str, str], int]:
        """Places of the tasks, of the first data set and seed where there are several."""
        out: dict[tuple[str, str], int] = {}
        for place, task in enumerate(self.results.tasks):
            out.setdefault((str(task["identifier"]), str(task["fit"])), place)
        return out

    def _model(self, key: tuple[str, str]) -> ComparedModel:
        place = self._tasks[key]
        task = self.results.tasks[place]
        document = model_document_of(task)
        if self.fitted is not None:
            result = self.fitted[key]
            source = {**result.overall.provenance, **document["provenance"]}
            friction, folds = replace(result.overall, provenance=source), result.friction
        else:
            known = {**LAWS, **{law.__name__: law for law in self.laws}}
            friction = read_model(document, known, str(self.results.folder))
            theta = np.asarray(task["folds"]["theta"], float).reshape(task["folds"]["shape"])
            folds = replace(friction, theta=theta, provenance={}, calibration=None)
        own = self.results.scores.loc[[place]]
        own = own[own["dataset"] == task["dataset"]].reset_index(drop=True)
        return ComparedModel(
            *key,
            friction=friction,
            folds=folds,
            scores=own.drop(columns=["suite", "dataset", "identifier", "fit", "seed"]),
            velocity=np.asarray(self.results.datasets[task["dataset"]]["velocity"], dtype=float),
            curves=np.asarray(task["curves"], dtype=float),
            data=self.dataset,
        )


def compare(
    data: DatasetLike,
    models: Mapping[str, Any] | Sequence[Any],
    folds: int | Split | Folds | None = None,
    recipes: str | Method | Sequence[str | Method] = "integral",
    protocol: Protocol | None = None,
    seed: int = 0,
    *,
    horizons: Sequence[float] | None = None,
    tests: Sequence[DatasetLike] = (),
    initial_states: str = "filter",
    sample_time: float | None = None,
    whole: bool = False,
    jobs: int = 1,
    done: Callable[[str], None] | None = None,
) -> Comparison:
    """Compare friction models on identical folds.

    Parameters
    ----------
    data : Dataset, or path or name of one
    models : list of names, laws, identifiers or fits, or a mapping to these
        As in `frictionid.fit`; a fit is given, and is not fitted again. The names of a mapping
        stand in tables.
    folds : int, Split or Folds, optional
        How many: whole recordings where there are so many, else stretches of time. None: ten, or
        one for each recording where there are fewer.
    recipes : str, Method, or list of these
        "integral", "study", "shooting", or a method; each fits every model.
    protocol : Protocol, optional
        Everything that is scored, in place of the arguments below.
    seed : int
    horizons : list of float [s], optional
        Of the predictions. None: those of 0.1, 0.25, 0.5 and 1 s that the folds hold out.
    tests : list of data sets that only test what was fitted
    initial_states : str
        Estimator of the states that predictions start from: "filter", the same for all models, or
        "model", each model's own.
    sample_time : float [s], optional
        Use samples at least this far apart.
    whole : bool
        Also simulate whole recordings from their start.
    jobs : int
        Number of models that are fitted side by side; 0: one for each core.
    done : function, optional
        Called with the name of each model that is finished.

    Raises
    ------
    InputError
        Where data, models and folds do not fit together, or a fit fails.

    Examples
    --------
    >>> bench = compare("acrobot_clean", ["none", "coulomb_viscous"], horizons=[0.5])
    >>> bench["coulomb_viscous"].value("rollout_angle", "median", 0.5) < 0.1
    True
    """
    dataset = dataset_of(data)
    methods = [method_of(recipe) for recipe in _listed(recipes)]
    distinct([method.name for method in methods], "recipes")
    named = [NamedIdentifier(name, identifier_of(model)) for name, model in _named(models)]
    benchmark = Benchmark(
        dataset,
        _folds(dataset, folds),
        protocol or Protocol(initial_states=initial_states, sample_time=sample_time, whole=whole),
        tuple(map(dataset_of, tests)),
    )
    asked = None if protocol is not None else USUAL if horizons is None else tuple(horizons)
    benchmark, shared = _prepared(benchmark, methods, asked, fewer=horizons is None)
    tasks = tasks_on(benchmark, methods, named, [seed])
    prepared = {dataset.name: shared}
    found = {}
    for task, result in results_of(tasks, prepared, jobs=jobs):
        found[task.name, task.recipe.name] = task, result
        if done is not None:
            done(task.name)
    return _comparison(tasks, found, prepared)


def _listed(recipes: str | Method | Sequence[str | Method]) -> Sequence[str | Method]:
    if isinstance(recipes, str) or not isinstance(recipes, Sequence):
        return [recipes]
    return recipes


def _comparison(
    tasks: Sequence[Task],
    found: Mapping[tuple[str, str], tuple[Task, Result]],
    prepared: Mapping[str, PreparedBenchmark],
) -> Comparison:
    dataset = tasks[0].benchmark.dataset
    protocol = tasks[0].benchmark.protocol
    settings = {
        "horizons": protocol.horizons,
        "every": protocol.every,
        "history": protocol.history,
        "sample_time": protocol.sample_time,
        "seeds": [tasks[0].seed],
        "folds": {"count": tasks[0].benchmark.folds.count},
        "datasets": [{"path": dataset.name}],
    }
    ordered = [found[task.name, task.recipe.name] for task in tasks]
    results = results_in_memory(dataset.name, settings, ordered, prepared, LAWS)
    return Comparison(results, dataset, fitted={key: result for key, (_, result) in found.items()})


def _named(models: Mapping[str, Any] | Sequence[Any]) -> list[tuple[str, Any]]:
    """Models with their names in tables, all different."""
    if isinstance(models, str) or not isinstance(models, Mapping | Sequence):
        models = [models]
    if isinstance(models, Mapping):
        return [(str(name), model) for name, model in models.items()]
    if not models:
        raise InputError("name at least one model to compare, such as 'stribeck'")
    names = [name_of(model) for model in models]
    labels = [
        name if names.count(name) == 1 else f"{name} {names[: i + 1].count(name)}"
        for i, name in enumerate(names)
    ]
    return list(zip(labels, models, strict=True))


def _folds(dataset: Dataset, folds: int | Split | Folds | None) -> Folds:
    """Folds of the recordings, of stretches of time where there are fewer recordings."""
    if isinstance(folds, Folds):
        return folds
    split = folds if isinstance(folds, Split) else Split(count=folds)
    count, recordings = split.folds(len(dataset.recordings)), len(dataset.recordings)
    if split.kind is None and recordings < count:
        split = replace(split, kind="blocks")
    return make_folds(dataset.recordings, split)


def _prepared(
    benchmark: Benchmark,
    methods: Sequence[Method],
    horizons: tuple[float, ...] | None,
    *,
    fewer: bool,
) -> tuple[Benchmark, PreparedBenchmark]:
    """The benchmark over some horizons; with `fewer`, over those that its folds hold out."""
    if horizons is None:
        return benchmark, prepare_benchmark(benchmark, methods)
    first: InputError | None = None
    for last in range(len(horizons), 0, -1):
        protocol = replace(benchmark.protocol, horizons=horizons[:last])
        tried = replace(benchmark, protocol=protocol)
        try:
            return tried, prepare_benchmark(tried, methods)
        except InputError as error:
            first = first or error
            if not fewer:
                break
    raise first or InputError("horizons must name at least one time ahead, e.g. [0.5]")


def load_comparison(folder: str | Path, laws: Sequence[type[Law]] = ()) -> Comparison:
    """The comparison of a result folder, as `frictionid compare` writes it.

    laws : classes of one's own laws that its models may have

    Raises
    ------
    InputError
        If the folder holds no comparison, none of its tasks is finished, or a file is damaged.
    """
    return Comparison(load_results(Path(folder)), laws=tuple(laws))
