"""Cogging and springs beside friction, found from motion that another engine made."""

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from scipy.integrate import solve_ivp

import frictionid as fid
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction.laws import Cogging, Sum
from frictionid.mechanics import Plant, linear_axis, pendulum


def moved(frequency, waves, start, sigma, rate_of_speed):
    """A joint driven by two waves (amplitude [N m], share of the frequency) for 8 s, by SciPy."""
    time = np.arange(0.0, 8.0, 1.0 / 200.0)
    drive = sum(a * np.sin(share * frequency * time) for a, share in waves)

    def rate_of(t, x):
        return [x[1], rate_of_speed(*x, np.interp(t, time, drive))]

    span, settings = time[[0, -1]], {"t_eval": time, "rtol": 1e-8, "max_step": 0.002}
    q = solve_ivp(rate_of, span, [start, 0.0], **settings).y[0]
    noise = sigma * np.random.default_rng(int(10 * frequency)).standard_normal(len(q))
    return {"time": time, "angle": q + noise, "torque": drive}


# --- Cogging --------------------------------------------------------------------------------------

POLES, AMPLITUDE, PHASE = 7, 0.02, 0.6
COGGING = Sum(("coulomb_viscous", {"kind": "cogging", "harmonics": [POLES]}))
RIG = pendulum(mass=0.4, length=0.15)
J, MGL = 0.4 * 0.15**2, 0.4 * 9.81 * 0.15


def cogged(q, w, u):
    """Angular acceleration with friction .05 sgn(w) + .01 w and cogging."""
    friction = 0.05 * np.tanh(w / 0.02) + 0.01 * w
    cogging = AMPLITUDE * np.cos(POLES * q + PHASE)
    return (u - MGL * np.sin(q) - friction - cogging) / J


def test_amplitude_and_phase_are_found():
    waves = ((0.9, 1.0), (0.5, 1.7))
    data = {f"run{f}": moved(f, waves, 0.3, 2e-4, cogged) for f in (2.0, 3.1)}
    dataset = fid.Dataset.from_arrays(data, RIG, hold="linear", sigma=2e-4)
    fit = fid.fit(dataset, COGGING, method="shooting", free="friction", windows=[0.1, 0.3])
    values = dict(zip(COGGING.names, fit.friction.theta[0], strict=True))
    cos, sin = values[f"cos_{POLES}"], values[f"sin_{POLES}"]
    assert np.hypot(cos, sin) == pytest.approx(AMPLITUDE, rel=0.05)
    assert np.arctan2(-sin, cos) == pytest.approx(PHASE, rel=0.05)
    assert values["coulomb"] == pytest.approx(0.05, rel=0.05)


def test_cogging_above_friction_sets_a_joint_in_motion_and_below_it_does_not():
    free = pendulum(mass=1e-9, length=1.0, inertia=0.01)  # without gravity
    for level, moves in ((0.015, True), (0.025, False)):
        friction = fid.Friction(COGGING, [[level, 0.0, 0.0, 0.02]])
        start = State(np.array([0.5 * np.pi / POLES]), np.array([0.0]))
        steps = np.full(50, 0.01)
        q = rollout(Plant.from_parameters(free, {}), friction, start, np.zeros((50, 1)), steps).q
        assert (abs(q[-1, 0] - q[0, 0]) > 1e-3) == moves


def test_harmonics_must_differ():
    with assert_refused(r"cogging: harmonics = \[3, 3\] must differ"):
        Cogging((3, 3))


# --- Springs --------------------------------------------------------------------------------------

MASS, TRUTH = 8.0, {"coulomb": 6.0, "viscous": 9.0, "stiffness": 4.0, "preload": -0.8}
SPRING = Sum(("coulomb_viscous", "spring"))


def dragged(q, w, u):
    """Acceleration of a carriage that drags a cable."""
    friction = TRUTH["coulomb"] * np.tanh(w / 0.02) + TRUTH["viscous"] * w
    return (u - friction - (TRUTH["stiffness"] * q + TRUTH["preload"])) / MASS


@pytest.fixture(scope="module")
def carriage():
    waves = ((22.0, 1.0), (9.0, 2.3))
    data = {f"run{f}": moved(f, waves, 0.1, 2e-5, dragged) for f in (1.1, 1.6, 2.3)}
    return fid.Dataset.from_arrays(data, linear_axis(mass=MASS), hold="linear", sigma=2e-5)


@pytest.mark.parametrize("method", ["integral", "shooting"])
def test_truth_in_truth_out(carriage, method):
    theta = fid.fit(carriage, SPRING, method=method).friction.theta[0]
    near = 0.02 if method == "shooting" else 0.1
    assert dict(zip(SPRING.names, theta, strict=True)) == pytest.approx(TRUTH, rel=near)


def test_quick_offers_it_where_it_shows(carriage):
    verdict = fid.quick(carriage)
    assert verdict.chosen.name == "spring"
    others = [law.error for law in verdict.candidates if law.name != "spring"]
    assert verdict.chosen.error < 0.5 * min(others)


def test_units_follow_the_joint():
    assert SPRING.names[2:] == ("stiffness", "preload")
    assert tuple(fid.friction.friction.units_of(SPRING, "m")[2:]) == ("N/m", "N")
