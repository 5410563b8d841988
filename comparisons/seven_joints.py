"""A simulated arm of seven joints: friction curves and intervals over many sets.

    python comparisons/seven_joints.py [--sets 50] [--seed 1] [--methods inverse_dynamics,shooting]
        [--recordings 3] [--seconds 5] [--jobs 1]

At 1 kHz, with real stiction, encoders of 19 bits, 2 % of torque noise, the torque 1.5 ms late, and
masses and rotors 20 % off the nominal ones, all drawn from each set's seed.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table
from script import call
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from fixtures.seven_joints import TRUE, arm_rig, curve_errors

from frictionid.comparison.fit_model import fit_model
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.parameters import DelayBlock, FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import Settings, Shooting
from frictionid.fitting.torque_balance import InverseDynamics
from frictionid.friction.laws import Stribeck
from frictionid.simulate import simulate

METHODS = {
    "inverse_dynamics": InverseDynamics(),
    "shooting": Shooting(
        blocks=(FrictionBlock(), InertiaBlock(), DelayBlock()),
        settings=Settings(windows=(0.02, 0.05, 0.1)),
    ),
}


class Shown(NamedTuple):
    """What a set shows: curve errors (7,), held and identified intervals (28,), seconds."""

    errors: np.ndarray
    held: np.ndarray
    identified: np.ndarray
    seconds: float


def shown(method: str, seed: int, recordings: int, seconds: float) -> Shown:
    """One set by a method."""
    with threadpool_limits(1), tempfile.TemporaryDirectory() as folder:
        data = simulate(arm_rig(Path(folder), seed, recordings=recordings, seconds=seconds))
        begin = perf_counter()
        friction = fit_model(data, LeastSquares(Stribeck()), METHODS[method])
        took = perf_counter() - begin
    refined = friction.provenance.refined
    assert refined is not None
    estimates = [e for e in refined.parameters if e.block == "friction"]
    held = np.array([e.holds(TRUE[e.parameter][e.joint or 0]) for e in estimates])
    known = np.array([e.identified for e in estimates])
    return Shown(curve_errors(friction, data), held, known, took)


def row_of(method: str, sets: Sequence[Shown]) -> list[str]:
    """A line of the table."""
    errors = 100 * np.array([one.errors for one in sets])
    held = np.concatenate([one.held[one.identified] for one in sets])
    known = np.concatenate([one.identified for one in sets])
    return [
        method,
        str(len(sets)),
        f"{np.median(errors):.2f}",
        f"{errors.max():.2f}",
        str(len(held)),
        f"{100 * held.mean():.1f}",
        f"{100 * (1 - known.mean()):.1f}",
        f"{np.median([one.seconds for one in sets]):.0f}",
    ]


def main(
    *,
    sets: int = 50,
    seed: int = 1,
    methods: str = ",".join(METHODS),
    recordings: int = 3,
    seconds: float = 5.0,
    jobs: int = 1,
) -> None:
    """Print the table.

    Parameters
    ----------
    sets : Simulated data sets.
    seed : Of the first set.
    recordings : In each set.
    seconds : Of each recording.
    jobs : Processes side by side.
    """
    heads = ("method", "sets", "median error %", "worst %", "intervals", "held %", "unknown %", "s")
    table = Table(*heads, title="Seven joints: friction curves and 95 % intervals")
    for method in methods.split(","):
        results = Parallel(n_jobs=jobs)(
            delayed(shown)(method, each, recordings, seconds) for each in range(seed, seed + sets)
        )
        table.add_row(*row_of(method, results))
    Console().print(table)


if __name__ == "__main__":
    call(main)
