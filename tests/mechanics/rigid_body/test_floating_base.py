"""Trees on a base that moves: Pinocchio's free flyer agrees, and only an IMU's numbers matter."""

import numpy as np
import pytest
from fixtures import floating_legs as legs
from fixtures.random_robots import motions, random_robot, urdf_text
from fixtures.refusals import assert_refused
from numpy.testing import assert_array_equal
from test_tree_engines import close

from frictionid.arrays import times
from frictionid.mechanics import Plant, urdf
from frictionid.mechanics.plant import with_base_motion
from frictionid.mechanics.rigid_body.rigid_body_tree import with_free_base

COUNT = 30
UP = np.array([0.0, 0.0, 9.81])


@pytest.fixture(
    params=[(0, 1, True, 0), (2, 6, True, 0), (4, 7, False, 2)], ids=str, scope="module"
)
def robot(request, tmp_path_factory):
    """File, and the mechanism on a floating base."""
    seed, n, serial, fixed = request.param
    rng = np.random.default_rng(seed)
    path = tmp_path_factory.mktemp("robot") / "robot.urdf"
    path.write_text(urdf_text(random_robot(rng, n, serial, fixed)))
    joints = urdf(path).joints
    rotors = {f"rotor_{name}": float(rng.uniform(0, 1)) for name in joints}
    return path, urdf(path, joints=joints, floating=True).with_values(rotors)


@pytest.fixture
def case(robot):
    """File, mechanism, a generator, and a motion: angles, velocities and accelerations."""
    rng = np.random.default_rng(1)
    return *robot, rng, *motions(rng, (COUNT, robot[1].n))


def inverse_dynamics(mechanism, p, q, w, a):
    M, h = mechanism.dynamics(p, q, w)
    return times(M, a) - h


def test_torques_and_regressor_agree_with_pinocchio_on_a_free_flyer(case):
    pin = pytest.importorskip("pinocchio", reason="the test extra installs it")
    path, mechanism, rng, q, w, a = case
    n = mechanism.n
    model = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    names = [str(name) for name in model.names][2:]
    model.armature[6:] = [mechanism.values[f"rotor_{name}"] for name in names]
    at = [names.index(name) for name in mechanism.joints]
    twist, change = rng.normal(size=(2, COUNT, 6)) * 3.0
    turn = rng.normal(size=(COUNT, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    data, torque, force = model.createData(), np.empty((COUNT, 6 + n)), np.empty((COUNT, 3))
    for k in range(COUNT):
        states = np.empty((3, n))
        states[:, at] = q[k], w[k], a[k]
        place = np.r_[rng.normal(size=3), turn[k], states[0]]
        full = pin.rnea(model, data, place, np.r_[twist[k], states[1]], np.r_[change[k], states[2]])
        torque[k] = np.r_[full[:6], full[6:][at]]
        # the spatial acceleration, and that of the point
        up = pin.Quaternion(turn[k]).toRotationMatrix().T @ UP
        force[k] = change[k, :3] + np.cross(twist[k, 3:], twist[k, :3]) + up
    motion = np.hstack([twist[:, 3:], change[:, 3:], force])
    p = with_base_motion(mechanism.base({}), motion)
    assert close(inverse_dynamics(mechanism, p, q, w, a), torque[:, 6:])
    assert close(times(mechanism.partials(p, q, w, a).by_p, mechanism.base({})), torque[:, 6:])
    # and the wrench on the base; its link has no mass in these files
    tree, rotors = mechanism.with_parameters({})
    p = with_base_motion(np.r_[np.zeros(10), tree.inertia.ravel(), rotors], motion)
    states = (np.pad(x, ((0, 0), (6, 0))) for x in (q, w, a))
    assert close(inverse_dynamics(with_free_base(mechanism), p, *states), torque)


def test_partial_derivatives_are_those_of_the_torques(case):
    _, mechanism, rng, q, w, a = case
    p = with_base_motion(mechanism.base({}), rng.normal(size=(COUNT, 9)) * 5.0)
    by_q, by_w, _ = mechanism.partials(p, q, w, a)
    size = np.abs(inverse_dynamics(mechanism, p, q, w, a)).max()
    for j, step in enumerate(1e-5 * np.eye(mechanism.n)):
        for exact, dq, dw in ((by_q, step, 0.0), (by_w, 0.0, step)):
            up, down = (inverse_dynamics(mechanism, p, q + s * dq, w + s * dw, a) for s in (1, -1))
            assert np.abs((up - down) / 2e-5 - exact[..., j]).max() < 1e-6 * size


def test_momentum_balances_the_torques_without_angular_acceleration(case):
    _, mechanism, rng, q, w, a = case
    base = rng.normal(size=(COUNT, 9)) * 3.0
    p = mechanism.base({})

    def terms(time):
        later = base + time * np.pad(base[:, 3:6], ((0, 0), (0, 6)))
        later[:, 3:6] = np.nan  # it must not matter
        return mechanism.terms(
            with_base_motion(p, later), q + time * w + time**2 * a / 2, w + time * a
        )

    change = (terms(1e-5).momentum - terms(-1e-5).momentum) / 2e-5
    torque = inverse_dynamics(mechanism, with_base_motion(p, base), q, w, a)
    assert np.abs(change - terms(0.0).dLdq - torque).max() < 1e-7 * np.abs(torque).max()


def test_a_base_at_rest_is_a_fixed_base(case):
    path, mechanism, _, q, w, a = case
    p = mechanism.base({})
    still = with_base_motion(p, np.r_[np.zeros(6), UP])

    def terms(p):
        return *mechanism.terms(p, q, w), *mechanism.partials(p, q, w, a)

    for ours, fixed in zip(terms(still), terms(p), strict=True):
        assert_array_equal(ours, fixed)
    held = urdf(path, joints=mechanism.joints).with_values(mechanism.values)
    assert close(mechanism.dynamics(p, q, w)[1], held.dynamics(held.base({}), q, w)[1])
    assert len(held.base_names) <= len(mechanism.base_names)


def test_loads_of_gears_are_those_on_the_moving_base(case):
    _, mechanism, rng, q, w, u = case
    plant = Plant.from_parameters(mechanism, {}).on_base(rng.normal(size=(COUNT, 9)))
    M, h = plant.dynamics(q, w)
    a = np.linalg.solve(M, (h + u)[..., None])[..., 0]
    rotors = np.array([mechanism.values[f"rotor_{name}"] for name in mechanism.joints])
    assert close(plant.load(q, w, u), np.abs(u - rotors * a))


def test_a_free_joint_is_held_or_its_child_floats(tmp_path):
    held, floating = (
        legs.mechanism(tmp_path, **x) for x in ({"base": "trunk"}, {"floating": True})
    )
    assert (held.floating, floating.floating) == (False, True)
    assert floating.table["floating"] is True and held != floating
    with assert_refused("floating = true"):
        legs.mechanism(tmp_path)
    with assert_refused("floating: it should be a valid boolean, not 'yes'"):
        legs.mechanism(tmp_path, floating="yes")
