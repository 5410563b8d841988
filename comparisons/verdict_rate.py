"""How often the verdict is wrong, where it is known which model is right.

    python comparisons/verdict_rate.py                # errors from each start, drawn: seconds
    python comparisons/verdict_rate.py --recordings   # simulated recordings, fitted: minutes

A simple model is truly as good as a rich one; worse by half the region of practical equivalence,
where it is right all the same; or by twice the region, where the rich one is right. Drawn errors of
a recording have a scale of its own, e^(0.6 z). With recordings, a pendulum's friction has no
Stribeck peak, or one that is so narrow that Coulomb and viscous friction do nearly as well, or a
wide one; then it has other friction that neither model has.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from coverage_cases import MOMENT, Case, parts_of, rig_of
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table
from scipy.optimize import brentq
from script import call

from frictionid.comparison.cross_validate import Benchmark, prepare_benchmark, run
from frictionid.data.recordings import Dataset
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.evaluation.reference_model import StartErrors, choose
from frictionid.evaluation.statistics import REGION
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL
from frictionid.friction.laws import CoulombViscous, Stribeck
from frictionid.simulate import Curve, LoadFriction, simulate
from frictionid.simulate import Stribeck as TrueStribeck

EQUAL, EQUIVALENT, DIFFERENT = 0.0, 0.5, 2.0  # excess of the simple model, in units of the region
SIMPLE, RICH, UNDECIDED = "simple", "rich", "undecided"
HORIZON, FOLDS = 0.5, 8  # [s]
STARTS = 6  # of a drawn recording


# --- Drawn errors --------------------------------------------------------------------------------


def drawn(
    rng: np.random.Generator,
    excess: float,
    *,
    recordings: int = 24,
    scatter: float = 0.6,
    share: float = 0.5,
) -> list[StartErrors]:
    """Errors of a simple model and of a rich one, which is the reference.

    Parameters
    ----------
    rng : Generator
    excess : float
        By how much the simple model is truly worse, in units of the region.
    recordings : int
    scatter : float
        Standard deviation of the logarithm of each recording's scale.
    share : float
        Standard deviation of the logarithm of how far apart both predictions are in a recording.
    """
    group = np.repeat(np.arange(recordings), STARTS)
    scale = np.exp(scatter * rng.standard_normal(recordings))[group, None]
    noise = scale * rng.standard_normal((len(group), 2))
    apart = np.exp(share * rng.standard_normal(recordings))[group, None]
    distance = _distance(1.0 + REGION * excess, share) * scale * apart
    other = noise + distance * rng.standard_normal((len(group), 2))
    return [StartErrors(0.01 * e, group) for e in (other, noise)]


@cache
def _distance(ratio: float, share: float) -> float:
    """How far apart predictions are, in units of the errors, where these have a ratio of means."""
    z, weight = np.polynomial.hermite_e.hermegauss(40)
    apart, weight = np.exp(share * z), weight / weight.sum()

    def excess(distance: float) -> float:
        return float(weight @ np.sqrt(1.0 + (distance * apart) ** 2)) - ratio

    return float(brentq(excess, 0.0, 10.0))


def chosen(errors: Sequence[StartErrors]) -> str:
    """What the rule says of a simple model, the first, and a richer one."""
    place = choose(errors, np.arange(1.0, 1 + len(errors))).recommended
    return UNDECIDED if place is None else SIMPLE if place == 0 else RICH


def rates(seed: int, sets: int, excess: float, **settings: float) -> Counter[str]:
    """How often the rule says what, over so many drawn data sets."""
    rng = np.random.default_rng(seed)
    return Counter(chosen(drawn(rng, excess, **settings)) for _ in range(sets))


CONDITIONS: dict[str, dict[str, Any]] = {
    "24 recordings": {},
    "12 recordings": {"recordings": 12},
    "recordings more alike": {"scatter": 0.3},
    "recordings less alike": {"scatter": 1.0},
}


def from_draws(seed: int, sets: int) -> Iterator[tuple[str, str, Counter[str]]]:
    """Condition, what is right, and how often the rule says what."""
    for name, settings in CONDITIONS.items():
        for excess in (EQUAL, EQUIVALENT, DIFFERENT):
            right = RICH if excess > 1 else SIMPLE
            words = f"{name}, simple worse by {excess:g} regions"
            yield words, right, rates(seed, sets, excess, **settings)


# --- Simulated recordings ------------------------------------------------------------------------


@dataclass(frozen=True)
class Truth:
    """What makes recordings: a Stribeck peak [N m] of a velocity [rad/s], and what no model has.

    load : coefficient of friction by bearing forces; gear : loss of the motor's torque
    delay : [s] of the torque
    """

    peak: float
    velocity: float
    right: str
    recordings: int = 24
    load: float = 0.0
    gear: float = 0.0
    delay: float = 0.0

    def case(self) -> Case:
        """The pendulum with this friction."""
        levels = {"coulomb_positive": (0.12,), "coulomb_negative": (0.12,), "viscous": (0.008,)}
        peaks = {"peak_positive": (self.peak,), "peak_negative": (self.peak,)}
        curve = Curve(**levels, **peaks, stribeck_velocity=(self.velocity,))
        truth: Any = TrueStribeck(curve)
        if self.load or self.gear:
            truth = LoadFriction(curve, bearing=(self.load,), motor=(self.gear,), moment=MOMENT)
        return Case(Stribeck(), "joint", truth, None)

    def sets(self, seed: int, count: int) -> list[Dataset]:
        """Simulated sets, moved side by side."""
        rig = rig_of(self.case(), range(seed, seed + count), self.recordings, late=False)
        late = simulate(replace(rig, drive=replace(rig.drive, delay=self.delay)))
        return parts_of(late, self.recordings)


TRUTHS = {
    "no peak": Truth(0.0, 1.0, SIMPLE),
    "narrow peak": Truth(0.06, 0.8, SIMPLE),
    "wide peak": Truth(0.065, 2.2, RICH),
    "wide peak, 12 recordings": Truth(0.065, 2.2, RICH, recordings=12),
    "no peak, load": Truth(0.0, 1.0, SIMPLE, load=0.008),
    "wide peak, load": Truth(0.065, 2.2, RICH, load=0.008),
    "no peak, gear": Truth(0.0, 1.0, SIMPLE, gear=0.1),
    "no peak, delay": Truth(0.0, 1.0, SIMPLE, delay=0.008),
}


def start_errors(dataset: Dataset) -> list[StartErrors]:
    """Held-out errors half a second ahead of Coulomb and viscous friction, and of Stribeck's."""
    folds = make_folds(dataset.recordings, Split(count=FOLDS, kind="recordings"))
    models = {SIMPLE: LeastSquares(CoulombViscous()), RICH: LeastSquares(Stribeck())}
    benchmark = Benchmark(dataset, folds, Protocol(horizons=(HORIZON,)))
    shared = prepare_benchmark(benchmark, [INTEGRAL])
    results = [run(benchmark, model, INTEGRAL, 0, shared) for model in models.values()]
    return [result.errors.after(HORIZON) for result in results if result.errors]


