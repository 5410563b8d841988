"""Laws of friction: what holds for every law, and its torque along recorded motion."""

import numpy as np
import pytest
import torch
from fixtures.memory_laws import Follower, Sampled

from frictionid.errors import InputError
from frictionid.friction import Friction, Inputs, Nodes, along, at_rest, memory_along
from frictionid.friction.law import smooth_sign
from frictionid.friction.laws import (
    CoulombViscous,
    FilmLag,
    NoFriction,
    Stribeck,
)

# one row per joint; the joints differ, so that mixed-up joints show
STATIC = {
    "none": (NoFriction(), np.zeros((2, 0))),
    "coulomb_viscous": (CoulombViscous(), np.array([[0.1, 0.02], [0.05, 0.01]])),
    "arctan": (CoulombViscous(0.01, "arctan"), np.array([[0.1, 0.02], [0.05, 0.01]])),
    "stribeck": (Stribeck(), np.array([[0.1, 0.03, 1.5, 0.02], [0.05, 0.04, 0.7, 0.01]])),
    "asymmetric": (
        Stribeck(symmetric=False),
        np.array([[0.1, 0.08, 0.03, 0.05, 1.5, 0.02], [0.05, 0.06, 0.0, 0.04, 0.7, 0.01]]),
    ),
}
FILM = Friction(FilmLag(), np.array([[0.1, 0.05, 1.5, 0.02, 0.03], [0.05, 0.03, 0.7, 0.01, 0.1]]))
SAMPLED = Friction(Sampled(), np.array([[0.2], [0.1]]))


@pytest.fixture(params=STATIC)
def static(request):
    return Friction(*STATIC[request.param])


@pytest.fixture(params=[*STATIC, "film lag", "sampled"])
def friction(request):
    remembering = {"film lag": FILM, "sampled": SAMPLED}
    return remembering.get(request.param) or Friction(*STATIC[request.param])


def velocities():
    """Velocities of all sizes, and zero."""
    w = np.concatenate([[0.0], np.logspace(-5, 1.5, 60)])
    return np.concatenate([-w[::-1], w])


def drawn(rng, shape=(40,)):
    """Inputs of two joints at random."""
    q, w, u = (rng.normal(size=(*shape, 2)) * scale for scale in (1.0, 2.0, 0.3))
    return Inputs(q, w, u, 1.0 + rng.random((*shape, 2)))


# ---------------------------------------------------------------- laws without memory


def test_friction_never_drives(static):
    assert (static.curve(velocities()) * velocities()[:, None]).min() >= 0.0


@pytest.mark.parametrize("name", ["none", "coulomb_viscous", "arctan", "stribeck"])
def test_symmetric_laws_turn_round_with_the_motion(name):
    friction = Friction(*STATIC[name])
    np.testing.assert_array_equal(friction.curve(velocities()), -friction.curve(-velocities()))


def test_the_break_away_level_is_the_most_that_friction_reaches_without_its_viscous_part(static):
    law, theta = static.law, static.theta.copy()
    if theta.shape[-1]:
        theta[:, -1] = 0.0  # viscous
    curve = Friction(law, theta).curve(np.linspace(-100.0, 100.0, 200_001))
    # smoothing costs a little of it: the stribeck_factor is past its top when the sign is complete
    up, down = (law.limit(theta, at_rest(np.full(2, w)), ()) for w in (1.0, -1.0))
    np.testing.assert_allclose(curve.max(axis=0), up, rtol=0.02)
    np.testing.assert_allclose(-curve.min(axis=0), down, rtol=0.02)
    assert (curve.max(axis=0) <= up).all() and (-curve.min(axis=0) <= down).all()


def test_gradients_are_those_of_the_torque(static):
    x = drawn(np.random.default_rng(1))
    step = 1e-6
    for i in range(static.theta.shape[-1]):
        shift = np.zeros_like(static.theta)
        shift[:, i] = step
        up, down = (Friction(static.law, static.theta + s).torque(x) for s in (shift, -shift))
        found = static.law.gradient(static.theta, x)[..., i]
        np.testing.assert_allclose(found, (up - down) / (2 * step), rtol=0, atol=1e-8)
    assert static.law.gradient(static.theta, x).shape == (40, *static.theta.shape)


