"""Dahl friction: the simplest of bristles."""

import numpy as np
import pytest
from fixtures.exact_problems import assert_recovered
from numpy.testing import assert_allclose

from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.friction import Friction, along, at_rest
from frictionid.friction.laws import Dahl, LuGre, MotorLoad

THETA = np.array([[0.1, 0.02, 0.01]])


def test_it_is_lugre_friction_without_peak_and_damping():
    nodes = synthetic_problem(1).nodes
    lugre = np.array([[0.1, 0.0, 1.0, 0.02, 0.01, 0.0, 0.1]])
    expected = along(Friction(LuGre(), lugre), nodes)
    assert_allclose(along(Friction(Dahl(), THETA), nodes), expected, rtol=1e-12)


def test_its_torque_depends_on_the_way_gone_and_not_on_the_time_it_took():
    law, x = Dahl(), at_rest(np.array([[0.02], [2.0]]))
    (z,) = law.advance(THETA, x, (np.zeros((2, 1)),), np.array([[0.5], [0.005]]))
    assert_allclose(z[0], z[1], rtol=1e-12)
    assert z[0, 0] == pytest.approx(0.01 * (1 - np.exp(-1)))


def test_it_is_passive_with_the_energy_of_its_spring():
    rng = np.random.default_rng(0)
    w, z = rng.normal(size=(500, 1)), 0.01 * rng.uniform(-1, 1, (500, 1))
    torque = Dahl().torque(THETA, at_rest(w), (z,))
    stored = 0.1 / 0.01 * z * (w - np.abs(w) * z / 0.01)
    assert (w * torque - stored >= -1e-12).all()


@pytest.mark.parametrize("presliding", [0.003, 0.1])
@pytest.mark.parametrize("size", [1.0, 100.0])
def test_truth_in_truth_out_whatever_its_size(presliding, size):
    theta = np.array([[0.1 * size, 0.02 * size, presliding], [0.05, 0.02, presliding / 2]])
    assert_recovered(Dahl(), theta)


LOADED = np.array([[0.1, 0.02, 0.01, 0.15], [0.05, 0.03, 0.004, 0.3]])


def test_under_load_it_is_dahl_friction_of_a_level_that_grows_with_the_torque():
    nodes = synthetic_problem(2).nodes
    idle = nodes._replace(inputs=nodes.inputs._replace(u=0.0 * nodes.inputs.u))
    assert_allclose(
        along(Friction(Dahl(motor_load=True), LOADED), idle),
        along(Friction(Dahl(), LOADED[:, :3]), idle),
        rtol=1e-12,
    )
    # sliding for long it is that of a gear under load
    x = at_rest(np.full((1, 2), 3.0))._replace(u=np.array([[0.7, -0.4]]))
    z = (LOADED[:, 2] * np.ones((1, 2)),)
    expected = MotorLoad().torque(LOADED[:, [0, 1, 3]], x, ())
    assert_allclose(Dahl(motor_load=True).torque(LOADED, x, z), expected, rtol=1e-9)


def test_truth_in_truth_out_under_load():
    assert_recovered(Dahl(motor_load=True), LOADED)
