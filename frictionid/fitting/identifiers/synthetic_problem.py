"""A small problem with known friction, on which the protocol of identifiers is checked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frictionid.arrays import Array, times
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import States
from frictionid.fitting.one_step.residual import Problem, integral_problem
from frictionid.friction import Friction, along
from frictionid.friction.laws import Stribeck
from frictionid.mechanics import Plant, double_pendulum, pendulum

_RATE = 50.0  # [Hz]
_SAMPLES = 45
_RECORDINGS = 3
_NOISE = 1e-3  # [rad/s]
_TEMPERATURES = (20.0, 40.0)  # [degC]
_PENDULUM = {"mass": 0.5, "length": 0.3}  # [kg], [m]
# coulomb, peak [N m], Stribeck velocity [rad/s], viscous [N m s/rad] of each joint
_TRUTH = np.array([[0.10, 0.04, 1.5, 0.02], [0.05, 0.03, 2.5, 0.01]])


def true_friction(joints: int) -> Friction:
    """True friction of the synthetic problem, of one or two joints."""
    return Friction(Stribeck(), _TRUTH[:joints])


def synthetic_problem(joints: int, noise: float = _NOISE) -> Problem:
    """One-step problem of a pendulum with one or two driven joints: 3 recordings of 40 rows.

    Its motion is a sum of sines. The residual r is that of the true friction, plus `noise` [rad/s].
    Rows have a history of 4 samples.

    >>> problem = synthetic_problem(1, noise=0.0)
    >>> float(abs(problem.residual(along(true_friction(1), problem.nodes))).max())
    0.0
    """
    rng = np.random.default_rng(0)
    mechanism = pendulum() if joints == 1 else double_pendulum((True, True))
    parameters = _PENDULUM if joints == 1 else mechanism.defaults
    plant = Plant.from_parameters(
        mechanism, {k: np.full(_RECORDINGS, v) for k, v in parameters.items()}
    )
    states = [_motion(rng, joints) for _ in range(_RECORDINGS)]
    recordings = [
        Recording(f"{i}", Signal(s.time, s.q), Signal(s.time, np.cos(3 * s.q)))
        for i, s in enumerate(states)
    ]
    problem = _warmed(integral_problem(plant, recordings, states, history=4))
    torque = along(true_friction(joints), problem.nodes)
    explained = times(problem.G, problem.mean(torque))
    return replace(problem, r=explained + noise * rng.standard_normal(problem.r.shape))


def _warmed(problem: Problem) -> Problem:
    """The problem with a temperature that rises, for laws that ask for one; the truth does not."""
    inputs = problem.nodes.inputs
    rising = np.linspace(*_TEMPERATURES, len(inputs.w))[:, None] + 0.0 * inputs.w
    nodes = problem.nodes._replace(inputs=inputs._replace(temperature=rising))
    return replace(problem, nodes=nodes)


def _motion(rng: np.random.Generator, joints: int) -> States:
    """Smooth motion at up to about 8 rad/s that reverses a few times."""
    time = np.arange(_SAMPLES) / _RATE
    rate = rng.uniform(2.0, 9.0, (3, joints))
    phase = rng.uniform(0.0, 2 * np.pi, (3, joints))
    height = 2.5 / rate
    angle = rate * time[:, None, None] + phase
    return States(time, (height * np.sin(angle)).sum(1), (height * rate * np.cos(angle)).sum(1))


def synthetic_weights(problem: Problem) -> Array:
    """Weights (F, K) that leave out one recording each, of unequal size, with some rows in none."""
    left_out = problem.recording != np.arange(_RECORDINGS)[:, None]
    sizes = 1.0 + 0.5 * np.sin(np.arange(len(problem.r)))
    ignored = np.arange(len(problem.r)) % 10 == 3
    return left_out * sizes * ~ignored
