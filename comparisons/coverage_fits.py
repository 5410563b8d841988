"""What intervals of one set show, for `intervals.py`: fits by one step and by shooting."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from coverage_cases import DELAY, Case, rig_of
from scipy.special import stdtrit

from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset
from frictionid.fitting.fit import Fit
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, covariance_of_fit, training_problem
from frictionid.fitting.parameter_block import ParameterBlock
from frictionid.fitting.parameters import DelayBlock, FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import Settings, refine
from frictionid.friction import Inputs
from frictionid.simulate.rig import true_system

BLOCKS = (FrictionBlock(), InertiaBlock(), DelayBlock())
SETTINGS = Settings(significance=1.0)  # a delay that does not show stays free, not identified


class Estimated(NamedTuple):
    """A parameter of a set: estimate less truth, half of its 95 % interval, and whether it counts.

    held : whether the interval holds the truth
    """

    name: str
    error: float
    half: float
    identified: bool
    held: bool


def true_values(case: Case, dataset: Dataset) -> np.ndarray:
    """True parameters (n, P) of the law; of a spline, those nearest to the true curve."""
    if case.values is not None:
        return case.values
    rows = []
    for j in range(case.truth.curve.n):
        w = np.concatenate([r.truth.velocity.value[:, j] for r in dataset.recordings])
        w = np.abs(w[np.abs(w) > 0.1])
        x = Inputs(0.0 * w, w, 0.0 * w, 0.0 * w)
        A = case.law.gradient(np.full(len(case.law.names), 1e-3), x)
        level = case.truth.curve.level(np.repeat(w[:, None], case.truth.curve.n, 1), 1.0)[:, j]
        rows.append(np.linalg.lstsq(A, level, rcond=None)[0])
    return np.array(rows)


def by_integral(case: Case, dataset: Dataset) -> list[Estimated]:
    """What a one-step fit finds."""
    problem = training_problem(dataset, plant_of(dataset), INTEGRAL)
    weights = np.ones(len(problem.r))
    identifier = LeastSquares(case.law)
    friction = identifier.fit(problem, weights[None], seed=0)[0]
    matrix, freedom = covariance_of_fit(friction, problem, weights)
    half = (stdtrit(freedom, 0.975) * np.sqrt(np.diag(matrix))).reshape(friction.theta.shape)
    out = []
    true = true_values(case, dataset)
    for (j, i), value in np.ndenumerate(friction.theta):
        error, wide = float(value - true[j, i]), float(half[j, i])
        name = f"{case.law.names[i]} of joint {j + 1}"
        out.append(Estimated(name, error, wide, bool(np.isfinite(wide)), abs(error) <= wide))
    return out


def shot(
    dataset: Dataset,
    law: Any,
    blocks: tuple[ParameterBlock, ...] = BLOCKS,
    settings: Settings = SETTINGS,
) -> Fit:
    """The fit by shooting, beginning with the one-step fit."""
    problem = training_problem(dataset, plant_of(dataset), INTEGRAL)
    start = LeastSquares(law).fit(problem, np.ones((1, len(problem.r))), seed=0)[0]
    return refine(start, dataset, blocks, settings)


def by_shooting(case: Case, dataset: Dataset, rotor_known: bool = False) -> list[Estimated]:
    """What shooting finds."""
    c, true = shot(dataset, case.law).covariance, true_values(case, dataset)
    base = true_system(rig_of(case, [0], 2, late=True, rotor_known=rotor_known)).p
    out = []
    intervals = c.interval(0.95)
    known = c.identified
    for k, p in enumerate(c.parameters):
        at = {"friction": lambda p=p: true[p.place], "delay": lambda: DELAY}
        value = at.get(p.block, lambda p=p: base[p.place[0]])()
        low, high = intervals[k]
        out.append(
            Estimated(
                *(p.name, float(c.values[k] - value), float(high - low) / 2, bool(known[k])),
                bool(low <= value <= high),
            )
        )
    return out
