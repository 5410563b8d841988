"""One-step scores and friction curves: each equals what its definition gives by hand."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.changed_data import each
from fixtures.refusals import assert_refused
from fixtures.score_frames import lines, select
from fixtures.shared import shared
from fixtures.tiny_pendulums import GRAVITY, INERTIA, TRUTH, dataset, true_torque
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.evaluation import (
    SCORE_COLUMNS,
    Protocol,
    Split,
    curve_error,
    curve_scores,
    make_folds,
    prepare,
    score_folds,
    score_model,
    steady_state,
    true_friction,
    velocity_grid,
)
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, NoFriction

PROTOCOL = Protocol(horizons=(0.1,))
COEFFICIENTS = (0.0, 0.004, 0.03)
STATISTICS = {
    "mean": np.mean,
    "rms": lambda e: np.sqrt(np.mean(e**2)),
    "median": np.median,
    "q90": lambda e: np.quantile(e, 0.9),
}


@shared
def prepared():
    return prepare(dataset(), PROTOCOL)


@shared
def folds():
    return make_folds(dataset().recordings, Split(count=3))


def viscous(*coefficients):
    """A batch of frictions that are viscous and differ much."""
    return Friction(CoulombViscous(), [[[0.0, c]] for c in coefficients])


def scored(friction, data, folds):
    """Scores of the frictions of folds, the first of which is that of all data."""
    return score_folds(friction, friction[0], data, folds).scores


def bare(*recordings):
    """A data set of which no truth is known."""
    return each(dataset(recordings=recordings, truth=None), lambda r: replace(r, truth=None))


def by_hand(recording, torque):
    """Study's residual of one recording: backward differences, explicit Euler, in plain NumPy."""
    time, q = recording.angle.time, recording.angle.value[:, 0]
    dt = np.diff(time)
    w = np.diff(q) / dt
    u = recording.torque.value[1:-1, 0]
    accel = (u - GRAVITY * np.sin(q[1:-1]) - torque(w[:-1])) / INERTIA
    return time[1:-1], w[:-1] + accel * dt[1:] - w[1:]


# --- One step ahead ------------------------------------------------------------------------------


def test_the_studys_rows_equal_a_computation_by_hand(prepared, folds):
    rows = scored(viscous(*COEFFICIENTS), prepared, folds)
    errors = {fold: [] for fold in range(3)}
    for recording, label in zip(dataset().recordings, folds.labels, strict=True):
        fold = int(label[0])
        time, residual = by_hand(recording, lambda w, c=COEFFICIENTS[fold]: c * w)
        errors[fold].append(np.abs(residual[time >= PROTOCOL.history - 1e-9]))
    errors = {fold: np.concatenate(parts) for fold, parts in errors.items()}
    for name, statistic in STATISTICS.items():
        found = select(rows, score="one_step_euler", statistic=name)
        everything = np.concatenate(list(errors.values()))
        expected = {(str(f), "all"): statistic(e) for f, e in errors.items()}
        expected |= {("all", "all"): statistic(everything), ("all", "1"): statistic(everything)}
        assert found == pytest.approx(expected, rel=1e-9)


def test_the_integral_rows_are_those_of_the_momentum_balance(prepared, folds):
    rows = scored(viscous(*COEFFICIENTS), prepared, folds)
    squares = []
    for recording, label, s in zip(
        dataset().recordings, folds.labels, prepared.smoothed, strict=True
    ):
        dt, q, w = np.diff(s.time), s.q[:, 0], s.w[:, 0]
        middle_q = (q[1:] + q[:-1]) / 2 + (w[:-1] - w[1:]) * dt / 8
        middle_w = 1.5 * np.diff(q) / dt - (w[1:] + w[:-1]) / 4

        def force(q, w, c=COEFFICIENTS[label[0]]):
            return -GRAVITY * np.sin(q) - c * w

        mean = force(q[:-1], w[:-1]) + 4 * force(middle_q, middle_w) + force(q[1:], w[1:])
        predicted = w[:-1] + (mean / 6 + recording.torque.value[:-1, 0]) * dt / INERTIA
        use = s.time[:-1] >= PROTOCOL.history - 1e-9
        squares.append(((predicted - w[1:]) ** 2)[use])
    found = select(rows, score="one_step_integral", statistic="rms")
    assert found["all", "all"] == pytest.approx(np.sqrt(np.concatenate(squares).mean()), rel=1e-9)


def backwards(recording):
    """The recording played backwards, of which the motion implies that friction gives energy."""
    angle, torque = (s._replace(value=s.value[::-1]) for s in (recording.angle, recording.torque))
    return replace(recording, angle=angle, torque=torque)


def test_friction_is_not_judged_by_its_energy_where_some_motion_implies_that_it_gives_some(folds):
    first, *others = dataset().recordings
    found = []
    for recording in (first, backwards(first)):
        mixed = prepare(bare(recording, *others), PROTOCOL)
        rows = scored(viscous(0.004, 0.004, 0.004), mixed, folds)
        found.append({fold for fold, _ in select(rows, score="dissipated_energy")})
    everything = {"0", "1", "2", "all"}
    assert found == [everything, everything - {"all", folds.labels[0][0].astype(str)}]


# --- Data that nothing was fitted to -------------------------------------------------------------


def test_a_data_set_that_only_tests_has_no_folds(prepared, folds):
    friction = viscous(0.004)[0]
    alone, *_ = score_model(friction, prepared)
    assert set(alone.fold) == {"all"}
    same = scored(friction[None][np.zeros(3, int)], prepared, folds)
    pooled = {row[1:5]: row.value for row in lines(same) if row.fold == "all"}
    assert {row[1:5]: row.value for row in lines(alone)} == pytest.approx(pooled, rel=1e-12)


