"""Whether parameters that the motion does not show do harm, and what neutral values cost.

    python comparisons/neutral_values.py [--sets 100] [LAW ...]

A pendulum with Coulomb and viscous friction is recorded in motion that does not show a further
parameter of a richer law: small swings, in which the load hardly changes; turns one way, without
slow motion or reversal. The richer law and the law without that parameter are fitted to it in one
step, and predict other motion: swings of all kinds. Their median errors after half a second should
be the same. Then the truth has the further parameter and the motion shows it: the fit should be
that without neutral values, in units of its standard error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from coverage_cases import MACHINES, NOISE, Case, case_of, parts_of, runs_of, sets_of
from rich.console import Console
from rich.table import Table
from script import call

import frictionid as fid
from frictionid.data.recordings import Dataset
from frictionid.errors import NoFitError
from frictionid.evaluation import score_value
from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction import Law
from frictionid.friction.laws import (
    CoulombViscous,
    Dahl,
    FilmLag,
    LoadDependent,
    LuGre,
    Play,
    Quadratic,
    Stribeck,
)
from frictionid.simulate import Camera, Rig, Run, simulate

HORIZON = 0.5  # [s]
RECORDINGS, TESTS = 6, 60  # twelve have 60 starts: their median moves by 6 % from one to the next
TRUE = case_of("coulomb_viscous", "joint")
# laws whose parameters the motion of `coverage_cases` shows, and sets of each
SHOWN, SHOWN_SETS = ("stribeck", "load_dependent", "motor_load", "film_lag", "dahl"), 10


def swings(draw: np.random.Generator, name: str) -> Run:
    """A small swing: the load changes by a few per cent."""
    return Run(name, (float(draw.uniform(0.35, 0.5) * draw.choice([-1, 1])),))


def turns(draw: np.random.Generator, name: str) -> Run:
    """Turns one way, fast: friction slows it down, and it does not come back in the recording."""
    return Run(name, (float(draw.uniform(-3, 3)),), (float(draw.uniform(22.0, 26.0)),))


Motion = Callable[[np.random.Generator, str], Run]
HIDDEN: Mapping[str, tuple[Law, Motion]] = {
    "load_dependent": (LoadDependent(), swings),
    "quadratic": (Quadratic(), swings),
    "stribeck": (Stribeck(), turns),
    "coulomb_viscous, asymmetric": (CoulombViscous(symmetric=False), turns),
    "stribeck, asymmetric": (Stribeck(symmetric=False), turns),
    "film_lag": (FilmLag(), turns),
    "dahl": (Dahl(), turns),
    "lugre": (LuGre(), turns),
    "play": (Play(), turns),
}


def rig(runs: Sequence[Run], seconds: float) -> Dataset:
    """Recordings of a pendulum with Coulomb and viscous friction, at 60 Hz."""
    camera = Camera(samples=round(60 * seconds) + 1, angle_noise=NOISE["joint"])
    machine = MACHINES["joint"]
    return simulate(Rig("hidden", machine, TRUE.truth, camera, tuple(runs), substeps=24))


def hidden(motion: Motion, seeds: Sequence[int]) -> list[Dataset]:
    """Sets whose motion does not show the parameter."""
    runs = []
    for seed in seeds:
        draw = np.random.default_rng([seed, 11])
        runs += [motion(draw, f"{seed:04d}_{k:02d}") for k in range(RECORDINGS)]
    return parts_of(rig(runs, 1.0), RECORDINGS)


def error(model: fid.Fit, test: Dataset) -> float:
    """Median error [rad] after the horizon, infinite where no step can follow the model."""
    try:
        scores = fid.evaluate(model, test, horizons=(HORIZON,))
    except NoFitError:
        return np.inf
    return score_value(scores, "rollout_angle", "median", HORIZON)


def harm(law: Law, motion: Motion, seeds: Sequence[int], neutral: bool) -> np.ndarray:
    """Errors (sets,) of the law over those of the law without the parameter, on other motion."""
    test = rig(runs_of("joint", 10_000, TESTS), 3.0)
    ratios = []
    for data in hidden(motion, seeds):
        fits = (
            fid.fit(data, LeastSquares(form, neutral=neutral), method="one_step")
            for form in (law, CoulombViscous())
        )
        rich, plain = (error(fit, test) for fit in fits)
        ratios.append(rich / plain)
    return np.array(ratios)


def cost(case: Case, seeds: Sequence[int]) -> float:
    """Largest move of a parameter by neutral values, in standard errors, where motion shows all."""
    most = 0.0
    for data in sets_of(case, seeds, 12, late=False):
        shown, plain = (
            fid.fit(data, LeastSquares(case.law, neutral=n), method="one_step")
            for n in (True, False)
        )
        spread = (plain.frame.high_95 - plain.frame.low_95).to_numpy() / 4.0
        off = np.abs(shown.friction.theta - plain.friction.theta).ravel() / spread
        most = max(most, float(np.nanmax(off)))
    return most


def main(laws: list[str] | None = None, *, sets: int = 100, seed: int = 0) -> None:
    """Print both tables.

    Parameters
    ----------
    laws : Names of laws [all].
    """
    seeds, console = range(seed, seed + sets), Console(width=110)
    title = f"error on other motion over that of coulomb_viscous, {sets} sets"
    heads = ("law", "median", "worst", "without neutral values: median", "worst")
    table = Table(*heads, title=title)
    for name in laws or HIDDEN:
        with_, without = (harm(*HIDDEN[name], seeds, neutral) for neutral in (True, False))
        each = (np.median(with_), with_.max(), np.median(without), without.max())
        table.add_row(name, *(f"{value:.3f}" for value in each))
        console.print(f"{name} done")
    console.print(table)
    few = seeds[:SHOWN_SETS]
    title = f"largest move by neutral values where motion shows all, {len(few)} sets"
    table = Table("law", "standard errors", title=title)
    for name in SHOWN:
        table.add_row(name, f"{cost(case_of(name, 'joint'), few):.3f}")
    console.print(table)


if __name__ == "__main__":
    call(main)
