"""The comparison: every identifier by every recipe on identical folds.

What `run` does for one identifier and one recipe is a task: its folds are fitted together, the
friction of all data with them, and each is judged on what it was not fitted to.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.evaluation import (
    Folds,
    Protocol,
    Row,
    curves,
    examples,
    judge,
    judge_folds,
    prepare,
)
from frictionid.friction import Friction
from frictionid.identifiers import Identifier
from frictionid.mechanics import mechanism_of, plant_of
from frictionid.recipe import INTEGRAL, Recipe, training_problem
from frictionid.recordings import Dataset


class Result(NamedTuple):
    """What a task found: rows of scores, friction of the folds and of all data, pictures' data."""

    rows: tuple[Row, ...]
    friction: Friction
    overall: Friction
    curves: Array
    motions: tuple[dict[str, Any], ...]
    tests: Mapping[str, tuple[Row, ...]]
    seconds: Mapping[str, float]

    def value(
        self, score: str, statistic: str, horizon: float | None = None, joint: str = "all"
    ) -> float:
        """One held-out score, pooled over the folds.

        Raises
        ------
        InputError
            Where there is no such score.
        """
        for row in self.rows:
            found = (row.score, row.statistic, row.horizon_s, row.joint)
            if row.fold == "all" and found == (score, statistic, horizon, joint):
                return row.value
        raise InputError(f"no score {score!r}, {statistic!r} at {horizon} s for joint {joint}")


@dataclass(frozen=True)
class Contest:
    """A data set with its folds, and data sets that only test what was fitted to it."""

    dataset: Dataset
    folds: Folds
    protocol: Protocol = field(default_factory=Protocol)
    tests: tuple[Dataset, ...] = ()


def run(contest: Contest, identifier: Identifier, recipe: Recipe, seed: int = 0) -> Result:
    """Fit an identifier by a recipe in every fold and on all data, and score it on what was held out.

    Raises
    ------
    InputError
        Where data, folds and settings do not fit together.
    """
    dataset, folds, protocol = contest.dataset, contest.folds, contest.protocol
    clock = time.perf_counter()
    problem = training_problem(
        dataset, plant_of(dataset), recipe, protocol.sample_time, protocol.history
    )
    training = folds.training(problem.recording, problem.time, problem.dt)
    weights = np.concatenate([training, np.ones((1, len(problem.r)))])
    seconds = {"prepare": time.perf_counter() - clock}
    clock = time.perf_counter()
    angle_unit = mechanism_of(dataset.mechanism).description.angle_unit
    fitted = replace(identifier.fit(problem, weights, seed), angle_unit=angle_unit)
    seconds["fit"] = time.perf_counter() - clock
    clock = time.perf_counter()
    friction, overall = fitted[:-1], fitted[-1]
    prepared = prepare(dataset, protocol, fitted.parameters)
    rows, motions = judge_folds(friction, overall, prepared, folds)
    tests, pictures = {}, list(motions)
    for test in contest.tests:
        ready = prepare(test, protocol, fitted.parameters)
        tests[test.name] = tuple(judge(overall, ready))
        pictures += examples(overall, ready)
    lines = np.concatenate([curves(friction, prepared.grid), curves(overall, prepared.grid)[None]])
    seconds["score"] = time.perf_counter() - clock
    return Result(tuple(rows), friction, overall, lines, tuple(pictures), tests, seconds)


def compare(
    dataset: Dataset,
    identifiers: Mapping[str, Identifier],
    folds: Folds,
    recipes: Sequence[Recipe] = (INTEGRAL,),
    protocol: Protocol | None = None,
    seed: int = 0,
) -> dict[tuple[str, str], Result]:
    """Result of every identifier by every recipe, keyed by (identifier, recipe) names, one by one.

    Examples
    --------
    A comparison of one's own recordings::

        dataset = frictionid.load_dataset("my_rig")
        folds = make_folds(dataset.recordings, Split(count=10))
        results = compare(dataset, {"none": Nothing(), "stribeck": LeastSquares(Stribeck())}, folds)
    """
    contest = Contest(dataset, folds, protocol or Protocol())
    return {
        (name, recipe.name): run(contest, identifier, recipe, seed)
        for recipe in recipes
        for name, identifier in identifiers.items()
    }


def with_provenance(friction: Friction, entries: Mapping[str, Any]) -> Friction:
    """The friction, saying also where it comes from."""
    return replace(friction, provenance={**friction.provenance, **entries})