def from_recordings(seed: int, sets: int) -> Iterator[tuple[str, str, Counter[str]]]:
    """The same of simulated recordings; the excess is that of the mean over all sets."""
    for name, truth in TRUTHS.items():
        made = truth.sets(seed, sets)
        errors = Parallel(n_jobs=-1)(delayed(start_errors)(dataset) for dataset in made)
        simple, rich = np.mean([[e.size.mean() for e in pair] for pair in errors], axis=0)
        words = f"{name}: simple worse by {(simple / rich - 1.0) / REGION:.1f} regions"
        yield words, truth.right, Counter(map(chosen, errors))


def report(counted: Iterator[tuple[str, str, Counter[str]]], sets: int) -> None:
    """A table of how often the rule is right, undecided and wrong."""
    heads = ("condition", "right is", "right", "undecided", "wrong")
    table = Table(*heads, title=f"verdicts on {sets} data sets each")
    for name, right, counts in counted:
        wrong = sum(counts.values()) - counts[right] - counts[UNDECIDED]
        row: Sequence[int] = (counts[right], counts[UNDECIDED], wrong)
        table.add_row(name, right, *map(str, row))
        print(name, right, *row, flush=True)
    Console(width=110).print(table)


def main(*, recordings: bool = False, sets: int | None = None, seed: int = 0) -> None:
    """Print the table.

    Parameters
    ----------
    recordings : Simulate and fit recordings.
    sets : Data sets of each kind [200, recordings: 20].
    """
    count = sets or (20 if recordings else 200)
    make = from_recordings if recordings else from_draws
    report(make(seed, count), count)


if __name__ == "__main__":
    call(main)
