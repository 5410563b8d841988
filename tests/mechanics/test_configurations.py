"""Positions that stand for all fill the space, and stay few."""

import numpy as np
import pytest

from frictionid.mechanics import configurations


@pytest.mark.parametrize("n", [1, 2])
def test_few_joints_have_a_grid(n):
    grid = np.linspace(-np.pi, np.pi, 5)
    assert len(configurations(n, 5)) == 5**n
    np.testing.assert_allclose(np.unique(configurations(n, 5)), grid)


@pytest.mark.parametrize("n", [3, 7])
def test_many_joints_are_filled_evenly(n):
    q = configurations(n, 13)
    assert len(q) == 512 and (np.abs(q) <= np.pi).all()
    assert (q[0] == 0).all()
    for column in q.T:  # each joint by itself, and each pair by quarters
        assert np.histogram(column, 16, (-np.pi, np.pi))[0].min() > 0.8 * 512 / 16
    for i in range(n):
        for j in range(i):
            count = np.histogram2d(q[:, i], q[:, j], 4, [(-np.pi, np.pi)] * 2)[0]
            assert 0.5 * 32 < count.min() and count.max() < 1.6 * 32
