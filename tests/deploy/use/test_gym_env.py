"""Environments keep to Gymnasium's contract; many side by side are each alone."""

import warnings

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from gymnasium.utils.env_checker import check_env
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.deploy.gym_env import Episode, FrictionEnv, FrictionVectorEnv
from frictionid.deploy.simulator import Simulator
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, FilmLag
from frictionid.mechanics import acrobot

LAW = FilmLag()
FRICTION = Friction(LAW, np.repeat(np.array(LAW.initial[:1]), 2, axis=0))
SIMULATOR = Simulator(acrobot(), FRICTION, dt=0.02)


def height(q, _, u):
    return -np.cos(q[..., 0]) - 0.01 * (u**2).sum(-1)


def fast(_, w):
    return w[..., 0] > 3.0


def anywhere(random):
    return random.uniform(-1, 1, 2), random.uniform(-1, 1, 2)


EPISODE = Episode(height, 0.4, steps=7, start=anywhere, terminated=fast)


def test_gymnasium_finds_nothing_wrong():
    with warnings.catch_warnings():
        # angles and velocities have no bounds, which it finds unusual
        warnings.filterwarnings("ignore", message=".*Box observation space m.*mum value is")
        check_env(FrictionEnv(SIMULATOR, EPISODE), skip_render_check=True)


def test_the_same_seed_gives_the_same_episode():
    env, seen = FrictionEnv(SIMULATOR, EPISODE), []
    for seed in (5, 5, 6):
        first, _ = env.reset(seed=seed)
        seen.append([first, *(env.step(np.array([0.3]))[0] for _ in range(5))])
    assert_array_equal(seen[0], seen[1])
    assert np.abs(np.array(seen[0]) - seen[2]).max() > 0.1


def test_many_machines_are_each_alone():
    """Through ends and resets, with a memory of friction that starts anew."""
    count, rng = 4, np.random.default_rng(0)
    many = FrictionVectorEnv(SIMULATOR, EPISODE, count)
    alone = [FrictionEnv(SIMULATOR, EPISODE) for _ in range(count)]
    observed, _ = many.reset(seed=10)
    for i, env in enumerate(alone):
        assert_array_equal(observed[i], env.reset(seed=10 + i)[0])
    ended, ends = np.zeros(count, dtype=bool), 0
    for _ in range(25):
        actions = rng.uniform(-0.4, 0.4, (count, 1))
        observed, reward, over, late, _ = many.step(actions)
        for i, env in enumerate(alone):
            if ended[i]:
                own = (env.reset()[0], 0.0, False, False)
            else:
                own = env.step(actions[i])[:4]
            assert_allclose(observed[i], own[0], atol=1e-12)
            assert (reward[i], over[i], late[i]) == (pytest.approx(own[1]), *own[2:])
        ended = over | late
        ends += int(ended.sum())
    assert ends >= 2 * count


def test_machines_of_a_vector_may_differ():
    theta = np.array([[[0.0, 0.0]] * 2, [[0.5, 0.0]] * 2])
    simulator = Simulator(acrobot(), Friction(CoulombViscous(), theta), dt=0.02)
    env = FrictionVectorEnv(simulator, Episode(height, 0.4, start=lambda _: ([0.3, 0.0], None)), 2)
    env.reset(seed=1)
    for _ in range(5):
        observed, *_ = env.step(np.zeros((2, 1)))
    assert observed[1].tolist() == [0.3, 0.0, 0.0, 0.0]  # friction holds it
    assert observed[0, 0] != 0.3


def test_a_motion_that_diverges_ends_the_episode_with_finite_numbers():
    wild = Episode(height, 0.4, start=lambda _: (None, [1e6, 0.0]))
    env = FrictionEnv(SIMULATOR, wild)
    env.reset(seed=1)
    observation, reward, over, _, _ = env.step(np.zeros(1))
    assert over and np.isfinite(observation).all() and np.isfinite(reward)


@pytest.mark.parametrize("limit", [0.0, [0.1, 0.2], float("nan")])
def test_limits_that_no_motor_has_are_refused(limit):
    with assert_refused("torque_limit"):
        FrictionEnv(SIMULATOR, Episode(height, limit))


def test_a_batch_of_another_size_is_refused():
    three = Simulator(acrobot(), Friction(LAW, np.stack([FRICTION.theta] * 3)))
    with assert_refused("batch of shape"):
        FrictionVectorEnv(three, EPISODE, 2)
