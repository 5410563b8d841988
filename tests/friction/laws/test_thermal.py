"""Thermal: friction of a joint that warms up within a recording."""

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from drive_logs import ServoPendulum
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.friction import Friction, at_rest
from frictionid.friction.laws import LuGre, Stribeck, Thermal

SLOPE, DECAY = -0.008, 0.03  # [1/K]
TRUTH = {"coulomb": 0.06, "viscous": 0.03, "coulomb_slope": SLOPE, "viscous_decay": DECAY}
THETA = np.array([[0.1, 0.05, 0.3, 0.02, SLOPE, DECAY]])


RIG = fid.mechanisms.pendulum(mass=0.5, length=0.15)
COLUMNS = {"time": "t", "angle": "q", "torque": "u"}


@cache
def frames(seed, seconds=30.0):
    servo = ServoPendulum(
        *(0.5, 0.15, TRUTH["coulomb"], TRUTH["viscous"]),
        **{"delay": 0.0, "warming": 35.0, "slope": SLOPE, "decay": DECAY},
    )
    logs = (servo.log(4.0, 0.05, seed=10 * seed + i, seconds=seconds) for i in range(2))
    return {f"run {i}": pd.DataFrame(log) for i, log in enumerate(logs)}


def dataset(tables, covariates=("temperature",)):
    named = dict.fromkeys(covariates, "T")
    return fid.Dataset.from_frames(tables, RIG, **COLUMNS, covariates=named)


def median_error(fit, data):
    scores = fit.score(data, horizons=(1.0,))
    row = (scores.score == "rollout_angle") & (scores.statistic == "median")
    return float(scores[row & (scores.joint == "all")].value.iloc[0])


@pytest.mark.parametrize("T", [5.0, 25.0, 60.0])
def test_at_one_temperature_it_is_an_ordinary_law(T):
    w = np.linspace(-4.0, 4.0, 9)[:, None]
    friction = Friction(Thermal("stribeck"), THETA)
    there = friction.at_temperature(T)
    assert type(there.law) is Stribeck
    level, drag = 1.0 + SLOPE * (T - 25.0), np.exp(-DECAY * (T - 25.0))
    assert_allclose(there.theta[0], THETA[0, :4] * [level, level, 1.0, drag])
    warm = at_rest(w)._replace(temperature=T + 0.0 * w)
    assert_array_equal(friction.torque(warm), there.torque(at_rest(w)))
    ahead = at_rest(w)._replace(temperature=25.0 + 0.0 * w)
    assert_allclose(friction.torque(at_rest(w)), friction.torque(ahead))


def test_a_level_does_not_fall_below_zero():
    friction = Friction(Thermal(), [[0.1, 0.0, -0.05, 0.0]])
    assert friction.at_temperature(100.0).theta[0, 0] == 0.0


@pytest.mark.parametrize(
    "seed, method",
    [(0, "one_step"), (1, "inverse_dynamics"), (1, "shooting")],
)
def test_a_warm_up_gives_the_truth_and_the_temperatures_effect(seed, method):
    data = dataset(frames(seed))
    found = fid.fit(data, "thermal", method=method).frame.set_index("parameter").value
    for name, true in TRUTH.items():
        assert found[name] == pytest.approx(true, rel=0.05), name
    # without the temperature, viscous friction is that of warm grease: half or less
    without = fid.fit(data, "coulomb_viscous", method="one_step").frame.set_index("parameter").value
    assert without["viscous"] < 0.75 * TRUTH["viscous"]


def mean_error(table):
    return float((table.q1 - table.measured_q1).abs().mean())


def test_predictions_follow_the_temperature():
    data, unseen = dataset(frames(1)), dataset({"run": frames(9, 12.0)["run 0"]})
    warm, plain = (fid.fit(data, law, method="one_step") for law in ("thermal", "coulomb_viscous"))
    assert median_error(warm, unseen) < median_error(plain, unseen) / 4
    tables = [fit.predict(unseen, whole=True) for fit in (warm, plain)]
    own, other = map(mean_error, tables)
    assert own < other / 4


