"""Laws of signals: exact values and averages, held or linear, on any clock."""

import re

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.integrals import averages
from frictionid.data.signals import Signal, cut, sample

HOLDS = ("linear", "previous")


@st.composite
def clocks(draw, smallest=1):
    """Uneven, increasing times somewhere around zero."""
    steps = draw(st.lists(st.floats(1e-3, 1.0), min_size=smallest - 1, max_size=12).map(np.array))
    return draw(st.floats(-5.0, 5.0)) + np.concatenate([[0.0], np.cumsum(steps)])


@st.composite
def signals(draw):
    time = draw(clocks())
    shape = (len(time), draw(st.integers(1, 3)))
    value = draw(hnp.arrays(float, shape, elements=st.floats(-10, 10)))
    return Signal(time, value, draw(st.sampled_from(HOLDS)))


def integral_by_brute_force(signal, start, stop):
    """Sum over the intervals on which the signal has no corner, each by its midpoint's value."""
    inside = signal.time[(signal.time > start) & (signal.time < stop)]
    corners = np.concatenate([[start], inside, [stop]])
    middle = 0.5 * (corners[:-1] + corners[1:])
    return (sample(signal, middle) * np.diff(corners)[:, None]).sum(axis=0)


@given(signals())
def test_sample_at_own_times_is_the_value(signal):
    assert_array_equal(sample(signal, signal.time), signal.value)


@given(signals(), st.floats(1e-3, 10.0))
def test_first_and_last_value_stay_outside_the_span(signal, beyond):
    outside = [signal.time[0] - beyond, signal.time[-1] + beyond]
    assert_array_equal(sample(signal, outside), signal.value[[0, -1]])


@given(signals(), st.floats(0.01, 0.99))
def test_between_two_samples_linear_interpolates_and_previous_holds(signal, share):
    left, right = signal.value[:-1], signal.value[1:]
    between = (1 - share) * signal.time[:-1] + share * signal.time[1:]
    held = sample(signal._replace(hold="previous"), between)
    assert_array_equal(held, left)
    linear = sample(signal._replace(hold="linear"), between)
    assert_allclose(linear, (1 - share) * left + share * right, atol=1e-10)


@given(signals(), clocks(smallest=2))
def test_averages_are_the_integral_of_what_sample_returns(signal, edges):
    total = averages(signal, edges) * np.diff(edges)[:, None]
    for k in range(len(edges) - 1):
        expected = integral_by_brute_force(signal, edges[k], edges[k + 1])
        assert_allclose(total[k], expected, atol=1e-11)


@given(clocks(), st.floats(-1e6, 1e6), st.sampled_from(HOLDS), clocks(smallest=2))
def test_a_constant_stays_exactly(time, constant, hold, edges):
    signal = Signal(time, np.full((len(time), 2), constant), hold)
    assert_array_equal(averages(signal, edges), np.full((len(edges) - 1, 2), constant))
    assert_array_equal(sample(signal, edges), np.full((len(edges), 2), constant))


@given(signals(), st.floats(-1e6, 1e6))
def test_all_clocks_may_count_from_another_instant(signal, shift):
    edges = np.linspace(signal.time[0] - 1.0, signal.time[-1] + 1.0, 7)
    later = signal._replace(time=signal.time + shift)
    assert_allclose(averages(later, edges + shift), averages(signal, edges), atol=1e-6)


@given(signals(), st.floats(-5, 5), st.floats(0, 10))
def test_cut_keeps_the_samples_of_the_span_and_nothing_else(signal, start, length):
    inside = (signal.time >= start) & (signal.time <= start + length)
    if not inside.any():
        span = f"the signal spans {signal.time[0]:g} to {signal.time[-1]:g} s"
        with assert_refused(re.escape(span)):
            cut(signal, start, start + length)
        return
    part = cut(signal, start, start + length)
    assert_array_equal(part.time, signal.time[inside])
    assert_array_equal(part.value, signal.value[inside])
    assert part.hold == signal.hold


def test_lists_are_as_good_as_arrays():
    lists = Signal([0, 1, 3], [[0], [2], [4]])
    arrays = Signal(np.array([0.0, 1.0, 3.0]), np.array([[0.0], [2.0], [4.0]]))
    assert_array_equal(sample(lists, [0.5, 2]), sample(arrays, [0.5, 2]))
    assert_array_equal(averages(lists, [0, 2]), averages(arrays, [0, 2]))
    assert_array_equal(cut(lists, 0, 1).value, cut(arrays, 0, 1).value)


@pytest.mark.parametrize("edges", [[0.0, 0.0], [0.0, 1.0, 0.5], [0.0, np.nan]])
def test_edges_that_do_not_increase_are_refused(edges):
    with assert_refused("edges of averages must increase"):
        averages(Signal(np.arange(2.0), np.ones((2, 1))), edges)


def test_an_unknown_hold_is_refused():
    with assert_refused("hold must be .* not 'next'"):
        sample(Signal(np.arange(2.0), np.ones((2, 1)), "next"), [0.5])
