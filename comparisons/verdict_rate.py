"""How often the verdict is wrong, where it is known which model is right.

    python comparisons/verdict_rate.py                # errors of folds, drawn: seconds
    python comparisons/verdict_rate.py --recordings   # simulated recordings, fitted: minutes

A simple model is truly worse than a rich one by half the region of practical equivalence, where the
simple one is right, or by twice the region, where the rich one is. Differences between the models
scatter from fold to fold and, as the folds share training data, have a part in common that no
scatter shows. With recordings, a pendulum's friction has a Stribeck peak that is so narrow that
Coulomb and viscous friction do nearly as well, or a wide one.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
from coverage_cases import Case, sets_of
from rich.console import Console
from rich.table import Table

from frictionid.comparison.cross_validate import compare
from frictionid.data.recordings import Dataset
from frictionid.evaluation import Protocol, Split, make_folds, score_value
from frictionid.evaluation.statistics import REGION, choose
from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction.laws import CoulombViscous, Stribeck
from frictionid.simulate import Curve
from frictionid.simulate import Stribeck as TrueStribeck

EQUIVALENT, DIFFERENT = 0.5, 2.0  # excess of the simple model's error, in units of the region
SIMPLE, RICH, UNDECIDED = "simple", "rich", "undecided"
HORIZON = 0.5  # [s]
RECORDINGS, FOLDS = 24, 8
# Stribeck velocities [rad/s] of a pendulum's friction: without the peak the error after half a
# second is larger by about half the region, and by about twice
NARROW, WIDE = 0.9, 1.5


def drawn(
    rng: np.random.Generator,
    excess: float,
    *,
    folds: int = 10,
    scatter: float = 0.7,
    shared: float = 1.0,
    rivals: int = 1,
) -> np.ndarray:
    """Errors (1 + rivals, folds) of a simple model, the first, and rich ones that are equally good.

    Folds differ in how hard they are to predict, by half of the mean error, which all models share.

    Parameters
    ----------
    rng : Generator
    excess : float
        By how much the simple model is truly worse, in units of the region.
    folds, rivals : int
        Number of folds, and of rich models.
    scatter : float
        Standard deviation of each model's own error in a fold, in units of the region.
    shared : float
        Variance of the part that all folds have in common, in units of 1/folds of the scatter's:
        one is the correlation that the corrected tests assume.
    """
    hard = rng.gamma(4.0, 0.25, folds)  # mean one, standard deviation one half
    common = np.sqrt(shared / folds) * rng.standard_normal((1 + rivals, 1))
    own = np.sqrt(max(1.0 - shared / folds, 0.0)) * rng.standard_normal((1 + rivals, folds))
    mean = 1.0 + REGION * excess * (np.arange(1 + rivals) == 0)[:, None]
    return np.maximum(mean * hard + REGION * scatter / np.sqrt(2.0) * (common + own), 1e-3)


def chosen(errors: np.ndarray) -> str:
    """What the rule says of a simple model, the first, and richer ones."""
    complexity = np.arange(1.0, 1 + len(errors))
    place = choose(errors, complexity).recommended
    return UNDECIDED if place is None else SIMPLE if place == 0 else RICH


def rates(seed: int, sets: int, excess: float, **settings: float) -> Counter[str]:
    """How often the rule says what, over so many drawn data sets."""
    rng = np.random.default_rng(seed)
    return Counter(chosen(drawn(rng, excess, **settings)) for _ in range(sets))


CONDITIONS: dict[str, dict[str, float]] = {
    "10 folds": {},
    "5 folds": {"folds": 5},
    "twice the scatter": {"scatter": 1.4},
    "half the scatter": {"scatter": 0.35},
    "folds twice as correlated": {"shared": 2.0},
    "5 rich models": {"rivals": 5},
}


def from_folds(seed: int, sets: int) -> Iterator[tuple[str, str, Counter[str]]]:
    """Condition, what is right, and how often the rule says what."""
    for name, settings in CONDITIONS.items():
        for excess, right in ((EQUIVALENT, SIMPLE), (DIFFERENT, RICH)):
            yield name, right, rates(seed, sets, excess, **settings)


def fold_errors(dataset: Dataset) -> np.ndarray:
    """Median errors (2, F) after half a second: Coulomb and viscous friction, and Stribeck's."""
    folds = make_folds(dataset.recordings, Split(count=FOLDS, kind="recordings"))
    models = {SIMPLE: LeastSquares(CoulombViscous()), RICH: LeastSquares(Stribeck())}
    protocol = Protocol(horizons=(HORIZON,))
    results = compare(dataset, models, folds, protocol=protocol)
    each = [result.scores for result in results.values()]
    return np.array(
        [
            [score_value(s, "rollout_angle", "median", HORIZON, fold=str(f)) for f in range(FOLDS)]
            for s in each
        ]
    )


def from_recordings(seed: int, sets: int) -> Iterator[tuple[str, str, Counter[str]]]:
    """The same of simulated recordings; the excess is that of the mean over all sets."""
    for velocity, right in ((NARROW, SIMPLE), (WIDE, RICH)):
        seeds = range(seed, seed + sets)
        made = sets_of(with_peak(velocity), seeds, RECORDINGS, late=False)
        errors = [fold_errors(dataset) for dataset in made]
        mean = np.mean(errors, axis=(0, 2))
        excess = (mean[0] / mean[1] - 1.0) / REGION
        words = f"{RECORDINGS} recordings, {FOLDS} folds, simple worse by {excess:.1f} regions"
        yield words, right, Counter(map(chosen, errors))


def with_peak(velocity: float) -> Case:
    """A pendulum whose friction has a Stribeck peak of some velocity [rad/s]."""
    curve = Curve(
        coulomb_positive=(0.12,),
        coulomb_negative=(0.12,),
        viscous=(0.008,),
        peak_positive=(0.06,),
        peak_negative=(0.06,),
        stribeck_velocity=(velocity,),
    )
    return Case(Stribeck(), "joint", TrueStribeck(curve), None)


def report(found: Iterator[tuple[str, str, Counter[str]]], sets: int) -> None:
    """A table of how often the rule is right, undecided and wrong."""
    table, console = Table(title=f"verdicts on {sets} data sets each"), Console(width=110)
    for head in ("condition", "right is", "right", "undecided", "wrong"):
        table.add_column(head)
    for name, right, counts in found:
        wrong = sum(counts.values()) - counts[right] - counts[UNDECIDED]
        row: Sequence[int] = (counts[right], counts[UNDECIDED], wrong)
        table.add_row(name, right, *map(str, row))
    console.print(table)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--recordings", action="store_true", help="simulate and fit recordings")
    parser.add_argument("--sets", type=int, help="data sets of each kind [100, recordings: 20]")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    sets = given.sets or (20 if given.recordings else 100)
    make = from_recordings if given.recordings else from_folds
    report(make(given.seed, sets), sets)


if __name__ == "__main__":
    main()
