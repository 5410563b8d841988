"""From simulated films to friction: film, track, compare with perfect angles of the same noise.

    python comparisons/from_pixels.py

Ten recordings of data/acrobot_clean are filmed at 1280 x 720 with blur, noise, uneven light, tilt,
lens, hidden dots and dropped frames; `--setup` of the tracker proposes what to look for. The other
data set has the true angles of the same frames with noise of the tracker's own size. Then
comparisons/from_pixels.toml runs on both.
"""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import tomli_w
from joblib import Parallel, delayed
from rich.progress import track as progress
from scipy.interpolate import CubicHermiteSpline
from script import call

from frictionid import load_dataset
from frictionid.data.recordings import Recording
from frictionid.rig.camera.angles import Angles
from frictionid.rig.camera.film import Film, write_film
from frictionid.rig.camera.marker_setup import Links, MarkerSetup
from frictionid.rig.camera.propose import propose
from frictionid.rig.camera.scene import Look, View
from frictionid.rig.camera.source import open_source
from frictionid.rig.camera.track import track

ROOT = Path(__file__).parents[1]
CLEAN = ROOT / "data" / "acrobot_clean"
OUT = ROOT / "report" / "from_pixels_data"
COUNT = 10
FILM = Film(
    lengths=(0.153, 0.175),
    dropped=0.02,
    hidden=0.02,
    view=View(tilt=(2.0, -3.0), distortion=0.01),
    look=Look(gradient=0.4, shadow=0.3),
)


def seen(
    recording: Recording, film: Film, folder: Path, setup: MarkerSetup | None
) -> tuple[MarkerSetup, Angles]:
    """Angles from a film of a recording, and what the tracker looked for."""
    assert recording.truth is not None
    path = write_film(film, recording.truth, folder / recording.name)
    source = open_source(str(path))
    if setup is None:
        setup = propose(source).model_copy(update={"links": Links(lengths=list(film.lengths))})
    angles = track(source, setup).angles
    path.unlink()  # a hundred megabytes each
    return setup, angles


def table(recording: Recording, time: np.ndarray, q: np.ndarray, sigma: np.ndarray) -> str:
    """CSV text with the camera's rows, then the drive's."""
    assert recording.truth is not None
    spans = (recording.truth.angle, recording.truth.velocity)
    true_q = CubicHermiteSpline(spans[0].time, spans[0].value, spans[1].value)
    columns = [time, q, sigma, true_q(time), true_q(time, 1)]
    rows = [
        ",".join([*(f"{v:.8f}" if np.isfinite(v) else "" for v in row), "", ""])
        for row in np.column_stack(columns)
    ]
    names = "time_camera,q1,q2,sigma1,sigma2,q1_true,q2_true,w1_true,w2_true,time_drive,u2"
    torque = recording.torque
    logged = [
        f"{',' * 9}{t:.8f},{u:.8f}" for t, u in zip(torque.time, torque.value[:, 1], strict=True)
    ]
    return "\n".join([names, *rows, *logged]) + "\n"


def document(name: str, described: str) -> bytes:
    """dataset.toml, with the truth of data/acrobot_clean."""
    told = tomllib.loads((CLEAN / "dataset.toml").read_text())
    columns = {
        "time": {"angle": "time_camera", "torque": "time_drive"},
        "angle": ["q1", "q2"],
        "sigma": ["sigma1", "sigma2"],
        "missing": "drop",
        "torque": ["", "u2"],
        "truth": {"angle": ["q1_true", "q2_true"], "velocity": ["w1_true", "w2_true"]},
    }
    kept = {key: told[key] for key in ("origin", "licence", "mechanism", "recordings", "truth")}
    head = {"name": name, "description": described}
    return tomli_w.dumps({**head, **kept, "columns": columns}).encode()


def main(*, jobs: int = 2, codec: Literal["jpeg", "jpeg444"] = FILM.codec) -> None:
    """Film, track, write both data sets, compare."""
    film = replace(FILM, codec=codec)
    recordings = load_dataset(CLEAN).recordings[::2][:COUNT]
    for name in ("tracked", "perfect"):
        (OUT / name).mkdir(parents=True, exist_ok=True)
    setup, first = seen(recordings[0], film, OUT, None)
    work = Parallel(n_jobs=jobs, return_as="generator")(
        delayed(seen)(recording, film, OUT, setup) for recording in recordings[1:]
    )
    found = [first, *(a for _, a in progress(work, "filming, tracking", total=len(recordings) - 1))]
    rng = np.random.default_rng(0)
    for recording, angles in zip(recordings, found, strict=True):
        assert recording.truth is not None
        q, w = recording.truth.angle, recording.truth.velocity
        true = CubicHermiteSpline(q.time, q.value, w.value)(angles.time)
        there = np.isfinite(angles.q).all(axis=1)
        error = (angles.q - true)[there]
        noise = error.std(axis=0)
        print(
            f"{recording.name}: {there.mean():.1%} found, off by {np.degrees(noise).round(3)} deg, "
            f"stated {np.degrees(np.sqrt((angles.sigma[there] ** 2).mean(axis=0))).round(3)}"
        )
        perfect = true + noise * rng.standard_normal(true.shape)
        perfect[~there] = np.nan
        flat = np.where(there[:, None], noise, np.nan)
        for name, value, sigma in (("tracked", angles.q, angles.sigma), ("perfect", perfect, flat)):
            text = table(recording, angles.time, value, sigma)
            (OUT / name / f"{recording.name}.csv").write_text(text)
    for name, described in (
        ("tracked", "Angles tracked in simulated films of data/acrobot_clean."),
        ("perfect", "True angles of the same frames, with noise of the tracker's own size."),
    ):
        (OUT / name / "dataset.toml").write_bytes(document(name, described))
    from frictionid.cli.suites import compare

    compare(
        ROOT / "comparisons" / "from_pixels.toml",
        None,
        ROOT / "report" / "from_pixels",
        jobs,
        False,
    )


if __name__ == "__main__":
    call(main)
