"""Random effects: closed forms, invariances, and how often intervals hold what they are to hold."""

from importlib import import_module

import numpy as np
import pytest
from fixtures.paths import ROOT
from scipy.special import stdtrit

from frictionid.deploy.random_effects import between, random_effects

RNG = np.random.default_rng(4)
Y, S = RNG.normal(1.0, 0.2, 6), RNG.uniform(0.02, 0.1, 6)


def test_equal_errors_give_the_textbooks_closed_form():
    found = random_effects(Y, np.full(6, 0.05))
    variance = Y.var(ddof=1)
    assert found.mean == pytest.approx(Y.mean())
    assert found.tau == pytest.approx(np.sqrt(variance - 0.05**2))
    half = stdtrit(5, 0.975) * np.sqrt(variance / 6)
    assert found.interval() == pytest.approx((Y.mean() - half, Y.mean() + half))
    assert found.Q == pytest.approx(5 * variance / 0.05**2)


@pytest.mark.parametrize("count", [2, 3, 6])
def test_exact_estimates_give_the_prediction_interval_of_a_normal_sample(count):
    y = Y[:count]
    half = stdtrit(count - 1, 0.975) * y.std(ddof=1) * np.sqrt(1 + 1 / count)
    found = random_effects(y, np.full(count, 1e-6)).range()
    assert found == pytest.approx((y.mean() - half, y.mean() + half), abs=2e-3 * half)


def test_tau_is_where_cochrans_statistic_has_its_expectation():
    found = random_effects(Y, S)
    w = 1 / (found.tau**2 + S**2)
    assert np.sum(w * (Y - found.mean) ** 2) == pytest.approx(5.0)
    assert found.tau_low < found.tau < found.tau_high


def test_estimates_that_agree_have_no_spread_and_the_weighted_mean():
    y = 1.0 + S * np.array([0.3, -0.2, 0.1, -0.4, 0.2, 0.1])
    found = random_effects(y, S)
    w = 1 / S**2
    assert (found.tau, found.tau_low) == (0.0, 0.0) and found.p_value > 0.9
    assert found.mean == pytest.approx(np.sum(w * y) / w.sum())
    assert found.error == pytest.approx(w.sum() ** -0.5)


def test_other_units_and_another_order_change_nothing():
    one, other = random_effects(Y, S), random_effects(3.0 - 1e3 * Y[::-1], 1e3 * S[::-1])
    assert other.range() == pytest.approx([3.0 - 1e3 * end for end in one.range()[::-1]])
    assert (other.Q, other.tau) == pytest.approx((one.Q, 1e3 * one.tau))


def test_the_statistic_falls_with_the_spread():
    levels = np.array([0.5, 2.0, 5.0, 8.0])
    assert (np.diff(between(np.ones((6, 1)), Y, S, levels)) < 0).all()
    assert between(np.ones((6, 1)), Y, S, np.array([1e9])) == 0.0


@pytest.mark.parametrize("specimens, tau", [(2, 1.0), (3, 3.0), (10, 0.5)])
def test_intervals_hold_the_mean_and_the_next_specimen(specimens, tau, monkeypatch):
    """In 95 % of 250 meta-analyses each, seed 1, less 2.5 standard errors of that count."""
    monkeypatch.syspath_prepend(str(ROOT / "comparisons"))
    covered = import_module("pooling").covered
    interval, range_ = covered(specimens, tau, 250, 1)
    assert min(interval, range_) >= 0.95 - 2.5 * np.sqrt(0.05 * 0.95 / 250)
