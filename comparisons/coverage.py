"""How often intervals hold the truth: simulated sets, each fitted by shooting.

python comparisons/coverage.py [--sets 200] [--jobs 1] [--seed 1] [--recordings 10]

Each set has motor torques, start angles and camera noise of its own, all drawn from its seed. Its
friction is set-valued, its torque acts 18 ms late, its rotor's inertia is missing from the told
mechanism; friction, inertia and delay are free, Stribeck friction is fitted to Stribeck friction.
Bands are asked for at velocities of the motion, from a twentieth of its 95 % quantile to all of it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed
from rich.console import Console
from rich.progress import track
from rich.table import Table
from threadpoolctl import threadpool_limits

from frictionid.data.recordings import Dataset
from frictionid.evaluation import curves, steady_state, velocity_grid
from frictionid.friction.laws import Stribeck
from frictionid.identifiers import LeastSquares
from frictionid.identifiers.formulation import INTEGRAL, training_problem
from frictionid.mechanics import plant_of
from frictionid.shooting import Refined, refine
from frictionid.shooting.parameters import DelayBlock, FrictionBlock, InertiaBlock
from frictionid.simulate import (
    Camera,
    Curve,
    Drive,
    Multisine,
    Noise,
    Rig,
    Run,
    Steps,
    simulate,
)
from frictionid.simulate import Stribeck as TrueStribeck
from frictionid.simulate.rig import true_system

LEVELS = (0.9, 0.95)
BARS = {0.9: (0.86, 0.94), 0.95: (0.92, 0.98)}
DELAY = 0.018  # [s]
TRUTH = {  # of joint 1 and 2; the law's own names
    "coulomb": (0.12, 0.05),
    "peak": (0.06, 0.03),
    "stribeck_velocity": (1.0, 2.0),
    "viscous": (0.004, 0.0008),
}
BLOCKS = (FrictionBlock(), InertiaBlock(), DelayBlock())
TOGETHER = 10  # sets that are simulated side by side
SHARES = np.array([0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0])


class Seen(NamedTuple):
    """What one set shows.

    names; error (D,), estimate minus truth over its standard error, and found (D,), whether the
    parameter was called identified; parameters (L, D), pointwise (L, V, n) and simultaneous (L, n):
    whether intervals and bands at each level hold the truth.
    """

    names: tuple[str, ...]
    error: np.ndarray
    found: np.ndarray
    parameters: np.ndarray
    pointwise: np.ndarray
    simultaneous: np.ndarray


def runs_of(seed: int, recordings: int) -> list[Run]:
    """Recordings of one set: two free decays, the others driven."""
    draw, runs = np.random.default_rng([seed, 7]), []
    for k in range(recordings):
        start = draw.uniform(1.8, 2.9) * draw.choice([-1, 1]), draw.uniform(-1.5, 1.5)
        kinds = (
            Multisine(0.14, tuple(map(float, draw.uniform(0.6, 2.0, 3)))),
            Steps(0.14, float(draw.uniform(0.25, 0.5))),
            Noise(0.14, (0.5, float(draw.uniform(0.9, 1.4)))),
        )
        torques = () if k < 2 else (kinds[k % 3],)
        start_angle = float(start[0]), float(start[1])
        runs.append(Run(f"{seed:04d}_{k:02d}", start_angle, torques=torques))
    return runs


def rig_of(seeds: Iterable[int], recordings: int = 10) -> Rig:
    """The rig with the recordings of some sets, 5 s each at 60 Hz."""
    curve = Curve(
        *(TRUTH["coulomb"], TRUTH["coulomb"], TRUTH["viscous"]),
        *(TRUTH["peak"], TRUTH["peak"], TRUTH["stribeck_velocity"]),
    )
    return Rig(
        "coverage",
        {"kind": "acrobot"},
        TrueStribeck(curve),
        Camera(samples=301, angle_noise=0.0016231562),
        tuple(run for seed in seeds for run in runs_of(seed, recordings)),
        true_parameters={"rotor": 2e-6},
        drive=Drive(delay=DELAY),
        substeps=24,
    )


def sets_of(seeds: Sequence[int], recordings: int = 10) -> list[Dataset]:
    """Simulated sets, moved side by side: as they come alone, sooner."""
    everything = simulate(rig_of(seeds, recordings))
    at = range(0, len(everything.recordings), recordings)
    return [replace(everything, recordings=everything.recordings[i : i + recordings]) for i in at]


def fitted(dataset: Dataset) -> Refined:
    """A set's friction, as `frictionid fit --by shooting` finds it."""
    law = LeastSquares(Stribeck())
    problem = training_problem(dataset, plant_of(dataset), INTEGRAL)
    return refine(law.fit(problem, np.ones((1, len(problem.r))), seed=0)[0], dataset, BLOCKS)


