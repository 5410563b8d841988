"""Every mistake in what a user gives to the functions is one sentence."""

from dataclasses import replace

from fixtures.arm_frames import SAID, arm, frames
from fixtures.mistakes import mistakes
from fixtures.refusals import assert_refused
from fixtures.shared import shared

import frictionid as fid
from frictionid.data.plants import Calibration


@shared
def names():
    """What the lines of the table may name."""
    law = fid.Friction(fid.CoulombViscous(), [[0.1, 0.01]])
    return {
        **{"fid": fid, "data": arm(), "frames": frames(), "SAID": SAID},
        **{"LAW": law, "SET": fid.Compensation(), "IDEAL": Calibration.ideal(1)},
        "replace": replace,
    }


MISTAKES = r"""
fid.fit(data, "stribek") => did you mean 'stribeck'
fid.fit(data, 3) => is no law: give a name
fid.fit(data, "none", method="shoting") => did you mean 'shooting'
fid.fit(data, "none", recipe="integrl") => did you mean 'integral'
fid.fit(data, "stribeck", method="one_step", free=["inertia"]) => free: only by shooting
fid.fit(data, "stribeck", method="shooting", free=["mass"]) => block 'mass' is unknown
fid.fit(data, "stribeck", method="shooting", windows=["a"]) => windows
fid.fit(data, "stribeck", settings={"widht": 0.1}) => did you mean 'width'
fid.fit(data, "stribeck", method=3) => method = 3 is unknown; known: 'one_step'
fid.fit(data, "stribeck", recipe=3) => 3
fid.fit(data, "stribeck", free=3) => free = 3 must be a list of names
fid.fit(data, "stribeck", fixed=3) => fixed = 3 must be a list of names
fid.fit(data, "stribeck", equal=3) => equal = 3 must be groups of joints
fid.fit(data, "stribeck", settings=3) => settings = 3 must be a dict
fid.fit(data, "stribeck", seed="a") => seed = 'a' must be a whole number
fid.fit(data, "stribeck", sample_time="a") => sample_time: it should be a valid number, not 'a'
fid.compare(data, ["none"], folds="a") => folds = 'a' must be a whole
fid.fit(data, "stribeck").curve("a") => velocity = 'a' must be a number
fid.fit(frames["run1"], "stribeck") => DataFrame is no data set
fid.check("no_such_set") => does not exist
fid.fit(data, "coulomb_viscous").predict("run9") => no recording 'run9'
fid.fit(data, "coulomb_viscous").predict("run1", start=99.0)
    => no recording has 1 s of motion from 99 s after its first sample
fid.fit(data, "coulomb_viscous").plot("frictoin") => did you mean 'friction'
fid.fit(data, "coulomb_viscous", method="one_step").plot("correlation") => fits by shooting only
fid.compare(data, []) => name at least one model
fid.compare(data, ["none"], folds=1) => count: it should be greater than or equal to 2, not 1
fid.compare(data, ["none"], horizons=[50.0]) => 50
fid.evaluate(data, data) => is no model
fid.suggest(data, {"torqe": 1.0}) => did you mean 'torque'
fid.Dataset.from_frames(frames, fid.mechanisms.acrobot(), **{**SAID, "motor": {"kt": 1.0}})
    => recording 'run1' has 1 column of angles, but acrobot has 2 joints
fid.mechanisms.pendulum(mass=-1.0) => mass = -1 kg is negative
fid.mechanisms.acrobot(rotor=-1e-6) => rotor inertias are 0 or more
fid.Dataset.from_frames(frames, data.mechanism, **SAID, parameters={"run1": {"mass": -0.1}})
    => recording 'run1': .* mass = -0.1 kg is negative
fid.Dataset.from_frames(frames, data.mechanism, **SAID, parameters={"run1": {"maas": 0.1}})
    => recording 'run1': .* did you mean 'mass'
fid.Dataset.from_frames(frames, "pendulum", **SAID) => mechanism
fid.Dataset.from_frames(frames, data.mechanism, **SAID, covariates="temp")
    => columns.covariates: it should be a valid dictionary, not 'temp'
fid.Dataset.from_frames(frames, data.mechanism, **SAID, signs="angle") => signs: must be a dict
fid.Dataset.from_frames(frames, data.mechanism, **SAID, parameters=1) => parameters: must be a dict
fid.Dataset.from_arrays({"time": [0.0, 1.0], "angle": [0.0, 1.0]}, data.mechanism)
    => recording 'time': must be a dict by names, not a list
fid.Dataset.from_arrays([1.0], data.mechanism) => must be a dict by names, not a list
fid.tune(data) => a suite is a file or a name, not a Dataset
fid.run_suite(data) => a suite is a file or a name, not a Dataset
fid.Friction(fid.CoulombViscous, [[0.1, 0.01]]) => needs a law, such as Stribeck\(\)
fid.Friction(fid.CoulombViscous(), [[0.1, "a"]]) => must be numbers
fid.Friction(fid.CoulombViscous(), [0.1, 0.01]) => theta must have shape
replace(IDEAL, delay="a") => calibration.delay = 'a' must be numbers
replace(IDEAL, delay=None) => calibration.delay = None must be one number
replace(IDEAL, gain=1.0) => calibration.gain = 1.0 must be a list of numbers, one for each joint
replace(LAW, calibration=0.1) => a calibration is that of a Fit, not 0.1
fid.Recording("a", 1.0, 2.0) => recording 'a', angle: it must be a Signal\(time, value\), not 1.0
LAW.torque([0.5]) => torque takes Inputs
fid.feed_forward(LAW, SET, 0.0, [[1.0]]) => dt = 0.0 s must be a positive time
fid.feed_forward(LAW, SET, 0.1, [[1.0, 2.0]]) => w has shape \(1, 2\); its last axis
fid.feed_forward(LAW, SET, 0.1, [1.0]) => w must be finite numbers \(T, n\)
fid.feed_forward(LAW, SET, 0.1, [["a"]]) => must be numbers
fid.feed_forward(LAW, SET, 0.1, [[float("nan")]]) => w must be finite numbers
fid.feed_forward(LAW, SET, 0.1, [[1.0]], [[0.0], [0.0]]) => a must be finite .* as many as w
fid.feed_forward(fid.Friction(fid.CoulombViscous(), [[float("nan"), 0.0]]), SET, 0.1, [[1.0]])
    => parameters that are nan
"""


@mistakes(MISTAKES)
def test_a_mistake_is_one_sentence(names, wrong, words):
    with assert_refused(words):
        eval(wrong, names)
