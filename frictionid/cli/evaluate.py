"""frictionid evaluate and predict: scores of model files, and the motion that they predict."""

from pathlib import Path
from typing import Any, Literal

import frictionid as fid
from frictionid.errors import InputError, needs

from .options import DatasetPath, ModelsAndDataset, PresentOrNone, PresentPath, numbers
from .progress import counted, show


def evaluate(
    files: ModelsAndDataset,
    *,
    out: Path | None = None,
    horizons: str = "0.1,0.25,0.5,1.0",
    data: Path | None = None,
    sample_time: float | None = None,
    law: list[str] | None = None,
    whole: bool = False,
    initial_states: Literal["filter", "model"] = "filter",
    json: bool = False,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Score fitted models on all recordings of a data set, one step ahead and over seconds.

    Parameters
    ----------
    out : Table of scores to write (CSV).
    horizons : Rollout horizons in seconds, with commas.
    whole : Also simulate whole recordings from their start.
    initial_states : Estimator of the states that rollouts start from: filter, or model.
    """
    from frictionid.api.evaluate import file_labels, scores_of, training_notes
    from frictionid.data.readers.dataset import dataset_files
    from frictionid.evaluation import Protocol
    from frictionid.files import csv_text, write_text
    from frictionid.friction.model_files import load_model, model_paths
    from frictionid.outputs import check_outputs
    from frictionid.report import show_scores, show_torque_left
    from frictionid.report.summary_table import score_torque_frames

    if len(files) < 2:
        raise InputError("evaluate needs at least one model file and, last, a data set")
    *models, place = files
    read = [path for model in models for path in model_paths(model)]
    check_outputs([out], [*read, *dataset_files(place, data)], replace=replace)
    named = dict(zip(file_labels(models), models, strict=True))
    laws = [*map(_own_law, law or ())]
    frictions = {name: load_model(path, laws) for name, path in named.items()}
    protocol = Protocol(
        horizons=tuple(numbers("--horizons", horizons, _HORIZONS)),
        sample_time=sample_time,
        whole=whole,
        initial_states=initial_states,
    )
    dataset = fid.load_dataset(place, data, trust=trust)
    with counted(len(models), f"evaluating ({dataset.name})") as done:
        table = scores_of(frictions, dataset, protocol, done, named)
    if out is not None:
        write_text(out, csv_text(table))
    if json:
        print(table.to_json(orient="records", indent=1))
        return
    show_scores(table)
    show_torque_left(score_torque_frames(table), dataset.mechanism.joints)
    written = [] if out is None else [f"written to {out}"]
    print(_STATES[initial_states], *training_notes(frictions, dataset), *written, sep="\n")


_HORIZONS = "be positive seconds with commas, e.g. 0.25,0.5"
_STATES = {
    "filter": "Rollouts start from states of a kinematic filter, the same for all models.",
    "model": "Rollouts start from states that each model estimates from the samples before.",
}


def predict(
    model: PresentPath,
    dataset: DatasetPath,
    *,
    out: Path,
    horizon: float = 1.0,
    every: float | None = None,
    whole: bool = False,
    law: list[str] | None = None,
    data: PresentOrNone = None,
    json: bool = False,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Write the motion that a model predicts beside the measured one, in SI units.

    Parameters
    ----------
    out : Table to write (CSV or Parquet).
    horizon : How far ahead [s].
    every : Time between two starts [s]; the horizon.
    whole : Whole recordings from their start instead.
    """
    from frictionid.data.readers.dataset import dataset_files
    from frictionid.files import csv_text, write_bytes, write_text
    from frictionid.friction.model_files import load_model
    from frictionid.outputs import check_outputs

    check_outputs([out], [model, *dataset_files(dataset, data)], replace=replace)
    friction = load_model(model, [*map(_own_law, law or ())])
    loaded = fid.load_dataset(dataset, data, trust=trust)
    table = fid.predict(friction, loaded, horizon, every, whole=whole)
    if out.suffix == ".parquet":
        with needs("parquet"):
            import pyarrow  # noqa: F401 (pandas writes by it)
        write_bytes(out, table.to_parquet(index=False))
    else:
        write_text(out, csv_text(table))
    starts = len(table[["recording", "start_s"]].drop_duplicates())
    counts = {"predictions": starts, "lines": len(table)}
    show(f"{starts} predictions, {len(table)} lines", counts, [out], json=json)


def _own_law(reference: str) -> Any:
    """Class of a law of one's own, `module:Class`."""
    from frictionid.config import imported

    law = imported(reference, Path(), "--law")
    if not (isinstance(law, type) and issubclass(law, fid.Law)):
        raise InputError(f"--law: {reference!r} does not subclass frictionid.friction.Law")
    return law
