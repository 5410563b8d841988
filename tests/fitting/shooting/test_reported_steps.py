"""Shooting says after each iteration how many are left, and fits the same unheard."""

import numpy as np
from fixtures.tiny_pendulums import dataset

from frictionid.fitting.parameters import FrictionBlock
from frictionid.fitting.shooting import Settings, refine
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.progress import listening

START = Friction(CoulombViscous(), np.array([[0.02, 0.002]]))


def test_every_iteration_is_heard_once():
    heard, settings = [], Settings(iterations=6)
    with listening(lambda *said: heard.append(said)):
        result = refine(START, dataset(), (FrictionBlock(),), settings)
    assert len(heard) == result.diagnostics.iterations
    begins = [k for k, (_, left) in enumerate(heard) if k == 0 or left >= heard[k - 1][1]]
    assert len(begins) == len(settings.windows) + 1  # the last length twice, coarse and fine
    for first, end in zip(begins, [*begins[1:], len(heard)], strict=True):
        left = [left for _, left in heard[first:end]]
        assert left == list(range(left[0], left[0] - len(left), -1)) and left[-1] >= 0
    unheard = refine(START, dataset(), (FrictionBlock(),), settings)
    np.testing.assert_array_equal(unheard.friction.theta, result.friction.theta)
