"""A mechanism written as MJCF moves in MuJoCo as it does here: accelerations, and a free motion."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import sympy as sp
from fixtures.cart_poles import cart_pole
from fixtures.random_machines import MECHANISMS, physical, wrapped
from fixtures.random_robots import random_robot, urdf_text
from fixtures.refusals import assert_refused
from fixtures.wrist import wrist
from numpy.random import default_rng
from numpy.testing import assert_allclose

from frictionid.arrays import solve
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction
from frictionid.friction.laws import NoFriction
from frictionid.mechanics import (
    Body,
    Joint,
    Parameter,
    Plant,
    acrobot,
    double_pendulum,
    from_bodies,
    linear_axis,
    mjcf,
    mjcf_of,
    pendulum,
    urdf,
)

COUNT = 20


def sprung():
    """An upright pole, clockwise positive, on a spring that is slack at 0.3 rad."""
    q, mass, length, k = sp.symbols("q mass length k")
    return from_bodies(
        [Body(mass, length * sp.sin(q), length * sp.cos(q), mass * length**2 / 3, q)],
        [Joint("pole", q)],
        [
            Parameter("mass", 0.4, "kg", "of the pole"),
            Parameter("length", 0.3, "m", "to its centre of mass"),
            Parameter("k", 2.0, "N m/rad", "of the spring"),
            Parameter("g", 9.81, "m/s^2", "gravity"),
        ],
        potential=k * (q - 0.3) ** 2 / 2,
    )


OTHERS = {
    "cart-pole": cart_pole,
    "linear_axis": lambda: linear_axis(mass=3.0),
    "point mass": lambda: pendulum(mass=0.3, length=0.2),
    "sprung": sprung,
}


def accelerations(text, mechanism, q, w, u):
    """MuJoCo's accelerations (K, n), joints in the mechanism's order, motors by their `ctrl`."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    at = [model.joint(name).dofadr[0] for name in mechanism.joints]
    motors = [i for i, driven in enumerate(mechanism.driven) if driven]
    out = np.empty_like(q)
    for k in range(len(q)):
        data.qpos[at], data.qvel[at] = q[k], w[k]
        for i in motors:
            data.actuator(mechanism.joints[i]).ctrl[:] = u[k, i]
        mujoco.mj_forward(model, data)
        out[k] = data.qacc[at]
    return out


def assert_same_accelerations(mechanism, parameters):
    rng, shape = default_rng(4), (COUNT, mechanism.n)
    q, w, u = rng.uniform(-3, 3, shape), rng.uniform(-9, 9, shape), rng.normal(size=shape)
    M, h = mechanism.dynamics(mechanism.base(mechanism.nominal(parameters)), q, w)
    ours = solve(M, h + mechanism.motors * u)
    theirs = accelerations(mjcf_of(mechanism, parameters), mechanism, q, w, u)
    assert_allclose(theirs, ours, rtol=1e-9, atol=1e-9 * np.abs(ours).max())


@pytest.mark.parametrize("name", MECHANISMS)
def test_built_in_mechanisms_accelerate_alike(name):
    mechanism, rng = MECHANISMS[name], default_rng(3)
    for _ in range(3):
        drawn = {key: float(value) for key, value in physical(mechanism, rng).items()}
        assert_same_accelerations(mechanism, drawn)


@pytest.mark.parametrize("name", OTHERS)
def test_mechanisms_of_bodies_accelerate_alike(name):
    assert_same_accelerations(OTHERS[name](), {})


@pytest.mark.parametrize(("n", "serial"), [(1, True), (6, True), (7, False)])
def test_robots_of_files_accelerate_alike_and_are_read_back(n, serial, tmp_path):
    rng = default_rng(n)
    path, copy = tmp_path / "robot.urdf", tmp_path / "robot.xml"
    path.write_text(urdf_text(random_robot(rng, n, serial, fixed=1)))
    robot = urdf(path, payload=f"link_{n}")
    drawn = {f"rotor_{joint}": float(rng.uniform(0, 0.2)) for joint in robot.joints}
    drawn |= {"payload_mass": 0.7, "payload_x": 0.1, "payload_Izz": 0.01}
    drawn |= {"payload_Ixx": 0.01, "payload_Iyy": 0.01}
    assert_same_accelerations(robot, drawn)
    copy.write_text(mjcf_of(robot, drawn))
    again = mjcf(copy, joints=robot.joints)
    assert again.base_names == robot.base_names
    assert_allclose(again.base({}), robot.base(drawn), rtol=1e-8, atol=1e-10)


def test_a_motor_that_turns_with_two_joints_is_a_tendon(tmp_path):
    arm = wrist(tmp_path)
    assert "<tendon>" in mjcf_of(arm)
    assert_same_accelerations(arm, {})


@pytest.mark.parametrize("name", ["acrobot", "double_pendulum-11", "pendulum"])
def test_a_free_motion_of_a_second_is_the_same(name):
    """To 1e-6 rad at steps of 2 ms, where both methods are of order 4."""
    mechanism = MECHANISMS[name]
    drawn = {k: float(v) for k, v in physical(mechanism, default_rng(6)).items()}
    plant = Plant.from_parameters(mechanism, drawn)
    start, T = State(np.full(mechanism.n, 1.2), np.full(mechanism.n, -0.5)), 500
    none = Friction(NoFriction(), np.zeros((mechanism.n, 0)))
    ours = rollout(plant, none, start, np.zeros((T, mechanism.n)), np.full(T, 1 / T))
    model = mujoco.MjModel.from_xml_string(mjcf_of(mechanism, drawn, timestep=1 / T))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start.q, start.w
    mujoco.mj_step(model, data, T)
    assert_allclose(data.qpos, ours.q[-1], atol=1e-6)
    assert_allclose(data.qvel, ours.w[-1], atol=1e-5)


def absolute():
    """The second angle is measured against the vertical, not against the first link."""
    a, b, mass = sp.symbols("a b mass")
    return from_bodies(
        [
            Body(mass, sp.sin(a), -sp.cos(a)),
            Body(mass, sp.sin(a) + sp.sin(b), -sp.cos(a) - sp.cos(b)),
        ],
        [Joint("first", a), Joint("second", b)],
        [Parameter("mass", 1.0, "kg", "of each bob")],
    )


def hardening():
    q, mass = sp.symbols("q mass")
    return from_bodies(
        [Body(mass, sp.sin(q), -sp.cos(q))],
        [Joint("hinge", q)],
        [Parameter("mass", 1.0, "kg", "of the bob")],
        potential=q**4,
    )


def test_what_mjcf_cannot_hold_is_refused_in_one_line():
    thin = {"m1": 0.5, "m2": 0.5, "l1": 0.2, "r1": 0.2, "r2": 0.1, "I1": 0.01, "I2": 0.01}
    cases = [
        (absolute(), {}, "no hinge and no slide"),
        (hardening(), {}, "no sum of springs"),
        (double_pendulum(), thin, "link 1: mass 0.5 kg .* those of no body"),
        (wrapped(acrobot()), {}, "only mechanisms of bodies"),
    ]
    for mechanism, parameters, reason in cases:
        with assert_refused(reason):
            mjcf_of(mechanism, parameters)


def test_a_name_with_quotes_is_a_name_in_the_file():
    odd = replace(pendulum(mass=1.0, length=1.0), kind='a "<b>"')
    assert mujoco.MjModel.from_xml_string(mjcf_of(odd)).njnt == 1
