"""How right shooting is, and how long ten folds of it take.

python comparisons/shooting_accuracy.py [--seeds 5] [--jobs 2]

Simulated rigs with set-valued friction, the recordings of data/acrobot_sim and acrobot_clean with
torques and noise of their own for each seed; the worst of the seeds is told. Predictions are judged
on a set that was not fitted, of another seed.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from coverage_fits import BLOCKS, shot
from joblib import Parallel, delayed
from outliers import error_of
from rich.console import Console
from rich.table import Table
from script import call
from threadpoolctl import threadpool_limits

from frictionid.comparison.cross_validate import Benchmark, run
from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset
from frictionid.evaluation import (
    Protocol,
    Split,
    make_folds,
    prepare,
    score_model,
)
from frictionid.fitting.fit import Fit
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.parameter_block import ParameterBlock
from frictionid.fitting.parameters import FrictionBlock, GainBlock, InertiaBlock
from frictionid.fitting.shooting import Settings, Shooting
from frictionid.friction.laws import CoulombViscous, Spline, Stribeck
from frictionid.simulate import Curve, Rig, load_rig, simulate
from frictionid.simulate import Stribeck as TrueStribeck
from frictionid.simulate.rig import true_system

DATA = Path(__file__).parent.parent / "data"
LAWS = (CoulombViscous(), Stribeck(), Stribeck(symmetric=False), Spline())
COULOMB = Curve((0.165, 0.055), (0.165, 0.055), (0.004, 0.0008))
ONE = 1.0  # [s] ahead
UNSEEN = 100  # added to the seeds of sets that only test
Lines = list[tuple[str, str]]


def fitted(dataset: Dataset, law: object, blocks: tuple[ParameterBlock, ...] = BLOCKS) -> Fit:
    """What `frictionid fit --by shooting` finds."""
    return shot(dataset, law, blocks, Settings())


def off(found: Fit, dataset: Dataset) -> np.ndarray:
    """Curve error (n,) of each joint."""
    return error_of(found.friction, dataset)


def ahead(found: Fit, dataset: Dataset) -> np.ndarray:
    """Median and 90 % quantile (2,) [rad] after 1 s, from initial states by the model itself."""
    protocol = Protocol(horizons=(ONE,), initial_states="model")
    scores = score_model(found.friction, prepare(dataset, protocol)).scores
    own = scores[scores.score == "rollout_angle_truth"]
    values = dict(zip(own.statistic, own.value, strict=True))
    return np.array([values["median"], values["q90"]])


def machine(seed: int) -> tuple[np.ndarray, ...]:
    """Curve error, delay error [s], relative base parameters' errors, and errors after 1 s."""
    rig = load_rig(DATA / "acrobot_sim" / "rig.toml")
    with threadpool_limits(1):
        dataset = simulate(rig, seed)
        found = fitted(dataset, Stribeck(symmetric=False))
        base = np.asarray(found.calibration.base) / true_system(rig).p - 1.0
        late = np.abs(found.calibration.delay - rig.drive.delay)
        later = ahead(found, simulate(rig, UNSEEN + seed))
        return off(found, dataset), late, np.abs(base).max(), later


def rights(seeds: int, jobs: int) -> Lines:
    """Friction, inertia and delay free, the right law."""
    results = Parallel(n_jobs=jobs)(delayed(machine)(seed) for seed in range(1, seeds + 1))
    error, late, base, later = (np.max(column, axis=0) for column in zip(*results, strict=True))
    return [
        (f"curve error, worst of {seeds} seeds (joint 1 / 2; at most 1 %)", percent(error)),
        ("  error of the delay (at most 0.3 ms)", f"{1e3 * late:.2f} ms"),
        ("  error of the inertias (at most 0.5 %)", f"{100 * base:.2f} %"),
        ("  after 1 s, median / 90 % (at most 0.012 / 0.05 rad)", radians(later)),
    ]


