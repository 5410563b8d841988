"""The identifier `none`: no friction, whatever the data."""

import numpy as np
from fixtures.exact_problems import everything, explained_by
from numpy.testing import assert_array_equal

from frictionid.fitting.identifiers import Frictionless, LeastSquares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem, synthetic_weights
from frictionid.friction import along
from frictionid.friction.laws import CoulombViscous, NoFriction


def test_it_predicts_the_motion_without_friction():
    problem = synthetic_problem(2)
    friction = Frictionless().fit(problem, synthetic_weights(problem), 0)
    assert friction.theta.shape == (3, 2, 0)
    torque = along(friction, problem.nodes)
    assert_array_equal(torque, np.zeros((3, *problem.nodes.inputs.w.shape)))
    assert_array_equal(problem.residual(torque)[2], problem.r)


def test_it_is_exact_on_motion_without_friction_and_there_others_find_none():
    problem = explained_by(NoFriction(), np.zeros((2, 0)))
    assert_array_equal(problem.r, np.zeros((120, 2)))
    found = LeastSquares(CoulombViscous()).fit(problem, everything(problem), 0)
    assert_array_equal(found.theta, np.zeros((1, 2, 2)))
