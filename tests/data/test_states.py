"""Laws of the state estimators: dense least squares, scipy, exact motions, recordings apart."""

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from fixtures.white_jerk import NOISE, driven_by_white_jerk, transition, wave
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import savgol_filter

from frictionid.data.kalman import kalman_filter, likeliest_jerk_ratio, padded_series, rts_smoother
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import RTS, Backward, KalmanFilter, SavitzkyGolay

ESTIMATORS = {
    "backward": Backward(),
    "savgol": SavitzkyGolay(),
    "rts": RTS(),
    "causal": KalmanFilter(),
}


def even(length=60, rate=60.0):
    return np.arange(length) / rate


def uneven(rng, length=60):
    """Time stamps that scatter by a factor of ten, with a gap of 0.4 s in the middle."""
    time = np.cumsum(rng.uniform(0.004, 0.04, length))
    time[length // 2 :] += 0.4
    return time


@pytest.fixture(params=["even", "uneven"])
def time(request):
    return even() if request.param == "even" else uneven(default_rng(1))


def one(time, value):
    return Signal(time, np.asarray(value)[:, None])


def most_probable(time, value, rho):
    """States (T, 3) of greatest probability, by least squares over all of them at once.

    Rows y_k - x_k[0] and Q^-1/2 (x_{k+1} - F x_k); nothing is known beforehand of the first state.
    """
    T = len(time)
    rows = np.zeros((T + 3 * (T - 1), T, 3))
    rows[np.arange(T), np.arange(T), 0] = 1.0
    for k, dt in enumerate(np.diff(time)):
        F, Q = transition(dt)
        unit = np.sqrt(np.diag(Q))
        root = np.linalg.cholesky(Q / np.outer(unit, unit))
        whiten = np.linalg.solve(root, np.diag(1 / (unit * np.sqrt(rho))))
        at = slice(T + 3 * k, T + 3 * k + 3)
        rows[at, k], rows[at, k + 1] = -whiten @ F, whiten
    A = rows.reshape(len(rows), -1)
    scale = np.linalg.norm(A, axis=0)
    y = np.concatenate([value, np.zeros(3 * (T - 1))])
    return (np.linalg.lstsq(A / scale, y, rcond=None)[0] / scale).reshape(T, 3)


# ---------------------------------------------------------------- the smoother and its filter

# of the greatest velocity; that nothing is known at the start costs digits on slow motions
ROUNDING = {1e5: 1e-4, 1e8: 5e-6, 1e11: 1e-7}


@pytest.mark.parametrize("rho", ROUNDING)
def test_the_smoother_is_the_dense_least_squares_solution(time, rho):
    value = wave(time, default_rng(2))
    expected = most_probable(time, value, rho)
    found = rts_smoother(padded_series([one(time, value)]), np.array([rho]))[:, 0]
    error = np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)
    assert error[0] < ROUNDING[rho] and error[1] < ROUNDING[rho]
    assert error[2] < 50 * ROUNDING[rho]


def test_the_filter_is_the_smoother_of_the_samples_so_far(time):
    value = wave(time, default_rng(3))
    rho = np.array([1e9])
    mean = kalman_filter(padded_series([one(time, value)]), rho).mean[0]
    for stop in (4, 10, 31, 60):
        so_far = padded_series([one(time[:stop], value[:stop])])
        assert_array_equal(mean[stop - 1], rts_smoother(so_far, rho)[-1, 0])
        expected = most_probable(time[:stop], value[:stop], rho[0])[-1]
        assert_allclose(mean[stop - 1, :2], expected[:2], rtol=1e-6, atol=1e-6)


def test_the_causal_estimator_sees_nothing_of_what_comes_later():
    rng = default_rng(5)
    time = even()
    angle = one(time, wave(time, rng))
    for stop in (3, 10, 31):
        noisy = angle.value + 0.3 * (time >= time[stop])[:, None] * rng.standard_normal(
            (len(time), 1)
        )
        before, other = (KalmanFilter()([angle._replace(value=v)])[0] for v in (angle.value, noisy))
        assert_array_equal(before.w[:stop], other.w[:stop])
        assert_array_equal(before.q[:stop], other.q[:stop])
        assert np.abs(before.w - other.w)[stop:].max() > 0.1


