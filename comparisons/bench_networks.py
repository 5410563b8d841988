"""Networks on all folds at once against the ordinary PyTorch loop, fold by fold: see `bench.py`.

Both learn an explicit Euler step of the same rows from the study's states [DeMeester2020]. The loop
trains one fold in full; ten of them take ten times as long. Times of ours include importing PyTorch
where it is needed.
"""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.data.plants import plant_of
from frictionid.evaluation import (
    Split,
    curve_error,
    curves,
    make_folds,
    steady_state,
    velocity_grid,
)
from frictionid.friction import along
from frictionid.friction.laws import LSTM, MLP
from frictionid.identifiers import CompressedNetwork, Network
from frictionid.identifiers.formulation import INTEGRAL, STUDY, problem_of, training_problem

sys.path.append(str(Path(__file__).parent / "peers"))
FOLDS, EPOCHS, BATCH = 10, 100, 32
HISTORY = 9 / 60  # [s]


def networks(dataset: Any) -> list[tuple[str, str]]:
    """Times of ten folds, and held-out losses of the first, ours beside the loop's."""
    problem = problem_of(dataset, plant_of(dataset), STUDY, history=HISTORY)
    folds = make_folds(dataset.recordings, Split(count=FOLDS))
    weights = folds.training(problem.recording, problem.time)
    by_squares = timed(lambda: CompressedNetwork(MLP()).fit(problem, weights, 0))
    imported, _ = timed(lambda: importlib.import_module("torch"))
    by_steps = timed(lambda: Network(MLP(), epochs=20).fit(problem, weights, 0))
    # free as the loop's, and in pieces of few samples: as many as in a batch of the loop
    free = LSTM(dissipative=False, monotone_tail=False, free=True)
    recurrent = Network(free, 40, BATCH, rate=7e-3, share=0.05, patience=40, targets=8)
    dynamic = timed(lambda: recurrent.fit(problem, weights, 0))

    loop = importlib.import_module("torch_loop")
    loop.torch.set_num_threads(1)
    samples = loop.samples_of(dataset, folds)
    assert len(samples.fold) == len(problem.r)
    static, lstm = (
        timed(lambda kind=kind: loop.train(dataset, samples, 0, kind, EPOCHS, BATCH))
        for kind in (loop.Static, loop.Dynamic)
    )
    rows = []
    for name, (seconds, friction), start, peer in (
        ("mlp by Levenberg-Marquardt", by_squares, 0.0, static),
        ("mlp by Adam", by_steps, imported, static),
        ("lstm by Adam, as many samples in a batch", dynamic, imported, lstm),
    ):
        ours, theirs = start + seconds, FOLDS * peer[0]
        error = np.linalg.norm(problem.residual(along(friction[0], problem.nodes)), axis=-1)
        held = error[weights[0] == 0].mean()
        losses = f"{held:.4f} / {peer[1]:.4f} rad/s"
        rows += [
            (f"{name}, ten folds at once", f"{ours:.1f} s"),
            ("  against a PyTorch loop, fold by fold", f"{theirs / ours:.0f} x faster"),
            ("  its held-out loss, and the loop's", losses),
        ]
    return [*rows, *accuracy(dataset)]


def accuracy(dataset: Any) -> list[tuple[str, str]]:
    """Curve errors of networks fitted to all data by our recipe."""
    problem = training_problem(dataset, plant_of(dataset), INTEGRAL)
    grid = velocity_grid(problem.nodes.inputs.w)
    true = curves(steady_state(dataset.truth), grid)
    rows = []
    for name, identifier in (("mlp", CompressedNetwork(MLP())), ("lstm", Network(LSTM()))):
        friction = identifier.fit(problem, np.ones((1, len(problem.r))), 0)[0]
        shown = " / ".join(
            f"{100 * e:.1f} %" for e in curve_error(curves(friction, grid), true, grid)
        )
        rows.append((f"acrobot_clean: curve error, {name} (joint 1 / 2)", shown))
    return rows


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Time [s] of a call, and its result."""
    begin = time.perf_counter()
    result = call()
    return time.perf_counter() - begin, result
