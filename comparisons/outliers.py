"""Curve errors under gross outliers of angles and torques: at most 1.5 times those of clean data.

    python comparisons/outliers.py [SEEDS]

The asymmetric Stribeck law on `data/acrobot_clean`, by one-step least squares and by shooting.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from script import call

from frictionid.arrays import Array
from frictionid.comparison.fit_model import fit_model
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset
from frictionid.evaluation import curve_error, steady_state, velocity_grid
from frictionid.fitting.identifiers.least_squares import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL
from frictionid.fitting.shooting import Shooting
from frictionid.friction import Friction
from frictionid.friction.laws import Stribeck

MOST = 1.5  # times the curve error of clean data


class Wild(NamedTuple):
    """A share of the samples of "angle" or "torque" that is off by `size` [rad or N m]."""

    quantity: str
    share: float
    size: float


CASES = (
    *(Wild("angle", 0.05, 1.0), Wild("angle", 0.01, 1.0), Wild("angle", 0.05, 0.05)),
    Wild("torque", 0.05, 1.0),
)


def with_outliers(dataset: Dataset, case: Wild, seed: int) -> Dataset:
    """The data set with outliers of either sign in the columns that are not zero throughout."""
    rng, recordings = np.random.default_rng(seed), []
    for recording in dataset.recordings:
        signal = getattr(recording, case.quantity)
        wild = (rng.random(signal.value.shape) < case.share) & np.any(signal.value != 0, axis=0)
        value = signal.value + wild * rng.choice([-case.size, case.size], wild.shape)
        recordings.append(replace(recording, **{case.quantity: signal._replace(value=value)}))
    return replace(dataset, recordings=tuple(recordings))


def error_of(friction: Friction, clean: Dataset) -> Array:
    """Curve errors (n,) against the truth of the clean data."""
    truth = clean.truth
    assert truth is not None
    speeds = [r.truth.velocity.value for r in clean.recordings if r.truth is not None]
    grid = velocity_grid(np.concatenate(speeds))
    return np.asarray(curve_error(friction.curve(grid), steady_state(truth).curve(grid), grid))


def main(seeds: int = 1) -> None:
    """Print curve errors [%] of each case, and whether they are within the limit."""
    clean = load_dataset(Path(__file__).parents[1] / "data" / "acrobot_clean")
    identifier = LeastSquares(Stribeck(symmetric=False))
    for recipe in (INTEGRAL, Shooting()):
        usual = error_of(fit_model(clean, identifier, recipe), clean)
        print(f"{recipe.name}, clean: {100 * usual[0]:.3f} {100 * usual[1]:.3f} %")
        for case in CASES:
            for seed in range(seeds):
                friction = fit_model(with_outliers(clean, case, seed), identifier, recipe)
                found = error_of(friction, clean)
                good = "within" if (found <= MOST * usual).all() else "BEYOND"
                figures = f"{100 * found[0]:.3f} {100 * found[1]:.3f} %"
                print(
                    f"  {case.share:.0%} of {case.quantity}s off by {case.size}: {figures} {good}"
                )


if __name__ == "__main__":
    call(main)
