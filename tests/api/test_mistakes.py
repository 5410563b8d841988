"""Every mistake in what a user gives to the functions is one sentence."""

import pytest
from fixtures.arm_frames import SAID, arm, frames
from fixtures.refusals import assert_refused

import frictionid as fid


@pytest.fixture(scope="module")
def data():
    return arm()


MISTAKES = {
    "law": (lambda d: fid.fit(d, "stribek"), "did you mean 'stribeck'"),
    "no law": (lambda d: fid.fit(d, 3), "is no law: give a name"),
    "method": (lambda d: fid.fit(d, "none", method="shoting"), "did you mean 'shooting'"),
    "recipe": (lambda d: fid.fit(d, "none", recipe="integrl"), "did you mean 'integral'"),
    "free": (
        lambda d: fid.fit(d, "stribeck", method="one_step", free=["inertia"]),
        "free: only by shooting",
    ),
    "block": (
        lambda d: fid.fit(d, "stribeck", method="shooting", free=["mass"]),
        "block 'mass' is unknown",
    ),
    "windows": (
        lambda d: fid.fit(d, "stribeck", method="shooting", windows=["a"]),
        "windows",
    ),
    "setting": (
        lambda d: fid.fit(d, "stribeck", settings={"widht": 0.1}),
        "did you mean 'width'",
    ),
    "seed": (lambda d: fid.fit(d, "stribeck", seed="a"), "seed = 'a' must be a whole number"),
    "sample time": (lambda d: fid.fit(d, "stribeck", sample_time="a"), "must be a number"),
    "fold names": (lambda d: fid.compare(d, ["none"], folds="a"), "folds = 'a' must be a whole"),
    "velocity": (lambda d: fid.fit(d, "stribeck").curve("a"), "velocity = 'a' must be a number"),
    "data": (lambda _: fid.fit(frames()["run1"], "stribeck"), "DataFrame is no data set"),
    "path": (lambda _: fid.check("no_such_set"), "does not exist"),
    "recording": (lambda d: fid.fit(d, "coulomb_viscous").predict("run9"), "no recording 'run9'"),
    "start": (
        lambda d: fid.fit(d, "coulomb_viscous").predict("run1", start=99.0),
        "no recording has 1 s of motion from 99 s after its first sample",
    ),
    "plot": (lambda d: fid.fit(d, "coulomb_viscous").plot("frictoin"), "did you mean 'friction'"),
    "correlation": (
        lambda d: fid.fit(d, "coulomb_viscous", method="one_step").plot("correlation"),
        "fits by shooting only",
    ),
    "no models": (lambda d: fid.compare(d, []), "name at least one model"),
    "folds": (lambda d: fid.compare(d, ["none"], folds=1), "must be at least 2"),
    "horizon": (lambda d: fid.compare(d, ["none"], horizons=[50.0]), "50"),
    "model": (lambda d: fid.evaluate(d, d), "is no model"),
    "limits": (lambda d: fid.suggest(d, {"torqe": 1.0}), "did you mean 'torque'"),
    "joints": (
        lambda _: fid.Dataset.from_frames(
            frames(), fid.mechanisms.acrobot(), **{**SAID, "motor": {"kt": 1.0}}
        ),
        "recording 'run1' has 1 column of angles, but acrobot has 2 joints",
    ),
    "mass": (lambda _: fid.mechanisms.pendulum(mass=-1.0), "mass = -1 kg is negative"),
    "rotor": (lambda _: fid.mechanisms.acrobot(rotor=-1e-6), "rotor inertias are 0 or more"),
    "mass of a recording": (
        lambda _: fid.Dataset.from_frames(
            frames(), fid.mechanisms.pendulum(), **SAID, parameters={"run1": {"mass": -0.1}}
        ),
        "recording 'run1': .* mass = -0.1 kg is negative",
    ),
    "parameter of a recording": (
        lambda _: fid.Dataset.from_frames(
            frames(), fid.mechanisms.pendulum(), **SAID, parameters={"run1": {"maas": 0.1}}
        ),
        "recording 'run1': .* did you mean 'mass'",
    ),
    "mechanism": (
        lambda _: fid.Dataset.from_frames(frames(), "pendulum", **SAID),
        "mechanism",
    ),
}


@pytest.mark.parametrize(("mistake", "message"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_one_sentence(data, mistake, message):
    with assert_refused(message):
        mistake(data)
