"""Steps within bounds, and minima of several fits at once: SciPy's, and each as alone."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import least_squares, lsq_linear

from frictionid.fitting.gauss_newton import Conditions, bounded, box_step, minimum


@pytest.mark.parametrize("N", [1, 4, 8, 12])
def test_quadratic_problems_within_bounds_are_solved_as_scipy_does(N):
    rng = default_rng(N)
    A = rng.normal(size=(50, 2 * N, N)) * 10.0 ** rng.uniform(-2, 2, N)
    A[:, :, 0] = A[:, :, -1] + 1e-3 * A[:, :, 0]  # nearly the same column twice
    b = rng.normal(size=(50, 2 * N))
    low = -np.abs(rng.normal(size=(50, N))) * (rng.uniform(size=(50, N)) < 0.7)
    free = rng.uniform(size=(50, N)) < 0.5
    high = np.where(free, np.inf, 1e-3 + np.abs(rng.normal(size=(50, N))))
    d = bounded(np.swapaxes(A, 1, 2) @ A, np.einsum("bki,bk->bi", A, b), low, high)
    assert ((low <= d) & (d <= high)).all()
    for i in range(50):
        exact = lsq_linear(A[i], b[i], (low[i], high[i]), method="bvls", tol=1e-14, max_iter=999)
        assert np.sum((A[i] @ d[i] - b[i]) ** 2) <= 2 * exact.cost * (1 + 1e-9)


def test_columns_that_are_nearly_alike_do_not_send_the_pivots_in_circles():
    rng = default_rng(1)
    for N in (3, 5, 8):
        A = rng.normal(size=(500, N + 1, N))
        A[:, :, 1:] += rng.uniform(0, 30, (500, 1, 1)) * A[:, :, :1]
        H, g = np.swapaxes(A, 1, 2) @ A, 10 * rng.normal(size=(500, N))
        low = -np.abs(rng.normal(size=(500, N))) * (rng.uniform(size=(500, N)) < 0.5)
        high = 1e-3 + np.abs(rng.normal(size=(500, N)))
        d = bounded(H, g, low, high)
        slope = (g - np.einsum("bij,bj->bi", H, d)) / np.abs(g).max(axis=1, keepdims=True)
        assert (slope[d > low] > -1e-7).all()
        assert (slope[d < high] < 1e-7).all()


def test_what_has_no_influence_stays_and_what_stands_beside_does_not_matter():
    H = np.array([[[2.0, 0.0], [0.0, 0.0]], [[1.0, 0.5], [0.5, 1.0]]])
    g, wide = np.array([[1.0, 0.0], [3.0, 1.0]]), np.full((2, 2), 9.0)
    both = bounded(H, g, -wide, wide)
    assert_allclose(both[0], [0.5, 0.0])
    for i in range(2):
        alone = bounded(H[i : i + 1], g[i : i + 1], -wide[:1], wide[:1])
        assert_array_equal(both[i], alone[0])


def test_steps_do_not_depend_on_units():
    rng = default_rng(2)
    A, g = rng.normal(size=(20, 8, 4)), rng.normal(size=(20, 4))
    H, wide = np.swapaxes(A, 1, 2) @ A, np.full((20, 4), 0.5)
    units = 10.0 ** np.array([-6, 0, 3, 9])
    plain = box_step(H, g, -wide, wide, 0.1)
    other = box_step(H / np.outer(units, units), g / units, -wide * units, wide * units, 0.1)
    assert_allclose(other / units, plain, rtol=1e-6, atol=1e-12)


class Decay:
    """A measured decay y (K,) at times t (K,), e = y - a exp(-b t), with parameters (a, b)."""

    t = np.linspace(0.0, 3.0, 30)

    def __init__(self, y):
        self.y = y

    def residual(self, x):
        return self.y - x[:, :1] * np.exp(-x[:, 1:] * self.t)

    def cost(self, residual, weights):
        return (weights * residual**2).sum(axis=1)

    def normal_equations(self, x, residual, weights):
        shape = np.exp(-x[:, 1:] * self.t)
        J = np.stack([shape, -x[:, :1] * self.t * shape], axis=-1)
        weighted = J * weights[..., None]
        return np.einsum("fkp,fk->fp", weighted, residual), np.swapaxes(weighted, 1, 2) @ J

    def possible(self, x):
        return x


def decay_of(seed, low, high):
    """One noisy decay, and the conditions of its fit with a prior of the rate."""
    rng = default_rng(seed)
    y = 2.0 * np.exp(-1.3 * Decay.t) + 0.1 * rng.normal(size=30)
    ends = (np.array([end]) for end in (low, high, [0.0, 1.0], [0.0, 3.0]))
    return Decay(y), Conditions(rng.uniform(0.5, 2.0, (1, 30)), *ends, np.zeros(1))


@pytest.mark.parametrize("high", [np.inf, 1.1], ids=["free", "bounded"])
@pytest.mark.parametrize("seed", range(4))
def test_a_minimum_within_bounds_is_scipys(seed, high):
    problem, under = decay_of(seed, [0.0, 0.0], [np.inf, high])
    end = minimum(problem, np.array([[0.5, 0.1]]), under, 100, tolerance=1e-14)

    def rows(x):
        e = np.sqrt(under.weights[0]) * problem.residual(x[None])[0]
        return np.append(e, np.sqrt(3.0) * (x[1] - 1.0))

    exact = least_squares(rows, [0.5, 0.1], bounds=(0.0, [np.inf, high]), xtol=1e-14, ftol=1e-14)
    assert_allclose(end.x[0], exact.x, rtol=1e-6)
    assert end.converged.all() and end.iterations < 30
    assert_array_equal(end.residual, problem.residual(end.x))


def test_fits_that_end_sooner_are_as_alone():
    begins = np.array([[2.0, 1.3], [20.0, 0.0], [0.1, 5.0]])
    problem, under = decay_of(0, [0.0, 0.0], [np.inf, np.inf])
    three = Conditions(*(np.repeat(field, 3, axis=0) for field in under))
    together = minimum(problem, begins, three, 100, tolerance=1e-12)
    for x, begin in zip(together.x, begins, strict=True):
        alone = minimum(problem, begin[None], under, 100, tolerance=1e-12)
        assert alone.iterations <= together.iterations
        assert_allclose(x, alone.x[0], rtol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_parameters_without_room_are_as_if_they_were_not_there(seed):
    """Most of them fixed, and all nearly alike: the others are where the smaller problem is."""
    rng = default_rng(seed)
    J = rng.normal(size=(600, 20)) @ rng.normal(size=(20, 200)) + 0.01 * rng.normal(size=(600, 200))
    H, g = J.T @ J, J.T @ rng.normal(size=600)
    room = rng.random(200) < 0.15
    low, high = np.where(room, -0.5, 0.0), np.where(room, 0.5, 0.0)
    d = bounded(H[None], g[None], low[None], high[None])[0]
    at = np.flatnonzero(room)
    small = bounded(H[None][:, at[:, None], at], g[None, at], low[None, at], high[None, at])[0]
    assert not d[~room].any()
    assert_allclose(d[at], small, atol=1e-6)
