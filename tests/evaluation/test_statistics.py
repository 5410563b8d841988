"""The correlated tests are those of scipy and baycomp."""

import baycomp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from frictionid.evaluation.statistics import correlated_test

FOLDS = np.random.default_rng(1).uniform(0.1, 0.3, (20, 2, 10))


@pytest.mark.parametrize("pair", FOLDS[:5])
def test_probabilities_are_those_of_baycomp(pair):
    test = correlated_test(pair[0] - pair[1], region=0.02)
    known = baycomp.CorrelatedTTest.probs(pair[1], pair[0], rope=0.02)
    inside = 1.0 - test.below - test.above
    assert [test.below, inside, test.above] == pytest.approx(known, abs=1e-10)


@pytest.mark.parametrize("pair", FOLDS[5:10])
def test_interval_and_p_value_are_those_of_the_corrected_t_test(pair):
    """Written out anew: Nadeau and Bengio's variance is s^2 (1/J + n_test/n_training)."""
    d = pair[0] - pair[1]
    test = correlated_test(d, region=0.02)
    error = np.sqrt(d.var(ddof=1) * (1 / 10 + 0.1 / 0.9))
    assert test.error == pytest.approx(error, abs=1e-10)
    assert (test.low, test.high) == pytest.approx(
        stats.t.interval(0.95, 9, d.mean(), error), abs=1e-10
    )
    assert test.p_value == pytest.approx(2 * stats.t.sf(abs(d.mean()) / error, 9), abs=1e-10)


@given(st.lists(st.floats(-1, 1), min_size=3, max_size=12), st.floats(1e-3, 0.5))
def test_probabilities_sum_to_one_at_most_and_exchange_with_the_models(differences, region):
    d = np.array(differences)
    one, other = correlated_test(d, region), correlated_test(-d, region)
    assert one.below >= 0 and one.above >= 0 and one.below + one.above <= 1.0 + 1e-12
    assert (one.below, one.above) == pytest.approx((other.above, other.below), abs=1e-12)
    assert one.error >= np.std(d, ddof=1) / np.sqrt(len(d))


def test_folds_that_agree_decide_by_the_region_alone():
    test = correlated_test(np.full(4, 0.03), region=0.02)
    assert (test.below, test.above, test.p_value) == (0.0, 1.0, 0.0)
    assert correlated_test(np.zeros(4), region=0.02)[-2:] == (0.0, 0.0)


@pytest.mark.parametrize("differences", [[0.1], [0.1, np.inf, 0.2]])
def test_what_says_nothing_is_refused(differences):
    with pytest.raises(ValueError, match="at least 2, all finite"):
        correlated_test(np.array(differences), 0.1)
