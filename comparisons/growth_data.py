"""Simulated acrobots of 8.6e3 to 8.6e5 samples, and chains of joints, for `growth.py`.

Ten times the 25 recordings of data/acrobot_clean are simulated, with start angles and commands of
their own, and 50 stretches of 20 s at 1 kHz. Larger sets repeat these motions with noise, names and
torque noise of their own: what time and memory depend on is their number and length. The long
recording is stretches one after the other, with a pause of a second before the next, as the motion
does not go on from one to the other.

A chain is a random robot of the tests as a URDF. Its torques are those of sums of sines, with
Coulomb and viscous friction.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from fixtures.random_robots import random_robot, urdf_text

from frictionid.arrays import Array
from frictionid.mechanics import Mechanism, urdf
from frictionid.simulate import Camera, Drive, Multisine, Rig, Run, load_rig, simulate

RIG = Path(__file__).parent.parent / "data" / "acrobot_clean" / "rig.toml"
SHORT, PAUSE = 333, 1.0
STRETCHES, STRETCH = 50, 20_000
NOISE = 1e-4  # [rad] of encoders
ROTOR = 0.1  # [kg m^2] of each joint of a chain
WAVES = (0.2, 0.4, 0.7)  # [Hz]


@dataclass(frozen=True)
class Data:
    """A data set to be made: `count` recordings of `samples` at a rate [Hz].

    kind : "recordings" as in the default comparison, "one" long one, or "short" ones of a third of
    a second; of a chain of "joints"; or "recordings" for laws of so many "parameters"
    """

    kind: str
    count: int
    samples: int
    rate: float
    joints: int = 2
    parameters: int = 0

    @property
    def size(self) -> int:
        """What grows: joints, parameters, or samples."""
        return int(getattr(self, self.kind, self.total))

    @property
    def total(self) -> int:
        """Samples of all recordings."""
        return self.count * self.samples

    @property
    def name(self) -> str:
        """Of its folder."""
        if self.kind == "joints":
            return f"joints_{self.joints}"
        kind = "recordings" if self.parameters else self.kind
        return f"{kind}_{self.count}x{self.samples}"


DEFAULT = tuple(Data("recordings", 25 * times, 343, 60.0) for times in (1, 10, 100))
ONE = tuple(Data("one", 1, samples, 1e3) for samples in (10_000, 100_000, 1_000_000, 10_000_000))
MANY = tuple(Data("short", count, SHORT, 1e3) for count in (30, 300, 3_000))
CHAINS = tuple(Data("joints", 3, 1_000, 100.0, joints=n) for n in (1, 3, 10, 30))
LAWS = tuple(Data("parameters", 25, 343, 60.0, parameters=N) for N in (8, 48, 500, 5_000))
ALL = (DEFAULT, ONE, MANY, CHAINS, LAWS)


def make(data: Data, folder: Path) -> Path:
    """The folder of a data set, made where it is not there yet."""
    target = folder / data.name
    if (target / "dataset.toml").exists():
        return target
    target.mkdir(parents=True, exist_ok=True)
    if data.kind == "joints":
        return _make_chain(data, target)
    tables = (dict(zip(("time", "q1", "q2", "u2"), t.T, strict=True)) for t in _tables(data))
    return _written(target, tables, 'kind = "acrobot"', ["q1", "q2"], ["", "u2"])


def _written(
    target: Path,
    tables: Iterator[dict[str, Array]],
    mechanism: str,
    angles: list[str],
    torques: list[str],
) -> Path:
    """The folder of a data set, written."""
    for i, table in enumerate(tables):
        rows = zip(*([f"{x:.7f}" for x in column] for column in table.values()), strict=True)
        text = "\n".join([",".join(table), *(",".join(row) for row in rows)])
        (target / f"{i:05d}.csv").write_text(text + "\n")
    lines = (
        f"name = {json.dumps(target.name)}",
        'origin = "simulated by comparisons/growth.py"',
        f"[mechanism]\n{mechanism}",
        f'[columns]\ntime = "time"\nangle = {angles}\ntorque = {torques}',
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


def _make_chain(data: Data, target: Path) -> Path:
    """The folder of recordings of a chain."""
    n = data.joints
    parts = random_robot(np.random.default_rng(n), n, serial=True)
    (target / "chain.urdf").write_text(urdf_text(parts))
    chain = urdf(target / "chain.urdf").with_values({f"rotor_joint_{j}": ROTOR for j in range(n)})
    tables = (_chain_table(chain, data, np.random.default_rng([n, i])) for i in range(data.count))
    rotors = "".join(f"rotor_joint_{j} = {ROTOR}\n" for j in range(n))
    mechanism = f'urdf = "chain.urdf"\n[mechanism.parameters]\n{rotors}'
    names = [[f"{of}{j}" for j in range(n)] for of in "qu"]
    return _written(target, tables, mechanism, *names)


def _chain_table(chain: Mechanism, data: Data, rng: np.random.Generator) -> dict[str, Array]:
    """Time, angles with noise and torques of a chain on sums of sines."""
    time, pulse = np.arange(data.samples) / data.rate, 2.0 * np.pi * np.array(WAVES)
    phase = np.multiply.outer(time, pulse) + rng.uniform(0.0, 2.0 * np.pi, (chain.n, 1, len(WAVES)))
    size = rng.normal(0.0, 0.5, (chain.n, len(WAVES))) / pulse
    q, w = (np.einsum("jtk,jk->tj", x, size) for x in (np.sin(phase), pulse * np.cos(phase)))
    a = np.einsum("jtk,jk->tj", -(pulse**2) * np.sin(phase), size)
    M, h = chain.dynamics(chain.nominal_base, q, w)
    u = (M @ a[..., None])[..., 0] - h
    u += 0.02 * np.sqrt((u**2).mean(axis=0)) * (np.sign(w) + w)
    u *= 1.0 + 0.01 * rng.standard_normal(u.shape)
    q = q + NOISE * rng.standard_normal(q.shape)
    pairs = [(f"{of}{j}", x[:, j]) for of, x in (("q", q), ("u", u)) for j in range(chain.n)]
    return {"time": time, **dict(pairs)}
