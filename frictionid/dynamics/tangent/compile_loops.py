"""Compile the loops of the physics step and of its derivatives, once for all mechanisms.

The first long prediction or fit does so otherwise, and takes some seconds longer. After an
installation: python -m frictionid.dynamics.tangent.compile_loops
"""

from __future__ import annotations

import numpy as np

from frictionid.dynamics.rollout import MANY, rollout
from frictionid.dynamics.state import State
from frictionid.dynamics.tangent.end_states import COMPILED, end_states
from frictionid.dynamics.tangent.law_derivatives import FreeTheta, LawReads
from frictionid.dynamics.tangent.tangent import MotionModel, MotorTorque
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import Plant, pendulum


def compile_loops() -> None:
    """Predict and differentiate a motion that is long enough."""
    count = max(MANY, COMPILED)
    plant = Plant.from_parameters(pendulum(), {})
    plant = Plant(plant.mechanism, {}, np.repeat(plant.p[None], count, axis=0))
    friction = Friction(CoulombViscous(), np.array([[0.1, 0.01]]))
    state, u = State(*np.zeros((2, count, 1))), np.zeros((1, count, 1))
    rollout(plant, friction, state, u, np.full((1, count), 0.01))
    free = FreeTheta(np.array([0, 0]), np.array([0, 1]))
    model = MotionModel(plant, friction, free, (0,), LawReads(q=False, u=False))
    end_states(model, state, MotorTorque(u, u[:, None]), np.full(count, 0.01), 2)


if __name__ == "__main__":
    compile_loops()
