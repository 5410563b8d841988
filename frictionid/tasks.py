"""Tasks of a comparison, run side by side, each result one file written as a whole.

A result file carries the digest of all that it depends on (versions of this package's format, data,
folds, settings), so that an interrupted comparison is finished by running what is missing.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

from filelock import FileLock, Timeout
from joblib import Parallel, delayed, parallel_config
from threadpoolctl import threadpool_limits

from frictionid.compare import Contest, Result, run
from frictionid.errors import InputError
from frictionid.identifiers import Identifier
from frictionid.recipe import Recipe
from frictionid.store import model_document, read_json, write_json


class Task(NamedTuple):
    """One identifier by one recipe on one data set with one seed; `name` stands in all tables."""

    contest: Contest
    name: str
    identifier: Identifier
    recipe: Recipe
    seed: int

    @property
    def file(self) -> str:
        """Name of the result file."""
        parts = (self.contest.dataset.name, self.name, self.recipe.name, f"seed{self.seed}")
        return "--".join(re.sub(r"[^A-Za-z0-9_.+-]+", "-", p) for p in parts) + ".json"

    @property
    def digest(self) -> str:
        """SHA-256 of everything that the result depends on."""
        c = self.contest
        data = [
            (d.name, dict(d.mechanism), dict(d.hashes), [dict(r.parameters) for r in d.recordings])
            for d in (c.dataset, *c.tests)
        ]
        settings = (repr(self.identifier), repr(self.recipe), repr(c.protocol), self.seed)
        text = json.dumps([data, c.folds.hash, settings], sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()


def lock(folder: Path) -> AbstractContextManager[Any]:
    """A lock that keeps a second comparison out of the folder.

    Raises
    ------
    InputError
        Where another process holds it, or the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held = FileLock(folder / ".lock", timeout=0)
        held.acquire()
    except Timeout:
        raise InputError(
            f"{folder}: another comparison is writing there: wait for it, or choose another --out"
        ) from None
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}): choose another --out"
        ) from None
    return held


def run_tasks(
    tasks: Sequence[Task],
    folder: Path,
    laws: Mapping[str, type],
    *,
    jobs: int = 1,
    resume: bool = False,
    done: Callable[[Task], None] = lambda task: None,
) -> None:
    """Run the tasks, `jobs` at a time on one thread each, and write their results to the folder.

    With `resume`, results of the same digest stay; otherwise all are made anew. Results of tasks that
    are no part of this comparison are removed. `done` is called after each task.
    """
    wanted = {task.file for task in tasks}
    for path in folder.glob("*.json") if folder.is_dir() else ():
        if path.name not in wanted or not resume:
            path.unlink()
    missing = []
    for task in tasks:
        if _finished(task, folder / task.file):
            done(task)
        else:
            missing.append(task)
    if jobs == 1 or len(missing) < 2:
        with threadpool_limits(1):
            for task in missing:
                write_json(folder / task.file, document(task, run_task(task), laws), None)
                done(task)
        return
    with parallel_config(backend="loky", inner_max_num_threads=1):
        parallel = Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)
        calls = (delayed(_numbered)(i, task) for i, task in enumerate(missing))
        for i, result in parallel(calls):
            task = missing[i]
            write_json(folder / task.file, document(task, result, laws), None)
            done(task)


def _finished(task: Task, path: Path) -> bool:
    try:
        return bool(read_json(path).get("digest") == task.digest)
    except InputError:
        return False


def run_task(task: Task) -> Result:
    """Result of one task."""
    return run(task.contest, task.identifier, task.recipe, task.seed)


def _numbered(index: int, task: Task) -> tuple[int, Result]:
    _one_torch_thread()
    return index, run_task(task)


def _one_torch_thread() -> None:
    import sys

    torch = sys.modules.get("torch")
    if torch is not None:
        torch.set_num_threads(1)


def document(task: Task, result: Result, laws: Mapping[str, type]) -> dict[str, Any]:
    """JSON document of a result, all that tables and figures need."""
    dataset = task.contest.dataset
    rows = {dataset.name: [list(row) for row in result.rows]}
    rows |= {name: [list(row) for row in test] for name, test in result.tests.items()}
    return {
        "digest": task.digest,
        "dataset": dataset.name,
        "identifier": task.name,
        "fit": task.recipe.name,
        "seed": task.seed,
        "settings": {"identifier": repr(task.identifier), "recipe": repr(task.recipe)},
        "rows": rows,
        "model": model_document(result.overall, laws),
        "folds": {"theta": result.friction.theta, "shape": list(result.friction.theta.shape)},
        "curves": result.curves,
        "motions": list(result.motions),
        "seconds": dict(result.seconds),
    }
