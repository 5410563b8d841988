"""Tasks of a comparison, run side by side, each result one file written as a whole.

A result file carries the digest of all that it depends on (data, folds, settings, versions), so
that an interrupted comparison is finished by running what is missing.
"""

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from joblib import cpu_count

from frictionid.errors import InputError, NoFitError, located, needs
from frictionid.evaluation import HorizonErrors
from frictionid.files import sha256
from frictionid.fitting.fit import own_base
from frictionid.fitting.identifier import Identifier
from frictionid.friction import Law
from frictionid.friction.model_files import model_document
from frictionid.mechanics import Mechanism

from .cross_validate import Benchmark, PreparedBenchmark, Result, prepare_benchmark, run
from .processes import package_digest, side_by_side
from .result_folder import finished, write_sealed
from .training_set import Method

FORMAT = 1  # of the result files
_DIGITS = 7

Outcome = Result | NoFitError  # of a task


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
        b = self.benchmark
        data = [
            (d.name, mechanism_digest(d.mechanism), d.recordings, d.truth)
            for d in (b.dataset, *b.tests)
        ]
        code = FORMAT, package_digest(), version("numpy"), foreign_source(self.identifier)
        settings = self.identifier, self.recipe, b.protocol, self.seed
        return digest_of((data, b.folds.hash, settings, code))


def mechanism_digest(mechanism: Mechanism) -> str:
    """SHA-256 of a mechanism: of its table, and of its equations of motion at one state.

    The table says too little where a file or a function of one's own makes the equations; where a
    file lies does not count.

    >>> from frictionid.mechanics import pendulum
    >>> mechanism_digest(pendulum(mass=1.0)) == mechanism_digest(pendulum(mass=1.1))
    False
    """
    table = {k: Path(v).name if k in ("urdf", "mjcf") else v for k, v in mechanism.table.items()}
    joints = np.arange(1.0, mechanism.n + 1)
    p = np.asarray(mechanism.base(mechanism.defaults))
    M, h = mechanism.dynamics(p, 0.3 * joints, 0.7 * joints)
    return digest_of((table, [f"{number:.9g}" for number in (*p, *M.ravel(), *h)]))


def file_name(dataset: str, identifier: str, recipe: str, seed: int) -> str:
    """Name of the file that belongs to a task.

    >>> file_name("my rig", "stribeck", "integral", 0)
    'my-rig--stribeck--integral--seed0.json'
    """
    parts = dataset, identifier, recipe, f"seed{seed}"
    return "--".join(re.sub(r"[^A-Za-z0-9_.+-]+", "-", part) for part in parts) + ".json"


def prepare_benchmarks(
    tasks: Sequence[Task], jobs: int = 1, kept: Sequence[Path] = ()
) -> dict[str, PreparedBenchmark]:
    """What the tasks of each data set share, by its name.

    jobs : number of folds that are calibrated side by side, 0 for one per core
    kept : folders with earlier results, as in `run_tasks`: what they have needs no calibration
    """
    benchmarks = {task.benchmark.dataset.name: task.benchmark for task in tasks}
    recipes: dict[str, dict[str, Method]] = {name: {} for name in benchmarks}
    for task in tasks:
        if task.recipe.calibrated is None or not _earlier(task, kept):
            recipes[task.benchmark.dataset.name][task.recipe.name] = task.recipe
    return {
        name: prepare_benchmark(benchmark, list(recipes[name].values()), jobs or cpu_count())
        for name, benchmark in benchmarks.items()
    }


def run_tasks(
    tasks: Sequence[Task],
    prepared_benchmarks: Mapping[str, PreparedBenchmark],
    folder: Path,
    *,
    jobs: int = 0,
    dask: str | None = None,
    kept: Sequence[Path] = (),
    done: Callable[[Task], None] = lambda _: None,
) -> None:
    """Run the tasks, `jobs` at a time on one thread each, and write their results to the folder.

    A model that cannot be fitted leaves a file that says why.

    jobs, dask : see `results_of`
    kept : folders with earlier results: those of the same digest, and unchanged, count
    done : called with each task that is finished

    Raises
    ------
    InputError
        Where data or settings are wrong, with the task's name, or no model can be fitted to one of
        the data sets.
    """
    left, reasons = [], dict[str, list[str]]()
    for task in tasks:
        if _earlier(task, kept):
            done(task)
        else:
            left.append(task)
    for task, result in results_of(left, prepared_benchmarks, jobs=jobs, dask=dask):
        content = {"digest": task.digest, **content_of(task, result)}
        write_sealed(folder / task.file, content)
        if isinstance(result, NoFitError):
            reasons.setdefault(task.benchmark.dataset.name, []).append(str(result))
        done(task)
    for name, texts in reasons.items():
        on_data = (task for task in tasks if task.benchmark.dataset.name == name)
        documents = (document for task in on_data for document in _earlier(task, (folder, *kept)))
        if all("not_fitted" in document for document in documents):
            raise InputError("; ".join(dict.fromkeys(texts)))


def _earlier(task: Task, places: Sequence[Path]) -> list[dict[str, Any]]:
    """Documents of the task in some folders, of the same digest, and unchanged."""
    documents = (finished(place / task.file, task.digest) for place in places)
    return [document for document in documents if document]


