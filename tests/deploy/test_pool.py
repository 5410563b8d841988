"""Models of several specimens as one: what is pooled, left out, refused, saved and sampled."""

import json

import numpy as np
import pytest
from fixtures.one_joint_sets import Setup, sets
from fixtures.refusals import assert_refused
from fixtures.shared import shared
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.deploy.pooled_models import pooled
from frictionid.files import plain
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, NoFriction, Stribeck

SPREAD, ERROR = 0.15, 0.03


def one_step(theta, half, **others):
    """A one-step fit of Coulomb and viscous friction of each joint."""
    theta, half = np.array(theta, dtype=float), np.array(half, dtype=float)
    return Friction(CoulombViscous(), theta, {}, {"half_widths": half.tolist(), **others})


def rigs(count):
    """Fits of machines of two joints whose levels scatter by 15 %, with 3 % of error."""
    rng = np.random.default_rng(3)
    mean = np.array([[0.1, 0.02], [0.3, 0.05]])
    true = mean * (1 + SPREAD * rng.standard_normal((count, 2, 2)))
    found = true * (1 + ERROR * rng.standard_normal(true.shape))
    return [one_step(theta, 1.96 * ERROR * mean) for theta in found]


def test_every_parameter_has_the_spread_between_the_specimens():
    frame = fid.pool(rigs(60)).frame
    assert frame.parameter.tolist() == ["coulomb", "viscous"] * 2
    assert frame.joint.tolist() == [1, 1, 2, 2] and frame.unit[0] == "N m"
    mean = np.array([0.1, 0.02, 0.3, 0.05])
    assert_allclose(frame.value, mean, rtol=4 * SPREAD / np.sqrt(60))
    assert_allclose(frame.tau, SPREAD * mean, rtol=4 / np.sqrt(120))
    assert (frame.p_value < 1e-6).all()
    assert (frame.range_low < frame.low_95).all() and (frame.high_95 < frame.range_high).all()


def test_samples_lie_within_the_ranges_and_scatter_as_the_specimens():
    made = fid.pool(rigs(60))
    draws = made.sample(4000, 5).theta
    assert draws.shape == (4000, 2, 2)
    low, high = (made.frame[name].to_numpy().reshape(2, 2) for name in ("range_low", "range_high"))
    assert (draws >= low).all() and (draws <= high).all()
    spread = SPREAD * np.array([[0.1, 0.02], [0.3, 0.05]])
    assert_allclose(draws.std(axis=0), spread, rtol=0.4)
    assert_array_equal(draws, made.sample(4000, 5).theta)
    assert (draws != made.sample(4000, 6).theta).any()


def test_what_is_not_identified_or_at_a_bound_is_named_and_left_out():
    models = [
        one_step([[0.10, 0.001], [0.3, 0.0]], [[0.01, 0.002], [0.01, 0.001]]),
        one_step([[0.12, 0.020], [0.2, 0.0]], [[0.01, 0.002], [0.01, np.nan]]),
        one_step([[0.14, 0.024], [0.4, 0.1]], [[0.01, 0.002], [0.01, 0.001]]),
    ]
    made = pooled(models, ["a", "b", "c"])
    document = made.provenance.pooled
    assert [(e.name, len(e.models)) for e in document.parameters] == [
        ("coulomb of joint 1", 3),
        ("viscous of joint 1", 2),
        ("coulomb of joint 2", 3),
    ]
    assert list(document.left_out) == [
        "viscous of joint 1 is not identified in a: pooled over the other 2",
        "viscous of joint 2 lies at its bound in a, b: not pooled, it stays at the median, 0",
    ]
    assert made.theta[1, 1] == 0.0 and (fid.Pooled(made).sample(9).theta[:, 1, 1] == 0.0).all()
    assert made.theta[0, 1] == pytest.approx(0.022)


def test_parameters_of_the_calibration_are_pooled_and_ranges_end_at_the_laws_bounds():
    def shot(level, delay):
        entry = {"value": level, "error": 0.001, "identified": True, "at_bound": False}
        friction = {"block": "friction", "name": "coulomb of hip", "unit": "N m", "joint": 0}
        late = {"block": "delay", "name": "delay", "unit": "s", "joint": None}
        parameters = [{**entry, **friction}, {**entry, **late, "value": delay}]
        theta = np.array([[level, 0.0]])
        return Friction(CoulombViscous(), theta, {}, {"refined": {"parameters": parameters}})

    frame = fid.pool([shot(0.01, 0.005), shot(0.05, 0.015), shot(0.09, 0.012)]).frame
    assert frame[["block", "joint", "parameter"]].to_numpy().tolist() == [
        ["friction", 1, "coulomb"],
        ["delay", 0, "delay"],
    ]
    assert frame.range_low[0] == 0.0 and frame.range_low[1] < 0.0


