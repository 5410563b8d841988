"""frictionid.evaluate and frictionid.predict: models on recordings, as frames."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import pandas as pd

from frictionid.comparison.results import model_scores
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError, located
from frictionid.evaluation import (
    Protocol,
    nominal_torque_scores,
    prepare,
    prepared_for,
    protocol_for,
    score_model,
)
from frictionid.evaluation.predicted_motion import predicted_motion
from frictionid.evaluation.score_frame import with_scores
from frictionid.friction import Friction
from frictionid.friction.provenance import tables_of
from frictionid.progress import Done, say_nothing

from .models import DatasetLike, dataset_of, friction_of, number, numbers

HORIZONS = (0.1, 0.25, 0.5, 1.0)


def evaluate(
    models: Any,
    data: DatasetLike,
    horizons: Sequence[float] = HORIZONS,
    *,
    sample_time: float | None = None,
    whole: bool = False,
    initial_states: Literal["filter", "model"] = "filter",
) -> pd.DataFrame:
    """Scores of fitted models on all recordings of a data set, one step ahead and over seconds.

    Warns of models that were fitted to some of these recordings: their scores are those of training
    data.

    Parameters
    ----------
    models : Fit, Friction, path of a model file, or a mapping or list of these
        The names of a mapping stand in the table.
    data : Dataset, or path or name of one
    horizons : list of float [s], of the predictions
    sample_time : float [s], optional
        Use samples at least this far apart.
    whole : bool
        Also simulate whole recordings from their start.
    initial_states : str
        Estimator of the states that predictions start from: "filter", the same for all models, or
        "model", each model's own.

    Returns
    -------
    DataFrame
        One line for each score, in the columns of a comparison's scores.csv.
    """
    named = {name: friction_of(model) for name, model in _named(models).items()}
    dataset = dataset_of(data)
    protocol = Protocol(
        horizons=tuple(numbers("horizons", horizons)),
        sample_time=sample_time,
        whole=whole,
        initial_states=initial_states,
    )
    table = scores_of(named, dataset, protocol)
    for sentence in training_notes(named, dataset):
        warnings.warn(sentence, UserWarning, stacklevel=2)
    return table


def _named(models: Any) -> dict[str, Any]:
    """Models by their names: those of a mapping, of files, or of laws."""
    if isinstance(models, Mapping):
        return {str(name): model for name, model in models.items()}
    listed = list(models) if isinstance(models, list | tuple) else [models]
    if all(isinstance(model, str | Path) for model in listed):
        return dict(zip(file_labels([Path(m) for m in listed]), listed, strict=True))
    names = [getattr(m, "law", None) or "model" for m in listed]
    names = [n if isinstance(n, str) else type(n).__name__ for n in names]
    labels = [n if names.count(n) == 1 else f"{n} {i + 1}" for i, n in enumerate(names)]
    return dict(zip(labels, listed, strict=True))


def file_labels(files: Sequence[Path]) -> list[str]:
    """Name of each model in tables: that of its file, or its path where two have one name."""
    stems = [path.stem for path in files]
    names = [s if stems.count(s) == 1 else str(p) for s, p in zip(stems, files, strict=True)]
    if len(set(names)) < len(names):
        raise InputError("evaluate: one of the model files is named twice")
    return names


def scores_of(
    models: Mapping[str, Friction],
    dataset: Dataset,
    protocol: Protocol,
    done: Done = say_nothing,
    files: Mapping[str, Path] | None = None,
) -> pd.DataFrame:
    """Scores of models by their names, as in `evaluate`; `done` is called after each.

    files : of the models, for complaints about one of them
    """
    prepared = prepare(dataset, protocol_for(protocol, [(dataset, None)]))
    scores = {}
    for name, friction in models.items():
        with located(f"{(files or {}).get(name, name)}"):
            frame = score_model(friction, prepared_for(prepared, friction)).scores
            scores[name] = with_scores(frame, nominal_torque_scores(prepared))
        done(name)
    return model_scores(dataset.name, scores)


def training_notes(models: Mapping[str, Friction], dataset: Dataset) -> Iterator[str]:
    """A sentence on each model that was fitted to tables of the data set."""
    scored = tables_of(dataset.hashes)
    for name, friction in models.items():
        shared = {*tables_of(friction.provenance.data).values()} & {*scored.values()}
        if shared:
            yield (
                f"{name} was fitted to {len(shared)} of the {len(scored)} files of "
                f"{dataset.name!r}: its scores are of training data, not of held-out recordings"
            )


def predict(
    model: Any,
    data: DatasetLike,
    horizon: float = 1.0,
    every: float | None = None,
    *,
    start: float | None = None,
    whole: bool = False,
) -> pd.DataFrame:
    """Motion that a model predicts beside the measured one, a line for each sample.

    Parameters
    ----------
    model : Fit, Friction, or path of a model file
    data : Dataset, or path or name of one
    horizon : float [s], how far ahead
    every : float [s] between two starts; None: one prediction begins where the one before ends
    start : float [s] after the first sample of each recording; None: as often as it goes
    whole : bool
        Simulate whole recordings from their start instead.

    Returns
    -------
    DataFrame
        Columns recording, start_s, time_s, ahead_s; for each joint j the angle predicted qj, the
        velocity predicted wj (not of whole recordings) and the angle measured measured_qj; SI.
    """
    friction, dataset = friction_of(model), dataset_of(data)
    begin = None if start is None else number("start", start)
    return predicted_motion(friction, dataset, horizon, every, start=begin, whole=whole)