def test_the_public_estimators_use_the_likeliest_ratio():
    time = even()
    angle = one(time, wave(time, default_rng(5)))
    series = padded_series([angle])
    rho = likeliest_jerk_ratio(series)
    assert_array_equal(RTS()([angle])[0].w, rts_smoother(series, rho)[..., 1])
    # the causal one tries whole decades, so it ends within half a decade
    low, high = (kalman_filter(series, rho * 10.0**shift).mean[0, -1, 1] for shift in (-0.6, 0.6))
    assert min(low, high) <= KalmanFilter()([angle])[0].w[-1, 0] <= max(low, high)


@pytest.mark.parametrize("exponent", [5.0, 8.0, 10.0])
def test_the_likeliest_ratio_is_that_of_the_model_which_drew_the_data(exponent):
    rng = default_rng(6)
    # the ratio is all that matters, not the size of the noise
    value = NOISE * driven_by_white_jerk(rng, 10.0**exponent, 240, 48, 60.0)
    angle = Signal(even(240), value)
    found = np.log10(likeliest_jerk_ratio(padded_series([angle])))
    assert abs(np.median(found) - exponent) < 0.15
    assert np.abs(found - exponent).max() < 1.5


def test_a_wave_without_noise_is_recovered_and_ever_better_on_faster_clocks():
    def errors(estimator, rate):
        time = even(int(2 * rate), rate)
        w = estimator([one(time, np.sin(5 * time))])[0].w[:, 0]
        return np.abs(w - 5 * np.cos(5 * time))

    inner = slice(20, -20)
    smooth, causal = (
        [errors(estimator, rate)[inner].max() for rate in (30, 60, 120)]
        for estimator in (RTS(), KalmanFilter())
    )
    assert smooth[1] < 1e-5 and causal[1] < 0.01
    assert errors(RTS(), 60).max() < 0.01  # at the ends it is a filter
    for coarse, fine in (smooth[:2], smooth[1:], causal[:2], causal[1:]):
        assert fine < coarse / 3


# ---------------------------------------------------------------- all estimators


@pytest.fixture(params=ESTIMATORS)
def estimator(request):
    return ESTIMATORS[request.param]


def several(seed):
    """Recordings of two joints, unequal in length and clock."""
    out, rng = [], default_rng(seed)
    for length in (40, 77, 25):
        time = uneven(rng, length)
        out.append(Signal(time, np.stack([wave(time, rng), 3 * wave(time, rng)], axis=1)))
    return out


def test_many_recordings_at_once_give_what_each_gives_alone(estimator):
    angles = several(7)
    for angle, together in zip(angles, estimator(angles), strict=True):
        alone = estimator([angle])[0]
        for a, b in zip(together, alone, strict=True):
            assert_array_equal(a, b)


def test_joints_do_not_mix(estimator):
    angle = several(8)[0]
    both = estimator([angle])[0]
    second = estimator([angle._replace(value=angle.value[:, 1:])])[0]
    assert_allclose(both.w[:, 1:], second.w, rtol=0, atol=1e-12)


def test_clock_origin_and_angle_origin_do_not_matter_and_units_scale(estimator):
    angle = several(9)[1]
    plain = estimator([angle])[0]
    moved = estimator([Signal(angle.time + 8.0, angle.value + 2.0)])[0]
    assert_allclose(moved.w, plain.w, rtol=0, atol=1e-5)
    assert_allclose(moved.q, plain.q + 2.0, rtol=0, atol=1e-7)
    scaled = estimator([Signal(angle.time, 1e-3 * angle.value)])[0]
    assert_allclose(scaled.w, 1e-3 * plain.w, rtol=0, atol=1e-8)


