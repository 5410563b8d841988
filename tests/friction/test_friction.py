"""Laws of friction: what holds for every law, and its torque along recorded motion."""

from itertools import pairwise

import numpy as np
import pytest
from fixtures.memory_laws import FILM, STRIBECK, Follower, Sampled
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.friction import Friction, Inputs, Nodes, along, memory_along
from frictionid.friction.laws import CoulombViscous, NoFriction
from frictionid.friction.provenance import Estimate, Estimates

NONE = Friction(NoFriction(), np.zeros((2, 0)))
SAMPLED = Friction(Sampled(), [[0.2], [0.1]])


@pytest.fixture(params=[NONE, STRIBECK, FILM, SAMPLED], ids=lambda f: type(f.law).__name__)
def friction(request):
    return request.param


def drawn(rng, shape=(40,)):
    """Inputs of two joints at random."""
    q, w, u = (rng.normal(size=(*shape, 2)) * scale for scale in (1.0, 2.0, 0.3))
    return Inputs(q, w, u, 1.0 + rng.random((*shape, 2)))


# ---------------------------------------------------------------- a law and its numbers


def test_theta_must_fit_the_law():
    with pytest.raises(ValueError, match=r"\(\.\.\., joints, 2\).* coulomb, viscous; got \(2, 3\)"):
        Friction(CoulombViscous(), np.zeros((2, 3)))
    with pytest.raises(ValueError, match=r"got \(2,\)"):
        Friction(CoulombViscous(), np.zeros(2))


def test_an_index_picks_from_the_batch_and_keeps_the_rest():
    theta = default_rng(3).random((5, 3, 2, 2))
    many = Friction(CoulombViscous(), theta, {"m1": 0.4}, {"source": "x"})
    one = many[4, 1]
    assert_array_equal(one.theta, theta[4, 1])
    assert (one.law, one.parameters, one.provenance.source) == (many.law, {"m1": 0.4}, "x")
    assert many.n == one.n == 2
    assert_array_equal(many[:, 0].theta, theta[:, 0])


def test_curve_is_the_torque_of_settled_motion():
    w = np.array([-2.0, -0.5, 0.5, 2.0])
    level, peak, ws, viscous, _ = FILM.theta.T
    speed = np.abs(w)[:, None]
    settled = (level + peak * np.exp(-((speed / ws) ** 2))) * np.sign(w)[:, None]
    assert_allclose(FILM.curve(w), settled + viscous * w[:, None], rtol=1e-9)
    assert_allclose(SAMPLED.curve(w), w[:, None] * [0.2, 0.1])
    each = np.stack([w, 2 * w], axis=1)  # velocities of each joint
    assert_array_equal(FILM.curve(each)[:, 1], FILM.curve(2 * w)[:, 1])
    slow = Friction(Follower(), np.ones((1, 1)))  # its memory starts away from the steady state
    assert_allclose(slow.curve(w)[:, 0], w, rtol=1e-9)
    assert_allclose(slow.curve(w, settle=0.1)[:, 0], w * -np.expm1(-1.0), rtol=1e-9)


def test_friction_prints_its_numbers_with_units():
    assert str(NONE) == "NoFriction()"
    lines = str(STRIBECK).splitlines()
    assert lines[0] == "Stribeck(width=0.02, shape='tanh', symmetric=True)"
    assert lines[2] == (
        "  joint 2  coulomb 0.05 N m, peak 0.04 N m, stribeck_velocity 0.7 rad/s, "
        "viscous 0.01 N m s/rad"
    )


def test_a_batch_prints_mean_and_spread():
    theta = np.array([[[0.1, 0.02]], [[0.3, 0.02]]])
    lines = str(Friction(CoulombViscous(), theta)).splitlines()
    assert lines[1] == "  joint 1  coulomb 0.2 +- 0.14 N m, viscous 0.02 +- 0 N m s/rad"


# ---------------------------------------------------------------- along recorded motion


def series(rng, lengths=(15, 7, 11), per_sample=1):
    """Nodes of recordings of unequal length, on an uneven clock."""
    steps = [rng.uniform(0.005, 0.03, size) for size in lengths]
    time = np.concatenate([np.cumsum(s) for s in steps])
    first = np.concatenate([[0], np.cumsum(lengths)])
    return Nodes(drawn(rng, (sum(lengths),)), time, first, per_sample)


def at(x, index):
    return x.each(lambda part: part[index])


def loop(friction, nodes):
    """Torque along nodes, written down as it is meant: node by node, recording by recording."""
    law, theta, x = friction.law, friction.theta, nodes.inputs
    torque = np.zeros_like(x.w)
    for begin, end in pairwise(nodes.first):
        memory = law.start(theta, at(x, begin))
        last = begin
        for k in range(begin, end):
            due = law.sample_time is None or (k - begin) % nodes.per_sample == 0
            if k > begin and due:
                dt = np.array([nodes.time[k] - nodes.time[last]])
                mean = at(x, last).each(lambda a, b: (a + b) / 2, at(x, k))
                seen = mean if law.sample_time is None else at(x, k)
                memory = law.advance(theta, seen, memory, dt)
                last = k
            torque[k] = law.torque(theta, at(x, k), memory)
    return torque


@pytest.mark.parametrize("per_sample", [1, 2])
def test_along_is_a_plain_loop_over_each_recording(friction, per_sample):
    nodes = series(default_rng(6), per_sample=per_sample)
    assert_allclose(along(friction, nodes), loop(friction, nodes), rtol=0, atol=1e-14)


def test_folds_along_nodes_are_each_fold_alone(friction):
    rng = default_rng(9)
    nodes = series(rng)
    many = Friction(friction.law, friction.theta * rng.uniform(0.5, 2.0, (4, 1, 1)))
    w = np.linspace(-3, 3, 11)
    together, curves = along(many, nodes), many.curve(w)
    assert together.shape == (4, 33, 2) and curves.shape == (4, 11, 2)
    for k in range(4):
        assert_array_equal(together[k], along(many[k], nodes))
        assert_array_equal(curves[k], many[k].curve(w))


def test_memory_along_keeps_recordings_side_by_side():
    nodes = series(default_rng(11))
    memories = memory_along(FILM, nodes)
    assert len(memories) == 15 and memories[0][0].shape == (3, 2)
    for r, size in enumerate((15, 7, 11)):
        part = slice(nodes.first[r], nodes.first[r + 1])
        own = Nodes(at(nodes.inputs, part), nodes.time[part], np.array([0, size]))
        alone = memory_along(FILM, own)
        for t in range(size):
            assert_array_equal(memories[t][0][r], alone[t][0][0])


def test_joints_have_the_names_of_the_fit():
    found = Estimate("friction", "viscous of elbow", "N m s/rad", 1, 0.01)
    fitted = STRIBECK.noted({"refined": Estimates(parameters=(found,))})
    named = fitted.noted({"joints": ("hip", "knee")})
    names = [x.joints for x in (STRIBECK, fitted, named)]
    assert names == [("joint 1", "joint 2"), ("joint 1", "elbow"), ("hip", "knee")]
    assert "\n  knee  coulomb" in str(named)
