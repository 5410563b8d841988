"""The verdict is seldom wrong where the right one is known, as the page says."""

import re

import pytest
import verdict_rate
from fixtures.paths import ROOT
from scipy.stats import binom
from verdict_rate import DIFFERENT, EQUAL, EQUIVALENT

SETS, STATED = 400, 0.05  # share of wrong verdicts that the page states
SIDES = [(EQUAL, "rich"), (EQUIVALENT, "rich"), (DIFFERENT, "simple")]
PAGE = (ROOT / "docs/verdict.md").read_text(encoding="utf-8")
EDGE = PAGE.partition("just the region")[2].partition("\n\n")[0]


@pytest.mark.parametrize("condition", verdict_rate.CONDITIONS)
@pytest.mark.parametrize(("excess", "wrong"), SIDES)
def test_verdicts_are_wrong_at_the_stated_rate_or_less(condition, excess, wrong):
    """Within the binomial's 99.9 % of as many sets."""
    counts = verdict_rate.rates(1, SETS, excess, **verdict_rate.CONDITIONS[condition])
    assert counts[wrong] <= binom.ppf(0.999, SETS, STATED)


def test_at_the_edge_of_the_region_statements_have_the_levels_of_the_page():
    """Where the simple model is worse by just the region, either statement is wrong."""
    worse, good, alike = map(int, re.findall(r"of\s+(\d+) % ", EDGE))
    skewed, even = (verdict_rate.rates(2, SETS, 1.0, share=share) for share in (0.5, 0.0))
    assert skewed["rich"] <= binom.ppf(0.999, SETS, 0.1)
    assert [round(100 * n / SETS) for n in (skewed["rich"], skewed["simple"], even["simple"])] == [
        worse,
        good,
        alike,
    ]


def test_the_page_says_what_the_script_prints():
    """The script's own 200 sets of 24 recordings."""
    shown = {
        excess: verdict_rate.rates(0, 200, excess) for excess in (EQUAL, EQUIVALENT, DIFFERENT)
    }
    words = r"(\d+), (\d+) and (\d+) of 200 such sets get the right verdict, (\w+) a wrong one"
    *right, wrong = re.search(words, PAGE).groups()
    assert list(map(int, right)) == [
        shown[EQUAL]["simple"],
        shown[EQUIVALENT]["simple"],
        shown[DIFFERENT]["rich"],
    ]
    assert {"none": 0, "one": 1}[wrong] == (
        shown[EQUAL]["rich"] + shown[EQUIVALENT]["rich"] + shown[DIFFERENT]["simple"]
    )


@pytest.mark.parametrize(("excess", "right"), [(EQUAL, "simple"), (DIFFERENT, "rich")])
def test_most_data_decide(excess, right):
    assert verdict_rate.rates(1, SETS, excess)[right] >= 0.7 * SETS
