"""The true friction of simulated data as a model: the law is the friction of the simulator."""

import numpy as np
import pytest
from fixtures.mistakes import mistakes
from fixtures.paths import DATA
from fixtures.refusals import assert_refused
from fixtures.tiny_pendulums import changed
from fixtures.true_curves import true_states
from numpy.testing import assert_allclose

from frictionid import load_dataset
from frictionid.data.plants import plant_of
from frictionid.evaluation import make_initial_states, steady_state, true_friction
from frictionid.evaluation.predicted_motion import predict
from frictionid.friction import Friction, at_rest
from frictionid.simulate import Curve, FilmLag, LuGre

CURVE = Curve((0.1, 0.05), (0.12, 0.06), (0.01, 0.0), (0.04, 0.03), (0.02, 0.05), (1.0, 2.0))
TRUTHS = {
    "film_lag": FilmLag(CURVE, (0.015, 0.03)),
    "lugre": LuGre(CURVE, (40.0, 12.0), (0.1, 0.02), (0.1, 0.2)),
}
ROWS = 500


def drawn(kind):
    """Velocities and memories of the simulator, with the side on which each velocity is."""
    rng = np.random.default_rng(5)
    w = rng.normal(scale=3.0, size=(ROWS, 2)) * rng.choice([0.01, 0.1, 1.0], (ROWS, 1))
    w += np.copysign(0.2 if kind == "film_lag" else 0.0, w)  # beyond the smoothing at rest
    size = 4.0 if kind == "film_lag" else 0.02
    z = size * (rng.random((ROWS, 2)) if kind == "film_lag" else rng.uniform(-1, 1, (ROWS, 2)))
    return w, z, np.sign(w)


@pytest.mark.parametrize("kind", TRUTHS)
def test_torques_are_those_of_the_simulator(kind):
    truth = TRUTHS[kind]
    friction = true_friction(truth.table())
    w, z, side = drawn(kind)
    found = friction.torque(at_rest(w), (z,))
    assert_allclose(found, truth.torque(w, z, side), rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("kind", TRUTHS)
def test_memories_advance_at_the_rate_of_the_simulator(kind):
    truth = TRUTHS[kind]
    friction = true_friction(truth.table())
    w, z, side = drawn(kind)
    dt = np.array([1e-8])
    (later,) = friction.law.advance(friction.theta, at_rest(w), (z,), dt)
    rate = truth.rate(w, z, side)
    assert_allclose((later - z) / dt, rate, rtol=1e-4, atol=1e-4 * np.abs(rate).max())


@pytest.mark.parametrize("kind", TRUTHS)
def test_they_end_on_the_true_curve(kind):
    truth = TRUTHS[kind]
    w = np.array([-20.0, -3.0, -0.5, 0.5, 3.0, 20.0])
    curve = true_friction(truth.table()).curve(w)
    assert_allclose(curve, truth.curve.torque(w[:, None], np.sign(w)[:, None]))
    assert_allclose(curve, steady_state(truth.table()).curve(w), rtol=1e-9)


TABLES = r"""
lag = => lacks lag
lag = [0.01] => lag = \[0.01\] must be one number for each joint
kind = "lugre" => lacks bristle_stiffness, bristle_damping, damping_velocity
kind = "lugre"; bristle_stiffness = [0, 1]; bristle_damping = [1, 1]; damping_velocity = [1, 1]
    => bristle_stiffness and damping_velocity must be positive
"""


@mistakes(TABLES)
def test_tables_that_tell_too_little_are_refused(wrong, words):
    with assert_refused(words):
        true_friction(changed(TRUTHS["film_lag"].table(), wrong))


def errors(dataset, friction):
    """Angle errors [rad] half a second after true starts with the memory of the motion before."""
    plant, states = plant_of(dataset), true_states(dataset)
    starts = make_initial_states(dataset, states, plant, (0.5,), every=1.5, begin=0.5)
    S = len(starts.recording)
    theta = np.broadcast_to(friction.theta, (S, *friction.theta.shape))
    motion = predict(plant[starts.recording], Friction(friction.law, theta), starts)
    off = (motion.q - starts.truth)[starts.last[0], np.arange(S)]
    return np.linalg.norm(off, axis=-1)


@pytest.mark.parametrize(("name", "better"), [("acrobot_lag", 3.0), ("acrobot_lugre", 30.0)])
def test_the_truth_predicts_simulated_motion_better_than_its_own_curve_without_memory(name, better):
    """The laws and the step are not the simulator's: they only mean the same."""
    dataset = load_dataset(DATA / name)
    truth = errors(dataset, true_friction(dataset.truth))
    curve = errors(dataset, steady_state(dataset.truth, 0.02))
    assert np.median(truth) < 0.005
    assert np.median(curve) > better * np.median(truth)
