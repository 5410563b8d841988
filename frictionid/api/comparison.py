"""A comparison as an object: frames, pictures and models, in memory or of a result folder."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.comparison.cross_validate import Result
from frictionid.comparison.results import Results, load_results, model_document_of, task_provenance
from frictionid.config import nearest
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import score_value
from frictionid.friction import Friction, Law
from frictionid.friction.model_files import read_model
from frictionid.friction.provenance import Provenance
from frictionid.pictures import as_html, drawn
from frictionid.report import show_summary
from frictionid.report.exhibits import (
    FITTED,
    Picture,
    correlation_picture,
    kind_pictures,
    motion_pictures,
    names_of,
)
from frictionid.report.sections import Section, sections_of
from frictionid.report.side_by_side import SideBySide, side_by_side
from frictionid.report.summary_table import summary_of
from frictionid.report.terminal import Shown
from frictionid.report.verdict import Verdict, verdict_of

from .fitted import Fit

PLOTS = (*FITTED, "motion", "correlation")


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

    def value(
        self, score: str, statistic: str, horizon: float | None = None, joint: str = "all"
    ) -> float:
        """One held-out score, pooled over the folds."""
        return score_value(self.scores, score, statistic, horizon, joint)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Shown, Mapping[tuple[str, str], ComparedModel]):
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

    def show(self) -> None:
        show_summary(self.results)

    def _repr_html_(self) -> str:
        return super()._repr_html_() + as_html(self.plot())

    def __iter__(self) -> Iterator[tuple[str, str]]:
        return iter(self._tasks)

    def __len__(self) -> int:
        return len(self._tasks)

    def __getitem__(self, key: str | tuple[str, str]) -> ComparedModel:
        """A model by its name and recipe, or by its name where it has one recipe."""
        hits = [key] if key in self._tasks else [k for k in self._tasks if k[0] == key]
        if len(hits) != 1:
            candidates = ", ".join(repr(k if len(hits) else k[0]) for k in hits or self._tasks)
            rule = "has several recipes; name one" if hits else "is no model of the comparison"
            reasons = "".join(f"; not fitted: {text}" for text in self.results.not_fitted)
            raise InputError(f"{key!r} {rule}: {candidates}{reasons}")
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
            summary_of(data, verdict_of(section).failed).frame.assign(dataset=data.dataset)
            for section in self._sections
            for data in section.data
        ]
        whole = pd.concat(frames, ignore_index=True).dropna(axis=1, how="all")
        return whole[["dataset", *(c for c in whole.columns if c != "dataset")]]

    @property
    def scores(self) -> pd.DataFrame:
        """All scores, one for each line, as in scores.csv of a result folder."""
        return self.results.scores.reset_index(drop=True)

    @property
    def verdict(self) -> Verdict:
        """Which model the evidence supports, and why; of the first data set, see `verdicts`."""
        return self.verdicts[0]

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """The verdicts on all data sets that were fitted."""
        return tuple(map(verdict_of, self._sections))

    def against(self, other: "Comparison") -> SideBySide:
        """What changes from this comparison to another one, and whether they can be compared.

        Raises
        ------
        InputError
            Where no data set was fitted in both.
        """
        return side_by_side(self.results, other.results)

    @property
    def page(self) -> Path | None:
        """Path of the page index.html in the result folder; None without one."""
        path = self.results.folder / "index.html"
        return path.resolve() if self.results.folder != Path() and path.exists() else None

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
            "learning" of networks, "loops" of laws with memory.
        dataset : str, optional
            Where several were fitted.
        """
        names = [k for k in PLOTS if k.rstrip("s") == kind.rstrip("s")]
        if not names:
            raise InputError(f"plot: kind = {kind!r} is unknown; {nearest(kind, PLOTS)}")
        section = self._section(dataset)
        return drawn(lambda: self._picture(names[0], section).figure)

    def _picture(self, kind: str, section: Section) -> Picture:
        """The first picture of a kind."""
        names = names_of(self._sections)
        if kind == "motion":
            pictures = motion_pictures(section, section.fitted, names)
        elif kind == "correlation":
            shot = [model for model in section.models if model in names.fits]
            pictures = (correlation_picture(section, model, names) for model in shot)
        else:
            pictures = kind_pictures(section, names, kind)
        picture = next(iter(pictures), None)
        if picture is None:
            raise InputError(f"plot: these models have no picture of kind {kind!r}")
        return picture

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
            source = task_provenance(task)
            friction, folds = replace(result.overall, provenance=source), result.friction
        else:
            friction = read_model(document, str(self.results.folder), self.laws)
            theta = np.asarray(task["folds"]["theta"], float).reshape(task["folds"]["shape"])
            folds = replace(friction, theta=theta, provenance=Provenance(), calibration=None)
        scores = self.results.scores.loc[[place]]
        scores = scores[scores["dataset"] == task["dataset"]].reset_index(drop=True)
        return ComparedModel(
            *key,
            friction=friction,
            folds=folds,
            scores=scores.drop(columns=["suite", "dataset", "identifier", "fit", "seed"]),
            velocity=np.asarray(self.results.datasets[task["dataset"]]["velocity"], dtype=float),
            curves=np.asarray(task["curves"], dtype=float),
            data=self.dataset,
        )


def load_comparison(folder: str | Path, laws: Sequence[type[Law]] = ()) -> Comparison:
    """The comparison of a result folder, as `frictionid compare` writes it.

    laws : classes of one's own laws that its models may have

    Raises
    ------
    InputError
        If the folder holds no comparison, none of its tasks is finished, no model could be fitted,
        or a file is damaged.
    """
    return Comparison(load_results(Path(folder)), laws=tuple(laws))
