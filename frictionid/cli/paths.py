"""Paths that commands read: a wrong one is refused before anything heavy is imported."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def _dataset(path: Path) -> Path:
    from frictionid.data.readers.dataset_path import dataset_path

    dataset_path(path)
    return path


def _suite(path: Path) -> Path:
    from frictionid.comparison.suite import suite_path

    return suite_path(path)


def present(path: Path | None) -> Path | None:
    """The path of a file or folder that a command reads; InputError where there is none."""
    from frictionid.errors import InputError

    if path is not None and not path.exists():
        raise InputError(f"{path}: no such file; correct the path")
    return path


def _results(folder: Path) -> Path:
    if not (folder / "unfinished" / "provenance.json").exists():  # that was interrupted
        present(folder / "provenance.json")
    return folder


def _other_results(folder: Path | None) -> Path | None:
    return None if folder is None else _results(folder)


def _models_and_dataset(paths: list[Path]) -> list[Path]:
    for path in paths[:-1]:
        present(path)
    if len(paths) > 1:
        _dataset(paths[-1])
    return paths


def _models(paths: list[Path]) -> list[Path]:
    for path in paths:
        present(path)
    return paths


DatasetPath = Annotated[
    Path,
    typer.Argument(
        help="Folder with dataset.toml, that file, or a name, e.g. acrobot_clean.",
        callback=_dataset,
    ),
]
SuitePath = Annotated[
    Path, typer.Argument(help="Suite file, or the name of one, e.g. acrobot.", callback=_suite)
]
ResultFolder = Annotated[
    Path, typer.Argument(help="Result folder of a comparison.", callback=_results)
]
OtherFolder = Annotated[
    Path | None,
    typer.Argument(help="A second one, to say what changed.", callback=_other_results),
]
ModelPath = Annotated[Path, typer.Argument(help="Model file.", callback=present)]
ModelPaths = Annotated[
    list[Path], typer.Argument(help="MODEL.json MODEL.json ...", callback=_models)
]
ModelsAndDataset = Annotated[
    list[Path], typer.Argument(help="MODEL.json ... DATASET", callback=_models_and_dataset)
]
DataFolder = Annotated[
    Path | None, typer.Option("--data", help="Folder with the tables.", callback=present)
]
