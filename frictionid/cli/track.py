"""frictionid track: joint angles from a video of coloured dots."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from frictionid.acquire.camera.angles import Angles


class Method(StrEnum):
    """How dots are found."""

    follow = "follow"
    study = "study"


def track(
    video: Annotated[str, typer.Argument(help="Video, folder of pictures, or a camera's number.")],
    rig: Annotated[
        Path, typer.Option(help="Markers, links and camera; written by --setup.")
    ] = Path("rig.toml"),
    out: Annotated[Path | None, typer.Option(help="Table of angles to write (CSV).")] = None,
    setup: Annotated[
        bool, typer.Option("--setup", help="Propose dots, pivot and links; write them to --rig.")
    ] = False,
    method: Annotated[Method, typer.Option(help="study: thresholds of whole pictures.")] = (
        Method.follow
    ),
    overlay: Annotated[Path | None, typer.Option(help="Video of what was found (.mp4).")] = None,
    sheet: Annotated[Path | None, typer.Option(help="Contact sheet of it (.png).")] = None,
) -> None:
    """Track coloured dots in a video and write joint angles with their accuracy."""
    from frictionid.acquire.camera.source import open_source
    from frictionid.errors import InputError

    if setup:
        return _setup(video, rig)
    if out is None:
        raise InputError("--out is missing: name the table of angles to write, such as angles.csv")
    from frictionid.acquire.camera.angles import angles_csv
    from frictionid.acquire.camera.marker_setup import load_marker_setup
    from frictionid.files import write_bytes

    _check_places(video, rig, out, sheet, overlay)
    markers = load_marker_setup(rig)
    source = open_source(video, markers.camera.rate)
    if source.kind == "live" and (overlay or sheet):
        raise InputError("--overlay and --sheet need a video: a live camera shows its frames once")
    angles = _tracked(source, markers, method.value)
    _written(out, lambda: write_bytes(out, angles_csv(angles).encode()))
    _say(angles, out)
    if sheet is not None:
        import cv2

        from frictionid.acquire.camera.overlay import contact_sheet

        picture = cv2.imencode(".png", contact_sheet(source.frames(), angles, source.size))[
            1
        ].tobytes()
        _written(sheet, lambda: write_bytes(sheet, picture))
        print(f"contact sheet in {sheet}")
    if overlay is not None:
        from frictionid.acquire.camera.overlay import write_overlay

        _written(overlay, lambda: overlay.parent.mkdir(parents=True, exist_ok=True))
        write_overlay(source, angles, overlay)
        print(f"video of what was found in {overlay}")
    return None


def _check_places(video: str, rig: Path, *places: Path | None) -> None:
    """Complain now about what would be lost or could not be written after the film was followed."""
    from frictionid.errors import InputError

    taken = {Path(video).resolve(): "the film itself", rig.resolve(): "the rig's file"}
    for place in places:
        if place is None:
            continue
        if place.is_dir():
            raise InputError(f"{place} is a folder; name a file in it")
        whole = place.resolve()
        if whole in taken:
            raise InputError(f"{place} is {taken[whole]} and is not overwritten; name another file")
        taken[whole] = "written already by another option"


def _setup(video: str, rig: Path) -> None:
    from frictionid.acquire.camera.marker_setup import marker_setup_text
    from frictionid.acquire.camera.propose import propose
    from frictionid.acquire.camera.source import open_source
    from frictionid.errors import InputError
    from frictionid.files import write_bytes

    if rig.exists():
        raise InputError(f"{rig} is there already; name another --rig, or delete it")
    markers = propose(open_source(video))
    notes = [
        f"proposed from {Path(video).name}; check it with frictionid track ... --sheet",
        "give links.lengths [m] where you know them: they check the order and sharpen the view",
    ]
    _written(rig, lambda: write_bytes(rig, marker_setup_text(markers, notes).encode()))
    for marker in markers.markers:
        place = f"at {marker.at[0]:.1f}, {marker.at[1]:.1f}" if marker.at else ""
        dot = (
            f"hue {marker.hue:.0f} deg, radius {marker.radius:.1f} px"
            if marker.hue is not None
            else ""
        )
        print(f"{marker.name}: {dot or place}")
    lengths = ", ".join(f"{p:.1f}" for p in markers.links.pixels or ())
    print(f"links: {lengths} px\nwritten to {rig}")


def _tracked(source: object, markers: object, method: str) -> Angles:
    from frictionid.acquire.camera.source import Source
    from frictionid.acquire.camera.track import MarkerSetup, track
    from frictionid.cli.progress import counted

    assert isinstance(source, Source) and isinstance(markers, MarkerSetup)
    with counted(source.count or 0, source.name) as tell:
        return track(
            source, markers, "study" if method == "study" else "follow", lambda _: tell("")
        )


def _written(path: Path, write: object) -> None:
    from frictionid.errors import InputError

    assert callable(write)
    try:
        write()
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}); name another") from None


def _say(angles: Angles, out: Path) -> None:
    import numpy as np

    counts = {s: angles.state.count(s) for s in ("found", "predicted", "lost")}
    told = ", ".join(f"{c} {s}" for s, c in counts.items() if c or s == "found")
    print(f"{len(angles.state)} frames: {told}")
    for j, sigma in enumerate(np.nanmedian(angles.sigma, axis=0), start=1):
        print(f"q{j}: standard deviation {np.degrees(sigma):.3f} deg in the median")
    stretch, diagonal, right, down, bulge = angles.calibration.plane.shape
    if any((stretch, diagonal, right, down, bulge)):
        print(f"camera: slant {right:+.3f}, {down:+.3f}, lens {bulge:+.3f} per half diagonal")
    if angles.sync_led is not None:
        name, brightness = angles.sync_led
        print(f"{name}: brightness {brightness.min():.3f} to {brightness.max():.3f}")
    print(f"written to {out}")
