"""Tasks of a comparison, run side by side, each result one file written as a whole.

A result file carries the digest of all that it depends on (data, folds, settings, versions), so
that an interrupted comparison is finished by running what is missing.
"""

from __future__ import annotations

import hashlib
import os
import re
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.metadata import version
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from filelock import FileLock, Timeout
from joblib import Parallel, cpu_count, delayed, parallel_config
from threadpoolctl import threadpool_limits

from frictionid.comparison.cross_validate import (
    Benchmark,
    Method,
    PreparedBenchmark,
    Result,
    first_step,
    prepare_benchmark,
    run,
)
from frictionid.errors import InputError
from frictionid.files import read_json, remove_unfinished, write_json
from frictionid.friction.model_files import model_document
from frictionid.identifiers import Identifier
from frictionid.shooting import CalibratedRecipe, Shooting, document_of

FORMAT = 1  # of the result files
Found = TypeVar("Found")


class Task(NamedTuple):
    """One identifier by one recipe on one data set with one seed; `name` stands in all tables."""

    benchmark: Benchmark
    name: str
    identifier: Identifier
    recipe: Method
    seed: int

    @property
    def file(self) -> str:
        """Name of the result file."""
        return file_name(self.benchmark.dataset.name, self.name, self.recipe.name, self.seed)

    @property
    def digest(self) -> str:
        """SHA-256 of everything that the result depends on."""
        c = self.benchmark
        data = [(d.name, d.mechanism, d.recordings, d.truth) for d in (c.dataset, *c.tests)]
        made_by = FORMAT, _package(), version("numpy"), _own_code(self.identifier)
        settings = self.identifier, self.recipe, c.protocol, self.seed
        digest = hashlib.sha256()
        for part in _parts((data, c.folds.hash, settings, made_by)):
            digest.update(part)
        return digest.hexdigest()


def file_name(dataset: str, identifier: str, recipe: str, seed: int) -> str:
    """Name of the file that belongs to a task.

    >>> file_name("my rig", "stribeck", "integral", 0)
    'my-rig--stribeck--integral--seed0.json'
    """
    parts = dataset, identifier, recipe, f"seed{seed}"
    return "--".join(re.sub(r"[^A-Za-z0-9_.+-]+", "-", part) for part in parts) + ".json"


def _parts(value: Any) -> Iterator[bytes]:
    """Bytes that are equal for equal values, in this process and the next."""
    if isinstance(value, np.ndarray):
        yield f"array {value.dtype.str} {value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, Mapping):
        yield f"map {len(value)}".encode()
        for key in sorted(value, key=repr):
            yield from _parts((key, value[key]))
    elif isinstance(value, list | tuple):
        yield f"list {len(value)}".encode()
        for entry in value:
            yield from _parts(entry)
    elif value is None or isinstance(value, str | bytes | bool | int | float | np.generic):
        yield f"{type(value).__name__} {value!r};".encode()
    else:
        kind = type(value) if not hasattr(value, "__qualname__") else value
        yield f"{kind.__module__}.{kind.__qualname__}".encode()
        names = (
            [f.name for f in fields(value)]
            if is_dataclass(value)
            else getattr(value, "__dict__", ())
        )
        yield from _parts({} if kind is value else {name: getattr(value, name) for name in names})


@cache
def _package() -> str:
    """SHA-256 of this package's sources: another version may find other numbers."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _own_code(part: Any) -> bytes:
    """Source of an identifier, and of its law, from outside this package: results depend on it."""
    name = type(part).__module__
    place = getattr(sys.modules.get(name), "__file__", None)
    foreign = place is not None and name.partition(".")[0] not in ("frictionid", "builtins")
    own = Path(place).read_bytes() if foreign and place else b""
    inner = (getattr(part, f.name) for f in fields(part)) if is_dataclass(part) else ()
    return own + b"".join(_own_code(value) for value in inner if is_dataclass(value))


def lock(
    folder: Path, file: str = "provenance.json", what: str = "comparison"
) -> AbstractContextManager[Any]:
    """A lock that keeps a second comparison out of the folder; what it holds is known by a file.

    Raises
    ------
    InputError
        Where another process holds it, or the folder holds other things or cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        found = [path.name for path in folder.glob("[!.]*")]
        if found and file not in found:
            other = min(found)
            raise InputError(f"{folder}: holds no {what} but {other!r}: choose another --out")
        held = FileLock(folder / ".lock", timeout=0)
        held.acquire()
    except Timeout:
        raise InputError(
            f"{folder}: another {what} is writing there: wait for it, or choose another --out"
        ) from None
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}): choose another --out"
        ) from None
    return held


def prepare_benchmarks(tasks: Sequence[Task]) -> dict[str, PreparedBenchmark]:
    """What the tasks of each data set share, by its name.

    Raises
    ------
    InputError
        Where recordings, folds and protocol do not fit together.
    """
    benchmarks = {task.benchmark.dataset.name: task.benchmark for task in tasks}
    recipes: dict[str, dict[str, Method]] = {name: {} for name in benchmarks}
    for task in tasks:
        recipes[task.benchmark.dataset.name][task.recipe.name] = task.recipe
    return {
        name: prepare_benchmark(benchmarks[name], list(own.values()))
        for name, own in recipes.items()
    }


