"""Plans of the control example move as the simulator does; their feedback brings errors back."""

import control
import numpy as np
from numpy.testing import assert_allclose

from frictionid.deploy.simulator import Simulator
from frictionid.friction import Friction
from frictionid.friction.laws import Stribeck
from frictionid.simulate.rig import nominal_mechanism

THETA = [[0.16, 0.15, 0.01, 0.02, 1.0, 0.004], [0.05, 0.06, 0.03, 0.02, 2.0, 0.001]]
FRICTION = Friction(Stribeck(symmetric=False), np.array(THETA))


def moving(rng, count):
    """States in which no joint is slow, where plans smooth friction."""
    q, w = rng.uniform(-3, 3, (count, 2)), rng.uniform(2.0, 9.0, (count, 2))
    return np.concatenate([q, w * rng.choice([-1, 1], (count, 2))], axis=1)


def test_a_plan_moves_as_the_simulator_where_joints_slide():
    rng = np.random.default_rng(0)
    x, u = moving(rng, 30), rng.uniform(-0.5, 0.5, 30)
    simulator = Simulator(nominal_mechanism(control.rig()), FRICTION, dt=control.DT)
    torque = np.stack([0.0 * u, u], axis=1)
    after = simulator.step(simulator.reset(x[:, :2], x[:, 2:]), torque)
    planned = control.motion(FRICTION).map(30)(x.T, u[None]).full().T
    assert_allclose(planned[:, :2], after.q, atol=2e-4)
    assert_allclose(planned[:, 2:], after.w, atol=2e-2)


def test_the_feedback_of_a_plan_brings_errors_back():
    """A second of hanging still: a push fades sooner with the feedback than without it."""
    step, count = control.frictionless(), 100
    gain = control.gains(step, np.zeros((count + 1, 4)), np.zeros(count))
    pushed = free = np.array([0.1, -0.1, 0.0, 0.0])
    for k in range(count):
        pushed = step(pushed, -gain[k] @ pushed).full()[:, 0]
        free = step(free, 0.0).full()[:, 0]
    assert np.abs(pushed[2:]).max() < 0.3 * np.abs(free[2:]).max()
