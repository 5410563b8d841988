"""Laws of growth: pieces change no number, recordings are independent, memory in proportion."""

import math
import tracemalloc
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from fixtures.changed_data import subset
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.kalman import alike
from frictionid.data.plants import plant_of
from frictionid.data.readers import csv_table, table
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import RTS, KalmanFilter
from frictionid.dynamics import end_states
from frictionid.evaluation.scoring import held_out_residual
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY, training_problem
from frictionid.fitting.parameters import FrictionBlock
from frictionid.fitting.shooting import refine, window_steps, windows
from frictionid.fitting.shooting.data_checks import odd_among
from frictionid.fitting.shooting.settings import Settings
from frictionid.friction import Friction, Inputs, Nodes, along, along_own, friction, memory_along
from frictionid.friction.laws import LSTM, MLP, Dahl, FilmLag, LuGre, Stribeck, WindowMLP

THETA = {
    FilmLag: (0.1, 0.05, 1.0, 0.01, 0.03),
    Dahl: (0.1, 0.01, 0.02),
    LuGre: (0.1, 0.05, 1.0, 0.01, 0.02, 0.05, 0.3),
}


def swing(samples, rng, rate=1000.0):
    """Angles of two joints with noise, and an outlier."""
    time = np.arange(samples) / rate
    value = np.sin(np.outer(6 * time, [1.0, 1.7]) + rng.uniform(0, 6, 2))
    value += 1e-3 * rng.standard_normal(value.shape)
    value[samples // 2] += 0.3
    return Signal(time, value)


def nodes_of(sizes):
    """Nodes of recordings of some lengths, each with its own clock from zero."""
    rng, count = default_rng(0), sum(sizes)
    w = np.cumsum(rng.normal(0, 0.3, (count, 2)), axis=0)
    x = Inputs(0.01 * np.cumsum(w, axis=0), w, 0.0 * w, 0.0 * w)
    time = np.concatenate([0.01 * np.arange(size) for size in sizes])
    return Nodes(x, time, np.concatenate([[0], np.cumsum(sizes)]))


def some_friction(law):
    if type(law) in THETA:
        theta = np.tile(THETA[type(law)], (3, 2, 1))
        return Friction(law, theta * np.linspace(1.0, 1.3, 3)[:, None, None])
    sizes = np.tile([0.1, 3.0], (3, 2, 1))
    return Friction(law, law.initial_parameters(sizes, default_rng(0)))


def peak(call):
    """Most bytes that a call holds."""
    tracemalloc.start()
    call()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


@pytest.mark.parametrize("law", [FilmLag(), Dahl(), LuGre()], ids=repr)
def test_a_memory_that_relaxes_is_that_of_step_by_step(law):
    nodes, own = nodes_of((40, 7, 60)), some_friction(law)
    theta, found = own.theta[:, None], memory_along(own, nodes)
    for r, (a, b) in enumerate(pairwise(nodes.first)):
        at = [nodes.inputs.each(lambda x, k=k: x[[k]]) for k in range(a, b)]
        memory = law.start(theta, at[0])
        for t in range(1, b - a):
            middle = at[t - 1].each(lambda p, q: (p + q) / 2, at[t])
            memory = law.advance(theta, middle, memory, np.array([[0.01]]))
            assert_allclose(found[t][0][:, [r]], memory[0], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("law", [Stribeck(), MLP(), FilmLag(), LSTM(), WindowMLP()], ids=repr)
def test_torque_in_pieces_is_that_at_once(law, monkeypatch):
    nodes = nodes_of((30, 5, 44, 44, 3))
    own = some_friction(law) if law != Stribeck() else Friction(law, np.full((3, 2, 4), 0.3))
    whole = along(own, nodes)
    monkeypatch.setattr(friction, "_STEPS", 150)
    assert_allclose(along(own, nodes), whole, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("law", [MLP(), LuGre()], ids=repr)
def test_held_out_residuals_are_those_of_all_frictions_everywhere(law):
    problem, own = synthetic_problem(2), some_friction(law)
    rng = default_rng(0)
    use = rng.random(len(problem.r)) < 0.8
    fold = rng.integers(0, 3, use.sum())
    everything = problem.residual(along(own, problem.nodes))[fold, np.flatnonzero(use)]
    found = held_out_residual(own, problem, use, fold)
    assert_allclose(found, everything, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("law", [LSTM(), WindowMLP(), LuGre()], ids=repr)
def test_recordings_held_out_side_by_side_are_those_alone(law, monkeypatch):
    nodes, own = nodes_of((30, 5, 44, 3)), some_friction(law)[[0, 2, 1, 2]]
    monkeypatch.setattr(friction, "_STEPS", 100)
    found = along_own(own, nodes)
    for r, (a, b) in enumerate(pairwise(nodes.first)):
        inputs = nodes.inputs.each(lambda x, own=slice(a, b): x[own])
        alone = Nodes(inputs, nodes.time[a:b], np.array([0, b - a]))
        assert_allclose(found[a:b], along(own[r], alone), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("estimator", [RTS(), KalmanFilter()], ids=repr)
def test_states_of_3000_recordings_are_those_of_each_alone(estimator):
    rng = default_rng(0)
    angles = [swing(int(size), rng) for size in rng.integers(12, 24, 2998)]
    angles += [swing(3000, rng), swing(60, rng, rate=5.0)]
    states = estimator(angles)
    for i in (*rng.choice(2998, 20, replace=False), 2998, 2999):
        (alone,) = estimator([angles[i]])
        for a, b in zip(states[i].motion, alone.motion, strict=True):
            assert_array_equal(a, b)


def test_signals_of_unlike_length_are_not_padded_together():
    angles = [Signal(np.arange(float(T)), np.zeros((T, 1))) for T in (*range(3, 40), 900)]
    for group in alike(angles):
        sizes = [len(angles[i].time) for i in group]
        assert max(sizes) <= 1.5 * min(sizes)
    assert sorted(i for group in alike(angles) for i in group) == list(range(38))


def repeated(dataset, times):
    """The recordings of a data set several times, under names of their own."""
    recordings = [
        replace(r, name=f"{r.name}_{k}") for k in range(times) for r in dataset.recordings
    ]
    return replace(dataset, recordings=tuple(recordings))


def fit_one_step(dataset, recipe=INTEGRAL):
    problem = training_problem(dataset, plant_of(dataset), recipe)
    return LeastSquares(Stribeck()).fit(problem, np.ones((1, len(problem.r))), seed=0)[0]


@pytest.fixture(scope="module")
def few():
    dataset = load_dataset("acrobot_clean")
    return subset(dataset, 3, 7)


@pytest.mark.parametrize("recipe", [STUDY, INTEGRAL], ids=["study", "integral"])
def test_memory_of_a_fit_grows_no_faster_than_the_data(few, recipe):
    fit_one_step(few, recipe)  # what is compiled and imported counts once
    once, four = (peak(lambda k=k: fit_one_step(repeated(few, k), recipe)) for k in (3, 12))
    assert four <= 4.4 * once


def test_memory_of_states_grows_no_faster_than_a_recording():
    rng = default_rng(0)
    RTS()([swing(1000, rng)])
    once, four = (peak(lambda n=n: RTS()([swing(n, rng)])) for n in (10_000, 40_000))
    assert four <= 4.5 * once


def test_a_long_recording_among_many_short_ones_needs_what_it_needs_alone():
    rng = default_rng(0)
    long, short = swing(20_000, rng), [swing(40, rng) for _ in range(300)]
    alone = peak(lambda: RTS()([long]))
    assert peak(lambda: RTS()([long, *short])) <= 2 * alone


def shot(dataset, start, iterations=2):
    settings = Settings(windows=(0.1,), iterations=iterations, tolerance=1e-12)
    return refine(start, dataset, (FrictionBlock(),), settings)


def test_shooting_in_pieces_is_that_at_once(few, monkeypatch):
    start = fit_one_step(few)
    monkeypatch.setattr(end_states, "COMPILED", 1)  # few intervals are differentiated as many are
    whole = shot(few, start)
    for module in (windows, window_steps):
        monkeypatch.setattr(module, "AT_ONCE", 300)
    parts = shot(few, start)
    assert_allclose(parts.friction.theta, whole.friction.theta, rtol=1e-9, atol=1e-11)
    assert_allclose(parts.covariance.error, whole.covariance.error, rtol=1e-8)


def test_more_iterations_of_shooting_need_no_more_memory(few):
    start = fit_one_step(few)
    one = subset(few, 0, 2)
    two, five = (peak(lambda k=k: shot(one, start, k)) for k in (2, 5))
    assert five <= 1.05 * two  # once by a linearisation each


def test_odd_ones_among_thousands_are_found():
    sizes = 1.0 + 0.05 * default_rng(0).standard_normal(4000)
    sizes[7] = 30.0
    names = [str(i) for i in range(4000)]
    assert [odd.recording for odd in odd_among(sizes, names)] == ["7"]


@pytest.mark.parametrize("cell", ["0.25", " 1e-3 ", "", '"2.5"', "nan", "-0.1234567890123456789"])
def test_long_tables_are_read_as_short_ones(cell, monkeypatch):
    rows = [f"{k / 7!r},{math.sin(k)!r},{-k}" for k in range(50)]
    rows[20] = f"2.9,{cell},1"
    content = "\n".join(["time,q,u", *rows]).encode()
    found = []
    for long in (0, 10**9):
        monkeypatch.setattr(csv_table, "_LONG", long)
        found.append(table.read_table(content, "a.csv", ["q", "time"]))
    at_once, by_rows = found
    assert_array_equal(at_once.rows, by_rows.rows)
    for name in ("q", "time"):
        assert_array_equal(at_once.columns[name], by_rows.columns[name])