EXACT = [
    (Backward(), 1),
    (SavitzkyGolay(), 3),
    (SavitzkyGolay(window=11, order=5), 5),
    (RTS(), 2),
    (KalmanFilter(), 2),
]


@pytest.mark.parametrize("estimator, degree", EXACT)
def test_motions_that_the_model_contains_are_exact(estimator, degree, time):
    motion = np.polynomial.Polynomial(default_rng(10).standard_normal(degree + 1))
    states = estimator([one(time, motion(time))])[0]
    # the causal filter needs three samples for three unknowns
    settled = slice(3 if isinstance(estimator, KalmanFilter) else 0, None)
    expected = motion.deriv()(states.time)[settled]
    assert_allclose(states.w[settled, 0], expected, rtol=0, atol=1e-7)
    assert_allclose(states.q[settled, 0], motion(states.time)[settled], atol=1e-8)


def test_angles_and_times_belong_together(estimator):
    angles = several(11)
    for angle, states in zip(angles, estimator(angles), strict=True):
        dropped = len(angle.time) - len(states.time)
        assert_array_equal(states.time, angle.time[dropped:])
        assert dropped == (1 if isinstance(estimator, Backward) else 0)
        assert states.q.shape == states.w.shape == (len(states.time), 2)
        assert np.abs(states.q - angle.value[dropped:]).max() < 0.1


def test_two_samples_are_enough_for_all_but_savgol():
    short = Signal(np.array([0.0, 0.02]), np.array([[1.0], [1.1]]))
    assert Backward()([short])[0].w[0, 0] == pytest.approx(5.0)
    assert RTS()([short])[0].w.mean() == pytest.approx(5.0, rel=1e-3)
    assert np.isfinite(KalmanFilter()([short])[0].w).all()


# ---------------------------------------------------------------- backward differences, polynomials


def test_backward_differences_are_what_a_semi_implicit_step_undoes():
    angle = several(12)[0]
    states = Backward()([angle])[0]
    dt = np.diff(angle.time)[:, None]
    assert_array_equal(states.w, (angle.value[1:] - angle.value[:-1]) / dt)
    assert_array_equal(states.q, angle.value[1:])
    assert_allclose(states.q[:-1] + states.w[1:] * dt[1:], states.q[1:], atol=1e-14)


@pytest.mark.parametrize("window, order", [(5, 2), (7, 3), (11, 4)])
def test_savgol_is_scipys_on_an_even_clock(window, order):
    time = even(80)
    value = wave(time, default_rng(13))
    states = SavitzkyGolay(window, order)([one(time, value)])[0]
    whole = slice(window // 2, -(window // 2))  # scipy treats the ends in its own ways
    for found, deriv in ((states.q, 0), (states.w, 1)):
        expected = savgol_filter(value, window, order, deriv=deriv, delta=1 / 60)
        assert_allclose(found[whole, 0], expected[whole], rtol=0, atol=1e-10)


def test_savgol_sees_its_window_only():
    time = uneven(default_rng(14))
    value = wave(time, default_rng(15))
    other = value.copy()
    other[20] += 1.0
    a, b = (SavitzkyGolay(7, 3)([one(time, y)])[0].w[:, 0] for y in (value, other))
    changed = np.flatnonzero(a != b)
    assert changed.min() == 20 - SavitzkyGolay(7, 3).support
    assert changed.max() == 20 + SavitzkyGolay(7, 3).support


@pytest.mark.parametrize("window, order", [(6, 3), (3, 3), (5, 7)])
def test_a_window_that_cannot_hold_the_polynomial_is_refused(window, order):
    with assert_refused(f"window = {window} must be odd and larger than order"):
        SavitzkyGolay(window, order)


def test_too_short_a_recording_is_refused():
    with assert_refused("6 samples are fewer than window = 7"):
        SavitzkyGolay()([one(even(6), np.zeros(6))])
