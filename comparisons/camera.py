"""How accurate and how fast the camera's part is, on simulated films: prints every figure it names.

    python comparisons/camera.py [--quick]

Angles against truth and against the study's method on the same frames; a difficult film; dots of
one colour that pass each other (50 seeds); proposals for scenes of many colours (20 seeds); speed
against decoding alone.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from rich.console import Console
from rich.progress import track as progress
from rich.table import Table
from scipy.interpolate import CubicHermiteSpline
from script import call

from frictionid import load_dataset
from frictionid.data.recordings import TrueMotion
from frictionid.data.signals import Signal
from frictionid.errors import InputError
from frictionid.rig.camera.angles import Angles
from frictionid.rig.camera.film import Film, write_film
from frictionid.rig.camera.marker_setup import Links, Marker, MarkerSetup
from frictionid.rig.camera.propose import propose
from frictionid.rig.camera.scene import Look, View
from frictionid.rig.camera.source import open_source
from frictionid.rig.camera.track import track

ROOT = Path(__file__).parents[1]
LENGTHS = (0.153, 0.175)
RED, BLUE, GREEN = (0.0, 0.85, 0.85), (210.0, 0.85, 0.85), (120.0, 0.85, 0.8)
PLAIN = Film(LENGTHS)
HARD = Film(
    LENGTHS,
    dropped=0.05,
    jitter=0.001,
    hidden=0.02,
    view=View(tilt=(4.0, -3.0), distortion=0.02),
    look=Look(gradient=0.5, shadow=0.3),
)


def swinging(seed: int, frames: int) -> TrueMotion:
    """Part of a recording of data/acrobot_clean, drawn by the seed."""
    rng = np.random.default_rng(seed)
    recordings = load_dataset(ROOT / "data" / "acrobot_clean").recordings
    truth = recordings[int(rng.integers(len(recordings)))].truth
    assert truth is not None
    at = int(rng.integers(0, len(truth.angle.time) - frames + 1))
    time = np.arange(frames) / 60  # films begin at nought
    parts = (signal.value[at : at + frames] for signal in (truth.angle, truth.velocity))
    return TrueMotion(*(Signal(time, np.asarray(value)) for value in parts))


def fast(seconds: float) -> TrueMotion:
    """Both joints up to 20 rad/s."""
    t = np.arange(int(60 * seconds)) / 60
    q = np.column_stack([2.0 * np.sin(10 * t), 2.5 * np.sin(8 * t + 1)])
    w = np.column_stack([20.0 * np.cos(10 * t), 20.0 * np.cos(8 * t + 1)])
    return TrueMotion(Signal(t, q), Signal(t, w))


def whirling(seed: int, frames: int) -> TrueMotion:
    """The second link goes round and round, past the pivot."""
    rng = np.random.default_rng(seed)
    t, turn = np.arange(frames) / 60, rng.uniform(8, 20) * rng.choice([-1, 1])
    q = np.column_stack([0.8 * np.sin(6 * t + seed), turn * t])
    return TrueMotion(
        Signal(t, q), Signal(t, np.column_stack([4.8 * np.cos(6 * t + seed), 0 * t + turn]))
    )


def marker_setup_of(film: Film, **others: object) -> MarkerSetup:
    """What a user who knows the rig writes."""
    names = ("pivot", "elbow", "tip")
    markers = [
        Marker(name=name, hue=hsv[0], saturation=hsv[1], value=hsv[2], radius=film.look.radius)
        if hsv
        else Marker(name=name, at=list(film.view.pivot))
        for name, hsv in zip(names, film.look.dots, strict=True)
    ]
    return MarkerSetup.model_validate(
        {"markers": markers, "links": Links(lengths=list(film.lengths)), **others}
    )


def errors(angles: Angles, motion: TrueMotion) -> np.ndarray:
    """Errors [deg] of the frames that were found."""
    true = CubicHermiteSpline(motion.angle.time, motion.angle.value, motion.velocity.value)
    found = np.array(angles.state) == "found"
    e = np.degrees(angles.q - true(angles.time))[found]
    return np.asarray(e - 360 * np.round(np.median(e, axis=0) / 360))


def rms(e: np.ndarray) -> str:
    """Root mean square of each joint as text."""
    return " / ".join(f"{v:.3f}" for v in np.sqrt((e**2).mean(axis=0)))


def accuracy(folder: Path, table: Table) -> None:
    """Angles of the plain and the difficult film, ours and the study's."""
    for name, film, motion in (
        ("plain", PLAIN, swinging(3, 343)),
        ("plain, to 20 rad/s", PLAIN, fast(4)),
        ("difficult", HARD, swinging(3, 343)),
        ("difficult, to 20 rad/s", HARD, fast(4)),
    ):
        source = open_source(str(write_film(film, motion, folder / "film")))
        angles = track(source, marker_setup_of(film)).angles
        e = errors(angles, motion)
        stated = np.degrees(np.sqrt(np.nanmean(angles.sigma**2, axis=0)))
        ratio = " / ".join(f"{v:.2f}" for v in (e - e.mean(axis=0)).std(axis=0) / stated)
        found = np.mean(np.array(angles.state) == "found")
        row = rms(e), f"{np.abs(e).max():.3f}", ratio, f"{found:.1%}"
        study = track(source, marker_setup_of(film), method="study").angles
        table.add_row(name, *row, rms(errors(study, motion)))


