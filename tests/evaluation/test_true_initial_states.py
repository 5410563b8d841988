"""Predictions from true states, and the true friction with the true machine and torque clock."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.changed_data import each, subset
from fixtures.paths import DATA
from fixtures.score_frames import select
from fixtures.tiny_pendulums import TRUTH, dataset

from frictionid import load_dataset
from frictionid.data.plants import Calibration, plant_of, stack_calibrations
from frictionid.evaluation import (
    Protocol,
    Split,
    make_folds,
    prepare,
    score_folds,
    score_model,
    true_calibration,
    true_friction,
)
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous

PROTOCOL = Protocol(horizons=(0.5,), true_initial_states=True)


def scores(rows, score="rollout_true_start"):
    return select(rows, score=score, statistic="median")


def test_what_is_off_from_true_states_is_the_models_alone():
    prepared = prepare(dataset(), PROTOCOL)
    rows, *_ = score_model(true_friction(TRUTH), prepared)
    true, causal = scores(rows)["all", "all"], scores(rows, "rollout_angle_truth")["all", "all"]
    assert true < 2e-4
    assert causal > 5 * true
    without = CoulombViscous(), np.array([[0.03, 0.004]])
    rows, *_ = score_model(Friction(*without), prepared)
    assert scores(rows)["all", "all"] > 20 * true


def test_every_fold_predicts_what_it_has_not_seen_whatever_its_rig():
    data = dataset()
    folds = make_folds(data.recordings, Split(count=3))
    prepared = prepare(data, PROTOCOL)
    alone, *_ = score_model(true_friction(TRUTH), prepared)
    theta = true_friction(TRUTH).theta
    friction = replace(true_friction(TRUTH), theta=np.repeat(theta[None], 3, axis=0))
    calibration = Calibration.ideal(1, plant_of(data).p[0])
    late = replace(calibration, delay=np.array(0.05))
    for calibrations, same in (
        (None, True),
        (stack_calibrations([calibration] * 3), True),
        (stack_calibrations([calibration, late, late]), False),
    ):
        rows, *_ = score_folds(
            replace(friction, calibration=calibrations), true_friction(TRUTH), prepared, folds
        )
        found = scores(rows)
        assert set(found) == {(f, j) for f in ("0", "1", "2") for j in ["all"]} | {
            ("all", "all"),
            ("all", "1"),
        }
        assert (found["all", "all"] == pytest.approx(scores(alone)["all", "all"])) == same


def test_they_are_made_only_where_they_are_wanted_and_the_truth_is_known():
    for data, protocol in (
        (dataset(), replace(PROTOCOL, true_initial_states=False)),
        (each(dataset(), lambda r: replace(r, truth=None)), PROTOCOL),
    ):
        rows, *_ = score_model(true_friction(TRUTH), prepare(data, protocol))
        assert not scores(rows)


def test_the_truth_has_the_true_inertias_and_torque_clock():
    data = subset(load_dataset(DATA / "acrobot_sim"), 12, 15)
    friction, calibration = true_friction(data.truth), true_calibration(data)
    prepared = prepare(data, replace(PROTOCOL, true_initial_states=False))
    own, told = (
        score_model(replace(friction, calibration=r), prepared)[0] for r in (calibration, None)
    )
    assert float(calibration.delay) == data.truth["rig"]["torque_delay"]
    assert scores(own, "rollout_angle")["all", "all"] < (
        0.2 * scores(told, "rollout_angle")["all", "all"]
    )


def test_a_machine_that_is_as_told_has_no_rig_of_its_own():
    assert true_calibration(load_dataset(DATA / "acrobot_clean")) is None
    assert true_calibration(dataset()) is None
    assert true_calibration(dataset(truth=None)) is None
    late = true_calibration(dataset(truth={"rig": {"torque_delay": 0.01}}))
    assert float(late.delay) == 0.01
