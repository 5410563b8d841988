"""frictionid render: videos of simulated recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Replace
from frictionid.cli.paths import DatasetPath


def render(
    dataset: DatasetPath,
    camera: Annotated[Path, typer.Option(help="Settings of the simulated camera, a camera.toml.")],
    out: Annotated[Path, typer.Option(help="Folder of the videos to write.")],
    only: Annotated[list[str] | None, typer.Option(help="Recordings, all where none is named.")] = (
        None
    ),
    replace: Replace = False,
) -> None:
    """Render simulated recordings as videos of coloured dots."""
    from frictionid.cli.progress import counted
    from frictionid.config import nearest
    from frictionid.data.readers.dataset import dataset_files, load_dataset
    from frictionid.errors import InputError
    from frictionid.outputs import check_outputs
    from frictionid.rig.film.film import load_film, video_path, write_film

    film, data = load_film(camera), load_dataset(dataset)
    names = [r.name for r in data.recordings]
    for name in only or ():
        if name not in names:
            raise InputError(f"{dataset}: no recording {name!r}; {nearest(name, names)}")
    chosen = [r for r in data.recordings if not only or r.name in only]
    without = next((r.name for r in chosen if r.truth is None), None)
    if without is not None:
        raise InputError(f"{dataset}: {without!r} has no true motion; render simulated data sets")
    videos = [video_path(film, out / recording.name) for recording in chosen]
    check_outputs(videos, (*dataset_files(dataset), camera), replace=replace)
    with counted(len(chosen), data.name) as done:
        for recording in chosen:
            assert recording.truth is not None
            write_film(film, recording.truth, out / recording.name)
            done(recording.name)
    print(f"{len(chosen)} videos written to {out}")
