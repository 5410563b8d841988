"""Disturbed recordings are named, good ones not: comparisons/odd_runs.py; noise of angles."""

import numpy as np
import pandas as pd
import pytest
from odd_runs import BAD, named, sets_with

import frictionid as fid
from frictionid.fitting.shooting.data_checks import angle_noise, odd_among
from frictionid.fitting.shooting.sample_intervals import intervals_of
from frictionid.mechanics import pendulum

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


# --- Noise of fast motion -------------------------------------------------------------------------

NOISE = 1e-3


@pytest.mark.parametrize("rate", [0.5, 1.0, 2.5, 4.0], ids="{} Hz".format)
def test_noise_does_not_vanish_in_fast_motion(rate):
    """At 60 samples a second; from 2.5 Hz on the smoother takes off nothing."""
    time, rng = np.arange(600) / 60.0, np.random.default_rng(0)
    swing = 3.0 * np.sin(2 * np.pi * rate * time) + 1.5 * np.sin(0.62 * np.pi * rate * time)
    angle = swing + rng.normal(scale=NOISE, size=time.shape)
    table = pd.DataFrame({"t": time, "q": angle, "u": np.sin(time)})
    data = fid.Dataset.from_frames({"r": table}, pendulum(), time="t", angle="q", torque="u")
    (noise,) = angle_noise(intervals_of(data))
    motion = 3.0 * (2 * np.pi * rate / 60.0) ** 3 / np.sqrt(20.0)  # third differences at most
    assert 0.3 * NOISE < noise < 1.5 * NOISE + motion
