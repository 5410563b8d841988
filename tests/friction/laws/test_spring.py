"""Spring: a torque that grows with the position, found from motion that another engine made."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import frictionid as fid
from frictionid.friction.laws import Sum
from frictionid.mechanics import linear_axis

MASS, TRUTH = 8.0, {"coulomb": 6.0, "viscous": 9.0, "stiffness": 4.0, "preload": -0.8}
LAW = Sum(("coulomb_viscous", "spring"))


def moved(frequency, rate=200.0, seconds=8.0):
    """A carriage that drags a cable, by SciPy."""
    time = np.arange(0.0, seconds, 1.0 / rate)
    drive = 22.0 * np.sin(frequency * time) + 9.0 * np.sin(2.3 * frequency * time)

    def rate_of(t, x):
        q, w = x
        friction = TRUTH["coulomb"] * np.tanh(w / 0.02) + TRUTH["viscous"] * w
        cable = TRUTH["stiffness"] * q + TRUTH["preload"]
        return [w, (np.interp(t, time, drive) - friction - cable) / MASS]

    q = solve_ivp(rate_of, time[[0, -1]], [0.1, 0.0], t_eval=time, rtol=1e-8, max_step=0.002).y[0]
    noise = 2e-5 * np.random.default_rng(int(10 * frequency)).standard_normal(len(q))
    return {"time": time, "angle": q + noise, "torque": drive}


@pytest.fixture(scope="module")
def carriage():
    data = {f"run{f}": moved(f) for f in (1.1, 1.6, 2.3)}
    return fid.Dataset.from_arrays(data, linear_axis(mass=MASS), hold="linear", sigma=2e-5)


@pytest.mark.parametrize("method", ["integral", "shooting"])
def test_truth_in_truth_out(carriage, method):
    theta = fid.fit(carriage, LAW, method=method).friction.theta[0]
    for name, value in TRUTH.items():
        rel = 0.02 if method == "shooting" else 0.1
        assert theta[LAW.names.index(name)] == pytest.approx(value, rel=rel), name


def test_quick_offers_it_where_it_shows(carriage):
    verdict = fid.quick(carriage)
    assert verdict.chosen.name == "spring"
    others = [law.error for law in verdict.candidates if law.name != "spring"]
    assert verdict.chosen.error < 0.5 * min(others)


def test_units_follow_the_joint():
    units = dict(zip(LAW.names, fid.friction.friction.units_of(LAW, "m"), strict=True))
    assert (units["stiffness"], units["preload"]) == ("N/m", "N")
