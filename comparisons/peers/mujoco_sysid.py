"""frictionid's shooting beside mujoco.sysid: same recordings, same windows, a fresh process each.

python comparisons/peers/mujoco_sysid.py [--seeds 5] [--ways documented batched free]

Needs the extra `peers`; mujoco_side.py says what the ways are. Recordings are simulated with
set-valued friction by the rig of data/acrobot_clean, once with Coulomb and viscous friction and
once with its own Stribeck friction. The peer always fits Coulomb and viscous friction, all that
MuJoCo's joints have; frictionid fits that to the first and asymmetric Stribeck friction to the
second. Wall time is that of a process: starting Python, imports and first use are in it.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from acrobot_mjcf import mjcf
from exchange import Task, save
from rich.console import Console
from rich.table import Table

from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset
from frictionid.data.state_estimators import RTS
from frictionid.evaluation import curve_error, steady_state, velocity_grid
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.friction.laws import Stribeck as StribeckLaw
from frictionid.simulate import Curve, Rig, Stribeck, load_rig, simulate

HERE = Path(__file__).parent
RIG = HERE.parent.parent / "data" / "acrobot_clean" / "rig.toml"
LENGTH = 20  # samples from the begin of a window to the next one's
OURS = "frictionid"
WAYS = ("documented", "batched", "free")
COULOMB = Curve((0.165, 0.055), (0.165, 0.055), (0.004, 0.0008))
SHARP = 1e-6  # [rad/s]: curves are compared with a true sgn(w)
LAWS = {
    "coulomb_viscous": CoulombViscous(width=SHARP),
    "stribeck": StribeckLaw(width=SHARP, symmetric=False),
}
# what has to hold: our curve error over the peer's, and its wall time over ours
ERROR_BAR = {"coulomb_viscous": 1.0, "stribeck": 0.1}
TIME_BAR = 10.0


class Run(NamedTuple):
    """What one side made of one task: curve errors (2,), wall and processor time [s].

    Processor time tells more than wall time where others use the machine too.
    """

    truth: str
    tool: str
    windows: int
    error: np.ndarray
    wall: float
    cpu: float


def truths(rig: Rig) -> dict[str, Rig]:
    """The rig with either friction."""
    return {"coulomb_viscous": replace(rig, friction=Stribeck(COULOMB)), "stribeck": rig}


def task_of(dataset: Dataset, length: int = LENGTH) -> Task:
    """Windows of a data set and their smoothed starts; what is left over at the end is cut."""
    recordings = dataset.recordings
    K = (len(recordings[0].angle.time) - 1) // length
    T = K * length + 1
    states = RTS()([r.angle for r in recordings])
    start = [np.concatenate([s.q, s.w], axis=1)[: T - 1 : length] for s in states]
    return Task(
        time=recordings[0].angle.time[:T],
        angle=np.stack([r.angle.value[:T] for r in recordings]),
        torque=np.stack([r.torque.value[:T] for r in recordings]),
        start=np.stack(start),
        length=length,
        mjcf=mjcf({k: v[0] for k, v in plant_of(dataset).parameters.items()}),
    )


def solve(task: Task, script: str, *arguments: str) -> tuple[np.ndarray, float, float]:
    """Theta that a side finds, and the wall and processor time [s] of its process.

    Raises
    ------
    RuntimeError
        Where the process ends with an error: the last line of it.
    """
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "task.npz", Path(folder) / "result.npz"
        save(task, source)
        command = [sys.executable, str(HERE / script), str(source), str(target), *arguments]
        before, begin = _used(), time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        wall, cpu = time.perf_counter() - begin, _used() - before
        if done.returncode:
            raise RuntimeError(f"{script}: {done.stderr.strip().splitlines()[-1]}")
        with np.load(target) as result:
            return result["theta"], wall, cpu


def _used() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


def error_of(theta: np.ndarray, law: str, dataset: Dataset) -> np.ndarray:
    """Curve error of each joint, as everywhere in frictionid."""
    moved = np.concatenate([r.truth.velocity.value for r in dataset.recordings])
    grid = velocity_grid(moved)
    estimate = Friction(LAWS[law], theta).curve(grid)
    return curve_error(estimate, steady_state(dataset.truth, SHARP).curve(grid), grid)


def runs_of(truth: str, dataset: Dataset, ways: list[str], say: Console) -> list[Run]:
    """Ours and the peer's runs on one data set."""
    task = task_of(dataset)
    sides = [(OURS, truth, ("our_side.py", truth))]
    sides += [(way, "coulomb_viscous", ("mujoco_side.py", way)) for way in ways]
    out = []
    for tool, law, command in sides:
        theta, wall, cpu = solve(task, *command)
        run = Run(truth, tool, task.count, error_of(theta, law, dataset), wall, cpu)
        say.print(f"{truth}, {tool}: {wall:.1f} s, {_percent(run.error)} %")
        out.append(run)
    return out


def ratios(ours: list[Run], peers: list[Run]) -> tuple[np.ndarray, float]:
    """Error of ours over the peer's by joint (2,), and its time over ours, in the worst seed."""
    pairs = list(zip(ours, peers, strict=True))
    errors = np.max([a.error / b.error for a, b in pairs], axis=0)
    return errors, min(b.wall / a.wall for a, b in pairs)


def table_of(truth: str, runs: list[Run]) -> Table:
    """What each tool made of one truth, medians over seeds, and whether the bars hold in each."""
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(run.tool, []).append(run)
    error, faster = ERROR_BAR[truth], TIME_BAR
    table = Table(
        *("", "wall\n[s]", "cpu\n[s]", "curve error [%]\njoint 1 / 2"),
        *(f"ours / its\n(<= {error:g})", f"faster\n(>= {faster:g})", "holds"),
        title=f"TrueFriction {truth}: frictionid beside ways of mujoco.sysid\n"
        f"{runs[0].windows} windows of {LENGTH} samples, {len(groups[OURS])} seed(s)",
    )
    for tool, group in groups.items():
        wall, cpu = (float(np.median([getattr(r, k) for r in group])) for k in ("wall", "cpu"))
        found = [f"{wall:.1f}", f"{cpu:.1f}", _percent(np.median([r.error for r in group], axis=0))]
        table.add_row(tool, *found, *([] if tool == OURS else _judged(truth, groups[OURS], group)))
    return table


def _judged(truth: str, ours: list[Run], peers: list[Run]) -> list[str]:
    errors, faster = ratios(ours, peers)
    less, sooner = np.all(errors <= ERROR_BAR[truth]), faster >= TIME_BAR
    said = {(True, True): "both", (True, False): "error", (False, True): "time"}
    shown = " / ".join(f"{e:.3f}" for e in errors)
    return [shown, f"{faster:.1f}", said.get((bool(less), bool(sooner)), "neither")]


def _percent(error: np.ndarray) -> str:
    return " / ".join(f"{100 * e:.2f}" for e in error)


def main() -> None:
    """Measure and print."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seeds", type=int, default=1, help="simulated data sets of each truth")
    options.add_argument("--ways", nargs="+", default=WAYS, choices=WAYS, help="of the peer")
    given, say = options.parse_args(), Console()
    say.print(
        f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} before: times need it below 1"
    )
    for truth, rig in truths(load_rig(RIG)).items():
        runs = []
        for seed in range(1, given.seeds + 1):
            runs += runs_of(truth, simulate(rig, seed), given.ways, say)
        say.print(table_of(truth, runs))


if __name__ == "__main__":
    main()
