"""The verdict is seldom wrong where the right one is known."""

import sys

import pytest
from fixtures.paths import ROOT

sys.path.insert(0, str(ROOT / "comparisons"))
verdict_rate = pytest.importorskip("verdict_rate")


@pytest.mark.parametrize("condition", verdict_rate.CONDITIONS)
@pytest.mark.parametrize(
    ("excess", "wrong"),
    [(verdict_rate.EQUIVALENT, "rich"), (verdict_rate.DIFFERENT, "simple")],
)
def test_at_most_ten_of_a_hundred_verdicts_are_wrong(condition, excess, wrong):
    found = verdict_rate.rates(1, 100, excess, **verdict_rate.CONDITIONS[condition])
    assert found[wrong] <= 10


@pytest.mark.parametrize(
    ("excess", "right"),
    [(verdict_rate.EQUIVALENT, "simple"), (verdict_rate.DIFFERENT, "rich")],
)
def test_most_data_that_scatter_little_decide(excess, right):
    assert verdict_rate.rates(1, 100, excess, scatter=0.35)[right] >= 60
