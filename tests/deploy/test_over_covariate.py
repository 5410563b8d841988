"""Friction over a temperature: lines that hold the truth, refusals, and a model at one value."""

import numpy as np
import pandas as pd
import pytest
from drive_logs import ServoPendulum
from fixtures.refusals import assert_one_line, assert_refused

import frictionid as fid
from frictionid.deploy.random_effects import meta_regression
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.friction.model_files import load_model, save_model

WARM = np.array([20.0, 26.0, 32.0, 38.0, 44.0])


@pytest.mark.parametrize("tau", [0.0, 0.003])
def test_intervals_hold_the_true_slope_in_95_of_100(tau):
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(400):
        errors = rng.uniform(0.0005, 0.002, len(WARM))
        noise = np.hypot(errors, tau) * rng.standard_normal(len(WARM))
        found = meta_regression(0.1 - 0.001 * WARM + noise, errors, WARM)
        held += abs(found.slope + 0.001) <= found.half_widths()[1]
    assert held >= 0.93 * 400


def test_with_equal_errors_it_is_ordinary_least_squares_with_its_intervals():
    y = np.array([0.1, 0.13, 0.12, 0.17, 0.18])
    found = meta_regression(y, np.full(5, 1e-9), WARM)
    slope, level = np.polyfit(WARM - WARM.mean(), y, 1)
    left = y - level - slope * (WARM - WARM.mean())
    error = np.sqrt((left @ left) / 3 / np.sum((WARM - WARM.mean()) ** 2))
    assert found.slope == pytest.approx(slope) and found.level == pytest.approx(level)
    assert found.covariance[1, 1] ** 0.5 == pytest.approx(error, rel=1e-6)


def recorded(temperature):
    """A servo whose Coulomb friction falls by 1 % a degree, its viscous by 2 %, fitted."""
    warmer = temperature - 32.0
    servo = ServoPendulum(
        coulomb=0.03 * (1 - 0.01 * warmer), viscous=0.02 * (1 - 0.02 * warmer), delay=0.0
    )
    log = servo.log(4.0, 0.05, seed=int(temperature), seconds=5.0)
    frame = pd.DataFrame({**log, "temperature": temperature + 0.0 * log["t"]})
    machine = fid.mechanisms.pendulum(mass=servo.mass, length=servo.length)
    return fid.Dataset.from_frames(
        {"one": frame.iloc[:500], "two": frame.iloc[500:]},
        machine,
        time="t",
        angle="q",
        actuator={"target": "target", "output": "torque", "P": 4.0, "D": 0.05},
        covariates={"temperature": "temperature"},
    )


def test_coulomb_and_viscous_friction_over_the_temperature_of_a_servo():
    fits = {
        f"{t:g} deg": fid.fit(recorded(t), "coulomb_viscous", method="shooting", free=["friction"])
        for t in WARM
    }
    over = fid.over_covariate(fits, "temperature")
    lines = over.frame.set_index("parameter")
    assert lines.loc["coulomb", "percent"] == pytest.approx(-1.0, abs=0.2)
    assert lines.loc["viscous", "percent"] == pytest.approx(-2.0, abs=0.2)
    assert (lines["p_value"] < 0.01).all()
    np.testing.assert_allclose(over.at(35.0).theta, [[0.03 * 0.97, 0.02 * 0.94]], rtol=0.03)


def models(levels):
    source = {"half_widths": [[0.001, 0.001]]}
    return {
        f"{k}": Friction(CoulombViscous(), [[level, 0.02 + 1e-6 * k]], {}, source)
        for k, level in enumerate(levels)
    }


def test_without_an_effect_there_is_no_slope():
    over = fid.over_covariate(models([0.1, 0.1004, 0.0997, 0.1002]), "age", [1, 2, 3, 4])
    assert (over.frame["p_value"] > 0.2).all()


def test_levels_do_not_fall_below_zero():
    over = fid.over_covariate(models([0.05, 0.03, 0.01]), "temperature", [20, 30, 40])
    assert over.at(55.0).theta[0, 0] == 0.0


@pytest.mark.parametrize(
    "levels, values, words",
    [
        ([0.1, 0.2], [1, 2], "needs three models or more, not 2"),
        ([0.1, 0.2, 0.3], [1, 2], "one finite number for each of 3 models"),
        ([0.1, 0.2, 0.3], [5, 5, 5], "temperature is 5 for all models"),
        ([0.1, 0.2, 0.3], None, "0 knows no 'temperature' of its recordings: give `values`"),
    ],
)
def test_what_is_no_covariate_is_refused(levels, values, words):
    with assert_refused(words):
        fid.over_covariate(models(levels), "temperature", values)


def test_far_from_the_fits_nothing_is_said():
    over = fid.over_covariate(models([0.1, 0.2, 0.3]), "temperature", [20, 30, 40])
    with assert_refused("temperature = 90 is far from the fits', 20 to 40"):
        over.at(90.0)


def test_the_command_writes_the_friction_at_one_value(tmp_path, run):
    for k, model in enumerate(models([0.12, 0.11, 0.1, 0.09]).values()):
        save_model(model, tmp_path / f"{k}.json")
    pool = "pool 0.json 1.json 2.json 3.json --over"
    code, text, _ = run(tmp_path, f"{pool} temperature=20,30,40,50 --at 25 --out at.json")
    assert code == 0 and "coulomb" in text and "friction at temperature = 25" in text
    assert load_model(tmp_path / "at.json").theta[0, 0] == pytest.approx(0.115)
    outcome = run(tmp_path, f"{pool} temperature=20,cold --out no.json")
    assert_one_line(outcome, "write it as temperature=20,30,40")
