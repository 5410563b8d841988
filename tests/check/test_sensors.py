"""Faults of sensors: gross outliers are named, and frozen torques at little cost.

A frozen torque is judged by friction fitted to all other windows.
"""

import time

import numpy as np
import pytest
from fixtures.changed_data import one_changed

from frictionid.check import check
from frictionid.check.motion import Measured, Motion, motions_of, windows_of
from frictionid.check.sensors import (
    FITS,
    LARGE,
    WIDTH,
    WORSE,
    frozen_angles,
    frozen_torques,
    without_outliers,
)
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import States

HELD = 25  # samples
MACHINE = {"kind": "pendulum", "parameters": {"mass": 1.0, "length": 0.5}}


def _measured(samples, frozen=slice(200, 300)):
    """A swinging pendulum whose torque is held over 0.25 s, with exact states; one is frozen."""
    time = np.arange(samples) * 0.01
    q, w, a = np.sin(3 * time), 3 * np.cos(3 * time), -9 * np.sin(3 * time)
    needed = 0.25 * a + 0.5 * 9.81 * np.sin(q) + 0.1 * np.sign(w)
    held = np.repeat(needed[::HELD], HELD)[:samples]
    held[frozen] = held[frozen.start]
    unit = np.ones(1)
    motion = Motion(States(time, q[:, None], w[:, None]), 1e-4 * unit, 1e-3 * unit, 1e-3 * unit)
    recording = Recording("r", Signal(time, q[:, None]), Signal(time, held[:, None], "previous"))
    return Measured.of_dataset(Dataset("held", MACHINE, (recording,)), [motion])


def _is_contradicted(measured, start, stop):
    """The definition: friction by least squares over all windows apart, and what it leaves."""
    rows = windows_of(measured.balances, WIDTH)
    torque = rows.means(measured.torque)[:, 0]
    target, moving = torque - rows.required(measured.nominal)[:, 0], rows.moving[:, 0]
    inside = moving & (rows.start >= start) & (rows.stop <= stop)
    apart = moving & ((rows.stop <= start) | (rows.start >= stop))
    shapes = rows.friction[:, 0]
    left = target - shapes @ np.linalg.lstsq(shapes[apart], target[apart], rcond=1e-9)[0]
    worst, elsewhere, level = (np.sqrt(np.mean(x**2)) for x in (left[inside], left[apart], torque))
    return bool(worst > max(WORSE * elsewhere, LARGE * level) and elsewhere < FITS * level)


def test_frozen_torques_are_those_that_friction_of_all_other_windows_contradicts():
    found = []
    for length in range(2 * HELD, 10 * HELD, HELD):
        frozen = slice(10 * HELD + 2 * length, 10 * HELD + 3 * length)
        measured = _measured(2000, frozen)
        long = [f for f in frozen_torques(measured) if f.length > 0.25]
        wanted = _is_contradicted(measured, frozen.start * 0.01, frozen.stop * 0.01 - 0.01)
        assert bool(long) == wanted, length
        found.append(wanted)
    assert 0 < sum(found) < len(found)


def _seconds(measured):
    begin = time.process_time()
    frozen_torques(measured)
    return time.process_time() - begin


def test_still_torques_cost_no_more_each_in_a_longer_recording():
    short, long = _measured(10_000), _measured(80_000)
    once = min(_seconds(short) for _ in range(3))
    assert min(_seconds(long) for _ in range(2)) < 24 * once  # linear: 8; one fit for each: 64


def found(data):
    return without_outliers(Measured.of_dataset(data, motions_of(data.recordings)))[1]


@pytest.fixture(scope="module")
def wild(clean):
    """Torques of one joint in one recording that are far off."""
    return one_changed(clean, "torque", 1, 1, np.arange(10, 330, 20), 1.0)


def test_clean_recordings_have_none(clean):
    assert found(clean) == []


def test_angles_are_named_by_recording_and_count(clean):
    some = one_changed(clean, "angle", 1, 1, [20, 90, 200], 99.0)
    (finding,) = found(one_changed(some, "angle", 0, 1, [33], -99.0))
    assert (finding.kind, finding.joint, finding.level) == ("angle_outliers", 2, "good")
    assert "4 gross outliers" in finding.text
    assert "3 in '04_sine', 1 in '03_decay'" in finding.text


def test_many_torques_make_the_data_doubtful(wild):
    (finding,) = found(wild)
    assert (finding.kind, finding.joint, finding.level) == ("torque_outliers", 2, "doubtful")
    assert finding.numbers["outliers"] == 16
    assert "16 in '04_sine'" in finding.text


def test_other_checks_see_torques_without_their_outliers(clean, wild):
    """Else their misfit would pass for a late, a wrong or a commanded torque."""
    given, found = check(clean), check(wild)
    assert {f.kind for f in found.findings} - {f.kind for f in given.findings} == {
        "torque_outliers"
    }
    np.testing.assert_allclose(found.estimate.value, given.estimate.value, rtol=0.02, atol=2e-4)


def test_a_joint_that_sticks_and_slips_is_not_frozen():
    """It rests for 99 % of the time; one slip falls into a gap; a slip that is lost is found."""
    time = np.arange(6000) * 0.025
    slips = np.maximum(time[:, None] - 12.0 - 13.5 * np.arange(10), 0.0)
    angle = np.round(0.06 * (1 - np.exp(-slips / 0.03)).sum(axis=1) / 4e-4) * 4e-4
    lost = np.abs(time - 12.0) < 0.12

    def frozen(angle, kept):
        signals = (Signal(time[kept], x[kept, None]) for x in (angle, 0 * angle))
        recordings = (Recording("r", *signals),)
        dataset = Dataset("slips", MACHINE, recordings)
        return frozen_angles(Measured.of_dataset(dataset, motions_of(recordings)))

    every = np.ones(6000, dtype=bool)
    assert not frozen(angle, every) and not frozen(angle, ~lost)
    assert frozen(np.where(lost, angle[0], angle), every)
    ramps = np.cumsum((time % 24.0 > 12.0) * 0.01)  # which start and stop within a sample
    assert not frozen(ramps, every)