def crossings(folder: Path, seeds: int) -> str:
    """Films of dots of one colour that pass each other, and how many were swapped."""
    film = Film((0.153, 0.155), look=Look(dots=(GREEN,) * 3))
    setup = marker_setup_of(film)
    setup = setup.model_copy(
        update={
            "markers": [setup.markers[0].model_copy(update={"moves": False}), *setup.markers[1:]],
            # three dots of one colour and two links alike: only their size tells which is which
            "links": Links(pixels=[film.view.scale * length for length in film.lengths]),
        }
    )
    swapped, found = 0, []
    for seed in progress(range(seeds), "dots of one colour"):
        motion = whirling(seed, 120) if seed % 2 else swinging(seed, 120)
        path = write_film(replace(film, seed=seed), motion, folder / "film")
        angles = track(path, setup).angles
        found.append(np.mean(np.array(angles.state) == "found"))
        swapped += bool(np.abs(errors(angles, motion)).max() > 0.5)
    return f"dots of one colour: {swapped} of {seeds} seeds swapped, {np.mean(found):.1%} found"


def proposals(folder: Path, seeds: int) -> str:
    """Scenes of many colours, and how many proposals name dots, pivot and links rightly."""
    right = 0
    for seed in progress(range(seeds), "proposals"):
        rng = np.random.default_rng(seed)
        hue = rng.uniform(0, 360)
        other = hue if seed % 5 == 4 else hue + rng.uniform(60, 300)
        colours = [(h % 360, rng.uniform(0.6, 0.95), rng.uniform(0.5, 0.95)) for h in (hue, other)]
        look = Look(
            dots=((), *colours),
            radius=rng.uniform(5, 11),
            background=("plate", "wall", "workshop")[seed % 3],
            wall=(rng.uniform(0, 360), rng.uniform(0, 0.15), rng.uniform(0.3, 0.9)),
            gradient=rng.uniform(0, 0.4),
            shadow=0.3,
            link=rng.uniform(0.2, 0.8),
        )
        if other == hue:
            look = replace(look, dots=((), colours[0], colours[0]))
        pivot = rng.uniform(500, 780), rng.uniform(330, 390)
        view = View(pivot=pivot, tilt=tuple(rng.uniform(-4, 4, 2)))
        film = replace(PLAIN, view=view, look=look, seed=seed)
        path = write_film(film, swinging(seed, 240), folder / "film")
        try:
            setup = propose(open_source(str(path)))
        except InputError:
            continue
        at = setup.markers[0].at or [0.0, 0.0]
        pixels = np.array(setup.links.pixels or [0.0])
        places = view.pixels(np.array([[0.0, 0.0]]))[0]
        near = len(pixels) == 2 and bool(
            (np.abs(pixels / (900 * np.array(LENGTHS)) - 1) < 0.04).all()
        )
        right += near and bool(np.hypot(*(np.array(at) - places)) < 5)
    return f"proposals: {right} of {seeds} scenes right without help"


def seconds(work: Callable[[], object]) -> np.ndarray:
    """Time on the wall and of processors, each the best of three."""
    spent = []
    for _ in range(3):
        begin = time.perf_counter(), time.process_time()
        work()
        spent.append([time.perf_counter() - begin[0], time.process_time() - begin[1]])
    return np.min(spent, axis=0)


def decoded(path: Path) -> int:
    """Frames that OpenCV alone decodes."""
    capture, count = cv2.VideoCapture(str(path)), 0
    while capture.read()[0]:
        count += 1
    return count


def speed(folder: Path) -> str:
    """Frames per second, tracked and only decoded."""
    path = write_film(replace(PLAIN, codec="mpeg4"), fast(20), folder / "film")
    count, setup = decoded(path), marker_setup_of(PLAIN)
    alone, ours = (
        count / seconds(work) for work in (lambda: decoded(path), lambda: track(path, setup))
    )
    return (
        f"speed (MPEG-4): {ours[0]:.0f} frames/s on the wall, decoding alone {alone[0]:.0f}: "
        f"{ours[0] / alone[0]:.2f} of it; {ours[1]:.0f} ({alone[1]:.0f}) per second of one "
        f"processor: {ours[1] / 60:.1f} times real time"
    )


def main(*, quick: bool = False) -> None:
    """Print all figures.

    Parameters
    ----------
    quick : A tenth of the seeds.
    """
    share = 10 if quick else 1
    cv2.setNumThreads(1)
    console = Console()
    table = Table(title="angles from 1280 x 720 films, joint 1 / 2 [deg]")
    for name in ("film", "rms error", "largest", "error / stated", "found", "study's method"):
        table.add_column(name, justify="left" if name == "film" else "right")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        accuracy(folder, table)
        console.print(table)
        console.print(speed(folder))
        console.print(crossings(folder, 50 // share))
        console.print(proposals(folder, 20 // share))


if __name__ == "__main__":
    call(main)