def test_richer_laws_contain_the_plainer_ones():
    x = drawn(np.random.default_rng(2))
    theta = STATIC["stribeck"][1]
    level, peak, ws, viscous = theta.T
    both = np.stack([level, level, peak, peak, ws, viscous], axis=-1)
    stribeck = Friction(Stribeck(), theta)
    np.testing.assert_allclose(
        Friction(Stribeck(symmetric=False), both).torque(x), stribeck.torque(x), rtol=1e-14
    )
    flat = theta * [1.0, 0.0, 1.0, 1.0]
    plain = Friction(CoulombViscous(), theta[:, [0, 3]])
    np.testing.assert_array_equal(Friction(Stribeck(), flat).torque(x), plain.torque(x))


def test_levels_far_above_the_smoothing_are_the_parameters():
    at = np.array([-5.0, 5.0])  # where dips have gone
    np.testing.assert_allclose(
        Friction(*STATIC["coulomb_viscous"]).curve(at)[1], [0.1 + 0.02 * 5, 0.05 + 0.01 * 5]
    )
    down, up = Friction(*STATIC["asymmetric"]).curve(at)
    np.testing.assert_allclose(up, [0.1 + 0.1, 0.05 + 0.05], atol=1e-5)
    np.testing.assert_allclose(down, [-0.08 - 0.1, -0.06 - 0.05], atol=1e-5)


def test_an_unknown_shape_of_the_sign_is_refused():
    for law in (CoulombViscous, Stribeck):
        with pytest.raises(InputError, match="shape = 'step' is unknown; known are tanh, arctan"):
            law(shape="step")
    with pytest.raises(ValueError, match="must be 'tanh' or 'arctan', got 'step'"):
        smooth_sign(np.ones(1), 0.02, "step")


@pytest.mark.parametrize("width", [0.0, -0.02, float("inf"), float("nan")])
def test_a_width_that_means_nothing_is_refused(width):
    with pytest.raises(InputError, match="width.* (positive and finite|a finite number)"):
        Stribeck(width=width)


# ---------------------------------------------------------------- a law and its numbers


def test_theta_must_fit_the_law():
    with pytest.raises(ValueError, match=r"\(\.\.\., joints, 2\).* coulomb, viscous; got \(2, 3\)"):
        Friction(CoulombViscous(), np.zeros((2, 3)))
    with pytest.raises(ValueError, match=r"got \(2,\)"):
        Friction(CoulombViscous(), np.zeros(2))


def test_an_index_picks_from_the_batch_and_keeps_the_rest():
    theta = np.random.default_rng(3).random((5, 3, 2, 2))
    many = Friction(CoulombViscous(), theta, {"m1": 0.4}, {"source": "x"})
    one = many[4, 1]
    np.testing.assert_array_equal(one.theta, theta[4, 1])
    assert (one.law, one.parameters, one.provenance.source) == (many.law, {"m1": 0.4}, "x")
    assert many.n == one.n == 2
    np.testing.assert_array_equal(many[:, 0].theta, theta[:, 0])


def test_batches_of_theta_are_each_friction_alone(friction):
    rng = np.random.default_rng(4)
    many = Friction(friction.law, friction.theta * rng.uniform(0.5, 2.0, (3, 1, 1)))
    w = np.linspace(-3, 3, 11)
    x = drawn(rng)
    each = Friction(many.law, many.theta[:, None])
    together = each.torque(x, many.law.start(each.theta, x))
    assert many.curve(w).shape == (3, 11, 2) and together.shape == (3, 40, 2)
    for k in range(3):
        np.testing.assert_array_equal(many.curve(w)[k], many[k].curve(w))
        alone = many[k].torque(x, many.law.start(many[k].theta, x))
        np.testing.assert_array_equal(together[k], alone)


