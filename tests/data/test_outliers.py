"""Gross outliers of angles: found where they are, and nowhere else."""

import numpy as np
import pytest
from fixtures.white_jerk import NOISE, driven_by_white_jerk, wave
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.kalman import kalman_filter, padded_series
from frictionid.data.outliers import _roughness, prediction_residuals
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import RTS, KalmanFilter, thin, without_outliers

RATE = 60.0


def clock(samples=300):
    return np.arange(samples) / RATE


def drawn(seed):
    """Times, a generator of random numbers, and noisy angles (T, 1) of a swing."""
    time, rng = clock(), default_rng(seed)
    return time, rng, swing(time, rng)


def swing(time, rng, noise=NOISE):
    return wave(time, rng, noise)[:, None]


def deletion_residuals(series, left_out, fit):
    off, deviation = prediction_residuals(series, left_out, fit)[0]
    return off / deviation


def states_of(time, value, **more):
    return RTS()([Signal(time, value, **more)])[0]


def found(time, value, **more):
    return states_of(time, value, **more).left_out[:, 0]


def test_roughness_is_the_upper_quartile_of_the_samples_around():
    sizes = 2.0 + default_rng(0).random((50, 3))
    around = np.stack([np.delete(sizes[20:31], 5, axis=0), np.delete(sizes[30:41], 5, axis=0)])
    expected = np.quantile(around, 0.75, axis=1, method="inverted_cdf")
    assert_array_equal(_roughness(sizes)[[25, 35]], expected)


# ---------------------------------------------------------------- deletion residuals


def test_a_deletion_residual_is_what_a_smoother_without_the_sample_leaves():
    """Two routes: all at once, and each sample left out on its own."""
    rng = default_rng(0)
    time = np.cumsum(rng.uniform(0.01, 0.03, 40))
    series = padded_series([Signal(time, swing(time, rng))])
    rho = np.array([1e8])
    none = np.zeros(series.valid.shape, dtype=bool)
    at_once = deletion_residuals(series, none, kalman_filter(series, rho))
    for k in (0, 1, 2, 20, 38, 39):
        one = none.copy()
        one[k] = True
        fit = kalman_filter(series.without(one), rho)
        assert_allclose(deletion_residuals(series, one, fit)[k], at_once[k], rtol=1e-6)


def test_deletion_residuals_of_noise_have_its_size():
    """Positions driven by white jerk, with unit noise: residuals are standard normal."""
    rho = 1e6
    value = driven_by_white_jerk(default_rng(1), rho, 4000, 1, RATE)
    series = padded_series([Signal(clock(4000), value)])
    fit = kalman_filter(series, np.array([rho]))
    residual = deletion_residuals(series, np.zeros(series.valid.shape, dtype=bool), fit)
    assert residual.std() == pytest.approx(1.0, abs=0.05)


# ---------------------------------------------------------------- what is left out


@pytest.mark.parametrize("size", [0.05, 1.0, 20.0])
@pytest.mark.parametrize("share", [0.01, 0.05, 0.1])
def test_outliers_are_left_out_and_good_samples_stay(size, share):
    rng = default_rng(2)
    time = clock()
    clean = np.hstack([swing(time, rng) for _ in range(4)])
    wild = rng.random(clean.shape) < share
    left_out = states_of(time, clean + wild * rng.choice([-size, size], clean.shape)).left_out
    assert (wild & ~left_out).sum() <= 0.05 * wild.sum()
    assert (left_out & ~wild).sum() <= 0.005 * (~wild).sum()


@pytest.mark.parametrize("places", [[0], [1], [0, 1], [299], [298, 299], [100, 101], [50, 52, 53]])
def test_outliers_at_the_ends_and_side_by_side_take_no_good_samples_along(places):
    time, _, value = drawn(3)
    value[places, 0] += 0.5
    assert np.flatnonzero(found(time, value)).tolist() == places


@pytest.mark.parametrize("size", [0.05, 1.0])
def test_outliers_of_a_jerky_motion_do_not_hide_all_together(size):
    """They pass for rough measurements, or the rest for a motion without noise."""
    rng, time = default_rng(0), clock(121)
    clean = np.stack([switched(time, rng) for _ in range(40)], axis=1)
    wild = rng.random(clean.shape) < 0.05
    wild[[0, 1, -2, -1]] = False
    left_out = states_of(time, clean + wild * rng.choice([-size, size], clean.shape)).left_out
    missed = wild & ~left_out
    assert not (missed.sum(axis=0) == wild.sum(axis=0))[wild.any(axis=0)].any()
    assert missed.sum() <= 0.08 * wild.sum()
    assert (left_out & ~wild).sum() <= 2


def test_without_its_outliers_a_motion_is_the_same():
    time, rng, clean = drawn(4)
    value = clean.copy()
    wild = rng.choice(len(time), 15, replace=False)
    value[wild, 0] += rng.choice([-1.0, 1.0], 15)
    a, b = (states_of(time, x) for x in (clean, value))
    assert not a.left_out.any()
    assert np.abs(a.q - b.q).max() < 0.01
    assert np.sqrt(np.mean((a.w - b.w) ** 2)) < 0.3 * np.sqrt(
        np.mean((a.w - true_speed(time)) ** 2)
    )


def true_speed(time):
    return (5 * np.cos(5 * time) - 3.3 * np.sin(11 * time + 1))[:, None]