def test_equal_joints_are_specimens_each():
    """Of one arm with six servos: the same as six rigs with one servo each."""
    rng = np.random.default_rng(2)
    theta = np.array([0.1, 0.02]) * (1 + SPREAD * rng.standard_normal((7, 2)))
    half = 1.96 * ERROR * np.array([0.1, 0.02])
    arm = one_step(theta, np.repeat(half[None], 7, axis=0))
    servos = fid.pool([one_step(t[None], half[None]) for t in theta[:6]]).frame
    made = fid.pool([arm], equal=[["joint 1", 2, 3, 4, 5, 6]])
    columns = ["value", "range_low", "range_high", "tau", "p_value", "models"]
    for joint in range(1, 7):
        own = made.frame[made.frame.joint == joint]
        assert_allclose(own[columns], servos[columns])
    assert set(made.frame.joint) == {1, 2, 3, 4, 5, 6}
    assert made.left_out == (
        f"coulomb of joint 7 is free in model 1 only: not pooled, it stays at the median, "
        f"{theta[6, 0]:.3g}",
        f"viscous of joint 7 is free in model 1 only: not pooled, it stays at the median, "
        f"{theta[6, 1]:.3g}",
    )
    draws = made.sample(500).theta
    assert (draws[:, 0] != draws[:, 1]).all() and (draws[:, 6] == theta[6]).all()
    tied = one_step(theta[[0, 0]], half * np.ones((2, 2)))
    with assert_refused("joints 1, 2 of model 1 were fitted as one"):
        fid.pool([tied], equal=[[1, 2]])
    with assert_refused("must be joints from 1 to 7"):
        fid.pool([arm], equal=[[1, 8]])


MODELS = rigs(3)
REFUSED = {
    "one": (MODELS[:1], "needs two models or more"),
    "twice": ([MODELS[0], MODELS[1], MODELS[0]], "model 1 and model 3 are the same fit"),
    "another law": (
        [MODELS[0], Friction(Stribeck(), np.ones((2, 4)))],
        "model 2 has the law Stribeck",
    ),
    "other joints": ([MODELS[0], one_step([[0.1, 0.1]], [[0.1, 0.1]])], "have other joints"),
    "no parameters": ([Friction(NoFriction(), np.ones((1, 0)))] * 2, "no parameters that mean"),
    "no intervals": ([MODELS[0], Friction(CoulombViscous(), np.ones((2, 2)))], "no intervals"),
    "pooled": ([MODELS[0], pooled(MODELS, "abc")], "model 2 is pooled itself"),
    "nothing": (
        [one_step([[0.1, 0.1]], [[1, 1]]), one_step([[0.2, 0.1]], [[1, 1]])],
        "no parameter has two estimates; coulomb of joint 1 is not identified in model 1",
    ),
    "several at once": (
        [MODELS[0], Friction(CoulombViscous(), np.ones((5, 2, 2)))],
        "holds several frictions",
    ),
}


@pytest.mark.parametrize("models, words", REFUSED.values(), ids=REFUSED)
def test_models_that_are_not_alike_are_refused_in_one_line(models, words):
    with assert_refused(words):
        fid.pool(models)


@shared
def servos(shared_path):
    """Model files of five simulated machines, set-valued friction, seed 11."""
    for i, data in enumerate(sets(Setup(), 5, seed=11)):
        fid.fit(data, "coulomb_viscous", method="one_step").save(shared_path / f"rig{i}.json")
    return shared_path


def test_the_command_writes_a_model_whose_export_draws_further_specimens(servos, run):
    files = [f"rig{i}.json" for i in range(5)]
    code, text, err = run(servos, "pool --out pooled.json --ranges ranges.json", *files)
    assert code == 0, err
    assert "coulomb of joint 1" in text and "written to ranges.json" in text
    ranges = json.loads((servos / "ranges.json").read_text())["ranges"]["coulomb of joint 1"]
    levels = [fid.load_model(servos / name).friction.theta[0, 0] for name in files]
    assert ranges["low"] < min(levels) < ranges["mean"] < max(levels) < ranges["high"]
    assert ranges["unit"] == "N m"

    loaded = fid.load_model(servos / "pooled.json")
    assert loaded.method == "pooled" and loaded.frame.value[0] == ranges["mean"]
    made = fid.Pooled(loaded.friction)
    assert made.ranges()["coulomb of joint 1"] == ranges and "coulomb" in repr(made)

    export = "export pooled.json --to isaac --randomise 50 --out servo.py"
    assert run(servos, export)[0] == 0
    samples = json.loads((servos / "servo_samples.json").read_text())
    drawn = np.array(samples["samples"])[:, 0]
    assert ranges["low"] <= drawn.min() < drawn.max() <= ranges["high"]
    assert samples["parameters"][0]["low_95"] == ranges["low"]


DAMAGED = {
    **{"values": ["x"], "joint": 7, "range_95": [0.0, np.inf], "interval_95": [1.0, 0.0]},
    **{"errors": [0.1, 0.0, 0.1], "models": ["a"], "Q": None, "tau_95": 3.0},
}


@pytest.mark.parametrize("key, value", DAMAGED.items(), ids=DAMAGED)
def test_a_pooled_model_with_damaged_parameters_is_refused_in_one_line(key, value):
    made = pooled(MODELS, "abc")
    document = plain(made.provenance.pooled)
    broken = {**document, "parameters": [{**document["parameters"][0], key: value}]}
    Friction(made.law, made.theta, {}, {"pooled": document})
    with assert_refused("^provenance.*(pooled|at no joint)"):
        Friction(made.law, made.theta, {}, {"pooled": broken})


def test_intervals_of_another_shape_are_refused():
    with assert_refused("half_widths: it should have shape .2, 2.: fit it again"):
        one_step([[0.2, 0.1], [0.3, 0.1]], [[1]])


@pytest.mark.parametrize("speeds", [3.0, "fast", [None, 1.0], [np.nan, 1.0], {"hip": [1.0]}])
def test_damaged_speeds_of_a_model_are_refused_in_one_line(speeds):
    with assert_refused("speeds of the model must be speeds .rad/s., not"):
        one_step([[0.2, 0.1], [0.3, 0.1]], [[0.01, 0.01]] * 2, speeds=speeds)


def test_only_a_pooled_model_has_ranges():
    with assert_refused("the model is not pooled: frictionid pool"):
        fid.Pooled(MODELS[0]).sample(2)
