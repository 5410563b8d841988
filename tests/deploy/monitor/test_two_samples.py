"""The tests of two groups of recordings keep their rates, and find what has changed."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from scipy.stats import binom, kstest

from frictionid.deploy.monitor.judgement import (
    hotelling_test,
    least_rate,
    needed_recordings,
    permutation_test,
)
from frictionid.deploy.monitor.monitor import log_evidence

# healthy recordings that scatter far from normally
DRAWS = {
    "normal": lambda rng, size: rng.standard_normal(size),
    "heavy": lambda rng, size: rng.standard_t(2, size),
    "skewed": lambda rng, size: rng.lognormal(0.0, 1.0, size),
}


@pytest.mark.parametrize("kind", DRAWS)
@pytest.mark.parametrize(("N", "k"), [(99, 1), (19, 1), (20, 5)])
def test_false_alarms_of_the_permutation_test_keep_the_rate(kind, N, k):
    """400 cases each, seeds 0 to 399, at a rate of 5 %: within the binomial's 99.9 %."""
    alarms = 0
    for seed in range(400):
        rows = DRAWS[kind](np.random.default_rng(seed), (N + k, 2, 3))
        alarms += permutation_test(rows[:N], rows[N:], seed).p <= 0.05 + 1e-12
    assert alarms <= binom.ppf(0.999, 400, 0.05)
    if N == 99:  # then the rate is met, not only kept
        assert alarms >= binom.ppf(0.001, 400, 0.05)


def test_the_smallest_p_is_the_least_rate():
    rng = np.random.default_rng(3)
    for N, k in ((9, 1), (5, 3)):
        rows = rng.standard_normal((N + k, 2, 4))
        rows[N:, 1] += 1e3
        found = permutation_test(rows[:N], rows[N:])
        assert found.p == pytest.approx(least_rate(N, k))
        assert found.p_of_joint.argmin() == 1
        assert found.p_of_joint[0] > 0.01


@pytest.mark.parametrize(("rate", "k"), [(0.01, 1), (1e-4, 1), (1e-4, 5), (1e-6, 3), (1e-12, 2)])
def test_the_needed_recordings_are_the_fewest_that_allow_a_rate(rate, k):
    N = needed_recordings(rate, k)
    assert comb(N + k, k) >= (1 - 1e-12) / rate > comb(N - 1 + k, k)


def test_a_rate_far_below_one_of_5000_is_kept_where_recordings_allow_it():
    rows = np.random.default_rng(8).standard_normal((20, 1, 2))
    rows[14:] += 9.0
    found = permutation_test(rows[:14], rows[14:], rate=1e-5)
    assert (found.p, found.choices) == (1 / comb(20, 6), comb(20, 6))
    drawn = permutation_test(rows[:14], rows[14:], rate=1 / 20_000)
    assert (drawn.p, drawn.choices) == (1 / 20_000, 20_000)


def test_the_order_of_recordings_and_units_do_not_matter():
    rng = np.random.default_rng(4)
    rows = rng.standard_normal((14, 2, 3))
    one = permutation_test(rows[:12], rows[12:])
    other = permutation_test(1e3 * rows[:12][::-1] + 5.0, 1e3 * rows[12:][::-1] + 5.0)
    assert one.p == other.p
    np.testing.assert_allclose(one.distance, other.distance, rtol=1e-6)


def test_hotelling_keeps_its_rate_where_recordings_scatter_normally():
    """p is uniform: 1,000 cases of one joint, seeds 0 to 999."""
    p = []
    for seed in range(1000):
        rows = np.random.default_rng(seed).standard_normal((13, 1, 3)) @ np.diag([1.0, 9.0, 0.1])
        p.append(hotelling_test(rows[:12], rows[12:]).p)
    assert kstest(p, "uniform").pvalue > 1e-3


def test_hotelling_agrees_with_student_in_one_dimension():
    from scipy.stats import t

    rng = np.random.default_rng(5)
    rows = rng.standard_normal((9, 1, 1))
    off = rows[8, 0, 0] - rows[:8, 0, 0].mean()
    student = off / (rows[:8, 0, 0].std(ddof=1) * np.sqrt(1 + 1 / 8))
    assert hotelling_test(rows[:8], rows[8:]).p == pytest.approx(2 * t.sf(abs(student), 7))


def test_evidence_against_healthy_recordings_seldom_reaches_one_over_the_rate():
    """Ever within 40 arrivals, at 5 %: 300 cases, seeds 0 to 299."""
    reached = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        names = tuple(f"{seed} {i}" for i in range(40))
        rows = rng.standard_t(3, (60, 2, 3))
        reached += log_evidence(rows[:20], rows[20:], names).max() >= np.log(20.0)
    assert reached <= binom.ppf(0.999, 300, 0.05)


def test_evidence_grows_once_friction_changes():
    rng = np.random.default_rng(6)
    rows = rng.standard_normal((60, 2, 3))
    rows[45:, 0] += 6.0
    after = log_evidence(rows[:40], rows[40:], tuple(map(str, range(20))))
    assert after[4] < np.log(20.0) < after[-1]
