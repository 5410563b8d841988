"""Sensitivity study: how far friction and predictions change when one thing is wrong.

Each variation is a data set of its own, as a laboratory would have it that does not know better: it
is fitted with the wrong mechanism or data, and judged on held-out recordings of the same kind.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from joblib import cpu_count

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.data.recordings import Dataset, Recording
from frictionid.errors import InputError, located
from frictionid.evaluation import (
    curve_error,
    prepare,
    score_model,
    score_value,
    steady_state,
)
from frictionid.fitting.identifiers import Frictionless
from frictionid.fitting.parameters import InertiaBlock
from frictionid.fitting.shooting import Shooting

from .cross_validate import Benchmark
from .fit_model import fit_model
from .processes import side_by_side
from .result_folder import finished, write_sealed
from .suite import Suite, tasks_of
from .tasks import Task, digest_of, file_name
from .training_set import Method
from .variations import SensitivitySettings, Variation, variations_of, varied, with_samples

EVERY = 3  # the last of three recordings is held out
TRAINING = 0.7  # share of a recording's time, where there are fewer than three


def training_and_test(dataset: Dataset) -> tuple[Dataset, Dataset]:
    """Every third recording is held out; of fewer than three the last 30 % of each one's time.

    >>> from frictionid import load_dataset
    >>> train, test = training_and_test(load_dataset("acrobot_clean"))
    >>> len(train.recordings), len(test.recordings)
    (17, 8)
    """
    recordings = dataset.recordings
    if len(recordings) >= EVERY:
        train = tuple(r for i, r in enumerate(recordings, 1) if i % EVERY)
        test = recordings[EVERY - 1 :: EVERY]
    else:
        train, test = zip(*map(_parts, recordings), strict=True)
    return replace(dataset, recordings=train), replace(dataset, recordings=test)


def _parts(recording: Recording) -> tuple[Recording, Recording]:
    """The recording before and after a moment; the torque keeps its samples."""
    begin, end = recording.angle.time[[0, -1]]
    moment = begin + TRAINING * (end - begin)
    early = with_samples(recording, lambda signal: signal.time < moment)
    return early, with_samples(recording, lambda signal: signal.time >= moment)


FORMAT = 1  # of the result files


class Case(NamedTuple):
    """One fit: a task of the suite on a variation of its data set."""

    task: Task
    variation: Variation

    @property
    def file(self) -> str:
        """Name of the result file."""
        name = f"{self.task.benchmark.dataset.name}, {self.variation.label}"
        return file_name(name, self.task.name, self.task.recipe.name, self.task.seed)

    @property
    def digest(self) -> str:
        """SHA-256 of everything that the result depends on."""
        return digest_of((self.task.digest, tuple(self.variation), FORMAT))

    @property
    def label(self) -> str:
        """What a progress bar shows."""
        task = self.task
        return f"{task.benchmark.dataset.name}, {self.variation.label}: {task.recipe.name}"


def sensitivity_cases(
    suite: Suite, file: Path, data: Path | None = None, *, trust: bool = False
) -> list[Case]:
    """Cases of a suite, by its `sensitivity` settings; the nominal one of each task first.

    Recipes that shoot come twice, with base parameters ("inertia") held and free.
    """
    settings = suite.sensitivity
    tasks = [task for task in tasks_of(suite, file, data, trust=trust) if not task.identifier.fixed]
    return cases_of(_chosen(tasks, settings, str(file)), settings)


def cases_of(tasks: Sequence[Task], settings: SensitivitySettings) -> list[Case]:
    """Cases of tasks; recipes that shoot come twice, with base parameters held and free."""
    cases = []
    for task in tasks:
        protocol = replace(task.benchmark.protocol, horizons=(settings.horizon,), loops=None)
        benchmark = Benchmark(task.benchmark.dataset, task.benchmark.folds, protocol)
        for recipe in with_and_without_inertia(task.recipe):
            varied = task._replace(benchmark=benchmark, recipe=recipe)
            cases += [Case(varied, v) for v in variations_of(benchmark.dataset, settings)]
    return cases


def _chosen(tasks: Sequence[Task], settings: SensitivitySettings, where: str) -> list[Task]:
    """Tasks of the identifiers and recipes that are asked for, with the first seed."""
    names = dict.fromkeys(task.name for task in tasks)
    usual = [
        task.name
        for task in tasks
        if not task.identifier.seeded
        and task.identifier.uses_mechanism
        and not isinstance(task.identifier, Frictionless)
    ]
    if settings.identifiers is None and not usual:
        raise InputError(
            f"{where}: no identifier draws no random numbers: name one by --identifier"
        )
    identifiers = settings.identifiers or usual[:1]
    for name in identifiers:
        if name not in names:
            raise InputError(f"{where}: identifier {name!r} is unknown; {nearest(name, names)}")
    chosen = [task for task in tasks if task.name in identifiers]
    recipes = dict.fromkeys(task.recipe.name for task in chosen)
    for name in settings.recipes or ():
        if name not in recipes:
            raise InputError(f"{where}: recipe {name!r} is unknown; {nearest(name, recipes)}")
    first = {(t.benchmark.dataset.name, t.name, t.recipe.name): t for t in reversed(chosen)}
    return [
        task
        for task in reversed(first.values())
        if settings.recipes is None or task.recipe.name in settings.recipes
    ]


def with_and_without_inertia(recipe: Method) -> list[Method]:
    """The recipe; if it shoots, with base parameters held and with them free."""
    if not isinstance(recipe, Shooting) or recipe.held is not None:
        return [recipe]
    held = tuple(b for b in recipe.blocks if not isinstance(b, InertiaBlock))
    free = recipe.blocks if len(held) < len(recipe.blocks) else (*held, InertiaBlock())
    return [
        replace(recipe, name=f"{recipe.name}, inertia held", blocks=held),
        replace(recipe, name=f"{recipe.name}, inertia free", blocks=free),
    ]


def run_cases(
    cases: Sequence[Case],
    folder: Path | None = None,
    *,
    jobs: int,
    done: Callable[[str], None],
) -> pd.DataFrame:
    """Frame of the results, see `result_frame`; each is one file of the folder, written whole.

    Files of the same digest are kept. Without a folder nothing is written.
    """
    kept = {c.file: folder and finished(folder / c.file, c.digest) for c in cases}
    results = {file: result for file, result in kept.items() if result}
    for case in cases:
        if case.file in results:
            done(case.label)
    left = [case for case in cases if case.file not in results]
    by_data = {case.task.benchmark.dataset.name: case for case in left}
    grids = {name: _grid(case) for name, case in by_data.items()}
    calls = [(case, grids[case.task.benchmark.dataset.name]) for case in left]
    for i, result in side_by_side(_run, calls, jobs or cpu_count()):
        case = left[i]
        results[case.file] = result
        if folder is not None:
            write_sealed(folder / case.file, {"digest": case.digest, **result})
        done(case.label)
    return result_frame(cases, [results[case.file] for case in cases])


def _grid(case: Case) -> Array:
    """Velocities (V, n) of the curves: those of the training recordings with nothing wrong."""
    train, _ = training_and_test(case.task.benchmark.dataset)
    return prepare(train, case.task.benchmark.protocol).grid


def _run(case: Case, grid: Array) -> dict[str, Any]:
    """Scores on the held-out recordings, and friction curves (V, n) at velocities (V, n)."""
    task, variation = case
    with located(case.label):
        train, test = training_and_test(task.benchmark.dataset)
        wrong, judged = varied(train, variation, 2 * task.seed), test
        if variation.cause != "recordings":
            judged = varied(test, variation, 2 * task.seed + 1)
        protocol = task.benchmark.protocol
        friction = fit_model(wrong, task.identifier, task.recipe, protocol, task.seed)
        scores = score_model(friction, prepare(judged, protocol)).scores
    horizon = protocol.horizons[0]
    estimate, error, truth = friction.curve(grid), None, task.benchmark.dataset.truth
    if truth is not None:
        error = curve_error(estimate, steady_state(truth).curve(grid), grid)
    return {
        "loss": score_value(scores, "one_step_euler", "mean"),
        "rollout": score_value(scores, "rollout_angle", "median", horizon),
        "velocity": grid,
        "curves": estimate,
        "curve_error": error,
        "seconds": wrong.seconds,
    }


def result_frame(cases: Sequence[Case], results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """One row for each case.

    Columns: dataset, identifier, recipe, cause, name, text, amount, `seconds` of motion fitted,
    `loss` [rad/s] one step ahead by the study's definition, `rollout` [rad] median error after the
    horizon, for each joint J `curve_change_J`, RMS difference to the nominal fit's curve over RMS
    of that, and `curve_error_J` against the true one, NaN where that is not known.
    """
    rows, nominal = [], np.zeros((1, 1))
    for case, result in zip(cases, results, strict=True):
        task, variation = case
        curve, grid = np.asarray(result["curves"]), np.asarray(result["velocity"])
        if variation.cause == "nominal":
            nominal = curve
        change = curve_error(curve, nominal, grid)
        error = result["curve_error"]
        errors = np.full(len(change), np.nan) if error is None else np.asarray(error, dtype=float)
        rows.append(
            {
                "dataset": task.benchmark.dataset.name,
                "identifier": task.name,
                "recipe": task.recipe.name,
                **{name: getattr(variation, name) for name in ("cause", "name", "text", "amount")},
                **{key: float(result[key]) for key in ("seconds", "loss", "rollout")},
                **{f"curve_change_{j + 1}": float(x) for j, x in enumerate(change)},
                **{f"curve_error_{j + 1}": float(x) for j, x in enumerate(errors)},
            }
        )
    return pd.DataFrame(rows)
