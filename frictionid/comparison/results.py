"""The result folder of a comparison: its tables are a reduction of the tasks' files.

tasks/*.json      one file for each task with the hash of its content, all that is needed below
datasets.json     velocities, true curves and parameters, and origin of the data sets
provenance.json   versions, hashes of data and folds, settings
scores.csv        all scores, one per line
timings.csv       seconds of each task (no part of reproducibility)
models/*.json     friction fitted to all data by each task
verdict.json      which model the evidence supports, and the answer to each question
index.html, summary.md, tables/, figures/   for people, see frictionid.report
SHA256SUMS        of the files from scores.csv on: those that are unchanged are made anew
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.check import check
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import (
    SCORE_COLUMNS,
    Prepared,
    score_frame,
    steady_state,
    true_friction,
)
from frictionid.evaluation.curves import slow_speed
from frictionid.files import csv_text, json_text
from frictionid.fitting.fit import recordings_own
from frictionid.friction.coordinates import of_parts, turns_of
from frictionid.friction.provenance import Provenance, read_provenance

from .cross_validate import PreparedBenchmark
from .processes import versions
from .result_folder import DATASETS, PROVENANCE, Document, place_of, read_sealed, write_sealed
from .tasks import Outcome, Task, content_of, file_name

COLUMNS = ("suite", "dataset", "identifier", "fit", *SCORE_COLUMNS, "seed")  # of scores.csv
_LEVELS = (0.25, 0.5, 0.75, 0.9, 0.95, 1.0)
_SHOWN = 1200  # velocities in a scatter, about


def describe(
    folder: Path,
    suite: str,
    title: str,
    settings: Any,
    tasks: Sequence[Task],
    prepared_benchmarks: Mapping[str, PreparedBenchmark],
) -> None:
    """Write provenance.json and datasets.json."""
    provenance = provenance_of(suite, title, settings, tasks)
    write_sealed(folder / PROVENANCE, provenance, indent=1)
    write_sealed(folder / DATASETS, descriptions_of(prepared_benchmarks))


def provenance_of(suite: str, title: str, settings: Any, tasks: Sequence[Task]) -> dict[str, Any]:
    """Document of provenance.json: versions, hashes of data and folds, settings."""
    benchmarks = {t.benchmark.dataset.name: t.benchmark for t in tasks}
    everything = {d.name: d for c in benchmarks.values() for d in (c.dataset, *c.tests)}
    return {
        "suite": suite,
        "title": title,
        "settings": settings,
        "tasks": [task.file for task in tasks],
        "versions": versions(),
        "data": {name: dict(d.hashes) for name, d in everything.items()},
        "origin": {name: dict(d.origin) for name, d in everything.items()},
        "folds": {name: benchmark.folds.hash for name, benchmark in benchmarks.items()},
    }


def descriptions_of(prepared_benchmarks: Mapping[str, PreparedBenchmark]) -> dict[str, Any]:
    """Document of datasets.json: a description of each data set."""
    about = {}
    for name, shared in prepared_benchmarks.items():
        about[name] = {**_about(shared.prepared), "tests": None}
        about |= {p.dataset.name: {**_about(p), "tests": name} for p in shared.tests}
    return about


def _about(prepared: Prepared) -> dict[str, Any]:
    dataset, grid, w = prepared.dataset, prepared.grid, prepared.speeds
    mechanism = dataset.mechanism
    truth = None if dataset.truth is None else steady_state(dataset.truth).curve(grid)
    density = [np.histogram(w[:, j], 60, (grid[0, j], grid[-1, j]))[0] for j in range(w.shape[1])]
    return {
        "mechanism": mechanism.table,
        "own_base": recordings_own(dataset),
        "joints": list(mechanism.friction_names),
        "torque_units": list(mechanism.friction_torque_units),
        "position_units": list(mechanism.friction_units),
        "recordings": len(dataset.recordings),
        "samples": sum(len(r.angle.time) for r in dataset.recordings),
        "seconds": dataset.seconds,
        "velocity": grid,
        "measured": [w.min(axis=0), w.max(axis=0)],
        "truth": truth,
        "true_parameters": None if dataset.truth is None else _true_parameters(dataset),
        "density": density,
        "velocities": w[:: max(len(w) // _SHOWN, 1)].round(4),
        "speeds": _speeds(prepared, w),
        "check": _checked(dataset),
    }


def _checked(dataset: Dataset) -> dict[str, Any] | None:
    """Verdict of `check` on a data set: level and findings; None where it cannot be checked."""
    try:
        verdict = check(dataset)
    except InputError:
        return None
    findings = [{"level": f.level, "text": f.text, "remedy": f.remedy} for f in verdict.findings]
    return {"level": verdict.level, "findings": findings, "next": list(verdict.next)}


def _speeds(prepared: Prepared, w: Array) -> dict[str, Any]:
    """How fast each joint is: levels that shares of its samples stay below, rest, reversals."""
    turns = turns_of(prepared.dataset.mechanism, w)
    each = [of_parts(s.w, turns) for s in prepared.smoothed]
    seconds = sum(float(s.time[-1] - s.time[0]) for s in prepared.smoothed)
    slow = slow_speed(np.quantile(np.abs(w), 0.95, axis=0))
    joints = [
        {
            "speeds": np.quantile(np.abs(w[:, j]), _LEVELS),
            "rest": float(np.mean(np.abs(w[:, j]) < slow[j])),
            "reversals": sum(_turns(s[:, j], slow[j]) for s in each) / seconds,
        }
        for j in range(w.shape[1])
    ]
    return {"levels": _LEVELS, "joints": joints}


def _turns(w: Array, slow: float) -> int:
    """How often a velocity (T,) reverses, not counting what happens at rest."""
    sign = np.sign(w[np.abs(w) >= slow])
    return int(np.sum(sign[1:] != sign[:-1]))


def _true_parameters(dataset: Dataset) -> dict[str, Any]:
    """What the simulation knows of each block of parameters: friction's by name, for each joint.

    Names of laws without a side have a value where both sides have the same one.
    """
    table: Any = dataset.truth
    truth = true_friction(table) or steady_state(table)
    friction: dict[str, Any] = {
        name: truth.theta[:, i].tolist() for i, name in enumerate(truth.law.names)
    }
    for name in ("coulomb", "peak"):
        sides = zip(friction[f"{name}_positive"], friction[f"{name}_negative"], strict=True)
        friction[name] = [a if a == b else None for a, b in sides]
    # without a peak its width is any
    peaks = zip(friction["peak_positive"], friction["peak_negative"], strict=True)
    friction["stribeck_velocity"] = [
        v if any(p) else None for v, p in zip(friction["stribeck_velocity"], peaks, strict=True)
    ]
    out: dict[str, Any] = {"friction": friction}
    if "rig" in table:
        calibration, mechanism = table["rig"], dataset.mechanism
        base = mechanism.base(mechanism.nominal(calibration.get("parameters", {})))
        out |= {
            "inertia": dict(zip(mechanism.base_names, base.tolist(), strict=True)),
            "delay": calibration.get("torque_delay", 0.0),
            "gain": calibration.get("torque_gain", 1.0),
            "bias": 0.0,
            "offset": 0.0,
        }
    return out


class Results(NamedTuple):
    """A loaded result folder: each file is parsed once, by `load_results`.

    Attributes
    ----------
    provenance, datasets : documents of provenance.json and datasets.json
    tasks : documents of the finished tasks, in the order of the suite
    missing : names of the files of unfinished tasks
    not_fitted : which models could not be fitted, and why, a text each
    scores : all scores, one per row; columns as in scores.csv (`COLUMNS`), the index is the
        position of the row's task in `tasks`
    """

    folder: Path
    provenance: Document
    datasets: Mapping[str, Document]
    tasks: tuple[Document, ...]
    missing: tuple[str, ...]
    not_fitted: tuple[str, ...]
    scores: pd.DataFrame


def results_in_memory(
    title: str,
    settings: Any,
    results: Sequence[tuple[Task, Outcome]],
    prepared_benchmarks: Mapping[str, PreparedBenchmark],
) -> Results:
    """Results of tasks as their folder would have them, without one.

    Raises
    ------
    InputError
        If no model could be fitted.
    """
    tasks = [task for task, _ in results]
    document = {
        "provenance": provenance_of(title, title, settings, tasks),
        "datasets": descriptions_of(prepared_benchmarks),
        "tasks": [content_of(task, result) for task, result in results],
    }
    provenance, datasets, contents = json.loads(json_text(document)).values()
    return _results(Path(), provenance, datasets, contents, ())


def load_results(folder: Path) -> Results:
    """Results of a comparison's folder, those of finished tasks if it was interrupted.

    Raises
    ------
    InputError
        If the folder holds no comparison, none of its tasks is finished, no model could be fitted,
        or a file was changed.
    """
    provenance, datasets = (read_sealed(place_of(folder, n)) for n in (PROVENANCE, DATASETS))
    paths = [place_of(folder, f"tasks/{name}") for name in provenance["tasks"]]
    documents = {path: read_sealed(path) for path in paths if path.exists()}
    if not documents:
        raise InputError(f"{folder}: holds no finished task: run frictionid compare first")
    missing = tuple(path.name for path in paths if path not in documents)
    return _results(folder, provenance, datasets, [*documents.values()], missing)


def _results(
    folder: Path,
    provenance: Document,
    datasets: Mapping[str, Document],
    documents: Sequence[Document],
    missing: tuple[str, ...],
) -> Results:
    tasks = tuple(task for task in documents if "not_fitted" not in task)
    texts = (str(task["not_fitted"]) for task in documents if "not_fitted" in task)
    why = tuple(dict.fromkeys(texts))  # several seeds may have one
    if not tasks:
        raise InputError("; ".join(why))
    table = _score_frame(provenance["suite"], tasks)
    return Results(folder, provenance, datasets, tasks, missing, why, table)


def _score_frame(suite: str, tasks: Sequence[Document]) -> pd.DataFrame:
    """Scores of all tasks, see `Results.scores`.

    Rows count numbers of friction: here `n_parameters` counts what shooting freed beside it, too.
    """
    frames = []
    for number, task in enumerate(tasks):
        refined = task_provenance(task).refined
        for dataset, rows in task["rows"].items():
            frame = score_frame(rows)
            if refined is not None:
                frame.loc[frame["score"] == "n_parameters", "value"] += refined.beside_friction
            names = suite, dataset, task["identifier"], task["fit"]
            frames.append(_long(frame, names, task["seed"]).set_axis([number] * len(frame)))
    return pd.concat(frames)


def _long(frame: pd.DataFrame, names: Sequence[str], seed: int) -> pd.DataFrame:
    """A score frame in the columns of scores.csv; `names` of suite, data set, identifier, fit."""
    labels = dict(zip(COLUMNS[:4], names, strict=True))
    return frame.assign(**labels, seed=seed)[list(COLUMNS)]


def reduction(results: Results) -> dict[str, bytes]:
    """Content of scores.csv, timings.csv and models/*.json of the finished tasks, by path."""
    keys = ["dataset", "identifier", "fit", "seed"]
    timings = pd.DataFrame(
        [
            (*(task[key] for key in keys), part, seconds)
            for task in results.tasks
            for part, seconds in task["seconds"].items()
        ],
        columns=[*keys, "part", "seconds"],
    )
    texts = {
        "scores.csv": csv_text(results.scores),
        "timings.csv": timings.to_csv(index=False, float_format="%.3f"),
    }
    for task in results.tasks:
        name = file_name(*(task[key] for key in keys))
        texts[f"models/{name}"] = json_text(model_document_of(task))
    return {name: text.encode() for name, text in texts.items()}


def model_document_of(task: Document) -> dict[str, Any]:
    """Model document of a task's document: friction of all data, and where it is from."""
    source = {key: task[key] for key in ("dataset", "identifier", "fit", "seed", "settings")}
    if task["refined"]:
        source["refined"] = task["refined"]
    model = dict(task["model"])
    return {**model, "provenance": {**model.get("provenance", {}), **source}}


def task_provenance(task: Document) -> Provenance:
    """Provenance of the model of a task's document, and what its fit estimated."""
    document = model_document_of(task)
    return read_provenance(document["provenance"], tuple(document["shape"]))


def model_scores(dataset: str, frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Scores of given models on one data set, in the columns of scores.csv; `fit` is "given"."""
    return pd.concat(
        [_long(frame, ("", dataset, name, "given"), 0) for name, frame in frames.items()],
        ignore_index=True,
    )
