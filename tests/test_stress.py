"""Numerics under stress: small versions of comparisons/stress.py, the table of docs/failures.md."""

import sys
from functools import cache

import numpy as np
import pytest
from fixtures.mistakes import mistakes
from fixtures.paths import ROOT
from fixtures.refusals import assert_refused

import frictionid as fid

sys.path.append(str(ROOT / "comparisons"))

from outliers import error_of
from stress import LAW, METHODS, STRESSES, THIN, of_torques, recorded

SEEDS = (1, 2)
BOTH = pytest.mark.parametrize("method", METHODS)


def pairs(name):
    """Stressed sets, each with its set without stress."""
    stress = STRESSES[name]
    clean = recorded(stress.rate, stress.noise, stress.rod, SEEDS)
    return [(stress.change(data, seed), data) for data, seed in zip(clean, SEEDS, strict=True)]


@cache
def fitted(method, name, seed=SEEDS[0]):
    """Fit of a stressed set."""
    stressed, _ = pairs(name)[SEEDS.index(seed)]
    return fid.fit(stressed, LAW, method=method, sample_time=THIN[method])


def error(method, name):
    """Mean curve error of all joints and seeds."""
    each = zip(SEEDS, pairs(name), strict=True)
    return np.mean([error_of(fitted(method, name, s).friction, clean) for s, (_, clean) in each])


@BOTH
def test_single_precision_fits_as_double_precision(method):
    rough, _ = pairs("single precision")[0]
    single, double = (
        fitted(method, name).friction.theta for name in ("single precision", "nothing")
    )
    assert rough.recordings[0].angle.value.dtype == np.float32
    assert single.dtype == np.float64
    np.testing.assert_allclose(single, double, rtol=2e-3)


@BOTH
@pytest.mark.parametrize("name", ["5 % of angles off by 1 rad", "5 % of torques off by 1 N m"])
def test_gross_outliers_hardly_harm(method, name):
    assert error(method, name) < 1.5 * error(method, "nothing")


@BOTH
@mistakes("""
angles constant               => no joint moves by more than the noise of its angle
angles constant but for noise => no joint moves by more than the noise of its angle
angle 1 constant              => joint 1 slides in no row
angle 2 constant              => joint 2 slides in no row
""")
def test_joints_that_stand_still_are_refused_in_a_line(method, wrong, words):
    still, _ = pairs(wrong)[0]
    with assert_refused(words):
        fid.fit(still, LAW, method=method)


def test_what_10_hz_cannot_tell_is_not_identified():
    (_, clean), fit = pairs("10 Hz")[0], fitted("one_step", "10 Hz")
    assert error_of(fit.friction, clean).max() > 0.1
    assert not fit.frame.identified.all()


@pytest.mark.parametrize(
    ("name", "named"),
    [("torque logged as zero", True), ("free decays only", False), ("nothing", False)],
)
def test_check_names_torques_that_were_not_logged(name, named):
    kinds = [[f.kind for f in fid.check(data).details.findings] for data, _ in pairs(name)]
    assert all(("zero_torque" in own) == named for own in kinds)
    assert all("unknown_cause" not in own for own in kinds)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("5 % of angles off by 1 rad", "angle_outliers"),
        ("5 % of angles off by 0.05 rad", "angle_outliers"),
        ("5 % of torques off by 1 N m", "torque_outliers"),
        ("10 Hz", "slow_sampling"),
        ("angle 1 constant", "constant_angle"),
        ("angle 2 constant", "constant_angle"),
    ],
)
def test_check_blames_nothing_else_for_what_it_names(name, kind):
    false = {"unknown_cause", "commanded_torque", "delay", "base", "gain", "nominal_mechanism"}
    for data, _ in pairs(name):
        kinds = set(fid.check(data).findings.kind)
        assert kind in kinds
        assert not kinds & false


def test_a_wrong_gain_is_named_beside_outliers():
    stress = STRESSES["5 % of angles off by 0.05 rad"]
    _, clean = pairs("nothing")[0]
    wrong = stress.change(of_torques(lambda u, _: 2.0 * u)(clean, 1), 1)
    assert "gain" in set(fid.check(wrong).findings.kind)
