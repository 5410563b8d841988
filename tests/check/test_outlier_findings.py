"""Gross outliers are named by recording and count, and clean data have none."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.paths import DATA

from frictionid.check import check
from frictionid.check.motion import Measured, motions_of
from frictionid.check.sensors import without_outliers
from frictionid.data.readers.dataset import load_dataset


@pytest.fixture(scope="module")
def clean():
    data = load_dataset(DATA / "acrobot_clean")
    some = [r for r in data.recordings if r.name in ("03_decay", "04_sine", "14_steps")]
    return replace(data, recordings=tuple(some))


def found(data):
    return without_outliers(Measured.of_dataset(data, motions_of(data.recordings)))[1]


def with_wild(data, name, quantity, rows, column, size):
    recordings = []
    for r in data.recordings:
        if r.name == name:
            signal = getattr(r, quantity)
            value = np.array(signal.value)
            value[rows, column] += size
            r = replace(r, **{quantity: signal._replace(value=value)})
        recordings.append(r)
    return replace(data, recordings=tuple(recordings))


def test_clean_recordings_have_none(clean):
    assert found(clean) == []


def test_angles_are_named_by_recording_and_count(clean):
    wild = with_wild(clean, "04_sine", "angle", [20, 90, 200], 1, 0.5)
    wild = with_wild(wild, "03_decay", "angle", [33], 1, -1.0)
    (finding,) = found(wild)
    assert (finding.kind, finding.joint, finding.level) == ("angle_outliers", 2, "good")
    assert "4 gross outliers" in finding.text
    assert "3 in '04_sine', 1 in '03_decay'" in finding.text


def test_many_torques_make_the_data_doubtful(clean):
    wild = with_wild(clean, "04_sine", "torque", np.arange(10, 330, 20), 1, 1.0)
    (finding,) = found(wild)
    assert (finding.kind, finding.joint, finding.level) == ("torque_outliers", 2, "doubtful")
    assert finding.numbers["outliers"] == 16
    assert "16 in '04_sine'" in finding.text


def test_other_checks_see_torques_without_their_outliers(clean):
    """Else their misfit would pass for a late, a wrong or a commanded torque."""
    wild = with_wild(clean, "04_sine", "torque", np.arange(10, 330, 20), 1, 1.0)
    given, found = check(clean), check(wild)
    assert {f.kind for f in found.findings} - {f.kind for f in given.findings} == {
        "torque_outliers"
    }
    np.testing.assert_allclose(found.estimate.value, given.estimate.value, rtol=0.02, atol=2e-4)
