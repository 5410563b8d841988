"""The correlated tests are those of scipy and baycomp; the rule keeps to its order."""

import baycomp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from frictionid.evaluation.statistics import choose, correlated_test

FOLDS = np.random.default_rng(1).uniform(0.1, 0.3, (20, 2, 10))


@pytest.mark.parametrize("pair", FOLDS[:5])
def test_probabilities_are_those_of_baycomp(pair):
    test = correlated_test(pair[0] - pair[1], region=0.02)
    known = baycomp.CorrelatedTTest.probs(pair[1], pair[0], rope=0.02)
    assert [test.below, test.inside, test.above] == pytest.approx(known, abs=1e-10)


@pytest.mark.parametrize("pair", FOLDS[5:10])
def test_interval_and_p_value_are_those_of_the_corrected_t_test(pair):
    """Written out anew: Nadeau and Bengio's variance is s^2 (1/J + n_test/n_training)."""
    d = pair[0] - pair[1]
    test = correlated_test(d, region=0.02, test_share=0.2)
    error = np.sqrt(d.var(ddof=1) * (1 / 10 + 0.2 / 0.8))
    assert test.error == pytest.approx(error, abs=1e-10)
    assert (test.low, test.high) == pytest.approx(
        stats.t.interval(0.95, 9, d.mean(), error), abs=1e-10
    )
    assert test.p_value == pytest.approx(2 * stats.t.sf(abs(d.mean()) / error, 9), abs=1e-10)


def test_without_a_share_in_the_test_set_it_is_the_ordinary_t_test():
    d = FOLDS[0, 0] - FOLDS[0, 1]
    known = stats.ttest_1samp(d, 0.0)
    assert correlated_test(d, 0.01, test_share=0.0).p_value == pytest.approx(
        known.pvalue, abs=1e-10
    )


@given(st.lists(st.floats(-1, 1), min_size=3, max_size=12), st.floats(1e-3, 0.5))
def test_probabilities_sum_to_one_and_exchange_with_the_models(differences, region):
    d = np.array(differences)
    one, other = correlated_test(d, region), correlated_test(-d, region)
    assert one.below + one.inside + one.above == pytest.approx(1.0, abs=1e-12)
    assert (one.below, one.above) == pytest.approx((other.above, other.below), abs=1e-12)
    assert one.error >= np.std(d, ddof=1) / np.sqrt(len(d))


def test_folds_that_agree_decide_by_the_region_alone():
    test = correlated_test(np.full(4, 0.03), region=0.02)
    assert (test.below, test.inside, test.above, test.p_value) == (0.0, 0.0, 1.0, 0.0)
    assert correlated_test(np.zeros(4), region=0.02).inside == 1.0


@pytest.mark.parametrize("differences", [[0.1], [0.1, np.inf, 0.2]])
def test_what_says_nothing_is_refused(differences):
    with pytest.raises(ValueError, match="at least 2, all finite"):
        correlated_test(np.array(differences), 0.1)


FOLD = np.array([0.30, 0.31, 0.29, 0.30, 0.32])
WIDE = np.array([0.10, -0.08, 0.09, -0.07, 0.02])


@pytest.mark.parametrize(
    ("simple", "standing", "recommended"),
    [
        (FOLD + 0.003, "adequate", 1),  # inside the region: the simple one
        (FOLD + 0.3, "worse", 0),
        (FOLD + 0.03 + WIDE, "undecided", None),
        (FOLD - 0.1, "best", 1),
        (np.where(FOLD > 0.31, np.inf, FOLD), "diverged", 0),
    ],
)
def test_the_simplest_model_that_is_not_practically_worse_is_recommended(
    simple, standing, recommended
):
    choice = choose(np.array([FOLD, simple]), np.array([8.0, 4.0]))
    assert choice.standings[1].standing == standing
    assert choice.recommended == recommended


def test_an_implausible_model_is_recommended_only_where_no_other_is_left():
    errors, complexity = np.array([FOLD, FOLD + 0.003]), np.array([8.0, 4.0])
    assert choose(errors, complexity, np.array([False, True])).recommended == 0
    assert choose(errors, complexity, np.array([True, True])).recommended == 1


def test_too_few_folds_and_models_that_diverge_give_no_choice():
    assert choose(np.array([[0.1, 0.2]]), np.ones(1)).recommended is None
    assert choose(np.array([[0.1, 0.2, np.nan]]), np.ones(1)).best is None
