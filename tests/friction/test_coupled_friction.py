"""Friction of a motor that turns with two joints is found beside that of the joints."""

import numpy as np
import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from fixtures.sines import sines, torque_without_friction

from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.formulation import INTEGRAL, states_of, training_problem
from frictionid.fitting.parameters import BiasBlock, FrictionBlock
from frictionid.fitting.torque_balance import TorqueSettings, fit_torques, torque_balance
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import urdf

LINK = '<inertial><origin xyz="0.1 0 0"/><mass value="{m}"/><inertia ixx="0.01" ixy="0" ixz="0" '
LINK += 'iyy="0.02" iyz="0" izz="0.02"/></inertial>'
ARM = f"""<robot name="wrist"><link name="base"/><link name="a">{LINK.format(m=2.0)}</link>
<link name="b">{LINK.format(m=1.0)}</link>
<joint name="bend" type="revolute"><parent link="base"/><child link="a"/>
<axis xyz="0 -1 0"/></joint>
<joint name="turn" type="revolute"><parent link="a"/><child link="b"/>
<origin xyz="0.2 0 0" rpy="0 1.2 0.3"/><axis xyz="1 0 0"/></joint></robot>"""
TRUE = np.array([[1.5, 0.4], [0.5, 0.2], [0.9, 0.3]])  # of bend, turn and motor


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Ten seconds along sines, with the torques that friction at three places needs."""
    path = tmp_path_factory.mktemp("wrist") / "wrist.urdf"
    path.write_text(ARM)
    arm = urdf(path, coupled={"motor": {"bend": 1.0, "turn": -0.8}})
    arm = arm.with_values({"rotor_motor": 0.3})
    t = np.arange(0.0, 10.0, 0.002)
    q, w, a = sines(t, ((0.9, 1.1), (0.4, 2.3)), ((1.1, 1.7), (0.5, 2.9)))
    A = arm.friction_map
    v = w @ A.T
    friction = (TRUE[:, 0] * np.sign(v) + TRUE[:, 1] * v) @ A
    u = torque_without_friction(arm, q, w, a) + friction
    noise = np.random.default_rng(0).normal(scale=1e-5, size=q.shape)
    return Dataset("wrist", arm, (Recording("a", Signal(t, q + noise), Signal(t, u, "linear")),))


def test_places_where_parts_slide_have_names_and_velocities(dataset):
    arm = dataset.mechanism
    assert arm.friction_names == ("bend", "turn", "motor")
    np.testing.assert_array_equal(arm.friction_map, [[1, 0], [0, 1], [1, -0.8]])


def test_the_rotor_of_a_coupled_motor_adds_to_all_its_joints(dataset):
    arm = dataset.mechanism
    q = np.random.default_rng(0).uniform(-2, 2, (5, 2))
    without = arm.inertia(arm.base({"rotor_motor": 0.0}), q)
    row = arm.friction_map[2]
    added = np.broadcast_to(0.3 * np.outer(row, row), without.shape)
    np.testing.assert_allclose(arm.inertia(arm.base({}), q) - without, added, atol=1e-12)


def test_one_step_finds_the_friction_of_all_three(dataset):
    problem = training_problem(dataset, plant_of(dataset), INTEGRAL, 0.01)
    found = LeastSquares(CoulombViscous()).fit(problem, np.ones((1, len(problem.r))), 0)[0]
    np.testing.assert_allclose(found.theta, TRUE, rtol=0.03)


def test_inverse_dynamics_finds_the_friction_of_all_three(dataset):
    balance = torque_balance(dataset, states_of(dataset, INTEGRAL.states, None), 0.05, 0.004)
    blocks = (FrictionBlock(), BiasBlock())
    found = fit_torques(LeastSquares(CoulombViscous()), balance, blocks, TorqueSettings())
    np.testing.assert_allclose(np.asarray(found.friction.theta), TRUE, rtol=0.02)
    names = [p.name for p in found.covariance.parameters if p.block == "friction"]
    assert names[-2:] == ["coulomb of motor", "viscous of motor"]


def test_no_speed_is_resolved_that_is_slower_than_the_windows_in_use(dataset):
    balance = torque_balance(dataset, states_of(dataset, INTEGRAL.states, None), 0.05, 0.004)
    least = np.abs(balance.nodes.inputs.w[balance.stencil]).min(axis=1)
    fast = (least > 0.4).all(axis=1)
    assert 20 < fast.sum() < len(fast) / 2 and (balance.slowest < 0.3).all()
    assert (balance.resolving(fast).slowest > 0.4).all()


WRONG = """
coupled = "motor" => must be a table
coupled = {motor = {bend = 1.0}} => two joints or more
coupled = {bend = {bend = 1.0, turn = 1.0}} => name of a joint
coupled = {motor = {bend = 1.0, trun = 1.0}} => 'trun'.*turn
coupled = {motor = {bend = 1.0, turn = 0.0}} => not zero
"""


@mistakes(WRONG)
def test_a_coupling_that_is_none_is_said_in_a_line(tmp_path, wrong, words):
    path = tmp_path / "wrist.urdf"
    path.write_text(ARM)
    with assert_refused(words):
        urdf(path, **changes(wrong))
