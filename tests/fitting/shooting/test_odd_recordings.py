"""Disturbed recordings are named, good ones are not; more cases: comparisons/odd_runs.py."""

import numpy as np
import pytest
from odd_runs import BAD, named, sets_with

from frictionid.fitting.shooting.data_checks import odd_among

NAMES = tuple(map(str, range(8)))


@pytest.mark.parametrize("fault", ["push", "mass", "none"])
def test_a_recording_with_a_hand_or_another_mass_is_named_and_no_other(fault):
    for dataset in sets_with(fault, (201, 202)):
        expected = () if fault == "none" else (dataset.recordings[BAD].name,)
        assert named(dataset) == expected


def test_recordings_of_one_kind_are_rarely_named():
    """However much the sizes of their residuals scatter: 1 % of 4000 sets, and chance."""
    rng = np.random.default_rng(1)
    wrong = [bool(odd_among(np.exp(rng.normal(0, 0.4, 8)), NAMES)) for _ in range(4000)]
    assert np.mean(wrong) < 0.015


def test_two_odd_recordings_do_not_hide_each_other():
    sizes = np.array([1.0, 1.1, 0.9, 5.0, 1.05, 0.95, 4.5, 1.0])
    found = odd_among(sizes, NAMES)
    assert [odd.recording for odd in found] == ["3", "6"]
    assert all(odd.p_value < 0.01 and 0.9 < odd.usual < 1.1 for odd in found)


def test_of_few_recordings_none_is_told_from_the_others():
    assert odd_among(np.array([1.0, 1.0, 1.0, 9.0]), NAMES[:4]) == ()


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_a_recording_that_stands_off_by_little_is_not_worth_a_word(size):
    sizes = size * np.array([1.0, 1.001, 0.999, 1.0, 1.1, 1.0, 0.999, 1.001])
    assert odd_among(sizes, NAMES) == ()
    sizes[4] = 2.0 * size
    assert [odd.recording for odd in odd_among(sizes, NAMES)] == ["4"]
