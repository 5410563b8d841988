"""What commands do is there in Python under `import frictionid`; earlier names still work."""

from dataclasses import replace

import numpy as np

import frictionid
from frictionid.api.check import FirstVerdict
from frictionid.comparison import cross_validate
from frictionid.comparison.fit_model import fit_model
from frictionid.evaluation.predicted_motion import predicted_motion
from frictionid.quickstart.quick import Quick


def test_the_functions_behind_the_commands_are_at_the_top():
    assert frictionid.fit_model is fit_model
    assert frictionid.predicted_motion is predicted_motion
    commands = {"check", "fit", "compare", "evaluate", "predict", "quick", "simulate", "suggest"}
    assert {*commands, "fit_model", "predicted_motion"} <= set(dir(frictionid))


def test_a_first_verdict_has_all_that_it_had():
    assert issubclass(FirstVerdict, Quick)


def test_a_comparison_of_a_mapping_gives_the_results_that_it_gave():
    data = frictionid.load_dataset("acrobot_clean")
    data = replace(data, recordings=data.recordings[:6])
    folds = frictionid.make_folds(data.recordings, frictionid.Split(count=3))
    models = {"coulomb": frictionid.LeastSquares(frictionid.CoulombViscous())}
    protocol = frictionid.Protocol(horizons=(0.5,))
    before = cross_validate.compare(data, models, folds, protocol=protocol)
    now = frictionid.compare(data, models, folds, protocol=protocol)
    for key, result in before.items():
        of = ("rollout_angle", "median", 0.5)
        assert now[key].value(*of) == result.value(*of)
        np.testing.assert_array_equal(now[key].friction.theta, result.overall.theta)
        np.testing.assert_array_equal(now[key].folds.theta, result.friction.theta)
