"""frictionid track and render: joint angles from videos of coloured dots, and such videos."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictionid.cli.options import DatasetPath, Json, Replace

if TYPE_CHECKING:
    from frictionid.rig.camera.angles import Angles


class Method(StrEnum):
    """How dots are found."""

    follow = "follow"
    study = "study"


def track(
    video: Annotated[str, typer.Argument(help="Video, folder of pictures, or a camera's number.")],
    rig: Annotated[
        Path, typer.Option(help="Settings with markers, links and camera; written by --setup.")
    ] = Path("rig.toml"),
    out: Annotated[Path | None, typer.Option(help="Table of angles to write (CSV).")] = None,
    setup: Annotated[
        bool, typer.Option("--setup", help="Propose dots, pivot and links; write them to --rig.")
    ] = False,
    method: Annotated[
        Method, typer.Option(help="study: thresholds in the whole picture, for comparison.")
    ] = Method.follow,
    overlay: Annotated[
        Path | None, typer.Option(help="Video with markers and angles drawn over it (.mp4).")
    ] = None,
    sheet: Annotated[Path | None, typer.Option(help="Contact sheet of it (.png).")] = None,
    json: Json = False,
    replace: Replace = False,
) -> None:
    """Track coloured dots in a video; write joint angles with their standard deviations."""
    from frictionid.errors import InputError

    if setup:
        return _propose(video, rig, replace, json)
    if out is None:
        raise InputError("--out is missing: name the table of angles to write, such as angles.csv")
    from frictionid.cli.progress import counted
    from frictionid.outputs import check_outputs
    from frictionid.rig.api.track import track as tracked
    from frictionid.rig.camera.marker_setup import load_marker_setup
    from frictionid.rig.camera.source import open_source

    check_outputs((out, sheet, overlay), (Path(video), rig), replace=replace)
    markers = load_marker_setup(rig)
    source = open_source(video, markers.camera.rate)
    if source.kind == "live" and (overlay or sheet):
        raise InputError("--overlay and --sheet need a video: a live camera shows its frames once")
    with counted(source.count or 0, source.name) as count:
        found = tracked(source, markers, method=method.value, done=lambda _: count(""))
    found.save(out)
    if sheet is not None:
        found.save_sheet(sheet)
    if overlay is not None:
        found.save_overlay(overlay)
    if json:
        written = [p for p in (out, sheet, overlay) if p is not None]
        print(_as_json(found.angles, written), end="")
        return None
    print(found)
    print(f"written to {out}")
    if sheet is not None:
        print(f"contact sheet in {sheet}")
    if overlay is not None:
        print(f"overlay in {overlay}")
    return None


def _propose(video: str, rig: Path, replace: bool, json: bool) -> None:
    import tomllib

    from frictionid.files import json_text, write_text
    from frictionid.outputs import check_outputs
    from frictionid.rig.camera.marker_setup import marker_setup_text
    from frictionid.rig.camera.propose import propose
    from frictionid.rig.camera.source import open_source

    check_outputs([rig], [Path(video)], replace=replace)
    markers = propose(open_source(video))
    notes = [
        f"proposed from {Path(video).name}; check it with frictionid track ... --sheet",
        "give links.lengths [m] where you know them: they check the order and calibrate the view",
    ]
    text = marker_setup_text(markers, notes)
    write_text(rig, text)
    if json:
        print(json_text(tomllib.loads(text) | {"written": [rig]}), end="")
        return
    for marker in markers.markers:
        dot = f"hue {marker.hue or 0:.0f} deg, radius {marker.radius:.1f} px"
        place = f"at {marker.at[0]:.1f}, {marker.at[1]:.1f}" if marker.at else ""
        print(f"{marker.name}: {place if marker.hue is None else dot}")
    lengths = ", ".join(f"{p:.1f}" for p in markers.links.pixels or ())
    print(f"links: {lengths} px\nwritten to {rig}")


def _as_json(angles: Angles, written: list[Path]) -> str:
    """Number of frames by state, median standard deviation [rad] of each joint, and the camera."""
    import numpy as np

    from frictionid.files import json_text

    return json_text(
        {
            "frames": len(angles.state),
            "states": {s: angles.state.count(s) for s in ("found", "predicted", "lost")},
            "sigma": np.nanmedian(angles.sigma, axis=0),
            "plane": list(angles.calibration.plane.shape),
            "written": written,
        }
    )


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