def results_of(
    tasks: Sequence[Task],
    prepared_benchmarks: Mapping[str, PreparedBenchmark],
    *,
    jobs: int = 0,
    dask: str | None = None,
) -> Iterator[tuple[Task, Outcome]]:
    """Results of the tasks as they are finished, `jobs` at a time on one thread each.

    In place of the result of a model that cannot be fitted there is the error that says why.

    Those that take longest begin first, so that all processes end together.

    jobs : 0 for one per core
    dask : address of the scheduler of a cluster, whose workers run the tasks in place of these
    """
    groups = sorted(_alike(tasks), key=lambda group: _effort(group[0]), reverse=True)
    # tasks of one benchmark share its data, which travel once
    shared = {
        id(task.benchmark): (task.benchmark, prepared_benchmarks[task.benchmark.dataset.name])
        for task in tasks
    }
    calls = [(shared[id(task.benchmark)], *task[1:]) for task, *_ in groups]
    if dask is None or not calls:
        results = side_by_side(_run, calls, jobs or cpu_count())
    else:
        with needs("dask"):
            from .cluster import on_cluster
        results = on_cluster(_run, calls, dask)
    for i, result in results:
        for task in groups[i]:
            yield task, result


def _alike(tasks: Sequence[Task]) -> list[list[Task]]:
    """Tasks in groups of one result.

    No recipe and no seed changes friction that is fixed, no seed the fit of an identifier that
    draws no random numbers.
    """
    groups: dict[Any, list[Task]] = {}
    for task in tasks:
        fixed = task.identifier.fixed
        key: Any = task.file
        if fixed or not task.identifier.seeded:
            key = (id(task.benchmark), id(task.identifier), None if fixed else task.recipe.name)
        groups.setdefault(key, []).append(task)
    return list(groups.values())


def _effort(task: Task) -> tuple[bool, bool, int]:
    """How long a task takes, to be compared: whether it fits, whether it shoots, and its weights.

    Weights are those of a network; what is no network is fitted and scored sooner.
    """
    law: Law | None = getattr(task.identifier, "law", None)
    weights = len(law.names) if law is not None and law.is_network else 0
    shoots = task.recipe.scheme == "shooting"
    return not task.identifier.fixed, shoots, weights


def _run(data: tuple[Benchmark, PreparedBenchmark], *settings: Any) -> Outcome:
    """Result of the task of these settings on a benchmark."""
    benchmark, shared = data
    task = Task(benchmark, *settings)
    try:
        with located(f"{task.benchmark.dataset.name}, {task.name} by {task.recipe.name}"):
            return run(task.benchmark, task.identifier, task.recipe, task.seed, shared)
    except NoFitError as error:
        return error


def content_of(task: Task, result: Outcome) -> dict[str, Any]:
    """All of a result that tables and figures need, as a JSON document."""
    if isinstance(result, NoFitError):
        return {"not_fitted": str(result)}
    dataset = task.benchmark.dataset
    frames = {dataset.name: result.scores, **result.tests}
    rows = {name: [list(row) for row in f.itertuples(index=False)] for name, f in frames.items()}
    refined = result.refined and result.refined.estimates(dataset, result.grid)
    return {
        "dataset": dataset.name,
        "identifier": task.name,
        "fit": task.recipe.name,
        "seed": task.seed,
        "settings": {"identifier": repr(task.identifier), "recipe": repr(task.recipe)},
        "method": {"scheme": task.recipe.scheme, "corrects": list(task.recipe.corrects)},
        "rows": rows,
        "model": model_document(result.overall),
        "base": own_base(dataset, result.overall.parameters),
        "folds": {"theta": result.friction.theta, "shape": list(result.friction.theta.shape)},
        "curves": result.curves,
        "motions": list(result.motions),
        "seconds": dict(result.seconds),
        "refined": refined and refined.document(),
        "beyond": result.beyond and result.beyond._asdict(),
        "loops": [loop._asdict() for loop in result.loops],
        "errors": result.errors and _rounded(result.errors),
        "torque": result.torque,
    }


def _rounded(errors: HorizonErrors) -> dict[str, Any]:
    """Errors of predictions as a document; what is far counts 1, digits far below it nothing."""
    rounded = {name: getattr(errors, name).round(_DIGITS) for name in ("error", "torque")}
    return {**errors._asdict(), **rounded}


# --- Digests: equal for equal data, settings and code


def digest_of(value: Any) -> str:
    """SHA-256 of a value made of arrays, mappings, sequences, numbers, texts and dataclasses.

    >>> digest_of({"a": 1, "b": np.zeros(2)}) == digest_of({"b": np.zeros(2), "a": 1})
    True
    """
    return sha256(b"".join(_parts(value)))


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


def foreign_source(part: Any) -> bytes:
    """Source of an identifier, and of its law, from outside this package."""
    name = type(part).__module__
    place = getattr(sys.modules.get(name), "__file__", None)
    foreign = place is not None and name.partition(".")[0] not in ("frictionid", "builtins")
    source = Path(place).read_bytes() if foreign and place else b""
    inner = (getattr(part, f.name) for f in fields(part)) if is_dataclass(part) else ()
    return source + b"".join(foreign_source(value) for value in inner if is_dataclass(value))
