"""frictionid check and quick: errors in recordings, and a first verdict."""

from pathlib import Path

import typer

import frictionid as fid

from .options import DatasetPath, PresentOrNone
from .progress import running


def check(
    dataset: DatasetPath,
    *,
    data: Path | None = None,
    json: bool = False,
    out: Path | None = None,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Report errors in recordings, what the recordings identify, and what to record next.

    Questions are answered by yes, NO, or not tested and why; yes means that the test could have
    failed. Of each motor's torque it says whether it is measured, commanded or modelled.

    The exit status is 0 where the data are good, 1 doubtful, 2 unusable as they stand.

    Parameters
    ----------
    out : Folder for pictures.
    """
    from frictionid.check import LEVELS
    from frictionid.data.readers.dataset import dataset_files
    from frictionid.outputs import check_outputs
    from frictionid.report.diagnostics import picture_paths, write_pictures

    if out is not None:
        check_outputs(picture_paths(out), dataset_files(dataset, data), replace=replace)
    verdict = fid.check(fid.load_dataset(dataset, data, trust=trust))
    if json:
        print(verdict.json())
    else:
        verdict.show()
    if out:
        for path in write_pictures(verdict.details, out):
            typer.echo(f"written to {path}", err=True)
    raise typer.Exit(LEVELS.index(verdict.level))


def quick(
    dataset: DatasetPath,
    *,
    figure: Path | None = None,
    data: PresentOrNone = None,
    json: bool = False,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Check a data set, compare a few friction laws on held-out motion, and say which one holds.

    The exit status is 2 where the data are unusable, else 0.

    Parameters
    ----------
    figure : Picture to write (PNG) [quick-<name>.png, or the next number].
    """
    import os
    from functools import partial
    from itertools import chain, count

    from frictionid.data.readers.dataset import dataset_files
    from frictionid.files import file_names, write_bytes
    from frictionid.outputs import check_outputs
    from frictionid.quickstart.quick import plan_for
    from frictionid.quickstart.quick_report import quick_figure, quick_json
    from frictionid.report.figures.style import png

    loaded = fid.load_dataset(dataset, data, trust=trust)
    name = f"quick-{file_names([loaded.name])[loaded.name]}"
    ends = chain([""], (f"-{k}" for k in count(2)))
    paths = (Path(f"{name}{end}.png") for end in ends)
    figure = figure or next(path for path in paths if replace or not os.path.lexists(path))
    check_outputs([figure], dataset_files(dataset, data), replace=replace)
    with running(plan_for(loaded).steps, f"first verdict ({loaded.name})") as done:
        verdict = fid.quick(loaded, done)
    print(quick_json(verdict)) if json else verdict.show()
    if verdict.chosen is None:
        raise typer.Exit(2)
    write_bytes(figure, png(partial(quick_figure, verdict)))
    typer.echo(f"written to {figure}", err=True)
