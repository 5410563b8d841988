"""Speed and accuracy of the parts, as ratios measured in one run: `make bench`.

Times are the best of a few repetitions on one thread; a ratio compares two ways to one answer.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import bench_networks
import bench_shooting
import bench_trees
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.evaluation import (
    Protocol,
    Split,
    curve_error,
    curves,
    make_folds,
    predict,
    prepare,
    steady_state,
)
from frictionid.friction import Friction, along
from frictionid.friction.laws import AsymmetricStribeck, Spline, Stribeck
from frictionid.identifiers import LeastSquares, Linear, SINDy
from frictionid.identifiers.formulation import INTEGRAL, STUDY, training_problem
from frictionid.simulate import Curve, load_rig, noise_free, simulate
from frictionid.simulate import Stribeck as SimulatedStribeck

DATA = Path(__file__).parent.parent / "data"


def best(call: Callable[[], Any], repetitions: int = 3) -> tuple[float, Any]:
    """Shortest time [s] of a call, and its result."""
    times = []
    for _ in range(repetitions):
        begin = time.perf_counter()
        result = call()
        times.append(time.perf_counter() - begin)
    return min(times), result


def fits(dataset: Any) -> list[tuple[str, str]]:
    """Ten folds at once against SciPy fold by fold, same cost function."""
    problem = training_problem(dataset, plant_of(dataset), INTEGRAL)
    folds = make_folds(dataset.recordings, Split(count=10))
    weights = folds.training(problem.recording, problem.time)
    identifier = LeastSquares(Stribeck())
    ours, friction = best(lambda: identifier.fit(problem, weights, 0))
    low, high = (np.tile([b[i] for b in Stribeck().bounds], 2) for i in (0, 1))

    def residual(theta: Any, root: Any) -> Any:
        torque = along(Friction(Stribeck(), theta.reshape(2, -1)), problem.nodes)
        return (problem.residual(torque) * root).ravel()

    def fold_by_fold() -> float:
        cost = 0.0
        for weight in weights:
            root = np.sqrt(weight)[:, None]
            start = np.tile([0.05, 0.01, 1.5, 0.001], 2)
            cost += 2 * least_squares(residual, start, bounds=(low, high), args=(root,)).cost
        return cost

    theirs, cost = best(fold_by_fold, 1)
    torque = along(friction, problem.nodes)
    own = float(np.einsum("fk,fki->", weights, problem.residual(torque) ** 2))
    return [
        ("stribeck, ten folds at once", f"{ours:.2f} s"),
        ("  against SciPy's least_squares, fold by fold", f"{theirs / ours:.0f} x faster"),
        ("  its cost over theirs", f"{own / cost:.6f}"),
    ]


def rollouts(dataset: Any) -> list[tuple[str, str]]:
    """All rollouts side by side against one after the other."""
    ready = prepare(dataset, Protocol(horizons=(1.0,)))
    truth = steady_state(dataset.truth, 0.02)
    starts = ready.starts
    S = len(starts.recording)
    everyone = np.zeros(S, dtype=int)
    plants = ready.plant[starts.recording]
    together, _ = best(lambda: predict(plants, truth[None][everyone], starts))

    def alone(s: int) -> Any:
        one = starts._replace(
            recording=starts.recording[s : s + 1],
            q=starts.q[s : s + 1],
            w=starts.w[s : s + 1],
            u=starts.u[:, s : s + 1],
            dt=starts.dt[:, s : s + 1],
        )
        return predict(ready.plant[one.recording], truth[None][everyone[:1]], one)

    few = range(0, S, max(S // 5, 1))
    single, _ = best(lambda: [alone(s) for s in few], 1)
    ratio = single / len(few) * S / together
    return [
        (f"{S} rollouts of 1 s, side by side", f"{together:.2f} s"),
        ("  against one after the other", f"{ratio:.0f} x faster"),
    ]


def accuracy(name: str, dataset: Any) -> list[tuple[str, str]]:
    """Curve errors of the study's recipe and ours, fitted to all data."""
    grid = prepare(dataset, Protocol(horizons=(0.1,))).grid
    true = curves(steady_state(dataset.truth), grid)
    rows, errors = [], []
    for recipe, robust in ((STUDY, None), (INTEGRAL, None), (INTEGRAL, 3.0)):
        problem = training_problem(dataset, plant_of(dataset), recipe)
        weights = np.ones((1, len(problem.r)))
        identifier = LeastSquares(AsymmetricStribeck(), robust=robust)
        friction = identifier.fit(problem, weights, 0)[0]
        errors.append(curve_error(curves(friction, grid), true, grid))
        shown = " / ".join(f"{100 * e:.1f} %" for e in errors[-1])
        how = f"{recipe.name}, robust" if robust else recipe.name
        rows.append((f"{name}: curve error, {how} (joint 1 / 2)", shown))
    ratio = " / ".join(f"{b / a:.2f}" for a, b in zip(*errors[:2], strict=True))
    return [*rows, ("  integral over study", ratio)]


def linear(dataset: Any) -> list[tuple[str, str]]:
    """Ten folds of the identifiers that only need Gram matrices, without the import of pysindy."""
    problem = training_problem(dataset, plant_of(dataset), INTEGRAL)
    folds = make_folds(dataset.recordings, Split(count=10))
    weights = folds.training(problem.recording, problem.time)
    SINDy().fit(problem, weights[:1], 0)
    sindy, _ = best(lambda: SINDy().fit(problem, weights, 0))
    spline, ours = best(lambda: Linear(Spline()).fit(problem, weights, 0))
    steps, theirs = best(lambda: LeastSquares(Spline()).fit(problem, weights, 0))
    return [
        ("sindy, ten folds", f"{sindy:.2f} s"),
        ("spline, ten folds", f"{spline:.3f} s"),
        ("  against least squares by steps", f"{steps / spline:.0f} x faster"),
        ("  largest difference of a parameter", f"{np.abs(ours.theta - theirs.theta).max():.0e}"),
    ]


TRUTHS = {
    "Coulomb-viscous": Curve((0.165, 0.055), (0.165, 0.055), (0.004, 0.0008)),
    "Stribeck": Curve(
        *((0.165, 0.0525), (0.165, 0.0525), (0.004, 0.0008)),
        *((0.0, 0.032), (0.0, 0.032), (1.0, 2.0)),
    ),
}
TERMS = {
    "Coulomb-viscous": [["sign", "viscous"], ["sign", "viscous"]],
    "Stribeck": [["sign", "viscous"], ["sign", "viscous", "peak_2.3"]],  # 2 is no candidate
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
            friction = SINDy().fit(problem, np.ones((1, len(problem.r))), 0)[0]
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
    clean = load_dataset(DATA / "acrobot_clean")
    twin = simulate(noise_free(load_rig(DATA / "acrobot_clean" / "rig.toml")))
    with threadpool_limits(1):
        rows = fits(clean) + rollouts(clean) + linear(clean)
        rows += bench_networks.networks(clean)
        rows += bench_trees.rows()
        rows += supports(load_rig(DATA / "acrobot_clean" / "rig.toml"))
        rows += accuracy("acrobot_clean", clean) + accuracy("noise-free twin", twin)
        rows += accuracy("acrobot_sim", load_dataset(DATA / "acrobot_sim"))
    rows += list(bench_shooting.rows(seeds=5, jobs=2))
    table = Table("what", "figure", title="frictionid, one thread")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


if __name__ == "__main__":
    main()
