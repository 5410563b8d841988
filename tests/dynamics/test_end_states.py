"""Compiled end states and derivatives are those of arrays, for all that can be free."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.random_robots import mechanism as robot
from fixtures.steps import looped
from test_compiled_step import LAWS, MECHANISMS

from frictionid.dynamics import end_states as sensitivities
from frictionid.dynamics.law_derivatives import FreeTheta, reads_of
from frictionid.dynamics.tangent import MotionModel, MotorTorque
from frictionid.friction import Friction, Inputs
from frictionid.friction import laws as known
from frictionid.friction.coordinates import at_places
from frictionid.mechanics import acrobot, double_pendulum

COUNT, PIECES, FINE, TORQUES = 240, 2, 8, 2
SMOOTH = ("a wide smoothing", "motor load", "a film", "bearing load")
STRIBECK = LAWS["stribeck"][1]
NETWORK = known.MLP(hidden=(3,))
CASES = {
    **{f"acrobot, {law}": (acrobot(), *LAWS[law]) for law in ("stribeck", "bristles", "none")},
    **{f"double, {law}": (double_pendulum(), *LAWS[law]) for law in SMOOTH},
    "pendulum, coulomb": (MECHANISMS["pendulum"], *LAWS["coulomb"]),
    "double, dahl": (double_pendulum(), known.Dahl(motor_load=True), [0.1, 0.1, 0.05, 0.02]),
    "double, coupled": (
        replace(double_pendulum(), coupled=(("both", (1.0, 1.0)),)),
        *LAWS["coulomb"],
    ),
    "robot, stribeck": (MECHANISMS["robot"], *LAWS["stribeck"]),
    "robot, load": (robot(seed=5, n=3), known.LoadDependent(), [0.3, 0.1, 0.01]),
    "robot, load of coupled gears": (
        replace(robot(seed=5, n=2), coupled=(("both", (1.0, 1.0)),)),
        known.LoadDependent(stribeck=True),
        [0.5, 0.3, 0.5, 0.15, 0.01],
    ),
    "acrobot, network": (acrobot(), NETWORK, list(0.1 + np.arange(len(NETWORK.names)) / 40)),
}


LOOPS = ("double, motor load", "double, bearing load", "acrobot, bristles")


@pytest.mark.parametrize(
    ("case", "gains"), [*((case, (0.0, 0.0)) for case in CASES), *((c, (4.0, 0.3)) for c in LOOPS)]
)
def test_end_states_and_derivatives_are_those_of_arrays(case, gains, monkeypatch):
    """Also under a controller."""
    machine, law, numbers = CASES[case]
    random, n, count = np.random.default_rng(2), machine.n, len(numbers)
    m = len(machine.friction_names)
    theta = np.tile(numbers, (m, 1))
    plant = looped(machine, COUNT, gains)
    q, w = random.normal(size=(2, COUNT, n))
    w[::4] *= 0.05
    w[1::4, 0] = 0.0
    x = at_places(machine, Inputs(q, w, 0.0 * q, 0.0 * q))
    reads = reads_of(law, theta, x.each(lambda rows: rows[:8]))
    nodes = np.concatenate([q, w, *(0.5 * z for z in law.start(theta, x))], axis=-1)
    free = FreeTheta(np.repeat(np.arange(m), count), np.tile(np.arange(count), m))
    model = MotionModel(plant, Friction(law, theta), free, (0, 1), reads)

    def motor(rows, parts):
        # the same torque however finely it is asked for
        level = np.linspace(-0.2, 0.2, COUNT)[rows, None] * machine.motors
        u = np.broadcast_to(level, (parts, *level.shape)).copy()
        by = np.stack([np.ones_like(u), 0.5 * u], axis=1) * machine.motors
        return MotorTorque(u, by, 1e-5 * u, 1e-5 * by)

    torque = motor(np.arange(COUNT), PIECES)
    torque = torque._replace(finer=lambda rows, _, parts: motor(rows, parts))
    dt = np.linspace(0.01, 1 / 60, COUNT)
    made = []
    for many in (10**9, 0):
        monkeypatch.setattr(sensitivities, "COMPILED", many)
        made.append(sensitivities.end_states(model, nodes, torque, dt, FINE))
    for arrays, fast in zip(*made, strict=True):
        # derivatives of friction by differences on arrays, exact in the compiled step
        np.testing.assert_allclose(fast, arrays, rtol=1e-6, atol=1e-8)


def test_only_what_is_free_has_derivatives(monkeypatch):
    """Of a law's parameters one joint may free others than the next one."""
    machine, law, n = double_pendulum(), known.Stribeck(symmetric=False), 2
    theta = np.tile(STRIBECK, (n, 1))
    plant = looped(machine, COUNT)
    nodes = np.concatenate([*np.random.default_rng(3).normal(size=(2, COUNT, n))], axis=-1)
    reads = reads_of(law, theta, Inputs(*(nodes[:8, :n],) * 4))
    u = np.zeros((1, COUNT, n))
    torque = MotorTorque(u, u[:, None][:, :0], u, u[:, None][:, :0])
    monkeypatch.setattr(sensitivities, "COMPILED", 0)

    def derivatives(joint, place):
        free = FreeTheta(np.array(joint, dtype=int), np.array(place, dtype=int))
        model = MotionModel(plant, Friction(law, theta), free, (), reads)
        dt = np.full(COUNT, 0.01)
        return sensitivities.end_states(model, nodes, torque, dt, FINE)[1][..., 2 * n :]

    every = derivatives([0] * 6 + [1] * 6, [*range(6), *range(6)])
    np.testing.assert_array_equal(derivatives([0, 1, 1], [4, 0, 5]), every[..., [4, 6, 11]])
    assert derivatives([], []).shape == (COUNT, 2 * n, 0)
