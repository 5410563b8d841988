"""Friction that grows with the motor's torque: Coulomb and viscous friction without it."""

import numpy as np

from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction import Friction, Inputs, Nodes
from frictionid.friction.laws import CoulombViscous, MotorLoad

THETA = np.array([[0.01, 0.005, 0.3]])


def inputs(rng, rows=400):
    w, u = rng.normal(scale=3.0, size=(rows, 1)), rng.normal(scale=0.3, size=(rows, 1))
    return Inputs(0.0 * w, w, u, 0.0 * w)


def test_without_torque_it_is_coulomb_and_viscous_friction():
    x = inputs(np.random.default_rng(0))._replace(u=np.zeros((400, 1)))
    plain = Friction(CoulombViscous(), THETA[:, :2]).torque(x)
    np.testing.assert_allclose(Friction(MotorLoad(), THETA).torque(x), plain)


def test_the_gear_passes_on_less_when_driving_and_holds_more_when_braking():
    law = MotorLoad()
    fast = np.array([[5.0]])
    for sign, passed in ((1.0, 0.7), (-1.0, 1.3)):
        x = Inputs(0 * fast, sign * fast, np.array([[0.2]]), 0 * fast)
        share = 0.2 - law.torque(np.array([[0.0, 0.0, 0.3]]), x, ())
        np.testing.assert_allclose(share, 0.2 * passed)


def test_it_never_drives_and_breaks_away_at_its_level():
    law, x = MotorLoad(), inputs(np.random.default_rng(1))
    assert np.all(law.torque(THETA, x, ()) * x.w >= 0)
    np.testing.assert_allclose(law.limit(THETA, x, ()), 0.01 + 0.3 * np.abs(x.u))


def test_a_fit_finds_the_truth_and_plain_coulomb_friction_is_biased():
    rng = np.random.default_rng(3)
    x = inputs(rng)
    nodes = Nodes(x, np.arange(400.0), np.array([0, 400]))
    G = np.ones((400, 1, 1))
    r = Friction(MotorLoad(), THETA).torque(x)
    rows = np.arange(400)
    problem = Problem(nodes, r, G, rows[:, None], np.ones(1), 0 * rows, 1.0 * rows, np.ones(400))
    weights = np.ones((1, 400))
    found = LeastSquares(MotorLoad()).fit(problem, weights, 0)
    np.testing.assert_allclose(found.theta[0], THETA, rtol=1e-5)
    plain = LeastSquares(CoulombViscous()).fit(problem, weights, 0)
    assert plain.theta[0, 0, 0] > 5 * THETA[0, 0]
