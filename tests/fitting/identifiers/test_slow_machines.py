"""Where rows of joints at rest are left out, numerical smoothing of sgn(w) changes no fit.

A slide is as slow in m/s as the smoothing is wide: a network that learned with it would brake twice
as much in the physics step, which goes round it.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.fitting.networks.compressed import CompressedNetwork
from frictionid.fitting.networks.network import Network
from frictionid.fitting.one_step.residual import mask_stiction
from frictionid.friction.laws import LSTM, MLP, Stribeck

SLOW = 0.01  # times as fast
IDENTIFIERS = {
    "least squares": (LeastSquares, Stribeck(), {}),
    "compressed squares": (CompressedNetwork, MLP((3,)), {"nodes": 6}),
    "static network": (Network, MLP((3,)), {"epochs": 2}),
    "recurrent network": (Network, LSTM(2, hidden=(2,)), {"epochs": 2}),
}


@pytest.mark.parametrize(("kind", "law", "settings"), IDENTIFIERS.values(), ids=IDENTIFIERS)
def test_a_slow_slide_is_fitted_whatever_the_width(kind, law, settings):
    problem = synthetic_problem(1)
    inputs = problem.nodes.inputs
    slow = problem.nodes._replace(inputs=inputs._replace(w=SLOW * inputs.w))
    masked = mask_stiction(replace(problem, nodes=slow, slowest=SLOW * problem.slowest), 0.2 * SLOW)
    fits = [
        kind(law.with_width(width), **settings).fit(masked, np.ones((1, len(masked.r))), 0)
        for width in (0.02, 0.001)
    ]
    assert_array_equal(fits[0].theta, fits[1].theta)
