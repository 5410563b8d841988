"""Folds: each interval is held out once, training keeps its distance, the hash tells all."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from fixtures.tiny_pendulums import dataset, recordings, shortened
from hypothesis import given
from hypothesis import strategies as st

from frictionid.data.plants import plant_of
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal
from frictionid.evaluation import Folds, Split, make_folds
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY, problem_of

KINDS = ("recordings", "blocks", "shuffled")


def of_sizes(sizes, rng=None, dt=0.01):
    """Still recordings with these numbers of samples, on uneven clocks where rng is given."""
    out = []
    for i, size in enumerate(sizes):
        steps = np.full(size, dt) if rng is None else rng.uniform(0.5 * dt, 1.5 * dt, size)
        signal = Signal(np.cumsum(steps), np.zeros((size, 1)))
        out.append(Recording(f"{i:03d}", signal, signal))
    return tuple(out)


def rows_of(made):
    """Recording, start and length of each sample interval."""
    parts = [(np.full(len(t) - 1, i), t[:-1], np.diff(t)) for i, t in enumerate(made.times)]
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def test_of_each_recording_all_folds_but_one_learn():
    """As where joints move one after the other, each in a recording of its own."""
    made = make_folds(of_sizes((40, 90, 65)), Split(count=5, kind="stretches"))
    for label in made.labels:
        assert np.array_equal(np.unique(label), np.arange(5)) and (np.diff(label) >= 0).all()
        assert np.ptp(np.bincount(label)) <= 1
    with assert_refused("001: 3 samples cannot make 5 folds"):
        make_folds(of_sizes((40, 3)), Split(count=5, kind="stretches"))


# --- Every interval is held out once -------------------------------------------------------------


@given(
    sizes=st.lists(st.integers(2, 60), min_size=1, max_size=12),
    count=st.integers(2, 12),
    kind=st.sampled_from(KINDS),
    gap=st.floats(0.0, 0.2),
    seed=st.integers(0, 3),
)
def test_every_interval_is_held_out_once_and_trains_all_other_folds(sizes, count, kind, gap, seed):
    split = Split(count=count, kind=kind, gap=gap, seed=seed)
    if count > (len(sizes) if kind == "recordings" else sum(sizes)):
        with assert_refused("cannot make"):
            make_folds(of_sizes(sizes), split)
        return
    made = make_folds(of_sizes(sizes, np.random.default_rng(seed)), split)
    recording, time, dt = rows_of(made)
    held = made.held_out(recording, time)
    assert held.min() >= 0 and held.max() < count
    assert [len(label) for label in made.labels] == sizes
    weights = made.training(recording, time, dt)
    assert set(np.unique(weights)) <= {0.0, 1.0}
    # what is held out never trains its own fold
    assert not weights[held, np.arange(len(held))].any()
    if kind != "blocks":
        assert np.array_equal(weights.sum(0), np.full(len(held), count - 1))


@pytest.mark.parametrize("kind", KINDS)
def test_times_within_an_interval_belong_to_its_fold(kind):
    made = make_folds(recordings(), Split(count=4, kind=kind))
    recording, time, dt = rows_of(made)
    held = made.held_out(recording, time)
    assert np.array_equal(made.held_out(recording, time + 0.4 * dt), held)
    assert np.array_equal(made.held_out(recording, time - 1e-12), held)  # rounding of clocks


@given(
    sizes=st.lists(st.integers(2, 80), min_size=3, max_size=20),
    kind=st.sampled_from(KINDS),
    seed=st.integers(0, 5),
)
def test_folds_are_balanced_and_none_is_empty(sizes, kind, seed):
    made = make_folds(of_sizes(sizes), Split(count=3, kind=kind, seed=seed))
    share = np.bincount(np.concatenate(made.labels), minlength=3)
    assert share.min() > 0
    assert share.max() - share.min() <= (max(sizes) if kind == "recordings" else 1)
    if kind == "recordings":
        assert all(len(set(label.tolist())) == 1 for label in made.labels)


# --- The hash ------------------------------------------------------------------------------------


def test_the_hash_changes_with_any_change_and_with_nothing_else():
    parts = recordings()
    split = Split(count=4, kind="blocks", gap=0.1)
    base = make_folds(parts, split)
    late = replace(parts[3], angle=parts[3].angle._replace(time=parts[3].angle.time + 1e-9))
    settings = [{"count": 5}, {"gap": 0.2}]
    settings += [{"kind": k, "seed": s} for k in ("recordings", "shuffled") for s in (0, 1)]
    changed = [[*parts[:3], other, *parts[4:]] for other in (late, shortened(parts[3], 1.0))]
    others = [
        *(make_folds(parts, replace(split, **each)) for each in settings),
        *(make_folds(each, split) for each in (parts[:-1], parts[::-1], *changed)),
        replace(base, contiguous=False),
        replace(base, labels=(1 - base.labels[0], *base.labels[1:])),
    ]
    assert len({base.hash, *(folds.hash for folds in others)}) == len(others) + 1
    assert make_folds(parts, split).hash == base.hash
    # measured values are no part of the assignment
    assert make_folds(recordings(noise=0.0), split).hash == base.hash


def test_the_hash_knows_where_one_recording_ends():
    time = np.zeros(4)
    joined = Folds(2, (time, time[:0]), (np.zeros(4, int), np.zeros(0, int)))
    split = Folds(2, (time[:2], time[2:]), (np.zeros(2, int), np.zeros(2, int)))
    assert joined.hash != split.hash


# --- Blocks and their gap ------------------------------------------------------------------------


def time_between(starts, stops, a, b):
    """Time between [a, b] and the nearest of some intervals, 0 where they touch or overlap."""
    return np.maximum(np.maximum(starts - b, a - stops), 0.0).min(initial=np.inf)


@pytest.mark.parametrize("gap", [0.03, 0.05, 0.25, 10.0])
@pytest.mark.parametrize("uneven", [False, True])
def test_training_keeps_the_gap_on_both_sides_of_a_block_and_no_more(gap, uneven):
    rng = np.random.default_rng(5) if uneven else None
    made = make_folds(of_sizes([70, 3, 110], rng), Split(count=4, kind="blocks", gap=gap))
    recording, time, dt = rows_of(made)
    held, weights = made.held_out(recording, time), made.training(recording, time, dt)
    for fold in range(4):
        for k in range(len(time)):
            own = (held == fold) & (recording == recording[k])
            stop = time[k] + dt[k]
            apart = time_between(time[own], time[own] + dt[own], time[k], stop)
            assert weights[fold, k] == (held[k] != fold and apart >= gap - 1e-9), (fold, k, apart)


def test_blocks_are_contiguous_and_follow_each_other():
    made = make_folds(recordings(), Split(count=5, kind="blocks"))
    assert (np.diff(np.concatenate(made.labels)) >= 0).all()


def test_shuffled_samples_scatter_and_say_what_that_costs():
    made = make_folds(recordings(), Split(count=5, kind="shuffled"))
    changes = np.mean(np.diff(np.concatenate(made.labels)) != 0)
    assert changes > 0.7  # 4/5 by chance: neighbours of what is held out are trained on
    assert not made.contiguous
    assert "neighbours in the training set" in Split.__doc__
    assert "seen in training" in Folds.whole.__doc__


# --- Stretches of time ---------------------------------------------------------------------------


# --- The same for all recipes --------------------------------------------------------------------


@pytest.mark.parametrize("sample_time", [None, 0.04])
@pytest.mark.parametrize("history", [0.0, 0.02, 0.15])
def test_both_recipes_have_the_same_rows_and_hold_out_the_same(sample_time, history):
    data = dataset()
    made = make_folds(data.recordings, Split(count=4, kind="blocks"))
    problems = [
        problem_of(data, plant_of(data), recipe, sample_time, history)
        for recipe in (STUDY, INTEGRAL)
    ]
    study, integral = problems
    assert np.array_equal(study.recording, integral.recording)
    np.testing.assert_array_equal(study.time, integral.time)
    for problem in problems:
        begin = np.array([r.angle.time[0] for r in data.recordings])[problem.recording]
        step = problem.dt.min()
        assert (problem.time - begin).min() >= history - step / 2
        # the first velocity that backward differences know is that of the second sample
        assert (problem.time - begin).min() == pytest.approx(max(history, step), abs=step / 2)
    held = [made.held_out(problem.recording, problem.time) for problem in problems]
    assert np.array_equal(*held)


# --- Refusals ------------------------------------------------------------------------------------

REFUSED = r"""
count = 13 => 12 recordings cannot make 13 folds of whole ones: lower folds.count, or .*"blocks"
count = 9999; kind = "blocks" => 1092 samples cannot make 9999
count = 1 => count: it should be greater than or equal to 2, not 1
kind = "block" => kind: it should be 'recordings', 'blocks', 'stretches' or 'shuffled', not 'block'
kind = "blocks"; gap = -0.1 => gap: it should be greater than or equal to 0, not -0.1
kind = "blocks"; gap = inf => gap: it should be a finite number, not inf
gap = nan => gap: it should be a finite number, not nan
seed = -1 => seed: it should be greater than or equal to 0, not -1
"""


@mistakes(REFUSED)
def test_what_cannot_be_split_is_refused_with_the_way_out(wrong, words):
    with assert_refused(words):
        make_folds(recordings(), Split(**changes(wrong)))


# --- Without a count -----------------------------------------------------------------------------


@pytest.mark.parametrize(("sizes", "kind"), [([50], "blocks"), ([50, 60], "recordings")])
def test_without_a_kind_folds_are_of_the_usual_one(sizes, kind):
    made, asked = (make_folds(of_sizes(sizes), Split(kind=k)) for k in (None, kind))
    assert made.hash == asked.hash


def test_a_single_recording_is_not_left_out():
    with assert_refused('1 recordings cannot make 2 folds.*"blocks"'):
        make_folds(of_sizes([50]), Split(kind="recordings"))
