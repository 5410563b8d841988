"""Play: friction behind a gap."""

import numpy as np
import pytest
from drive_logs import ServoPendulum
from fixtures.refusals import assert_refused
from fixtures.servo_logs import by_torque
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction, at_rest
from frictionid.friction.laws import CoulombViscous, Play, Stribeck
from frictionid.mechanics import Plant, pendulum

GAP, LEVEL = 0.02, 0.1
THETA = np.array([[LEVEL, 0.02, GAP]])
DT = np.array([1e-4])


def along(law, w, dt=DT):
    """Places and torques (T,) behind each step of a motion of one joint."""
    memory = law.start(THETA, at_rest(np.zeros((1, 1))))
    places, torques = [], []
    for speed in w:
        x = at_rest(np.full((1, 1), speed))
        memory = law.advance(THETA, x, memory, dt)
        places.append(float(memory[0][0, 0]))
        torques.append(float(law.torque(THETA, x, memory)[0, 0]))
    return np.array(places), np.array(torques)


def test_its_place_is_that_of_the_play_operator():
    w = 0.5 * np.sin(np.linspace(0.0, 30.0, 4000)) + 0.3 * np.sin(np.linspace(0.0, 71.0, 4000))
    place, sharp = 0.0, []
    for speed in w:
        place = min(max(place + speed * DT[0], -GAP / 2), GAP / 2)
        sharp.append(place)
    found, _ = along(Play(closing=1e-4), w)
    assert_allclose(found, sharp, atol=1e-4)


def test_without_a_gap_it_is_the_law_behind_wherever_the_joint_stands():
    plain, none = CoulombViscous(), THETA * [[1.0, 1.0, 0.0]] + [[0.0, 0.0, 1e-4]]
    x = at_rest(np.linspace(-2.0, 2.0, 41)[:, None])
    for place in (-1.0, 0.0, 1e-5):
        memory = (np.full_like(x.w, place),)
        assert_allclose(Play().torque(none, x, memory), plain.torque(THETA[:, :2], x, ()))
        assert_allclose(Play().limit(none, x, memory), plain.limit(THETA[:, :2], x, ()))


TURN = 0.5 * np.cos(np.linspace(0.0, np.pi, 12000))  # [rad/s], from one side to the other


def test_within_the_gap_nothing_rubs_and_at_its_sides_everything_does():
    place, torque = along(Play(), TURN)
    full = LEVEL * np.sign(TURN) + 0.02 * TURN
    near = 0.005 * np.abs(TURN)  # contact closes over this way on either side of it
    before, free = TURN > 0.1, (TURN < 0.0) & (np.abs(place) < GAP / 2 - near)
    closed = (TURN < 0.0) & (np.abs(place + GAP / 2) > near - 1e-12) & ~free
    assert before.any() and free.any() and closed.any()
    assert_allclose(torque[500:][before[500:]], full[500:][before[500:]], rtol=1e-2)
    assert (torque[free] == 0.0).all()
    fast = closed & (TURN < -0.05)
    assert_allclose(torque[fast], full[fast], rtol=1e-2)


@pytest.mark.parametrize("closing", [0.002, 0.03])
def test_the_impulse_of_a_contact_is_that_of_a_sharp_one(closing):
    _, torque = along(Play(closing=closing), TURN)
    back = TURN < 0.0
    closed = np.cumsum(np.where(back, TURN, 0.0)) * DT[0] < -GAP
    sharp = np.where(closed, -LEVEL + 0.02 * TURN, 0.0)
    assert torque[back].sum() == pytest.approx(sharp.sum(), rel=0.01)


def test_friction_never_drives():
    rng = np.random.default_rng(0)
    w, z = rng.normal(size=(500, 1)), rng.uniform(-0.03, 0.03, (500, 1))
    assert (w * Play().torque(THETA, at_rest(w), (z,)) >= 0.0).all()


def test_at_constant_speed_it_is_the_law_behind_the_gap_beside_that_of_the_joint():
    w = np.array([-20.0, -3.0, -0.6, 0.4, 2.0, 15.0])
    theta = np.array([[0.1, 0.05, 1.0, 0.02, GAP, 0.03, 0.01]])
    both = Friction(Stribeck(), theta[:, :4]).curve(w)
    both = both + Friction(CoulombViscous(), theta[:, 5:]).curve(w)
    law = Play("stribeck", "coulomb_viscous")
    assert_allclose(Friction(law, theta).curve(w), both, rtol=1e-9)


def test_a_side_holds_a_joint_that_is_pressed_to_it_and_no_other():
    plant = Plant.from_parameters(pendulum(), {"mass": 0.5, "length": 0.1})
    weight = 0.5 * 9.81 * 0.1
    friction = Friction(Play(), [[0.3, 0.0, GAP]])
    angle = float(np.arcsin(0.2 / weight))  # gravity turns back with 0.2 N m
    free = (0.0 * np.ones(1), GAP / 2 * np.ones(1))  # in the middle; at the wrong side
    steps = np.full(400, 0.002)
    for place, way in zip((-GAP / 2 - 1e-4, *free), (0.0, GAP / 2, GAP), strict=True):
        start = State(np.array([angle]), np.zeros(1), (np.broadcast_to(place, (1,)),))
        motion = rollout(plant, friction, start, np.zeros((400, 1)), steps)
        gone = angle - motion.q[-1, 0]
        assert motion.w[-1, 0] == 0.0
        if way == 0.0:
            assert gone == 0.0
        else:  # it falls through the gap, and slides behind it until friction has stopped it
            energy = 0.2 * gone - 0.3 * (gone - way)
            assert energy == pytest.approx(0.0, abs=0.07 * 0.2 * gone)


@pytest.mark.parametrize("name", ["lugre", "film_lag"])
def test_laws_with_a_memory_of_their_own_are_refused(name):
    with assert_refused(f"play: '{name}' has a memory"):
        Play(name)
    with assert_refused(f"play: '{name}' has a memory"):
        Play(joint=name)


def test_no_friction_behind_the_gap_is_refused():
    with assert_refused("'none' is no friction behind"):
        Play("none")


def servo_logs(servo, seconds):
    return by_torque(servo, {f"{k}": servo.log(4.0, 0.05, k, seconds) for k in range(2)})


def test_a_simulated_servo_with_friction_behind_a_gap():
    servo = ServoPendulum(gap=GAP, delay=0.0, held=True)
    data, truth = servo_logs(servo, 2.5), np.array([servo.coulomb, servo.viscous, GAP])
    for method, within in (("one_step", 0.15), ("shooting", 0.03)):
        fit = fid.fit(data, "play", method=method)
        friction = fit.frame[fit.frame.block == "friction"]
        assert_allclose(friction.value, truth, rtol=within)
    assert not fit.convergence.warnings
    assert ((friction.low_95 <= truth) & (truth <= friction.high_95)).all()


def test_a_torque_that_changes_within_its_samples_shows_as_inertia():
    servo = ServoPendulum(gap=GAP, delay=0.0)
    fit = fid.fit(servo_logs(servo, 4.0), "play", method="shooting", free=["friction", "delay"])
    truth = [servo.coulomb, servo.viscous, GAP]
    assert_allclose(fit.frame.value, truth, rtol=0.03)
    assert "would show: 'inertia'" in fit.convergence.warnings[0]


def test_half_of_the_smoothing_is_that_of_contact_alone():
    assert Play("stribeck", closing=0.01).finer() == Play("stribeck", closing=0.005)
    assert CoulombViscous().finer() == CoulombViscous()
