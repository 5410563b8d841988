"""LuGre friction by shooting, beside an inertia and a delay that nobody knew."""

from dataclasses import replace

import numpy as np
import pytest
from coverage_cases import NOISE, case_of, sets_of
from coverage_fits import BLOCKS, SETTINGS

from frictionid.data.plants import plant_of
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.formulation import INTEGRAL, training_problem
from frictionid.fitting.shooting import refine

CASE = case_of("lugre", "joint")
SEEDS = (102, 104)


@pytest.fixture(scope="module")
def sets():
    return sets_of(CASE, SEEDS, 8, late=True)


@pytest.mark.parametrize("which", range(len(SEEDS)))
@pytest.mark.parametrize("begin", ["one step", "truth"])
def test_bristles_explain_the_motion_to_its_noise(sets, which, begin):
    problem = training_problem(sets[which], plant_of(sets[which]), INTEGRAL)
    start = LeastSquares(CASE.law).fit(problem, np.ones((1, len(problem.r))), seed=0)[0]
    if begin == "truth":
        start = replace(start, theta=CASE.values)
    fit = refine(start, sets[which], BLOCKS, SETTINGS)
    assert fit.diagnostics.angle_noise[0] < 1.2 * NOISE["joint"]
