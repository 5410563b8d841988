"""frictionid fit, evaluate and predict: model files, their scores, and the motion they predict."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

import frictionid as fid
from frictionid.errors import InputError, needs

from .command import (
    DatasetPath,
    ModelsAndDataset,
    PresentOrNone,
    PresentPath,
    check_files,
    counted,
    heard,
    numbers,
    settings,
    show,
)


def fit(
    dataset: DatasetPath,
    *,
    identifier: str,
    out: Path,
    set_: list[str] | None = None,
    recipe: str | None = None,
    data: Path | None = None,
    sample_time: float | None = None,
    seed: int = 0,
    by: str | None = None,
    free: str = "",
    fixed: list[str] | None = None,
    windows: str | None = None,
    iterations: Annotated[int | None, typer.Option(min=1)] = None,
    consistent: bool = False,
    calibration: Path | None = None,
    equal: list[str] | None = None,
    bias: bool = False,
    figure: Path | None = None,
    json: bool = False,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Fit friction to all recordings of a data set; exit status 2 where these are unusable.

    Parameters
    ----------
    identifier : Kind of identifier, e.g. stribeck.
    out : Model file to write.
    set_ : A setting, e.g. symmetric=false or bounds.viscous=[0,1].
    recipe : One-step recipe: integral, study or calibrated.
    seed : Seed of the fit.
    by : shooting; inverse_dynamics, on torques; or one_step, fast, which takes masses, gains and
        clocks as given [shooting; from three joints with measured torques on inverse_dynamics].
    free : Free blocks: friction,inertia,delay,gain,bias,offset,actuator,target_delay,backlash,
        envelope [friction, and of inertia, delay and bias what the data tell].
    fixed : A parameter that is not free, e.g. inertia.gravity_2; repeatable.
    windows : Lengths of the windows of shooting [s], e.g. 0.1,0.3.
    iterations : Iterations of shooting at most.
    consistent : Inverse dynamics: inertias that bodies can have.
    calibration : Model file whose base parameters, delay, gain, bias, offset, and what it says of
        servos, are held; blocks named by --free have its standard errors as priors.
    bias : Intervals hold the bias of smoothed states, too; takes seconds.
    figure : Picture of friction over velocity to write (PNG).
    """
    from frictionid.api.models import identifier_of
    from frictionid.files import write_bytes
    from frictionid.friction.model_files import model_paths
    from frictionid.report.figures.fits import check_drawable, fit_figure
    from frictionid.report.figures.style import png

    read = model_paths(calibration) if calibration else ()
    check_files([*model_paths(out), figure], read, dataset, data, replace=replace)
    chosen = identifier_of(identifier, law_settings := settings(set_ or []))
    if figure is not None:
        check_drawable(chosen)
    loaded = fid.load_dataset(dataset, data, trust=trust)
    with heard(f"fitting ({loaded.name})"):
        fitted = fid.fit(
            *(loaded, chosen),
            method=by,
            recipe=recipe,
            free=free or None,
            fixed=fixed or (),
            windows=None if windows is None else numbers("--windows", windows, _WINDOWS),
            iterations=iterations,
            consistent=consistent,
            calibration=calibration,
            equal=[[name.strip() for name in group.split(",")] for group in equal or []],
            sample_time=sample_time,
            seed=seed,
            bias=bias,
        )
        fitted, status = _judged(fitted, loaded)
    fitted.save(out)
    if figure is not None:
        write_bytes(figure, png(lambda: fit_figure(fitted.friction, loaded)))
    text, written = out.read_text(encoding="utf-8"), filter(None, (out, figure))
    print(text, end="") if json else _show(fitted, law_settings, written)
    raise typer.Exit(status)


_WINDOWS = "be lengths in seconds, e.g. --windows 0.1,0.3"


def _judged(fitted: "fid.Fit", data: "fid.Dataset") -> tuple["fid.Fit", int]:
    """The fit, which says why data are unusable that are, and the exit status."""
    findings = [f for f in fid.check(data).details.findings if f.level == "unusable"]
    words = tuple(f"the data are unusable: {f.text} -> {f.remedy}" for f in findings)
    limits = words + fitted.friction.provenance.limits
    return fid.Fit(fitted.friction.noted({"limits": limits}), data), 2 if words else 0


def _show(fitted: "fid.Fit", chosen: Iterable[str], written: Iterable[Path]) -> None:
    """Print a fit, where a given width changes nothing, and where it was written."""
    fitted.show()
    law = fitted.friction.law
    if "width" in chosen and law.sharpened() is not law:
        print(
            f"width = {law.width:g} rad/s changes nothing: up to 0.02 rad/s it is numerical, and "
            "fits and predictions treat friction at rest as a step; a wider one is a part of it"
        )
    for path in written:
        print(f"written to {path}")


# --- Models that are fitted ---------------------------------------------------------------------


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
    from frictionid.evaluation import Protocol
    from frictionid.files import csv_text, write_text
    from frictionid.friction.model_files import load_model, model_paths
    from frictionid.report import show_scores, show_torque_left
    from frictionid.report.summary_table import score_torque_frames

    if len(files) < 2:
        raise InputError("evaluate needs at least one model file and, last, a data set")
    *models, place = files
    read = [path for model in models for path in model_paths(model)]
    check_files([out], read, place, data, replace=replace)
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
    from frictionid.files import csv_text, write_bytes, write_text
    from frictionid.friction.model_files import load_model

    check_files([out], [model], dataset, data, replace=replace)
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
