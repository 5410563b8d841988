"""How right one-step fits are on simulated acrobots: python comparisons/one_step_accuracy.py.

Curve errors of the study's recipe and of ours, with parametric laws and networks, and how often
SINDy finds the true terms and no others.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from threadpoolctl import threadpool_limits

from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.evaluation import (
    Protocol,
    curve_error,
    prepare,
    steady_state,
    velocity_grid,
)
from frictionid.fitting.identifiers import LeastSquares, SINDy
from frictionid.fitting.identifiers.compressed import CompressedNetwork
from frictionid.fitting.identifiers.network import Network
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY, training_problem
from frictionid.friction.laws import LSTM, MLP, Stribeck
from frictionid.simulate import Curve, load_rig, noise_free, simulate
from frictionid.simulate import Stribeck as SimulatedStribeck

DATA = Path(__file__).parent.parent / "data"


def fitted(identifier: Any, problem: Any) -> Any:
    """Friction fitted to all rows of a problem."""
    return identifier.fit(problem, np.ones((1, len(problem.r))), 0)[0]


def accuracy(name: str, dataset: Any) -> list[tuple[str, str]]:
    """Curve errors of the study's recipe and ours, fitted to all data."""
    grid = prepare(dataset, Protocol(horizons=(0.1,))).grid
    true = steady_state(dataset.truth).curve(grid)
    rows, errors = [], []
    for recipe, robust in ((STUDY, None), (INTEGRAL, None), (INTEGRAL, 3.0)):
        problem = training_problem(dataset, plant_of(dataset), recipe)
        friction = fitted(LeastSquares(Stribeck(symmetric=False), robust=robust), problem)
        errors.append(curve_error(friction.curve(grid), true, grid))
        shown = " / ".join(f"{100 * e:.1f} %" for e in errors[-1])
        how = f"{recipe.name}, robust" if robust else recipe.name
        rows.append((f"{name}: curve error, {how} (joint 1 / 2)", shown))
    ratio = " / ".join(f"{b / a:.2f}" for a, b in zip(*errors[:2], strict=True))
    return [*rows, ("  integral over study", ratio)]


def networks(dataset: Any) -> list[tuple[str, str]]:
    """Curve errors of networks fitted to all data by our recipe."""
    problem = training_problem(dataset, plant_of(dataset), INTEGRAL)
    grid = velocity_grid(problem.nodes.inputs.w)
    true = steady_state(dataset.truth).curve(grid)
    rows = []
    for name, identifier in (("mlp", CompressedNetwork(MLP())), ("lstm", Network(LSTM()))):
        friction = fitted(identifier, problem)
        shown = " / ".join(
            f"{100 * e:.1f} %" for e in curve_error(friction.curve(grid), true, grid)
        )
        rows.append((f"acrobot_clean: curve error, {name} (joint 1 / 2)", shown))
    return rows


TRUTHS = {
    "Coulomb-viscous": Curve((0.165, 0.055), (0.165, 0.055), (0.004, 0.0008)),
    "Stribeck": Curve(
        *((0.165, 0.0525), (0.165, 0.0525), (0.004, 0.0008)),
        *((0.0, 0.032), (0.0, 0.032), (1.0, 2.0)),
    ),
}
TERMS = {
    "Coulomb-viscous": [["coulomb", "viscous"], ["coulomb", "viscous"]],
    "Stribeck": [["coulomb", "viscous"], ["coulomb", "viscous", "peak_2.3"]],  # 2 is no candidate
}


def supports(rig: Any, seeds: int = 10) -> list[tuple[str, str]]:
    """How often SINDy finds the true terms and no others, each time with new camera noise."""
    rows = []
    for name, curve in TRUTHS.items():
        made = simulate(replace(rig, friction=SimulatedStribeck(curve)))
        right = 0
        for seed in range(seeds):
            random = np.random.default_rng(seed)
            noisy = tuple(_seen(r, rig.camera.angle_noise, random) for r in made.recordings)
            dataset = replace(made, recordings=noisy)
            problem = training_problem(dataset, plant_of(dataset), INTEGRAL)
            friction = fitted(SINDy(), problem)
            names = np.array(friction.law.names)
            right += [names[row != 0].tolist() for row in friction.theta] == TERMS[name]
        rows.append((f"sindy, {name} truth: seeds with the true terms only", f"{right} of {seeds}"))
    return rows


def _seen(recording: Any, noise: float, random: np.random.Generator) -> Any:
    angle = recording.truth.angle
    value = angle.value + noise * random.standard_normal(angle.value.shape)
    return replace(recording, angle=angle._replace(value=value))


def main() -> None:
    """Measure and print."""
    rig, clean = load_rig(DATA / "acrobot_clean" / "rig.toml"), load_dataset(DATA / "acrobot_clean")
    with threadpool_limits(1):
        rows = supports(rig)
        rows += accuracy("acrobot_clean", clean) + networks(clean)
        rows += accuracy("noise-free twin", simulate(noise_free(rig)))
        rows += accuracy("acrobot_sim", load_dataset(DATA / "acrobot_sim"))
    table = Table("what", "figure", title="one-step fits")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


if __name__ == "__main__":
    main()
