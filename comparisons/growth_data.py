"""Simulated acrobots of 8.6e3 to 8.6e5 samples, for `growth.py`.

Ten times the 25 recordings of data/acrobot_clean are simulated, with start angles and commands of
their own, and 50 stretches of 20 s at 1 kHz. Larger sets repeat these motions with noise, names and
torque noise of their own: what time and memory depend on is their number and length. The long
recording is stretches one after the other, with a pause of a second before the next, as the motion
does not go on from one to the other.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from frictionid.arrays import Array
from frictionid.simulate import Camera, Drive, Multisine, Rig, Run, load_rig, simulate

RIG = Path(__file__).parent.parent / "data" / "acrobot_clean" / "rig.toml"
SHORT, PAUSE = 333, 1.0
STRETCHES, STRETCH = 50, 20_000
ROW = "{:.6f},{:.7f},{:.7f},{:.6f}"
NOISE = 1e-4  # [rad] of encoders


@dataclass(frozen=True)
class Data:
    """A data set to be made: `count` recordings of `samples` at a rate [Hz].

    kind : "recordings" as in the default comparison, "one" long one, or "short" ones of a third of
    a second
    """

    kind: str
    count: int
    samples: int
    rate: float

    @property
    def total(self) -> int:
        """Samples of all recordings."""
        return self.count * self.samples

    @property
    def name(self) -> str:
        """Of its folder."""
        return f"{self.kind}_{self.count}x{self.samples}"


DEFAULT = tuple(Data("recordings", 25 * times, 343, 60.0) for times in (1, 10, 100))
ONE = tuple(Data("one", 1, samples, 1e3) for samples in (10_000, 100_000, 1_000_000))
MANY = tuple(Data("short", count, SHORT, 1e3) for count in (30, 300, 3_000))


def make(data: Data, folder: Path) -> Path:
    """The folder of a data set, made where it is not there yet."""
    target = folder / data.name
    if (target / "dataset.toml").exists():
        return target
    target.mkdir(parents=True, exist_ok=True)
    for i, table in enumerate(_tables(data)):
        text = "\n".join(["time,q1,q2,u2", *(ROW.format(*row) for row in table)])
        (target / f"{i:05d}.csv").write_text(text + "\n")
    lines = (
        f"name = {json.dumps(data.name)}",
        'origin = "simulated by comparisons/growth.py"',
        '[mechanism]\nkind = "acrobot"',
        '[columns]\ntime = "time"\nangle = ["q1", "q2"]\ntorque = ["", "u2"]',
        '[recordings]\npatterns = ["*.csv"]',
    )
    (target / "dataset.toml").write_text("\n".join(lines) + "\n")
    return target


def _tables(data: Data) -> Iterator[Array]:
    """Time, both angles and the torque (T, 4) of each recording."""
    if data.kind == "recordings":
        motions, sigma = _default_motions(), load_rig(RIG).camera.angle_noise
    else:
        motions, sigma = _fine_motions(), NOISE
    if data.kind == "one":
        motions = [_joined(motions, data.samples)]
    elif data.kind == "short":
        whole = STRETCH // SHORT * SHORT
        motions = [part for m in motions for part in np.split(m[:whole], STRETCH // SHORT)]
    for i in range(data.count):
        rng = np.random.default_rng([7, i])
        table = motions[i % len(motions)].copy()
        table[:, 0] -= table[0, 0]
        table[:, 1:3] += sigma * rng.standard_normal((len(table), 2))
        table[:, 3] += 1e-6 * rng.standard_normal(len(table)) * (table[:, 3] != 0)
        yield table


@cache
def _default_motions() -> list[Array]:
    """The recordings of the default comparison and nine times as many others like them."""
    rig, rng, runs = load_rig(RIG), np.random.default_rng(0), []
    for times in range(10):
        for run in rig.recordings:
            start = tuple(np.asarray(run.start_angle) + (times > 0) * rng.normal(0.0, 0.2, 2))
            runs.append(replace(run, name=f"{run.name}_{times}", start_angle=start))
    return _simulated(
        replace(rig, recordings=tuple(runs), camera=replace(rig.camera, angle_noise=0))
    )


@cache
def _fine_motions() -> list[Array]:
    """Stretches of 20 s at 1 kHz under sums of sines."""
    rng = np.random.default_rng(1)
    runs = []
    for i in range(STRETCHES):
        frequencies = tuple(np.sort(rng.uniform(0.3, 2.5, 5)))
        command = Multisine(0.3, frequencies)
        runs.append(Run(f"stretch_{i}", tuple(rng.uniform(-2.0, 2.0, 2)), torques=(command,)))
    camera, drive = Camera(STRETCH, 1e3), Drive(1e3)
    rig = load_rig(RIG)
    return _simulated(replace(rig, recordings=tuple(runs), camera=camera, drive=drive, substeps=2))


def _simulated(rig: Rig) -> list[Array]:
    out = []
    for r in simulate(rig).recordings:
        out.append(np.column_stack([r.angle.time, r.angle.value, r.torque.value[:, 1]]))
    return out


def _joined(motions: list[Array], samples: int) -> Array:
    """One recording of so many samples, of stretches with a pause between them."""
    parts, begin = [], 0.0
    for k in range(-(-samples // STRETCH)):
        part = motions[k % len(motions)].copy()
        part[:, 0] += begin
        begin = part[-1, 0] + PAUSE
        parts.append(part)
    return np.concatenate(parts)[:samples]
