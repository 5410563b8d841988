"""Friction while its memory stands still is friction without memory."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction, at_rest
from frictionid.friction.laws import LSTM, LuGre, WindowMLP
from frictionid.friction.wrapped import held
from frictionid.mechanics import Plant, pendulum

PLAIN = {"dissipative": False, "monotone_tail": False}
LAWS = [
    LSTM(cells=3, hidden=(5, 4), **PLAIN),
    LSTM(odd=True),
    LSTM(free=True, **PLAIN),
    WindowMLP(presliding=0.01),
    LuGre(),
]


@pytest.mark.parametrize("law", LAWS, ids=repr)
@pytest.mark.parametrize("width", [0.02, 1e-7])
def test_a_held_memory_gives_the_same_torque_and_break_away_level(law, width):
    rng = np.random.default_rng(1)
    theta = np.array(law.initial[0]) * rng.uniform(0.8, 1.2, (4, 2, len(law.names)))
    memory = law.start(theta, at_rest(rng.normal(size=(4, 2))))
    memory = law.advance(theta, at_rest(rng.normal(size=(4, 2))), memory, np.array([[1 / 60]]))
    still, numbers = held(law, theta, memory)
    law, still = law.with_width(width), still.with_width(width)
    x = at_rest(rng.normal(size=(4, 2)))
    assert not still.has_memory
    for name in ("torque", "limit"):
        found = getattr(still, name)(numbers, x, ())
        known = getattr(law, name)(theta, x, memory)
        assert_allclose(found, known, rtol=1e-12, atol=1e-15)


def test_a_motion_is_the_same_whether_or_not_the_law_knows_a_faster_one(monkeypatch):
    law, rng = LSTM(sample_time=0.01), np.random.default_rng(2)
    plant = Plant.from_parameters(pendulum(), {"mass": 0.3, "length": 0.2})
    own = Friction(law, np.array(law.initial[0]) * rng.uniform(0.8, 1.2, (6, 1, len(law.names))))
    begin = State(rng.normal(size=(6, 1)), rng.normal(size=(6, 1)))
    u, dt = 0.2 * rng.normal(size=(60, 6, 1)), np.full((60, 6), 0.01)
    fast = rollout(plant, own, begin, u, dt)
    monkeypatch.setattr(LSTM, "while_held", lambda *_: None)
    slow = rollout(plant, own, begin, u, dt)
    assert_allclose(fast.q, slow.q, rtol=0, atol=1e-11)
    assert np.ptp(slow.q[:, 0]) > 0.1
