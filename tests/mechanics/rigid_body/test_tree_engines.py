"""Pinocchio and MuJoCo agree with the trees of rigid bodies on robots drawn at random.

Rotors are in all of them: `rotorInertia` of Pinocchio, `armature` of MuJoCo.
"""

import numpy as np
import pytest
from fixtures.random_robots import beside_pinocchio, mjcf_text, motions, random_robot

from frictionid.arrays import solve, times
from frictionid.mechanics import check_mechanism, mjcf

pin = pytest.importorskip("pinocchio", reason="the test extra installs it")
COUNT = 50
ROBOTS = {  # seed, joints, serial, joints that do not move
    "one": (0, 1, True, 0),
    "seven": (3, 7, True, 2),
    "tree": (4, 7, False, 0),
    "branches": (5, 9, False, 3),
}


def close(ours, theirs):
    """Whether both have one shape, and agree to 1e-9 of the largest number."""
    scale = max(1.0, float(np.abs(theirs).max()))
    off = np.abs(np.asarray(ours) - np.asarray(theirs))
    return np.shape(ours) == np.shape(theirs) and bool(off.max() <= 1e-9 * scale)


@pytest.fixture(params=ROBOTS, scope="module")
def case(request, tmp_path_factory):
    """Mechanism, engine's model, parameters p and random motions; joints in the engine's order."""
    seed, n, serial, fixed = ROBOTS[request.param]
    rng = np.random.default_rng(seed)
    parts = random_robot(rng, n, serial, fixed)
    folder = tmp_path_factory.mktemp("robot")
    mechanism, model, rotors = beside_pinocchio(folder, parts, rng)
    text = mjcf_text(parts, [rotors.get(f"joint_{i}", 0.0) for i in range(len(parts))])
    return mechanism, model, mechanism.base({}), *motions(rng, (COUNT, n)), text, rotors


def theirs(model, function, *states):
    data = model.createData()
    return np.stack([function(model, data, *row) for row in zip(*states, strict=True)])


def test_terms_agree_with_pinocchio(case):
    mechanism, model, p, q, w, *_ = case
    terms = mechanism.terms(p, q, w)
    M = theirs(model, pin.crba, q)
    assert close(terms.M, np.triu(M) + np.swapaxes(np.triu(M, 1), -1, -2))
    assert close(terms.h, -theirs(model, pin.rnea, q, w, np.zeros_like(w)))
    assert close(terms.momentum, times(terms.M, w))
    C = theirs(model, pin.computeCoriolisMatrix, q, w)
    G = theirs(model, pin.computeGeneralizedGravity, q)
    assert close(terms.dLdq, times(np.swapaxes(C, -1, -2), w) - G)
    kinetic = (times(terms.M, w) * w).sum(-1) / 2  # Pinocchio's leaves out the rotors
    energy = kinetic + theirs(model, pin.computePotentialEnergy, q)
    assert close(terms.energy - terms.energy[0], energy - energy[0])
    for ours, term in zip(mechanism.dynamics(p, q, w), (terms.M, terms.h), strict=True):
        assert close(ours, term)
    assert close(mechanism.inertia(p, q), terms.M)


def test_partial_derivatives_agree_with_pinocchio(case):
    mechanism, model, p, q, w, a, *_ = case
    by_q, by_w, by_p = mechanism.partials(p, q, w, a)
    data = model.createData()
    for k in range(COUNT):
        pin.computeRNEADerivatives(model, data, q[k], w[k], a[k])
        assert close(by_q[k], data.dtau_dq)
        assert close(by_w[k], data.dtau_dv)
    assert close(times(by_p, p), theirs(model, pin.rnea, q, w, a))


def test_a_robot_in_mjcf_is_the_one_in_urdf(case, tmp_path):
    mechanism, _, p, q, w, a, text, _ = case
    path = tmp_path / "robot.xml"
    path.write_text(text)
    other = mjcf(path, joints=mechanism.joints)
    assert (other.joints, other.position_units) == (mechanism.joints, mechanism.position_units)
    for ours, same in zip(
        mechanism.partials(p, q, w, a), other.partials(other.base({}), q, w, a), strict=True
    ):
        assert close(ours, same)
    assert close(other.base({}), p)


def test_load_is_what_the_motor_gives_and_its_rotor_does_not_take(case):
    mechanism, model, p, q, w, *_, rotors = case
    u = np.random.default_rng(9).normal(scale=5.0, size=q.shape)
    M, h = mechanism.dynamics(p, q, w)
    a = solve(M, h + u)
    model = pin.Model(model)
    model.armature[:] = 0.0
    assert close(mechanism.load({}, q, w, u), np.abs(theirs(model, pin.rnea, q, w, a)))


def test_they_keep_to_the_protocol_and_parameters_may_go_with_the_states(case):
    mechanism, _, p, q, w, *_ = case
    check_mechanism(mechanism)
    each = p * np.array([1.0, 1.1, 0.9])[:, None]
    M, _ = mechanism.dynamics(each, q[:3], w[:3])
    assert close(M, np.stack([mechanism.inertia(each[k], q[k]) for k in range(3)]))
