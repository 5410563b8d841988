"""Whether halves of the recordings agree on what shooting finds, within their standard errors.

    python comparisons/halves.py comparisons/dfki_c1_shooting.toml motor_load --data FOLDER

Recordings are split into two halves in several ways, both are fitted by the suite's recipe from
where all data ended, and each parameter's difference is told in standard errors of the difference.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from script import call

from frictionid.comparison.suite import load_suite, tasks_of
from frictionid.comparison.tasks import Task
from frictionid.data.plants import plant_of
from frictionid.fitting.fit import Fit
from frictionid.fitting.one_step.recipe import training_problem
from frictionid.fitting.shooting import Shooting, refine

ERRORS = 2.0  # standard errors within which two halves agree


def chosen(file: Path, identifier: str, data: Path | None) -> tuple[Task, Shooting]:
    """The suite's task of an identifier with a recipe of shooting."""
    for task in tasks_of(load_suite(file), file, data):
        if task.name == identifier and isinstance(task.recipe, Shooting):
            return task, task.recipe
    raise SystemExit(f"{file}: no identifier {identifier!r} by shooting")


def fitted(task: Task, recipe: Shooting, which: Sequence[int], begin: Fit | None) -> Fit:
    """Fit to some recordings, from where another ended or else from the one-step fit."""
    dataset, protocol = task.benchmark.dataset, task.benchmark.protocol
    dataset = replace(dataset, recordings=tuple(dataset.recordings[i] for i in which))
    apart = protocol.sample_time
    if begin is not None:
        return refine(begin.friction, dataset, recipe.blocks, recipe.settings, sample_time=apart)
    told = dataset, plant_of(dataset), recipe.start, apart, protocol.history
    problem = training_problem(*told)
    friction = task.identifier.fit(problem, np.ones((1, len(problem.r))), task.seed)[0]
    return refine(friction, dataset, recipe.blocks, recipe.settings, sample_time=apart)


def splits_of(
    count: int, most: int, seed: int
) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Ways to split so many recordings into halves, each once, in an order drawn by the seed."""
    half = list(itertools.combinations(range(count), count // 2))
    if count % 2 == 0:
        half = half[: len(half) // 2]  # the rest are the same with the halves swapped
    for k in np.random.default_rng(seed).permutation(len(half))[:most]:
        yield half[k], tuple(i for i in range(count) if i not in half[k])


def main(
    suite: Path, identifier: str, *, data: Path | None = None, splits: int = 6, seed: int = 0
) -> None:
    """Print the parameters of all data, and how the halves agree."""
    task, recipe = chosen(suite, identifier, data)
    count = len(task.benchmark.dataset.recordings)
    whole = fitted(task, recipe, range(count), None)
    names = [entry.name for entry in whole.covariance.parameters]
    off = []
    for first, second in splits_of(count, splits, seed):
        one, other = (fitted(task, recipe, own, whole).covariance for own in (first, second))
        difference = (one.values - other.values) / np.hypot(one.error, other.error)
        known = np.isfinite(one.error) & np.isfinite(other.error)
        off.append(np.where(known, np.abs(difference), np.nan))
    report(whole, names, np.array(off))


def report(whole: Fit, names: Sequence[str], off: np.ndarray) -> None:
    """Tables: each parameter with its differences (splits, D), and the share that agrees."""
    console, table = Console(width=120), Table()
    for head in (
        "parameter",
        "value",
        "standard error",
        *(f"split {k + 1}" for k in range(len(off))),
    ):
        table.add_column(head, justify="left" if head == "parameter" else "right")
    covariance = whole.covariance
    for name, value, error, each in zip(
        names, covariance.values, covariance.error, off.T, strict=True
    ):
        words = ["–" if np.isnan(z) else f"{z:.1f}" for z in each]
        table.add_row(name, f"{value:.4g}", f"{error:.2g}", *words)
    console.print(table)
    known = off[np.isfinite(off)]
    console.print(
        f"Differences in standard errors; – where a half does not know the parameter. Within "
        f"{ERRORS:g} standard errors: {np.mean(known <= ERRORS):.0%} of {len(known)}."
    )


if __name__ == "__main__":
    call(main)