def test_a_servo_without_a_torque_log_is_followed_too():
    servo = ServoPendulum(0.5, 0.15, 0.06, 0.03, warming=35.0, slope=SLOPE, decay=DECAY)
    log = {"run": pd.DataFrame(servo.log(4.0, 0.05, seed=5, seconds=6.0))}
    given = {"target": "target", "output": "torque", "P": 4.0, "D": 0.05, "delay": 0.01}
    columns = {"time": "t", "angle": "q", "covariates": {"temperature": "T"}}
    data = fid.Dataset.from_frames(log, RIG, **columns, actuator=given)
    truth = Friction(Thermal(), [list(TRUTH.values())])
    tables = [
        fid.predict(friction, data, whole=True)
        for friction in (truth, truth.at_temperature(15.0), truth.at_temperature(50.0))
    ]
    own, *others = map(mean_error, tables)
    assert own < 5e-4
    assert min(others) > 4 * own


def test_a_temperature_of_a_joint_goes_before_that_of_the_machine():
    tables = {name: table.assign(cold=0.0 * table["T"]) for name, table in frames(1).items()}
    whole = dataset(tables)
    for name in (f"temperature_{RIG.joints[0]}", "temperature_1"):
        both = {"temperature": "cold", name: "T"}
        data = fid.Dataset.from_frames(tables, RIG, **COLUMNS, covariates=both)
        theta = [fid.fit(d, "thermal", method="one_step").friction.theta for d in (data, whole)]
        assert_array_equal(*theta)


def test_a_law_without_temperature_does_not_see_it():
    with_it, without = dataset(frames(2)), dataset(frames(2), ())
    theta = [
        fid.fit(data, "stribeck", method="one_step").friction.theta for data in (with_it, without)
    ]
    assert_array_equal(*theta)


def with_temperature(values):
    return {name: table.assign(T=values(table["T"])) for name, table in frames(3).items()}


@pytest.mark.parametrize(
    "data, match",
    [
        (lambda: dataset(frames(3), ()), "not all recordings have one: name its column"),
        (lambda: dataset(with_temperature(lambda T: T + 273.15)), "cannot be in degC"),
        (lambda: dataset(with_temperature(lambda T: 30.0 + 0.0 * T)), "changes by 0 K only"),
        (lambda: dataset(with_temperature(lambda T: T.where(T > 20.0))), "row 0: .*'T'"),
        (lambda: dataset({"a": frames(3)["run 0"].drop(columns="T")}), "no column 'T'"),
    ],
)
def test_a_temperature_that_is_none_is_refused_in_one_line(data, match):
    with assert_refused(match):
        fid.fit(data(), "thermal")


def test_what_knows_no_temperature_says_so(tmp_path):
    data = dataset(frames(3))
    fit = fid.fit(data, "thermal", method="one_step")
    with assert_refused("an export knows no temperature"):
        fit.export("c", tmp_path / "friction.c")
    with assert_refused("knows no temperature, on which this friction depends"):
        fid.Simulator(data.mechanism, fit, dt=0.002)
    without = replace(data.recordings[0], name="b", covariates={})
    with assert_refused("not all recordings have one"):
        fit.predict(replace(data, recordings=(without,)))
    for law in ("none", "lugre"):
        with assert_refused("name a static law"):
            Thermal(law)
    assert Friction(LuGre(), np.ones((1, 7))).at_temperature(30.0).law == LuGre()


def test_an_export_is_that_of_the_ordinary_friction_at_its_temperature(tmp_path):
    fit = fid.fit(dataset(frames(3)), "thermal", method="one_step")
    there = fit.friction.at_temperature(40.0)
    for name, own in (("a", fit), ("b", there)):
        temperature = 40.0 if own is fit else None
        (tmp_path / name).mkdir()
        fid.export(own, "c", tmp_path / name / "f.c", temperature=temperature)
    first, second = ((tmp_path / name / "f.c").read_text() for name in "ab")
    assert first == second
    with assert_refused("does not depend on it"):
        fid.export(there, "c", tmp_path / "c.c", temperature=40.0)