def run_tasks(
    tasks: Sequence[Task],
    prepared_benchmarks: Mapping[str, PreparedBenchmark],
    folder: Path,
    laws: Mapping[str, type],
    *,
    jobs: int = 0,
    resume: bool = False,
    done: Callable[[Task], None] | None = None,
) -> None:
    """Run the tasks, `jobs` at a time on one thread each, and write their results to the folder.

    jobs : 0 for one per core
    resume : results of the same digest stay; otherwise all are made anew
    done : called with each task that is finished

    Results of tasks that are no part of this comparison are removed.

    Raises
    ------
    InputError
        Where a task fails, with its name.
    """
    _clear(tasks, folder, resume)
    tell = done or _nobody
    missing = []
    for task in tasks:
        if _finished(task, folder / task.file):
            tell(task)
        else:
            missing.append(task)
    groups = _alike(missing)
    for i, result in _results(
        [group[0] for group in groups], prepared_benchmarks, jobs or cpu_count()
    ):
        for task in groups[i]:
            write_json(folder / task.file, document(task, result, laws), None)
            tell(task)


def _nobody(_: Task) -> None:
    """Nobody to tell."""


def _clear(tasks: Sequence[Task], folder: Path, resume: bool) -> None:
    remove_unfinished(folder)
    wanted = {task.file for task in tasks} if resume else set()
    for path in folder.glob("*.json"):
        if path.name not in wanted:
            path.unlink()


def _finished(task: Task, path: Path) -> bool:
    try:
        return bool(read_json(path).get("digest") == task.digest)
    except InputError:
        return False


def _alike(tasks: Sequence[Task]) -> list[list[Task]]:
    """Tasks in groups of one result: no recipe and no seed changes numbers that are given.

    Nor does a seed change what is found by an identifier that draws nothing.
    """
    groups: dict[Any, list[Task]] = {}
    for task in tasks:
        fixed = task.identifier.fixed
        key: Any = task.file
        if fixed or not task.identifier.seeded:
            key = (id(task.benchmark), id(task.identifier), None if fixed else task.recipe.name)
        groups.setdefault(key, []).append(task)
    return list(groups.values())


def _results(
    tasks: Sequence[Task], prepared_benchmarks: Mapping[str, PreparedBenchmark], jobs: int
) -> Iterator[tuple[int, Result]]:
    """Numbers of the tasks and their results, as they are finished."""
    return side_by_side(
        _ran, [(t, prepared_benchmarks[t.benchmark.dataset.name]) for t in tasks], jobs
    )


def _ran(task: Task, shared: PreparedBenchmark) -> Result:
    try:
        return run(task.benchmark, task.identifier, task.recipe, task.seed, shared)
    except InputError as error:
        where = f"{task.benchmark.dataset.name}, {task.name} by {task.recipe.name}"
        raise InputError(f"{where}: {error}") from None


def side_by_side(
    work: Callable[..., Found], calls: Sequence[tuple[Any, ...]], jobs: int
) -> Iterator[tuple[int, Found]]:
    """Number of each call of a function and what it gives, as they are finished.

    Each computes on one thread, in one of at most `jobs` processes.
    """
    workers = min(jobs, len(calls))
    if workers < 2:
        with threadpool_limits(1):
            _one_torch_thread()
            yield from ((i, work(*call)) for i, call in enumerate(calls))
        return
    # who interrupts a comparison knows that tasks were cancelled
    warnings.filterwarnings("ignore", r"\d+ tasks .*(not used|cancelled)", UserWarning)
    with parallel_config(backend="loky", inner_max_num_threads=1):
        # max_nbytes: arrays travel with their task, no files are left behind in shared memory
        parallel = Parallel(workers, return_as="generator_unordered", batch_size=1, max_nbytes=None)
        with _blocked(signal.SIGINT):
            results = parallel(
                delayed(_in_worker)(os.getpid(), i, work, call) for i, call in enumerate(calls)
            )
        yield from results


@contextmanager
def _blocked(number: signal.Signals) -> Iterator[None]:
    """Put a signal off. Processes started meanwhile never see it: Ctrl-C is the parent's affair."""
    resource_tracker.ensure_running()  # Python's own start of it would let the signal in
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [number])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _in_worker(
    parent: int, index: int, work: Callable[..., Found], call: tuple[Any, ...]
) -> tuple[int, Found]:
    _end_with(parent)
    _one_torch_thread()
    return index, work(*call)


def _end_with(parent: int) -> None:
    """End this worker when the comparison ends: one that was killed cannot tell its workers."""
    if all(thread.name != "end-with-parent" for thread in threading.enumerate()):
        threading.Thread(target=_watch, args=(parent,), name="end-with-parent", daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.3)
    os._exit(1)


def _one_torch_thread() -> None:
    torch = sys.modules.get("torch")
    if torch is not None:
        torch.set_num_threads(1)


def _way(recipe: Method) -> dict[str, Any]:
    """The kind of a recipe: its scheme, and what of a calibration corrects its data."""
    if isinstance(recipe, Shooting):
        return {"scheme": "shooting", "corrects": []}
    corrects = list(recipe.use) if isinstance(recipe, CalibratedRecipe) else []
    return {"scheme": first_step(recipe).scheme, "corrects": corrects}


def document(task: Task, result: Result, laws: Mapping[str, type]) -> dict[str, Any]:
    """JSON document of a result, all that tables and figures need."""
    dataset = task.benchmark.dataset
    frames = {dataset.name: result.scores, **result.tests}
    rows = {name: [list(row) for row in f.itertuples(index=False)] for name, f in frames.items()}
    return {
        "digest": task.digest,
        "dataset": dataset.name,
        "identifier": task.name,
        "fit": task.recipe.name,
        "seed": task.seed,
        "settings": {"identifier": repr(task.identifier), "recipe": repr(task.recipe)},
        "way": _way(task.recipe),
        "rows": rows,
        "model": model_document(result.overall, laws),
        "folds": {"theta": result.friction.theta, "shape": list(result.friction.theta.shape)},
        "curves": result.curves,
        "motions": list(result.motions),
        "seconds": dict(result.seconds),
        "refined": result.refined and document_of(result.refined, dataset, result.grid),
        "members": result.members,
        "loops": [loop.document() for loop in result.loops],
    }