def plainer(rig: Rig) -> Lines:
    """Stribeck friction against Coulomb and viscous truth: what is too much is called so."""
    dataset = simulate(replace(rig, friction=TrueStribeck(COULOMB)))
    c = fitted(dataset, Stribeck()).covariance
    extra = [k for k, e in enumerate(c.parameters) if e.name.startswith(("peak", "stribeck"))]
    named = ", ".join(c.parameters[k].name for k in extra if c.identified[k])
    said = f"{sum(not c.identified[k] for k in extra)} of {len(extra)}"
    return [
        (
            "stribeck, Coulomb-viscous truth: extra parameters not identified",
            f"{said}; identified: {named}" if named else said,
        )
    ]


def gained(rig: Rig) -> Lines:
    """A torque that is 5 % larger than logged, one base parameter known."""
    dataset = simulate(replace(rig, drive=replace(rig.drive, gain=1.05)))
    blocks = (FrictionBlock(), InertiaBlock(fixed=("gravity_2",)), GainBlock())
    gain = float(fitted(dataset, Stribeck(symmetric=False), blocks).calibration.gain[1])
    return [("gain 1.05, gravity_2 fixed: found (to 1 %)", f"{gain:.4f}")]


def weighed(rig: Rig) -> Lines:
    """Link 2 is 10 % heavier than told."""
    mass = 1.1 * plant_of(simulate(shortest(rig))).parameters["m3"][0]
    heavy = replace(rig, true_parameters={"m3": float(mass)})
    dataset, true = simulate(heavy), true_system(heavy).p
    free, told = (
        fitted(dataset, Stribeck(symmetric=False), blocks)
        for blocks in ((FrictionBlock(), InertiaBlock()), (FrictionBlock(),))
    )
    base = np.abs(np.asarray(free.calibration.base) / true - 1.0).max()
    return [
        ("m3 10 % wrong, inertia free: error of the base parameters", f"{100 * base:.2f} %"),
        ("  curve error (joint 1 / 2)", percent(off(free, dataset))),
        ("  curve error where inertia is not free", percent(off(told, dataset))),
    ]


def shortest(rig: Rig) -> Rig:
    """One recording of two samples."""
    return replace(rig, recordings=rig.recordings[:1], camera=replace(rig.camera, samples=2))


def ten_folds(jobs: int) -> Lines:
    """Four laws, ten folds, acrobot_clean, in a fresh process."""
    begin = time.perf_counter()
    command = [sys.executable, __file__, "--folds", "--jobs", str(jobs)]
    cpu = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    wall = time.perf_counter() - begin
    said = f"{wall:.0f} s, {cpu} s of processors"
    return [(f"four laws, ten folds, {jobs} processes, fresh (at most 90 s)", said)]


def one_law(law: object) -> float:
    """Processor time [s] of one law in all folds, without scores."""
    begin = time.process_time()
    dataset = load_dataset(DATA / "acrobot_clean")
    benchmark = Benchmark(
        dataset, make_folds(dataset.recordings, Split(count=10)), Protocol((0.1,))
    )
    with threadpool_limits(1):
        run(benchmark, LeastSquares(law), Shooting(blocks=BLOCKS))
    return time.process_time() - begin


def percent(error: np.ndarray) -> str:
    """Errors of the joints in per cent."""
    return " / ".join(f"{100 * e:.2f} %" for e in error)


def radians(error: np.ndarray) -> str:
    """Angles side by side."""
    return " / ".join(f"{e:.4f}" for e in error)


def rows(seeds: int, jobs: int) -> Iterator[tuple[str, str]]:
    """All figures."""
    yield from rights(seeds, jobs)
    rig = load_rig(DATA / "acrobot_clean" / "rig.toml")
    for part in (plainer, gained, weighed):
        yield from part(rig)
    yield from ten_folds(jobs)


def main(*, seeds: int = 5, jobs: int = 2, folds: bool = False) -> None:
    """Measure and print.

    Parameters
    ----------
    seeds : Simulated data sets.
    jobs : Processes side by side.
    folds : The four laws only, for their time.
    """
    if folds:
        times = Parallel(n_jobs=jobs)(delayed(one_law)(law) for law in LAWS)
        print(f"{sum(times):.0f}")
        return
    table = Table("what", "figure", title="shooting")
    for row in rows(seeds, jobs):
        table.add_row(*row)
    Console().print(table)


if __name__ == "__main__":
    call(main)
