"""Intervals of a model that does not explain the motion hold what another setting would give."""

import coverage_cases
import numpy as np
from coverage_cases import case_of, sets_of

from frictionid.data.plants import plant_of
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.formulation import INTEGRAL, training_problem
from frictionid.fitting.parameters import FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import Settings, refine
from frictionid.friction.laws import CoulombViscous


def data_of(seed):
    """A gear whose friction grows with the load."""
    return sets_of(case_of("gear_load", "joint"), [seed], 4, late=True, substeps=4)[0]


def first_of(data):
    """Coulomb and viscous friction of one step, where fits begin."""
    problem = training_problem(data, plant_of(data), INTEGRAL)
    return LeastSquares(CoulombViscous()).fit(problem, np.ones((1, len(problem.r))), seed=0)[0]


def test_windows_of_other_lengths_give_intervals_that_overlap():
    data = data_of(1)
    found = [
        refine(first_of(data), data, (FrictionBlock(), InertiaBlock()), Settings(windows=windows))
        for windows in ((0.1, 0.2), (0.1, 0.3, 1.0))
    ]
    short, long = (f.covariance.interval(0.95) for f in found)
    assert "what is fitted does not explain the motion" in " ".join(found[1].diagnostics.warnings)
    assert ((short[:, 0] < long[:, 1]) & (long[:, 0] < short[:, 1])).all()


def test_base_parameters_stay_free_where_the_motion_is_not_explained(monkeypatch):
    """Intervals hold the errors of the model; at nominal values these would be larger."""
    monkeypatch.setitem(coverage_cases.NOISE, "joint", 1e-4)
    data = data_of(3)
    found = refine(first_of(data), data)
    assert "what is fitted does not explain the motion" in " ".join(found.diagnostics.warnings)
    free = {p.name for p in found.covariance.parameters if p.tolerance > 0}
    assert {"inertia", "gravity"} <= free
    assert not any("stays at" in warning for warning in found.diagnostics.warnings)