def test_outliers_of_one_joint_leave_the_other_joint_alone():
    time, rng = clock(), default_rng(5)
    value = np.hstack([swing(time, rng), swing(time, rng)])
    value[70, 1] -= 0.3
    assert np.argwhere(states_of(time, value).left_out).tolist() == [[70, 1]]


# ---------------------------------------------------------------- legitimate data


def bouncing(time, rng):
    """A ball-like joint between two end stops: the velocity jumps within a sample."""
    phase = (2.3 * time) % 2.0
    return np.minimum(phase, 2.0 - phase) + 1e-3 * rng.standard_normal(len(time))


def stick_slip(time, rng):
    """Rest for half a second, then a slip of 0.1 rad within two samples."""
    return 0.1 * np.floor(2 * time + 0.3) + 3e-4 * rng.standard_normal(len(time))


def quantised(time, rng):
    step = 2 * np.pi / 4096
    return step * np.round((0.5 * np.sin(2 * time) + 1e-4 * rng.standard_normal(len(time))) / step)


def resting(time, rng):
    """A 12-bit encoder at rest that flickers, after a fast motion."""
    step = 2 * np.pi / 4096
    moving = np.where(time < 1.5, np.cos(9 * time), np.cos(13.5))
    return step * np.round((moving + 2e-4 * rng.standard_normal(len(time))) / step)


def switched(time, rng):
    """Acceleration of +-60 rad/s^2, switched at random."""
    a = 60.0 * rng.choice([-1.0, 1.0], len(time) // 7 + 1).repeat(7)[: len(time)]
    w = np.cumsum(a) / RATE
    w -= w.mean()
    return np.cumsum(w) / RATE + 1e-3 * rng.standard_normal(len(time))


def chattering(time, rng):
    """A slow motion whose drive switches every two or three samples for a third of the time."""
    held = rng.integers(2, 4, len(time))
    a = np.repeat(np.where(np.arange(len(time)) % 2, 11.0, -11.0), held)[: len(time)]
    w = np.cumsum(a * (np.abs(time - 3.0) < 1.2)) / RATE
    w -= np.convolve(w, np.ones(21) / 21, mode="same")
    return 0.3 * time + np.cumsum(w) / RATE + 1.5e-4 * rng.standard_normal(len(time))


@pytest.mark.parametrize("motion", [bouncing, stick_slip, quantised, resting, switched, chattering])
def test_rough_but_real_motion_stays(motion):
    rng = default_rng(6)
    time = clock(400)
    columns = np.stack([motion(time, rng) for _ in range(4)], axis=1)
    assert states_of(time, columns).left_out.mean() <= 0.005


def test_single_steps_of_an_encoder_at_rest_are_no_outliers():
    rng, time = default_rng(12), clock(3000)
    flicker = 1e-4 * rng.choice([-1.0, 0.0, 1.0], len(time), p=[0.005, 0.99, 0.005])
    value = 0.3 + flicker[:, None]
    assert not found(time, value).any()
    value[700] += 1e-3
    assert np.flatnonzero(found(time, value)).tolist() == [700]


def test_dropped_samples_and_noise_that_differs_between_recordings_are_no_outliers():
    rng = default_rng(7)
    signals = []
    for noise in (2e-4, 2e-3, 2e-2):
        time = np.delete(clock(), rng.choice(300, 60, replace=False))
        signals.append(Signal(time, swing(time, rng, noise)))
    assert not any(s.left_out.any() for s in RTS()(signals))


def test_a_sample_that_is_known_to_be_noisy_is_no_outlier():
    time, _, value = drawn(8)
    sigma = np.full_like(value, NOISE)
    value[90] += 0.05
    assert found(time, value)[90]
    sigma[90] = 0.05
    assert not found(time, value, sigma=sigma).any()


# ---------------------------------------------------------------- what follows


def test_states_keep_what_was_left_out_also_when_thinned():
    time, _, value = drawn(9)
    value[[60, 61]] += 0.4
    assert np.flatnonzero(thin(states_of(time, value), 2 / RATE).left_out).tolist() == [30]


def test_the_causal_filter_is_not_thrown_off_by_samples_without_weight():
    time, _, value = drawn(10)
    clean, wild = Signal(time, value), Signal(time, value.copy())
    wild.value[[120, 200]] += 0.7
    angles = without_outliers([wild], RTS()([wild]))
    good, kept, thrown = (KalmanFilter()([s])[0].w for s in (clean, *angles, wild))
    error = [np.abs(w - good)[119:130].max() for w in (kept, thrown)]
    assert error[0] < 0.5 < 5 < error[1]


@pytest.mark.parametrize("slower", [10**1.2, 10**1.8])
def test_a_slower_clock_changes_no_angle_and_no_outlier(slower):
    """Of a first state that is next to unknown only the ends see how unknown it is."""
    time, rng = clock(), default_rng(3)
    value = swing(time, rng, noise=5e-2)
    value[[40, 200]] += 1.0
    fast, slow = (states_of(t, value) for t in (time, slower * time))
    assert np.flatnonzero(fast.left_out).tolist() == [40, 200]
    assert_array_equal(slow.left_out, fast.left_out)
    assert_allclose(slow.q, fast.q, atol=1e-3)  # a fiftieth of the noise
    assert_allclose(slower * slow.w[20:-20], fast.w[20:-20], atol=1e-3)
