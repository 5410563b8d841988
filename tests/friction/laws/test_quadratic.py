"""Coulomb, viscous friction and drag."""

import numpy as np
import pytest
from fixtures.exact_problems import assert_recovered, everything, explained_by
from numpy.testing import assert_allclose

from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, Quadratic

THETA = np.array([[0.1, 0.02, 0.003], [0.05, 0.0, 0.001]])
SIDES = np.array([[0.1, 0.14, 0.02], [0.05, 0.03, 0.01]])


def test_drag_grows_with_the_square_of_the_velocity_and_opposes_it():
    w = np.array([-8.0, -4.0, 4.0, 8.0])
    drag = Friction(Quadratic(), THETA * [0, 0, 1]).curve(w)[:, 0]
    assert_allclose(drag, [-0.192, -0.048, 0.048, 0.192])


@pytest.mark.parametrize("theta", [THETA, THETA * [0, 1, 1], THETA * [0, 0, 100]])
def test_truth_in_truth_out(theta):
    assert_recovered(Quadratic(), theta, rtol=1e-8, atol=1e-12)


def test_drag_alone_is_told_from_coulomb_friction_with_noise():
    rng = np.random.default_rng(0)
    problem = explained_by(Quadratic(), THETA[:1] * [0, 0, 1], 1e-3, rng)
    found = LeastSquares(Quadratic()).fit(problem, everything(problem), 0).theta[0, 0]
    assert found[2] == pytest.approx(0.003, rel=0.05) and found[0] < 0.002


# Coulomb and viscous friction with a level of its own in each direction.


def test_each_direction_has_its_level():
    curve = Friction(CoulombViscous(symmetric=False), SIDES).curve(np.array([-2.0, 2.0]))
    assert_allclose(curve, [[-0.18, -0.05], [0.14, 0.07]])


def test_truth_in_truth_out_in_each_direction():
    assert_recovered(CoulombViscous(symmetric=False), SIDES, rtol=1e-9)
