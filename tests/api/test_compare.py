"""A comparison under `import frictionid` gives what the function behind it gives."""

from dataclasses import replace

import numpy as np

import frictionid
from frictionid.comparison import cross_validate


def test_a_comparison_of_a_mapping_gives_the_results_of_cross_validation():
    data = frictionid.load_dataset("acrobot_clean")
    data = replace(data, recordings=data.recordings[:6])
    folds = frictionid.make_folds(data.recordings, frictionid.Split(count=3))
    models = {"coulomb": frictionid.LeastSquares(frictionid.CoulombViscous())}
    protocol = frictionid.Protocol(horizons=(0.5,))
    before = cross_validate.compare(data, models, folds, protocol=protocol)
    now = frictionid.compare(data, models, folds, "integral", protocol=protocol)
    for key, result in before.items():
        score = ("rollout_angle", "median", 0.5)
        assert now[key].value(*score) == result.value(*score)
        np.testing.assert_array_equal(now[key].friction.theta, result.overall.theta)
        np.testing.assert_array_equal(now[key].folds.theta, result.friction.theta)
