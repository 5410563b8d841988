"""Ours: friction of each joint by shooting, in a process of its own.

python our_side.py TASK.npz RESULT.npz coulomb_viscous|stribeck

As `frictionid fit --by shooting --free friction` does it: least squares for a start, then
shooting with free start states over windows of 5, 10 and 20 samples. The smoothed starts that the
task brings are the peer's; frictionid smooths for itself, in its own time.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from exchange import Task, load

from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import RTS
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, training_problem
from frictionid.fitting.parameters import FrictionBlock
from frictionid.fitting.shooting import refine
from frictionid.friction.laws import CoulombViscous, Stribeck

LAWS = {"coulomb_viscous": CoulombViscous(), "stribeck": Stribeck(symmetric=False)}


def dataset_of(task: Task) -> Dataset:
    """The task's recordings, told no more than the peer: not even the noise of the angles."""
    pairs = enumerate(zip(task.angle, task.torque, strict=True), start=1)
    recordings = (
        Recording(f"{i:02d}", Signal(task.time, q), Signal(task.time, u, "previous"))
        for i, (q, u) in pairs
    )
    return Dataset("task", {"kind": "acrobot"}, tuple(recordings))


def main(source: str, target: str, law: str) -> None:
    """Read a task, fit, write theta (2, parameters of the law)."""
    dataset = dataset_of(load(Path(source)))
    states = RTS()([r.angle for r in dataset.recordings])
    problem = training_problem(dataset, plant_of(dataset), INTEGRAL, states=states)
    start = LeastSquares(LAWS[law]).fit(problem, np.ones((1, len(problem.r))), seed=0)[0]
    found = refine(start, dataset, (FrictionBlock(),), states=states)
    np.savez(target, theta=found.friction.theta)


if __name__ == "__main__":
    main(*sys.argv[1:])
