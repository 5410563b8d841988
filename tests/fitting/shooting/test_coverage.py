"""95 % intervals of shooting hold the truth; 100 sets of each law: comparisons/intervals.py."""

import numpy as np
import pytest
from coverage_cases import case_of, sets_of
from coverage_fits import by_shooting

SETS = range(101, 107)


@pytest.fixture(scope="module")
def found():
    """Parameters of six sets of a joint with Stribeck friction, at most 42."""
    case = case_of("stribeck", "joint")
    return [e for d in sets_of(case, SETS, 8, late=True, substeps=4) for e in by_shooting(case, d)]


def test_intervals_hold_the_truth(found):
    held = [e.held for e in found if e.identified]
    assert len(held) > 30
    assert np.mean(held) > 0.85  # 0.95 less three standard deviations of 42 cases


def test_intervals_are_no_wider_than_errors_ask_for(found):
    ratio = np.array([e.error / e.half for e in found if e.identified])
    assert 0.2 < np.sqrt(np.mean(ratio**2)) < 0.75  # 0.5 of t distributed errors
