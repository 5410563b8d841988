"""The verdict is seldom wrong where the right one is known, as the page says."""

import re
import sys

import pytest
from fixtures.paths import ROOT
from scipy.stats import binom

sys.path.insert(0, str(ROOT / "comparisons"))

import verdict_rate

SETS, STATED = 1000, 0.01  # share of wrong verdicts that the page states
SIDES = [(verdict_rate.EQUIVALENT, "rich"), (verdict_rate.DIFFERENT, "simple")]
PAGE = (ROOT / "docs" / "verdict.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("condition", verdict_rate.CONDITIONS)
@pytest.mark.parametrize(("excess", "wrong"), SIDES)
def test_verdicts_are_wrong_at_the_stated_rate_or_less(condition, excess, wrong):
    """Within the binomial's 99.9 % of as many sets."""
    counts = verdict_rate.rates(1, SETS, excess, **verdict_rate.CONDITIONS[condition])
    assert counts[wrong] <= binom.ppf(0.999, SETS, STATED)


def test_the_page_says_what_the_script_prints():
    """The script's own 100 sets of each condition."""
    counts = {
        (name, right): verdicts
        for name, right, verdicts in verdict_rate.from_folds(seed=0, sets=100)
    }
    undecided = [counts["10 folds", right]["undecided"] for right in ("simple", "rich")]
    no, first, second = re.search(r"\n(\w+) verdict was wrong; (\d+) and (\d+) were", PAGE).groups()
    assert (no, [int(first), int(second)]) == ("no", undecided)
    wrong = {
        key: sum(verdicts.values()) - verdicts[key[1]] - verdicts["undecided"]
        for key, verdicts in counts.items()
    }
    most = int(re.search(r"at most (\d+) of 100 was wrong", PAGE)[1])
    assert wrong["10 folds", "simple"] == wrong["10 folds", "rich"] == 0
    assert max(wrong.values()) == most == 100 * STATED


@pytest.mark.parametrize(
    ("excess", "right"),
    [(verdict_rate.EQUIVALENT, "simple"), (verdict_rate.DIFFERENT, "rich")],
)
def test_most_data_that_scatter_little_decide(excess, right):
    assert verdict_rate.rates(1, 100, excess, scatter=0.35)[right] >= 60
