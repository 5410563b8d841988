"""Base parameters: as many as motion can tell apart, and no torque is lost by them."""

import numpy as np
import pytest
from fixtures.random_robots import mechanism as robot
from fixtures.random_robots import motions
from numpy.testing import assert_allclose

from frictionid.arrays import times
from frictionid.data.readers.dataset import load_dataset
from frictionid.mechanics import urdf
from frictionid.mechanics.rigid_body.base_parameters import regressor

SEEDS = range(2)


@pytest.mark.parametrize("seed", SEEDS)
def test_there_are_as_many_as_the_regressor_has_rank(seed):
    mechanism = robot(seed, 5)
    q, w, a = motions(7, (200, 5))
    Y = regressor(mechanism.tree, q, w, a).reshape(-1, 11 * 5)
    singular = np.linalg.svd(Y, compute_uv=False)
    assert len(mechanism.base_names) == int((singular > 1e-9 * singular[0]).sum())
    assert len(set(mechanism.base_names)) == len(mechanism.base_names)


@pytest.mark.parametrize("seed", SEEDS)
def test_any_inertial_parameters_have_the_torques_of_their_base_parameters(seed):
    rng, mechanism = np.random.default_rng(seed), robot(seed, 5)
    q, w, a = motions(rng, (50, mechanism.n))
    pi = rng.normal(size=(3, 11 * mechanism.n))
    Y = regressor(mechanism.tree, q, w, a)
    p = pi @ mechanism.reduction.regrouping.T
    tau = times(mechanism.partials(p[:, None], q, w, a).by_p, p[:, None])
    assert_allclose(tau, np.einsum("kic,bc->bki", Y, pi), atol=1e-8)


def test_an_axis_that_the_file_rounds_to_a_right_angle_adds_no_parameter(tmp_path):
    """1.5708 is no right angle, and its torques are those of the file all the same."""
    exact = arm(tmp_path, repr(np.pi / 2))
    rounded = arm(tmp_path, "1.5708")
    assert rounded.base_names == exact.base_names
    q, w, a = motions(0, (50, 3))
    pi = np.concatenate([rounded.tree.inertia.ravel(), np.zeros(3)])
    Y = regressor(rounded.tree, q, w, a)
    by_p = rounded.partials(rounded.base({}), q, w, a).by_p
    assert_allclose(times(by_p, rounded.base({})), Y @ pi, atol=1e-12)
    M, h = rounded.dynamics(rounded.base({}), q, w)
    assert_allclose(times(M, a) - h, Y @ pi, atol=1e-12)


def arm(tmp_path, right_angle):
    """Three joints, turned by right angles."""
    links = "".join(
        f'<link name="l{i}"><inertial><origin xyz="0.1 0.03 0.02"/><mass value="2"/>'
        '<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.025"/></inertial></link>'
        for i in range(3)
    )
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="{f"l{i - 1}" if i else "base"}"/>'
        f'<child link="l{i}"/><origin xyz="0.2 0 0.1" rpy="{right_angle if i else 0} 0 0"/>'
        '<axis xyz="0 0 1"/></joint>'
        for i in range(3)
    )
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm"><link name="base"/>{links}{joints}</robot>')
    return urdf(path)


def test_what_rounding_leaves_of_a_base_parameter_is_zero():
    """Of the last link of this arm Ixx - Iyy is zero in the file, and a product of many turns."""
    machine = load_dataset("tx40").mechanism
    base = machine.nominal_base
    assert f"{base[machine.base_names.index('Ixx_link_6')]:g}" == "0"
    sizes = np.abs(base[base != 0.0])
    assert sizes.min() > 1e-12 * sizes.max()


def test_a_rotor_is_one_more_parameter_unless_it_acts_like_the_link(tmp_path):
    names = arm(tmp_path, "1.5707963267948966").base_names
    assert [name for name in names if name.startswith("rotor")] == ["rotor_j2"]
    assert {"Izz_l0", "Ixx_l1", "mx_l2"} <= set(names)
