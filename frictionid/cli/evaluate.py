"""frictionid evaluate: score model files on a data set."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictionid.cli.options import Json, Replace, Trust
from frictionid.cli.paths import ModelsAndDataset

if TYPE_CHECKING:
    import pandas as pd

    from frictionid.data.recordings import Dataset
    from frictionid.evaluation import Prepared
    from frictionid.friction import Friction


def evaluate(
    files: ModelsAndDataset,
    out: Annotated[Path, typer.Option(help="Table of scores to write (CSV).")],
    horizons: Annotated[
        str, typer.Option(help="Rollout horizons in seconds, with commas.")
    ] = "0.1,0.25,0.5,1.0",
    data: Annotated[Path | None, typer.Option(help="Folder with the tables.")] = None,
    sample_time: Annotated[
        float | None, typer.Option(help="Use samples at least this far apart [s].")
    ] = None,
    law: Annotated[
        list[str] | None,
        typer.Option(help="Class of a law that is not built in, module:Class; repeatable."),
    ] = None,
    whole: Annotated[
        bool, typer.Option(help="Also simulate whole recordings from their start.")
    ] = False,
    initial_states: Annotated[
        str,
        typer.Option(help="Estimator of the states that rollouts start from: filter, or model."),
    ] = "filter",
    json: Json = False,
    replace: Replace = False,
    trust: Trust = False,
) -> None:
    """Score fitted models on all recordings of a data set, one step ahead and over seconds."""
    from frictionid.comparison.registry import friction_of
    from frictionid.comparison.results import model_scores
    from frictionid.data.readers.dataset import dataset_files, load_dataset
    from frictionid.errors import InputError
    from frictionid.evaluation import Protocol, prepare
    from frictionid.files import write_text
    from frictionid.friction.model_files import model_paths
    from frictionid.outputs import check_outputs
    from frictionid.report import show_scores

    if len(files) < 2:
        raise InputError("evaluate needs at least one model file and, last, a data set")
    *models, place = files
    read = [path for model in models for path in model_paths(model)]
    check_outputs([out], [*read, *dataset_files(place, data)], replace=replace)
    frictions = {path: friction_of(path, law or ()) for path in models}
    protocol = Protocol(
        horizons=_seconds(horizons),
        sample_time=sample_time,
        whole=whole,
        initial_states=initial_states,
    )
    dataset = load_dataset(place, data, trust=trust)
    named = dict(zip(_names(models), models, strict=True))
    scores = _scores(named, frictions, prepare(dataset, protocol))
    table = model_scores(dataset.name, scores)
    write_text(out, table.to_csv(index=False, float_format="%.9g"))
    if json:
        print(table.to_json(orient="records", indent=1))
        return
    show_scores(table)
    print(_STATES[initial_states])
    for name, path in named.items():
        for line in _training(name, frictions[path], dataset):
            print(line)
    print(f"written to {out}")


def _scores(
    models: Mapping[str, Path], frictions: Mapping[Path, Friction], prepared: Prepared
) -> dict[str, pd.DataFrame]:
    """Scores of each model under its name in the table."""
    from frictionid.cli.progress import counted
    from frictionid.errors import InputError
    from frictionid.evaluation import prepared_for, score_model

    scores = {}
    with counted(len(models), f"evaluating ({prepared.dataset.name})") as done:
        for name, path in models.items():
            friction = frictions[path]
            try:
                scores[name] = score_model(friction, prepared_for(prepared, friction)).scores
            except InputError as error:
                raise InputError(f"{path}: {error}") from None
            done(name)
    return scores


_STATES = {
    "filter": "Rollouts start from states of a kinematic filter, the same for all models.",
    "model": "Rollouts start from states that each model estimates from the samples before.",
}


def _training(name: str, friction: Friction, dataset: Dataset) -> Iterator[str]:
    """A sentence where the model was fitted to tables of the data set."""
    hashes = friction.provenance.get("data")
    fitted = set(hashes.values()) if isinstance(hashes, Mapping) else set()
    shared = [file for file, own in dataset.hashes.items() if own in fitted]
    if shared:
        yield (
            f"{name} was fitted to {len(shared)} of the {len(dataset.hashes)} tables of "
            f"{dataset.name!r}: its scores are of training data, not of held-out recordings"
        )


def _names(models: list[Path]) -> list[str]:
    """Name of each model in the table: that of its file, or its path where two have one name."""
    stems = [path.stem for path in models]
    names = [s if stems.count(s) == 1 else str(p) for s, p in zip(stems, models, strict=True)]
    if len(set(names)) < len(names):
        from frictionid.errors import InputError

        raise InputError("evaluate: one of the model files is named twice")
    return names


def _seconds(text: str) -> tuple[float, ...]:
    from frictionid.errors import InputError

    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            f"--horizons {text!r} must be positive seconds with commas, e.g. 0.25,0.5"
        ) from None
