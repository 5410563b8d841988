"""Another unit of time is named, and a recording whose signs or units differ from the others'."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from fixtures import driven_wrist as wrist
from fixtures.changed_data import changed, each
from fixtures.driven_pendulum import simulated
from fixtures.one_joint_sets import one_recording
from fixtures.paths import DATA
from fixtures.shared import shared
from fixtures.true_curves import plain_friction
from fixtures.verdicts import kinds
from numpy.testing import assert_allclose

from frictionid import load_dataset
from frictionid.check import check
from frictionid.check.log_faults import in_seconds
from frictionid.data.readers.column_toml import Gears
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.simulate import Camera, Multisine, Rig, Run, simulate

PENDULUM = {"kind": "pendulum", "parameters": {"mass": 1.0, "length": 0.3}}


def _timed(dataset, factor):
    """Some recordings with the numbers of their times multiplied."""

    def timed(r):
        return Recording(r.name, *(x._replace(time=factor * x.time) for x in (r.angle, r.torque)))

    return each(_fifth(dataset), timed)


def _fifth(dataset):
    return replace(dataset, recordings=dataset.recordings[::5])


@shared
def acrobot():
    return load_dataset(DATA / "acrobot_clean")


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1e3, "the time is in ms, not in s"),
        (1e6, "the time is in us, not in s"),
        (1e-3, "the time is 1000 times too short"),
    ],
)
def test_a_time_in_another_unit_is_named_and_nothing_else(acrobot, factor, words):
    verdict = check(_timed(acrobot, factor))
    assert [f.kind for f in verdict.findings] == ["time_unit"]
    assert verdict.findings[0].text.startswith(words) and verdict.level == "unusable"
    right = check(_timed(acrobot, 1.0))
    assert_allclose(verdict.estimate.value, right.estimate.value, rtol=1e-6)
    assert not right.findings


@pytest.mark.parametrize("joint_noise", [0.0, 1e-3])
@pytest.mark.parametrize("interval", [1e-4, 0.25, 2.0])
def test_slow_and_fast_recordings_in_seconds_are_left_alone(interval, joint_noise):
    # a pendulum so heavy or light that it really moves at this pace
    time = interval * np.arange(300)
    rate = 0.1 / interval
    swing = 0.1 * np.cos(rate * time) + joint_noise * np.random.default_rng(0).normal(size=300)
    data = one_recording(time, swing, 0 * swing, 1.0, 9.81 / rate**2)
    assert in_seconds(data) == (data, [])


def test_all_signals_are_on_the_corrected_clock():
    time = np.arange(300) / 60
    angle = Signal(1e3 * time, np.cos(5.7 * time)[:, None])
    still = Signal(1e3 * time, np.zeros((300, 1)))
    swing = Recording("r", angle, still, velocity=still, covariates={"temperature": still})
    corrected, found = in_seconds(Dataset("d", PENDULUM, (swing,)))
    (r,) = corrected.recordings
    for signal in (r.angle, r.torque, r.velocity, r.covariates["temperature"]):
        assert_allclose(signal.time, time)
    assert found[0].numbers["factor"] == 1e-3


def _with_second(dataset, angle, torque):
    """Some recordings, angles and torques of the second one times factors."""
    every = _fifth(dataset)
    other = changed(every, "angle", lambda q: angle * q)
    other = changed(other, "torque", lambda u: torque * u).recordings[1]
    first, _, *others = every.recordings
    return replace(every, recordings=(first, other, *others))


def _of_recordings(verdict):
    return [f.text for f in verdict.findings if f.kind == "convention_of_recording"]


@pytest.mark.parametrize(
    ("factor", "kind"), [(1e3, "mN m"), (100.0, "N cm"), (0.01, "not N cm"), (1e-3, "not mN m")]
)
def test_torques_in_another_unit_are_told(acrobot, factor, kind):
    verdict = check(changed(_fifth(acrobot), "torque", lambda u: factor * u))
    assert verdict.level == "unusable"
    assert verdict.findings[0].kind == kind
    assert f"{max(factor, 1 / factor):g} times too" in verdict.findings[0].text
    (gain,) = [i for i in verdict.identifiable if i.what == "torque gain"]
    assert gain.reason.startswith(("1.0", "0.9"))  # the other checks use corrected data


@shared
def pendulum():
    torque = (Multisine(1.2, (0.4, 0.9, 1.6)),)
    runs = (Run(f"{k}", (0.3 * k,), torques=torque) for k in range(3))
    return simulated(0.1, 0.02, Camera(900, 60.0, 1e-3), runs, 1.0, 1.0)


@pytest.mark.parametrize("turns", [-50.0, 57.0], ids=str)
def test_angles_of_geared_motors_are_told_from_those_of_joints(pendulum, turns):
    """A gear of 57 looks like degrees, which is said beside it."""
    turned = changed(pendulum, "angle", lambda q: turns * q)
    gears = Gears(np.array([[turns]]), np.zeros(1), angles=False, torques=True)
    (said,) = check(replace(turned, gears=gears)).findings
    assert "motor.angle" in said.text and ("in degrees" in said.text) == (turns == 57.0)


LINKS = {"m1": 0.1, "m2": 0.14, "l1": 0.17, "r1": 0.11, "r2": 0.12, "I1": 2e-3, "I2": 3e-3}
FREE = {
    "pendulum": {"driven": False, "parameters": {"mass": 0.15, "length": 0.15}},
    "double_pendulum": {"driven": [False, False], "parameters": LINKS},
}


@pytest.mark.parametrize(
    ("kind", "frame"),
    [("pendulum", "relative"), ("double_pendulum", "relative"), ("double_pendulum", "absolute")],
)
def test_angles_from_upright_and_against_the_vertical_are_named_with_what_mends_them(kind, frame):
    """As pendulums on carts have them; in degrees nothing but a small swing would look alike."""
    n, machine = np.size(FREE[kind]["driven"]), {"kind": kind, **FREE[kind]}
    runs = (Run("long", (1.2, -0.4)[:n]), Run("short", (-0.7, 0.5)[:n]))
    friction = plain_friction([1e-3] * n, [1e-4] * n)
    true = simulate(Rig("p", machine, friction, Camera(600, 60.0, 1e-4), runs, substeps=8))
    angles = {r.name: np.pi * (np.arange(n) == 0) + r.angle.value for r in true.recordings}
    if frame == "absolute":
        angles = {name: np.cumsum(q, axis=1) for name, q in angles.items()}
    names = [f"q{j}" for j in range(n)]
    frames = {
        r.name: pd.DataFrame(angles[r.name], index=r.angle.time, columns=names)
        for r in true.recordings
    }
    verdict = check(Dataset.from_frames(frames, true.mechanism, angle=names))
    (first,) = verdict.findings
    assert first.kind == "shifted_angle" and verdict.level == "unusable"
    assert "add +180 degrees to angle 1" in first.text
    turned = n == 2 and frame == "absolute"
    assert f"add [{', '.join(['3.1416', '0.0000'][:n])}] to offset in [motor]" in first.remedy
    assert ("coupling = [[1, 0], [1, 1]]" in first.remedy) == turned
    motor = {"angle": "motor", "coupling": [[1, 0], [1, 1]]} if turned else {}
    motor |= {"offset": [np.pi, 0][:n]}
    mended = Dataset.from_frames(frames, true.mechanism, angle=names, motor=motor)
    assert not check(mended).findings
    for r, expected in zip(mended.recordings, true.recordings, strict=True):
        turns = (r.angle.value - expected.angle.value) / (2 * np.pi)
        assert_allclose(turns, np.round(turns), atol=1e-9)


@pytest.mark.parametrize("factor", [1.0, np.degrees(1.0)], ids=["rad", "deg"])
def test_columns_of_angle_and_torque_that_are_exchanged_are_named(pendulum, factor):
    turned = replace(changed(pendulum, "angle", lambda q: factor * q), truth=None)
    exchanged = each(turned, lambda r: Recording(r.name, r.torque, r.angle))
    named = [f.kind for f in check(exchanged).findings]
    assert named[0] == "exchanged_columns" and "unknown_cause" not in named
    assert "exchanged_columns" not in kinds(check(pendulum))


def test_a_single_recording_with_another_sign_is_named(acrobot):
    data = _with_second(acrobot, 1.0, [1.0, -1.0])
    verdict = check(data)
    (text,) = _of_recordings(verdict)
    assert verdict.level == "unusable" and data.recordings[1].name in text
    assert "torque 2 has the wrong sign" in text


def test_recordings_in_two_units_of_angle_are_told_apart(acrobot):
    data = _with_second(acrobot, 180 / np.pi, [1.0, 1.0])
    (text,) = _of_recordings(check(data))
    assert data.recordings[1].name in text and "angles are in degrees, not rad" in text


@pytest.mark.parametrize("factor", [3.0, 6.0, 20.0])
def test_a_constant_load_of_an_arm_is_no_sign_of_degrees(tmp_path, factor):
    """In degrees an arm would hardly move, and an offset would be all its gravity."""
    arm = wrist.mechanism(tmp_path)
    table = wrist.frame(arm)
    table[wrist.COLUMNS[1]] /= factor  # currents, whose constant nobody gave
    kinds = {finding.kind for finding in check(wrist.dataset(arm, table)).findings}
    assert kinds & {"gain", "nominal_mechanism"} and "degrees" not in kinds
