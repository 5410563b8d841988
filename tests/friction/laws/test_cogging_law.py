"""Cogging: a torque of the position beside friction, found from motion that another engine made."""

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from scipy.integrate import solve_ivp

import frictionid as fid
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction.laws import Cogging, Sum
from frictionid.mechanics import Plant, pendulum

POLES, AMPLITUDE, PHASE = 7, 0.02, 0.6
LAW = Sum(("coulomb_viscous", {"kind": "cogging", "harmonics": [POLES]}))
RIG = pendulum(mass=0.4, length=0.15)
J, MGL = 0.4 * 0.15**2, 0.4 * 9.81 * 0.15


def moved(frequency, rate=200.0, seconds=8.0):
    """A driven pendulum with friction .05 sgn(w) + .01 w and cogging, by SciPy."""
    time = np.arange(0.0, seconds, 1.0 / rate)
    drive = 0.9 * np.sin(frequency * time) + 0.5 * np.sin(1.7 * frequency * time)

    def rate_of(t, x):
        q, w = x
        friction = 0.05 * np.tanh(w / 0.02) + 0.01 * w
        cogging = AMPLITUDE * np.cos(POLES * q + PHASE)
        return [w, (np.interp(t, time, drive) - MGL * np.sin(q) - friction - cogging) / J]

    q = solve_ivp(rate_of, time[[0, -1]], [0.3, 0.0], t_eval=time, rtol=1e-8, max_step=0.002).y[0]
    noise = 2e-4 * np.random.default_rng(int(10 * frequency)).standard_normal(len(q))
    return {"time": time, "angle": q + noise, "torque": drive}


def test_amplitude_and_phase_are_found():
    data = {f"run{f}": moved(f) for f in (2.0, 3.1)}
    dataset = fid.Dataset.from_arrays(data, RIG, hold="linear", sigma=2e-4)
    fit = fid.fit(dataset, LAW, method="shooting", free="friction", windows=[0.1, 0.3])
    values = dict(zip(LAW.names, fit.friction.theta[0], strict=True))
    cos, sin = values[f"cos_{POLES}"], values[f"sin_{POLES}"]
    assert np.hypot(cos, sin) == pytest.approx(AMPLITUDE, rel=0.05)
    assert np.arctan2(-sin, cos) == pytest.approx(PHASE, rel=0.05)
    assert values["coulomb"] == pytest.approx(0.05, rel=0.05)


def test_cogging_above_friction_sets_a_joint_in_motion_and_below_it_does_not():
    free = pendulum(mass=1e-9, length=1.0, inertia=0.01)  # without gravity
    for level, moves in ((0.015, True), (0.025, False)):
        friction = fid.Friction(LAW, [[level, 0.0, 0.0, 0.02]])
        start = State(np.array([0.5 * np.pi / POLES]), np.array([0.0]))
        steps = np.full(50, 0.01)
        q = rollout(Plant.from_parameters(free, {}), friction, start, np.zeros((50, 1)), steps).q
        assert (abs(q[-1, 0] - q[0, 0]) > 1e-3) == moves


def test_harmonics_must_differ():
    with assert_refused(r"cogging: harmonics = \[3, 3\] must differ"):
        Cogging((3, 3))
