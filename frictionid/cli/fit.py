"""frictionid fit: friction of one data set, written as a model file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from frictionid.cli.options import (
    Fixed,
    Free,
    Iterations,
    Json,
    KnownCalibration,
    Replace,
    Settings,
    Trust,
    Windows,
)
from frictionid.cli.paths import DatasetPath
from frictionid.cli.settings import settings

if TYPE_CHECKING:
    from frictionid.comparison.methods import Method
    from frictionid.friction import Friction


def fit(
    dataset: DatasetPath,
    identifier: Annotated[str, typer.Option(help="Kind of identifier, e.g. stribeck.")],
    out: Annotated[Path, typer.Option(help="Model file to write.")],
    set_: Settings = None,
    recipe: Annotated[str, typer.Option(help="One-step recipe: integral, or study.")] = "integral",
    data: Annotated[Path | None, typer.Option(help="Folder with the tables.")] = None,
    sample_time: Annotated[
        float | None, typer.Option(help="Use samples at least this far apart [s].")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the fit.")] = 0,
    by: Annotated[
        str | None,
        typer.Option(help="shooting, or inverse_dynamics: refine the fit of the recipe."),
    ] = None,
    free: Free = "",
    fixed: Fixed = None,
    windows: Windows = None,
    iterations: Iterations = None,
    calibration: KnownCalibration = None,
    figure: Annotated[
        Path | None, typer.Option(help="Picture of friction over velocity to write (PNG).")
    ] = None,
    json: Json = False,
    replace: Replace = False,
    trust: Trust = False,
) -> None:
    """Fit friction to all recordings of a data set."""
    from frictionid.cli.progress import heard
    from frictionid.comparison.fit_model import fit_model
    from frictionid.comparison.registry import LAWS
    from frictionid.comparison.suite_identifiers import identifier_named
    from frictionid.data.readers.dataset import dataset_files, load_dataset
    from frictionid.evaluation import Protocol
    from frictionid.files import write_bytes
    from frictionid.friction.model_files import model_paths, save_model
    from frictionid.outputs import check_outputs
    from frictionid.report.figures.fitted import check_drawable, fit_picture

    read = [*dataset_files(dataset, data), *(model_paths(calibration) if calibration else ())]
    check_outputs([*model_paths(out), figure], read, replace=replace)
    chosen = identifier_named(identifier, settings(set_ or []))
    shooting = _shooting_settings(windows, iterations)
    method = _recipe(recipe, by, free, fixed or [], shooting, calibration)
    method.check(chosen)
    protocol = Protocol(sample_time=sample_time)
    if figure is not None:
        check_drawable(chosen)
    loaded = load_dataset(dataset, data, trust=trust)
    with heard(f"fitting ({loaded.name})"):
        friction = fit_model(loaded, chosen, method, protocol, seed)
    save_model(friction, out, LAWS)
    if figure is not None:
        write_bytes(figure, fit_picture(friction, loaded))
    if json:
        print(out.read_text(encoding="utf-8"), end="")
        return
    _show(friction, out)
    if any(text.partition("=")[0].strip() == "width" for text in set_ or []):
        _say_if_numerical(friction)
    if figure is not None:
        print(f"written to {figure}")


def _show(friction: Friction, out: Path) -> None:
    from frictionid.report import show_refined

    source = friction.provenance
    show_refined(source["refined"]) if "refined" in source else print(friction)
    if "equation" in source:
        print("\n  ".join(["with 95 % intervals:", *source["equation"]]))
    if "inclusion" in source:
        print("\n  ".join(["how often draws of the recordings had a term:", *source["inclusion"]]))
    for sentence in source.get("torque", []):
        print(sentence)
    print(f"written to {out}")


def _say_if_numerical(friction: Friction) -> None:
    """Say where a given width changes nothing."""
    law = friction.law
    if law.sharpened() is not law:
        print(
            f"width = {law.width:g} rad/s changes nothing: up to 0.02 rad/s it is numerical, and "
            "fits and predictions treat friction at rest as a step; a wider one is a part of it"
        )


def _shooting_settings(windows: str | None, iterations: int | None) -> dict[str, Any]:
    """Settings of shooting that the options give."""
    from frictionid.errors import InputError

    given: dict[str, Any] = {}
    if windows is not None:
        try:
            given["windows"] = [float(part) for part in windows.split(",")]
        except ValueError:
            raise InputError(
                f"--windows {windows!r} must be lengths in seconds, e.g. --windows 0.1,0.3"
            ) from None
    return given if iterations is None else given | {"iterations": iterations}


def _recipe(
    name: str,
    by: str | None,
    free: str,
    fixed: list[str],
    shooting: dict[str, Any],
    calibration: Path | None,
) -> Method:
    """Recipe that the options name."""
    from frictionid.comparison.suite_recipes import RecipeEntry, recipe_named, recipe_of
    from frictionid.errors import InputError

    known = None if calibration is None else str(calibration)
    if by is None:
        if free or fixed or shooting:
            raise InputError(
                "--free and --fixed need --by shooting or --by inverse_dynamics; --windows and "
                "--iterations need --by shooting"
            )
        if known is None:
            return recipe_named(name)
        return recipe_of(RecipeEntry(name=f"{name} calibrated", like=name, known=known))
    if by not in ("shooting", "inverse_dynamics"):
        raise InputError(f"--by {by!r} is unknown; known are shooting, inverse_dynamics")
    blocks = [part.strip() for part in free.split(",")] if free else None
    start = "integral" if name == by else name
    given = {"free": blocks, "fixed": fixed, "start": start, "known": known, **shooting}
    return recipe_of(RecipeEntry.model_validate({"name": by, "by": by, **given}))