def true_values(found: Refined) -> np.ndarray:
    """Values (D,) that the estimates should have."""
    names, base = found.mechanism.base_names, true_system(rig_of([0])).p
    known = {"torque delay": DELAY, **dict(zip(names, base, strict=True))}
    for joint, label in enumerate(found.mechanism.description.joints):
        known |= {f"{name} of {label}": value[joint] for name, value in TRUTH.items()}
    return np.array([known[e.name] for e in found.covariance.parameters])


def seen(dataset: Dataset) -> Seen:
    """Fit one set, and look which intervals hold the truth."""
    found = fitted(dataset)
    true, c = true_values(found), found.covariance
    far = velocity_grid(np.concatenate([r.truth.velocity.value for r in dataset.recordings]))[-1]
    grid = np.outer(np.concatenate([-SHARES[::-1], SHARES]), far)
    off = np.abs(curves(found.friction, grid) - curves(steady_state(dataset.truth), grid))
    intervals = np.stack([c.interval(level) for level in LEVELS])
    bands = np.array([found.bands(grid, level) for level in LEVELS])
    return Seen(
        tuple(e.name for e in c.parameters),
        (c.values - true) / c.error,
        c.identified,
        (intervals[..., 0] <= true) & (true <= intervals[..., 1]),
        off <= bands[:, 0],
        (off <= bands[:, 1]).all(axis=1),
    )


def some(seeds: Sequence[int], recordings: int) -> list[Seen]:
    """What a few sets show."""
    with threadpool_limits(1):
        return [seen(dataset) for dataset in sets_of(seeds, recordings)]


def shares(sets: list[Seen]) -> Iterable[tuple[str, int, np.ndarray]]:
    """Name, number of cases, share covered at each level (L,): parameters, then bands."""
    held = np.stack([s.parameters for s in sets])  # (S, L, D)
    found = np.stack([s.found for s in sets])[:, None]
    for d, name in enumerate(sets[0].names):
        yield name, int(found[..., d].sum()), _mean(held[..., d], found[..., d])
    yield "identified parameters", int(found.sum()), _mean(held, found)
    for name, all_of in (
        ("pointwise bands", np.stack([s.pointwise for s in sets])),
        ("simultaneous bands", np.stack([s.simultaneous for s in sets])),
    ):
        for j in range(all_of.shape[-1]):
            own = all_of[..., j]
            yield f"{name}, joint {j + 1}", own[:, 0].size, _mean(own, np.ones_like(own))
        yield name, all_of[:, 0].size, _mean(all_of, np.ones_like(all_of))


def _mean(held: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Share (L,) that holds of the cases that count; both (S, L, ...)."""
    axes = (0, *range(2, held.ndim))
    counts = np.broadcast_to(counts, held.shape)
    return (held & counts).sum(axis=axes) / np.maximum(counts.sum(axis=axes), 1)


def table_of(sets: list[Seen]) -> Table:
    """The shares, and how errors compare with their standard errors."""
    judged = {"identified parameters", "pointwise bands", "simultaneous bands"}
    error = np.stack([s.error for s in sets])
    size = dict(zip(sets[0].names, np.sqrt((error**2).mean(0)), strict=True))
    bias = dict(zip(sets[0].names, error.mean(0), strict=True))
    table = Table(
        *("", "cases", *(f"{100 * level:.0f} %" for level in LEVELS)),
        *("mean error\n[std. errors]", "rms", "holds"),
        title=f"Share of {len(sets)} sets whose intervals hold the truth",
    )
    for name, cases, share in shares(sets):
        holds = all(
            BARS[level][0] <= s <= BARS[level][1] for level, s in zip(LEVELS, share, strict=True)
        )
        said = ("yes" if holds else "no") if name in judged else ""
        more = [f"{x[name]:.2f}" if name in x else "" for x in (bias, size)]
        table.add_row(name, str(cases), *(f"{100 * s:.1f}" for s in share), *more, said)
    return table


def computed(given: argparse.Namespace) -> list[Seen]:
    """Results of all sets, in processes side by side."""
    last = given.seed + given.sets
    chunks = [range(k, min(k + TOGETHER, last)) for k in range(given.seed, last, TOGETHER)]
    jobs = Parallel(n_jobs=given.jobs, return_as="generator")
    running = jobs(delayed(some)(chunk, given.recordings) for chunk in chunks)
    shown = track(running, f"by {TOGETHER} sets", len(chunks), console=Console(stderr=True))
    return [result for results in shown for result in results]


def main() -> None:
    """Measure and print."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--sets", type=int, default=200, help="simulated data sets")
    options.add_argument("--jobs", type=int, default=1, help="processes side by side")
    options.add_argument("--seed", type=int, default=1, help="of the first set")
    options.add_argument("--recordings", type=int, default=10, help="in each set")
    given = options.parse_args()
    Console().print(table_of(computed(given)))


if __name__ == "__main__":
    main()