@pytest.mark.parametrize("theta", [np.zeros((2, 2)), np.zeros((3, 1, 2))], ids=str)
def test_models_of_another_machine_are_refused(prepared, theta):
    with assert_refused(r"'tiny' has 1 joints.*must be \(1, 2\)"):
        score_model(Friction(CoulombViscous(), theta), prepared)


def test_every_score_has_all_its_statistics(prepared, folds):
    rows = scored(viscous(0.0, 0.0, 0.0), prepared, folds)
    found = {(row.score, row.statistic, row.horizon_s) for row in lines(rows)}
    steps = {(f"one_step_{s}", name, None) for s in ("euler", "integral") for name in STATISTICS}
    ahead = {
        (score, name, 0.1)
        for score in ("rollout_angle", "rollout_angle_truth")
        for name in ("median", "q90", "diverged")
    }
    assert found == {
        *steps,
        *ahead,
        ("curve_error", "rms", None),
        ("n_parameters", "count", None),
        ("dissipated_energy", "ratio", None),
        *((f"torque_{name}", "rms", None) for name in ("left", "measured")),
        ("torque_left", "share", None),
    }
    assert not rows.duplicated(list(SCORE_COLUMNS[:5])).any()
    assert np.isfinite(rows.value).all()


def test_parameters_are_counted_over_the_joints(prepared, folds):
    for friction, count in ((viscous(0.0, 0.0, 0.0), 2.0), (nothing(3), 0.0)):
        rows = scored(friction, prepared, folds)
        assert select(rows, score="n_parameters") == {("all", "all"): count}


def nothing(batch):
    return Friction(NoFriction(), np.zeros((batch, 1, 0)))


# --- Friction curves -----------------------------------------------------------------------------


def test_the_grid_has_401_velocities_up_to_q95():
    w = np.random.default_rng(0).normal(size=(999, 2)) * [1.0, 7.0]
    grid = velocity_grid(w)
    assert grid.shape == (401, 2)
    assert_allclose(grid[-1], np.quantile(np.abs(w), 0.95, axis=0))
    assert_allclose(grid, -grid[::-1], atol=1e-12)
    assert_allclose(np.diff(grid, axis=0), (grid[-1] / 200)[None].repeat(400, 0))


def test_the_error_is_that_of_its_definition_and_blind_to_slow_speeds():
    grid = velocity_grid(np.random.default_rng(2).normal(size=(50, 1)))
    truth, estimate = np.sign(grid) + grid, 1.2 * np.tanh(grid / 0.1)
    use = np.abs(grid) >= min(0.05, 0.01 * grid.max())
    assert 0 < (~use).sum() < 40
    expected = np.sqrt(np.mean((estimate - truth)[use] ** 2) / np.mean(truth[use] ** 2))
    assert curve_error(estimate, truth, grid)[0] == pytest.approx(expected)
    wild = np.where(use, estimate, 1e9)
    assert curve_error(wild, truth, grid)[0] == pytest.approx(expected)


def test_errors_of_a_batch_are_those_of_each(prepared):
    true = steady_state(TRUTH).curve(prepared.grid)
    batch = viscous(0.0, 0.01)
    together = curve_error(batch.curve(prepared.grid), true, prepared.grid)
    each = [curve_error(batch[f].curve(prepared.grid), true, prepared.grid) for f in (0, 1)]
    assert_array_equal(together, each)


def test_the_grid_of_simulated_data_is_that_of_the_true_velocities(prepared):
    w = np.concatenate([r.truth.velocity.value for r in dataset().recordings])
    assert_array_equal(prepared.grid, velocity_grid(w))
    measured = prepare(bare(*dataset().recordings), PROTOCOL)
    assert measured.grid[-1, 0] == pytest.approx(prepared.grid[-1, 0], rel=0.05)


def test_the_true_curve_is_that_of_the_simulation(prepared):
    w = prepared.grid[np.abs(prepared.grid[:, 0]) > 0.1]
    assert_allclose(steady_state(TRUTH).curve(w), true_torque(w), rtol=1e-4)
    truth, fast = true_friction(TRUTH), prepared.grid[np.abs(prepared.grid[:, 0]) > 0.25]
    assert_allclose(truth.curve(fast), true_torque(fast), rtol=1e-9)


def test_rows_of_curves_name_fold_and_joint_and_leave_out_what_is_not_defined():
    rows = list(curve_scores(np.array([[0.1, np.nan], [0.2, np.nan], [0.15, np.nan]])))
    assert select(rows, score="curve_error", unit="1") == {
        ("0", "1"): 0.1,
        ("1", "1"): 0.2,
        ("all", "1"): 0.15,
    }


def test_a_joint_without_friction_or_motion_has_no_curve_error():
    grid = velocity_grid(np.array([[1.0, 1.0, 0.0]]))
    truth = np.where([True, False, True], np.sign(grid), 0.0)
    assert np.isnan(curve_error(truth + 0.1, truth, grid)).tolist() == [False, True, True]


def test_measured_data_have_neither_curve_error_nor_truth(folds):
    rows = scored(nothing(3), prepare(bare(*dataset().recordings), PROTOCOL), folds)
    assert set(rows.score) == {
        "dissipated_energy",
        "one_step_euler",
        "one_step_integral",
        "rollout_angle",
        "n_parameters",
        "torque_left",
        "torque_measured",
    }
