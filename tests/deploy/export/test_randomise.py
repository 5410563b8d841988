"""Samples of a model's parameters: the fit's covariance, within bounds, by a seed."""

import json

import numpy as np
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose

from frictionid.deploy.export.export import drawn, randomised
from frictionid.deploy.export.exported import exported
from frictionid.deploy.export.nearest import nearest
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, Stribeck

THETA = np.array([[0.1, 0.05, 0.5, 0.02]])
COVARIANCE = 1e-6 * np.array(
    [[4.0, -3.0, 0, 0], [-3.0, 9.0, 0, 0], [0, 0, np.inf, 0], [0, 0, 0, 1]]
)


def entry(name, value, error):
    ends = [value - 2 * error, value + 2 * error]
    return {
        "block": "friction",
        "name": f"{name} of joint 1",
        "unit": "N m",
        "joint": 0,
        "value": value,
        "interval_95": ends,
        "at_bound": False,
    }


def shot(covariance=COVARIANCE):
    errors = np.sqrt(np.diag(covariance))
    entries = [
        entry(name, value, error)
        for name, value, error in zip(Stribeck().names, THETA[0], errors, strict=True)
    ]
    document = {"parameters": entries, "covariance": covariance}
    return Friction(Stribeck(), THETA, provenance={"refined": document})


def test_samples_have_the_covariance_and_undetermined_parameters_stay():
    draws = drawn(shot().provenance.refined, 20_000, 5)
    free = [0, 1, 3]
    assert_allclose(np.cov(draws[:, free].T), COVARIANCE[np.ix_(free, free)], atol=2e-7)
    assert_allclose(draws.mean(axis=0), THETA[0], atol=1e-4)
    assert (draws[:, 2] == THETA[0, 2]).all()


def test_the_engines_numbers_come_with_each_sample_and_the_seed_decides():
    own = exported(shot(), ("hip",), (5.0,))
    text = randomised(own, 7, 1, nearest)
    assert text == randomised(own, 7, 1, nearest) != randomised(own, 7, 2, nearest)
    document = json.loads(text)
    assert document["parameters"][2]["fixed"] and document["parameters"][2]["low_95"] is None
    samples = np.array(document["samples"])
    assert samples.shape == (7, 4)
    for sample, numbers in zip(samples, document["engine"]["samples"], strict=True):
        same = nearest(exported(Friction(Stribeck(), sample[None]), speeds=(5.0,)))
        assert_allclose(numbers, same.theta[0], rtol=1e-12)
    for given in document["engine"]["parameters"]:
        assert given["low_95"] < given["value"] < given["high_95"]


def test_samples_stay_within_the_laws_bounds():
    own = exported(
        shot(1e2 * np.diag(np.diag(np.nan_to_num(COVARIANCE, posinf=0.0)))), ("hip",), (5.0,)
    )
    engine = json.loads(randomised(own, 300, 0, nearest))["engine"]["samples"]
    assert (np.array(engine) >= 0).all()


def test_models_without_a_covariance_are_refused_in_one_line():
    own = exported(Friction(CoulombViscous(), [[0.1, 0.02]]))
    with assert_refused("no covariance of its parameters: fit by shooting"):
        randomised(own, 10)
