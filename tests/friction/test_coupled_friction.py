"""Friction of a motor that turns with two joints is found beside that of the joints."""

import numpy as np
import pytest
from fixtures import driven_wrist as wrist
from fixtures.exact_problems import fit_to_all
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.plants import plant_of
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, states_of, training_problem
from frictionid.fitting.parameters import BiasBlock, FrictionBlock
from frictionid.fitting.torque_balance import TorqueSettings, fit_torques, torque_balance
from frictionid.friction.laws import CoulombViscous

TRUE = np.stack([wrist.COULOMB, wrist.VISCOUS], axis=-1)  # of three joints and the motor


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    arm = wrist.mechanism(tmp_path_factory.mktemp("wrist"))
    return wrist.dataset(arm, wrist.frame(arm, 14.0))


def test_places_where_parts_slide_have_names_and_velocities(dataset):
    arm = dataset.mechanism
    assert arm.friction_names == ("one", "two", "three", "turner")
    assert_array_equal(arm.friction_map, [*np.eye(3), [0, -1, 1]])


def test_the_rotor_of_a_coupled_motor_adds_to_all_its_joints(dataset):
    arm = dataset.mechanism
    q = np.random.default_rng(0).uniform(-2, 2, (5, 3))
    without = arm.inertia(arm.base({"rotor_turner": 0.0}), q)
    row = arm.friction_map[3]
    added = np.broadcast_to(wrist.PARAMETERS["rotor_turner"] * np.outer(row, row), without.shape)
    assert_allclose(arm.inertia(arm.base({}), q) - without, added, atol=1e-12)


def test_one_step_finds_the_friction_of_all_four(dataset):
    problem = training_problem(dataset, plant_of(dataset), INTEGRAL, 0.01)
    found = fit_to_all(LeastSquares(CoulombViscous()), problem)[0]
    assert_allclose(found.theta, TRUE, rtol=0.03)


@pytest.fixture(scope="module")
def balance(dataset):
    return torque_balance(dataset, states_of(dataset, INTEGRAL.states, None), 0.05, 0.004)


def test_inverse_dynamics_finds_the_friction_of_all_four(balance):
    blocks = (FrictionBlock(), BiasBlock())
    found = fit_torques(LeastSquares(CoulombViscous()), balance, blocks, TorqueSettings())
    assert_allclose(found.friction.theta, TRUE, rtol=0.02)
    names = [p.name for p in found.covariance.parameters if p.block == "friction"]
    assert names[-2:] == ["coulomb of turner", "viscous of turner"]


def test_no_speed_is_resolved_that_is_slower_than_the_windows_in_use(balance):
    least = np.abs(balance.nodes.inputs.w[balance.stencil]).min(axis=1)
    fast = (least > 0.4).all(axis=1)
    assert 20 < fast.sum() < len(fast) / 2 and (balance.slowest < 0.3).all()
    assert (balance.resolving(fast).slowest > 0.4).all()


WRONG = """
coupled = "motor" => coupled: it should be a valid dictionary, not 'motor'
coupled = {motor = {two = 1.0}} => two joints or more
coupled = {two = {two = 1.0, three = 1.0}} => name of a joint
coupled = {motor = {two = 1.0, thre = 1.0}} => 'thre'.*three
coupled = {motor = {two = 1.0, three = 0.0}} => not zero
"""


@mistakes(WRONG)
def test_a_coupling_that_is_none_is_said_in_a_line(tmp_path, wrong, words):
    with assert_refused(words):
        wrist.mechanism(tmp_path, **changes(wrong))
