"""Rollout scores: fair starts, honest horizons, the right friction, statistics that survive."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.changed_data import with_value
from fixtures.memory_laws import Sampled
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from fixtures.score_frames import lines, select
from fixtures.tiny_pendulums import (
    PENDULUM,
    RATE,
    TRUTH,
    dataset,
    disturbed,
    recordings,
    shortened,
)
from fixtures.true_curves import true_states
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.plants import plant_of
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import KalmanFilter
from frictionid.evaluation import (
    Protocol,
    Split,
    initial_state_folds,
    make_folds,
    make_initial_states,
    predict,
    prepare,
    rollout_scores,
    score_folds,
    score_model,
    true_friction,
    with_parameters,
)
from frictionid.evaluation.predicted_motion import memory_at
from frictionid.friction import Friction, along, at_rest, memory_along
from frictionid.friction.laws import CoulombViscous, FilmLag

HORIZONS = (0.1, 0.3)


@pytest.fixture(scope="module")
def prepared():
    return prepare(dataset(), Protocol(horizons=HORIZONS))


def starts_of(data, states=None, horizons=HORIZONS, every=0.25, begin=0.15):
    states = states or KalmanFilter()([r.angle for r in data.recordings])
    return make_initial_states(data, states, plant_of(data), horizons, every=every, begin=begin)


def still(time):
    """A data set of one pendulum that hangs, sampled at these times."""
    signal = Signal(np.asarray(time, float), np.zeros((len(time), 1)))
    return dataset(recordings=(Recording("still", signal, signal),), truth=None)


def test_a_recording_as_long_as_a_horizon_and_what_comes_before_has_one_initial_state():
    data = still(np.arange(46) / 100)
    starts = starts_of(data, horizons=(0.3,), begin=0.15)
    assert_array_equal(starts.index, [15])
    with assert_refused("no recording holds"):
        starts_of(still(np.arange(45) / 100), horizons=(0.3,), begin=0.15)


def times_of(starts, data):
    clocks = [r.angle.time for r in data.recordings]
    return np.array([clocks[r][k] for r, k in zip(starts.recording, starts.index, strict=True)])


# --- Truth in, truth out -------------------------------------------------------------------------


def test_the_truth_from_true_states_predicts_the_true_motion():
    data = dataset()
    true = true_states(data)
    starts = starts_of(data, true, horizons=(0.1, 0.5, 1.0))
    everyone = np.zeros(len(starts.recording), dtype=int)
    motion = predict(plant_of(data)[starts.recording], true_friction(TRUTH)[None][everyone], starts)
    rows = list(rollout_scores(motion, starts, np.zeros_like(starts.last), ("rad",)))
    for horizon in (0.1, 0.5, 1.0):
        truth = select(rows, score="rollout_angle_truth", statistic="q90", horizon_s=horizon)
        assert truth["all", "all"] < 2e-3
        # the camera's noise is all that is left
        measured = select(rows, score="rollout_angle", statistic="median", horizon_s=horizon)
        assert 2e-5 < measured["all", "all"] < 6e-4
    # the smooth friction of these data creeps through a stop where ours grips the joint: until the
    # first one nothing is off
    seen = 0
    for s, (r, k) in enumerate(zip(starts.recording, starts.index, strict=True)):
        w = true[r].w[k : k + len(motion.q), 0]
        slides = np.cumprod(np.sign(w[0]) * w > 0.3).astype(bool)
        off = np.abs(motion.q - starts.truth)[: len(w), s, 0][slides]
        assert off.max(initial=0.0) < 1e-6
        seen += len(off)
    assert seen > 1000


# --- Initial states ------------------------------------------------------------------------------


def test_starts_know_nothing_of_what_comes_later():
    data = dataset()
    before = starts_of(data, begin=0.1)
    for after in (0.4, 0.8):
        late = tuple(disturbed(r, after) for r in data.recordings)
        other = starts_of(replace(data, recordings=late), begin=0.1)
        early = times_of(before, data) < after - 1e-9
        assert early.sum() >= len(late)
        assert_array_equal(before.q[early], other.q[early])
        assert_array_equal(before.w[early], other.w[early])
        friction = Friction(FilmLag(), np.tile([[0.03, 0.01, 1.0, 0.0, 0.1]], (len(early), 1, 1)))
        memory, late_memory = (memory_at(friction, starts)[0] for starts in (before, other))
        assert_array_equal(memory[early], late_memory[early])
        # and the disturbance is one that is felt
        assert np.abs(before.w[~early] - other.w[~early]).max() > 0.1
        assert np.abs(memory - late_memory)[~early].max() > 0.1


@pytest.mark.parametrize(("every", "begin"), [(0.25, 0.15), (0.1, 0.0), (0.4, 0.31)])
def test_rollouts_start_every_so_many_seconds_after_the_history(every, begin):
    data = dataset()
    starts = starts_of(data, every=every, begin=begin, horizons=(0.3, 0.1))
    for r, recording in enumerate(data.recordings):
        time = recording.angle.time
        own = times_of(starts, data)[starts.recording == r]
        wanted = np.arange(begin, time[-1] - 0.1 + 1e-9, every)
        assert len(own) == len(wanted)
        assert (own >= wanted - 1e-9).all()  # the first sample that is not earlier
        assert (own - wanted < 1 / RATE).all()
    assert starts.horizons.tolist() == [0.1, 0.3]


def test_starts_closer_than_the_samples_are_one_per_sample():
    data = still(np.arange(12) * 0.1)
    starts = starts_of(data, every=1e-12, begin=0.0, horizons=(0.2,))
    assert starts.index.tolist() == list(range(10))


def test_a_horizon_ends_at_the_nearest_sample():
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.01, 0.03, 200))
    starts = starts_of(still(time), horizons=(0.05, 0.111, 0.7), begin=0.0)
    assert (starts.last > 0).any(axis=1).all()
    for h, s in np.argwhere(starts.last > 0):
        k, last = starts.index[s], starts.last[h, s]
        off = np.abs(time[k:] - time[k] - starts.horizons[h])
        assert off[last] == off.min()
        assert starts.dt[:last, s].sum() == pytest.approx(time[k + last] - time[k])


def around_a_gap(later, horizons):
    """Clock of one second and of another one that begins later, and the starts on it."""
    time = np.concatenate([begin + np.arange(50) * 0.02 for begin in (0.0, later)])
    return time, starts_of(still(time), horizons=horizons, begin=0.0, every=0.02)


def test_no_horizon_ends_behind_a_recording_or_in_a_gap():
    time, starts = around_a_gap(3.0, (0.105, 0.507))
    ends = time[starts.index] + starts.horizons[:, None]
    near = np.abs(ends[:, :, None] - time).min(-1) < 0.0205
    assert np.array_equal(starts.last > 0, near & (ends < time[-1] + 0.01))
    assert 0.1 < near.mean() < 1.0


def test_no_rollout_spans_a_gap_even_where_its_horizon_ends_right_behind_it():
    """The first sample behind the gap is 0.12 s after the last one before it."""
    time, starts = around_a_gap(1.1, (0.12,))
    assert 49 not in starts.index and 50 in starts.index
    for first, count in zip(starts.index, starts.last[0], strict=True):
        assert np.diff(time[first : first + count + 1]).max() < 0.021


def test_torques_and_angles_of_a_start_are_those_that_follow_it():
    data = dataset()
    starts = starts_of(data)
    for s in (0, 7, len(starts.index) - 1):
        recording, k = data.recordings[starts.recording[s]], starts.index[s]
        last = starts.last[:, s].max()
        torque, angle = recording.torque.value, recording.angle.value
        assert_allclose(starts.u[:last, s], torque[k : k + last], atol=1e-12)
        assert_array_equal(starts.measured[: last + 1, s], angle[k : k + last + 1])
        true = recording.truth.angle.value[k : k + last + 1]
        assert_array_equal(starts.truth[: last + 1, s], true)


REFUSED = r"""
horizons = [0.1, 1.4] => no recording holds 1\.55 s of motion.*rollout of 1\.4 s: choose
horizons = [30.0] => no recording holds 30\.15 s
horizons = [0.004] => sampled finely enough for a rollout of 0\.004 s
"""


@mistakes(REFUSED)
def test_a_horizon_that_no_start_reaches_is_refused(wrong, words):
    with assert_refused(words):
        prepare(dataset(), Protocol(**changes(wrong)))


def test_a_short_recording_beside_long_ones_is_left_out():
    parts = recordings()
    data = dataset(recordings=(shortened(parts[0], 0.2), *parts[1:]))
    assert 0 not in starts_of(data).recording


# --- Which fold predicts -------------------------------------------------------------------------


def folds_of(count, kind):
    return make_folds(dataset().recordings, Split(count=count, kind=kind))


@pytest.mark.parametrize("kind", ["recordings", "blocks", "shuffled"])
def test_a_start_belongs_to_the_fold_that_holds_out_its_whole_horizon(kind):
    data = dataset()
    folds = folds_of(5, kind)
    states = KalmanFilter()([r.angle for r in data.recordings])
    starts = starts_of(data, states)
    found = initial_state_folds(starts, folds, states)
    for h, s in np.ndindex(found.shape):
        r, k, last = starts.recording[s], starts.index[s], starts.last[h, s]
        if last < 0:
            assert found[h, s] == -1
            continue
        label = folds.labels[r][k : k + last]
        if kind == "shuffled":
            assert found[h, s] == label[0]
        else:
            assert found[h, s] == (label[0] if (label == label[0]).all() else -1)
    assert (found == -1).any() == (kind != "shuffled" or (starts.last < 0).any())


def test_blocks_shorter_than_a_horizon_are_refused(prepared):
    folds = folds_of(100, "blocks")
    with assert_refused(r"no fold holds out 0\.3 s of motion.*fewer folds"):
        initial_state_folds(prepared.initial_states, folds, prepared.causal)


@pytest.mark.parametrize("kind", ["recordings", "blocks"])
def test_each_start_is_predicted_by_the_friction_that_has_not_seen_it(prepared, kind):
    folds = folds_of(4, kind)
    friction = Friction(CoulombViscous(), [[[0.0, 0.1 * f]] for f in range(4)])
    rows, *_ = score_folds(friction, friction[0], prepared, folds)
    held_out, starts = lines(rows), prepared.initial_states
    fold = initial_state_folds(starts, folds, prepared.causal)
    for f in range(4):
        alone = np.full(len(starts.recording), f)
        motion = predict(prepared.plant[starts.recording], friction[alone], starts)
        own = list(rollout_scores(motion, starts, np.where(fold == f, f, -1), ("rad",)))
        for row in own:
            if row.fold == str(f):
                assert row in held_out


# --- Memory --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "numbers"),
    [(FilmLag(), [0.03, 0.01, 1.0, 0.004, 0.08]), (Sampled(), [0.01])],
    ids=["film lag", "sampled"],
)
def test_the_memory_at_a_start_is_that_along_the_recording(law, numbers):
    data = dataset()
    starts = starts_of(data)
    S = len(starts.recording)
    theta = np.array(numbers) * np.linspace(0.5, 1.5, 3)[:, None, None]  # three folds, one joint
    owner = np.arange(S) % 3
    found = memory_at(Friction(law, theta)[owner], starts)
    steps = memory_along(Friction(law, theta), starts.nodes)
    for s in range(S):
        expected = steps[starts.index[s]]
        for entry, part in zip(found, expected, strict=True):
            assert_allclose(entry[s], part[owner[s], starts.recording[s]], rtol=1e-12)


def test_a_remembering_law_is_predicted_with_the_memory_of_its_start():
    data = dataset()
    starts = starts_of(data, horizons=(0.3,))
    S = len(starts.recording)
    # a slow film: what happened before the start decides the friction after it
    friction = Friction(FilmLag(), np.tile([[0.0, 0.2, 3.0, 0.0, 5.0]], (S, 1, 1)))
    plant = plant_of(data)[starts.recording]
    warm = predict(plant, friction, starts)
    cold = predict(plant, friction, starts._replace(nodes=_cold(starts)))
    assert np.nanmax(np.abs(warm.q - cold.q)) > 0.01


def _cold(starts):
    """Nodes at which nothing moves before any start."""
    calm = at_rest(0.0 * starts.nodes.inputs.w)
    return starts.nodes._replace(inputs=calm)


def test_one_step_scores_remember_along_the_recording_too(prepared):
    friction = Friction(FilmLag(), [[0.03, 0.01, 1.0, 0.004, 0.08]])
    rows, *_ = score_model(friction, prepared)
    residual = prepared.euler.residual(along(friction, prepared.euler.nodes))
    rms = select(rows, score="one_step_euler", statistic="rms")["all", "all"]
    assert rms == pytest.approx(np.sqrt(np.mean(residual**2)))


def test_a_friction_that_drives_the_motion_away_is_counted_and_not_an_error():
    data = dataset()
    prepared = prepare(data, Protocol(horizons=(0.5,)))
    friction = Friction(CoulombViscous(), [[0.0, -5.0]])
    rows, motions, *_ = score_model(friction, prepared)
    assert select(rows, statistic="diverged", score="rollout_angle")["all", "all"] > 0.9
    assert select(rows, statistic="median", score="rollout_angle")["all", "all"] == np.inf
    assert not np.isfinite(motions[0]["predicted"]).all()


# --- Models that bring their own mechanism, pictures ---------------------------------------------


def test_other_parameters_replace_the_mechanisms_and_nothing_is_estimated_anew(prepared):
    heavy = with_parameters(prepared, {"mass": 0.4})
    assert heavy.estimated is prepared.estimated and with_parameters(prepared, {}) is prepared
    told = dataset(mechanism={**PENDULUM, "parameters": {"mass": 0.4, "length": 0.2}})
    other = prepare(told, Protocol(horizons=HORIZONS))
    friction = true_friction(TRUTH)
    rows = [score_model(friction, p)[0] for p in (prepared, heavy, other)]
    assert rows[1].equals(rows[2]) and not rows[1].equals(rows[0])
    with assert_refused("pendulum has no parameter 'mas'; did you mean 'mass'"):
        with_parameters(prepared, {"mas": 0.4})


def test_examples_are_predictions_beside_what_was_measured(prepared):
    data = dataset()
    folds = folds_of(4, "blocks")
    friction = true_friction(TRUTH)
    for motions in (
        score_model(friction, prepared)[1],
        score_folds(friction[None][np.zeros(4, int)], friction, prepared, folds)[1],
    ):
        assert [motion.get("place") for motion in motions] == [None] * 3 + [
            "best",
            "median",
            "worst",
        ]
        for motion in motions:
            recording = next(r for r in data.recordings if r.name == motion["recording"])
            k = int(np.searchsorted(recording.angle.time, motion["start_s"] - 1e-9))
            T = len(motion["time"])
            assert motion["time"][-1] == pytest.approx(0.3, abs=0.5 / RATE)
            assert_array_equal(motion["measured"], recording.angle.value[k : k + T])
            assert np.abs(motion["predicted"] - motion["measured"]).max() < 0.1
            assert np.abs(np.diff(motion["measured"], axis=0)).max() > 0


def test_the_best_example_is_one_of_motion():
    data = dataset()
    rest = replace(data.recordings[0], name="rest")
    for name in ("angle", "torque"):
        rest = with_value(rest, name, lambda x: 0.0 * x)
    resting = replace(data, recordings=(*data.recordings, rest))
    _, motions, *_ = score_model(
        true_friction(TRUTH), prepare(resting, Protocol(horizons=HORIZONS))
    )
    assert "rest" not in [m["recording"] for m in motions if "place" in m]
