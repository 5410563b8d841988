"""The residual over a tenth of a second: as long at the ends of a recording as elsewhere."""

import numpy as np
from numpy.testing import assert_allclose

from frictionid.deploy.monitor.changes import _local_means, _Rows


def test_noise_weighs_no_more_at_the_ends():
    """Half a window would double what a single row leaves there."""
    dt, rows = np.full(40, 0.02), np.eye(40)
    time = np.cumsum(dt)
    means = _local_means(rows, _Rows(rows, rows[..., None], time, dt, rows, np.zeros(40)))
    assert_allclose(means.max(axis=1), 10.0, rtol=0.25)
    assert_allclose((means**2).sum(axis=1), (means[20] ** 2).sum(), rtol=0.25)