def test_curve_is_the_torque_of_settled_motion():
    w = np.array([-2.0, -0.5, 0.5, 2.0])
    level, peak, ws, viscous, _ = FILM.theta.T
    speed = np.abs(w)[:, None]
    settled = (level + peak * np.exp(-((speed / ws) ** 2))) * np.sign(w)[:, None]
    np.testing.assert_allclose(FILM.curve(w), settled + viscous * w[:, None], rtol=1e-9)
    np.testing.assert_allclose(SAMPLED.curve(w), w[:, None] * [0.2, 0.1])
    slow = Friction(Follower(), np.ones((1, 1)))  # its memory starts away from the steady state
    np.testing.assert_allclose(slow.curve(w)[:, 0], w, rtol=1e-9)
    np.testing.assert_allclose(slow.curve(w, settle=0.1)[:, 0], w * -np.expm1(-1.0), rtol=1e-9)


def test_tensors_give_the_same_numbers(static):
    x = drawn(np.random.default_rng(5))
    other = Friction(static.law, torch.as_tensor(static.theta))
    tensors = x.each(torch.as_tensor)
    np.testing.assert_allclose(other.torque(tensors).numpy(), static.torque(x), rtol=1e-14)
    np.testing.assert_allclose(other.curve(velocities()), static.curve(velocities()), rtol=1e-14)
    assert str(other) == str(static)


def test_friction_prints_its_numbers_with_units():
    assert str(Friction(*STATIC["none"])) == "NoFriction()"
    lines = str(Friction(*STATIC["stribeck"])).splitlines()
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
    for begin, end in zip(nodes.first[:-1], nodes.first[1:], strict=True):
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
    nodes = series(np.random.default_rng(6), per_sample=per_sample)
    np.testing.assert_allclose(along(friction, nodes), loop(friction, nodes), rtol=0, atol=1e-14)


def test_each_recording_is_as_if_alone(friction):
    nodes = series(np.random.default_rng(7))
    together = along(friction, nodes)
    for begin, end in zip(nodes.first[:-1], nodes.first[1:], strict=True):
        part = slice(begin, end)
        own = Nodes(at(nodes.inputs, part), nodes.time[part], np.array([0, end - begin]))
        np.testing.assert_array_equal(together[part], along(friction, own))


def test_memory_starts_anew_in_each_recording():
    nodes = series(np.random.default_rng(8))
    begins = nodes.first[:-1]
    x = at(nodes.inputs, begins)
    fresh = FILM.torque(x, FILM.law.start(FILM.theta, x))
    np.testing.assert_array_equal(along(FILM, nodes)[begins], fresh)
    one = nodes._replace(first=nodes.first[[0, -1]])  # as if it were one recording
    assert np.abs(along(FILM, one) - along(FILM, nodes))[begins[1:]].max() > 1e-3


def test_folds_along_nodes_are_each_fold_alone(friction):
    rng = np.random.default_rng(9)
    nodes = series(rng)
    many = Friction(friction.law, friction.theta * rng.uniform(0.5, 2.0, (4, 1, 1)))
    together = along(many, nodes)
    assert together.shape == (4, 33, 2)
    for k in range(4):
        np.testing.assert_array_equal(together[k], along(many[k], nodes))


def test_sampled_laws_advance_once_a_sample():
    nodes = series(np.random.default_rng(10), lengths=(11,), per_sample=2)
    memories = memory_along(SAMPLED, nodes)
    for t in range(1, 11, 2):  # the middle of an interval remembers what its begin does
        for now, before in zip(memories[t], memories[t - 1], strict=True):
            np.testing.assert_array_equal(now, before)
    seen = (nodes.inputs.w + nodes.inputs.u)[::2]
    samples = seen[[2, 3, 4]]
    for entry, expected in zip(memories[8], samples, strict=True):
        np.testing.assert_array_equal(entry[0], expected)


def test_memory_along_keeps_recordings_side_by_side():
    nodes = series(np.random.default_rng(11))
    memories = memory_along(FILM, nodes)
    assert len(memories) == 15 and memories[0][0].shape == (3, 2)
    for r, size in enumerate((15, 7, 11)):
        part = slice(nodes.first[r], nodes.first[r + 1])
        own = Nodes(at(nodes.inputs, part), nodes.time[part], np.array([0, size]))
        alone = memory_along(FILM, own)
        for t in range(size):
            np.testing.assert_array_equal(memories[t][0][r], alone[t][0][0])
