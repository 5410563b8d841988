"""Statistics of rollout errors: the medians, quantiles and shares that stand in scores.csv."""

from types import SimpleNamespace

import numpy as np
import pytest
from fixtures.score_frames import select

from frictionid.evaluation import rollout_scores


def made_up(errors):
    """Motion, starts and folds of S rollouts with given errors (S, n) after the only horizon."""
    errors = np.asarray(errors, float)
    S, n = errors.shape
    motion = SimpleNamespace(q=np.stack([np.zeros((S, n)), errors]))
    starts = SimpleNamespace(
        measured=np.zeros((2, S, n)),
        truth=None,
        horizons=np.array([0.5]),
        last=np.ones((1, S), int),
    )
    return motion, starts


def scores(errors, fold):
    """Scores of such rollouts of joints that turn."""
    units = ("rad",) * np.shape(errors)[1]
    return list(rollout_scores(*made_up(errors), np.array(fold), units))


def test_errors_are_norms_of_all_joints_and_distances_of_each():
    rows = scores([[0.3, 0.4], [-0.6, 0.0], [0.0, -0.9]], [[0.0] * 3])
    assert select(rows, statistic="median") == pytest.approx(
        {("0.0", "all"): 0.6, ("all", "all"): 0.6, ("all", "1"): 0.3, ("all", "2"): 0.4}
    )
    assert {(row.score, row.horizon_s) for row in rows} == {("rollout_angle", 0.5)}


def test_statistics_are_numpys_while_all_is_finite():
    rng = np.random.default_rng(4)
    for size in (1, 2, 3, 10, 57):
        errors = np.abs(rng.normal(size=(size, 1)))
        rows = scores(errors, [[0] * size])
        found = {row.statistic: row.value for row in rows if row.fold == "all"}
        assert found["median"] == pytest.approx(np.median(errors), rel=1e-12)
        assert found["q90"] == pytest.approx(np.quantile(errors, 0.9), rel=1e-12)
        assert found["diverged"] == pytest.approx(np.mean(errors > 1.0))


@pytest.mark.parametrize("lost", [np.nan, np.inf, 1e300])
def test_what_diverges_counts_and_leaves_the_median_alone(lost):
    errors = np.array([0.1, 0.2, 0.3, 0.4, 2.0, 0.5, lost, 0.1, lost, 0.2])[:, None]
    with np.errstate(over="ignore"):
        rows = scores(errors, [[0] * 10])
    found = {row.statistic: row.value for row in rows if row.fold == "all"}
    assert found["diverged"] == pytest.approx(0.3)
    assert found["median"] == pytest.approx(0.35)
    assert found["q90"] > 1e299


def test_exactly_one_radian_has_not_diverged():
    rows = scores([[1.0], [1.0 + 1e-9]], [[0, 0]])
    assert select(rows, statistic="diverged")["all", "1"] == 0.5


def test_a_quarter_of_the_travel_is_far_off_for_a_joint_that_slides():
    errors = [[0.04, 0.0], [0.06, 0.0], [0.0, 0.3], [0.0, 0.6]]
    motion, starts = made_up(errors)
    starts.measured[0, 0], starts.measured[0, 1] = [0.0, -1.0], [0.2, 1.0]
    starts.measured[0, 2:] = np.nan
    fold = np.zeros((1, 4), int)
    rows = list(rollout_scores(motion, starts, fold, ("m", "m")))
    shares = select([row for row in rows if row.fold == "all"], statistic="diverged")
    assert shares == {("all", "1"): 0.25, ("all", "2"): 0.25, ("all", "all"): 0.25}
    scaled = made_up(np.multiply(errors, 1000.0))
    scaled[1].measured[:] = 1000.0 * starts.measured
    again = list(rollout_scores(*scaled, fold, ("m", "m")))
    assert [r.value for r in again if r.unit == "1"] == [r.value for r in rows if r.unit == "1"]


def test_pooled_is_over_all_starts_and_folds_only_over_their_own():
    errors = np.array([0.1, 0.2, 0.3, 5.0, 6.0])[:, None]
    fold = np.array([[0, 0, 0, 1, 1]])
    rows = scores(errors, fold)
    median = select(rows, statistic="median", joint="all")
    assert median == pytest.approx({("0", "all"): 0.2, ("1", "all"): 5.5, ("all", "all"): 0.3})
    without = scores(errors, np.where(fold == 1, -1, fold))
    assert select(without, statistic="median", joint="all") == pytest.approx(
        {("0", "all"): 0.2, ("all", "all"): 0.2}
    )
