"""Laws of signal integrals: windows, pieces and averages agree, whatever the hold and the delay."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frictionid.data.integrals import averages, integrals_of, pieces_of, window_means
from frictionid.data.signals import Signal

HOLDS = ("linear", "previous")


def signal(seed, hold, samples=40):
    rng = np.random.default_rng(seed)
    time = 5.0 + np.cumsum(rng.uniform(0.01, 0.05, samples))
    return Signal(time, rng.standard_normal((samples, 2)), hold)


@pytest.mark.parametrize("hold", HOLDS)
def test_delayed_window_means_are_the_averages_over_earlier_edges(hold):
    logs = [signal(0, hold), signal(4, hold, 25)]
    start = np.array([4.9, 5.2, 5.4])  # the first before the log begins, the last beyond its end
    stop, recording = start + np.array([0.3, 0.1, 2.0]), np.array([0, 1, 1])
    delays = np.array([-0.05, 0.0, 0.12])
    means = window_means(integrals_of(logs), recording, start, stop, delays)
    for d, delay in enumerate(delays):
        for k in range(3):
            one = averages(logs[recording[k]], [start[k] - delay, stop[k] - delay])[0]
            assert_allclose(means[d, k], one, atol=1e-12)


@pytest.mark.parametrize("hold", HOLDS)
def test_pieces_have_the_averages_and_moments_of_the_signal(hold):
    log = signal(1, hold)
    edges = np.array([5.1, 5.13, 5.3, 5.9])
    pieces = pieces_of(integrals_of([log]), np.array([0]), edges[None])
    assert_allclose(pieces.mean[:, 0], averages(log, edges), atol=1e-12)
    for k, (a, b) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        fine = np.linspace(a, b, 20001)
        value, middle = averages(log, fine), (fine[1:] + fine[:-1]) / 2
        deviation = value - pieces.mean[k, 0]
        moment = (deviation * (b - middle)[:, None]).sum(0) * (fine[1] - fine[0])
        assert_allclose(pieces.moment[k, 0], moment, atol=1e-8)


@pytest.mark.parametrize("hold", HOLDS)
def test_the_derivatives_by_the_delay_are_those_of_differences(hold):
    log = integrals_of([signal(2, hold)])
    edges, step = np.array([[5.1, 5.13, 5.3, 5.9]]), 1e-6
    late, early = (pieces_of(log, np.array([0]), edges - s) for s in (step, -step))
    now = pieces_of(log, np.array([0]), edges)
    assert_allclose((late.mean - early.mean) / (2 * step), now.mean_later, atol=1e-4)
    change = (late.moment - early.moment) / (2 * step)
    assert_allclose(change, now.moment_later, atol=1e-4)


def test_a_linear_map_of_the_columns_maps_every_integral():
    log = signal(3, "linear")
    matrix = np.array([[0.0, 2.0], [-1.0, 0.5]])
    mapped = integrals_of([log]).mapped(matrix)
    edges = (np.zeros(1, int), np.array([5.2]), np.array([5.4]))
    one = window_means(integrals_of([log]), *edges)
    assert_allclose(window_means(mapped, *edges), one @ matrix.T, atol=1e-12)
