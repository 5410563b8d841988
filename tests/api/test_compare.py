"""A comparison under `import frictionid` gives what the function behind it gives."""

from dataclasses import replace

import numpy as np
from fixtures import compared
from fixtures.tiny_pendulums import dataset
from numpy.testing import assert_array_equal

import frictionid
from frictionid.api.evaluate import training_notes
from frictionid.api.models import identifier_of
from frictionid.comparison.suite_recipes import usual_recipe
from frictionid.evaluation import Protocol, make_folds
from frictionid.friction import Friction
from frictionid.friction.laws import NoFriction
from frictionid.friction.provenance import Provenance


def test_a_comparison_of_a_mapping_gives_the_results_of_cross_validation():
    data = dataset()
    folds = make_folds(data.recordings, frictionid.Split(count=3))
    models = {"coulomb": frictionid.LeastSquares(frictionid.CoulombViscous())}
    before = compared.compare(data, models, folds, protocol=Protocol(horizons=(0.3,)))
    now = frictionid.compare(data, models, folds, "integral", horizons=[0.3])
    for key, result in before.items():
        score = ("rollout_angle", "median", 0.3)
        assert now[key].value(*score) == result.value(*score)
        assert_array_equal(now[key].friction.theta, result.overall.theta)
        assert_array_equal(now[key].folds.theta, result.friction.theta)


def test_all_models_of_a_comparison_are_fitted_alike():
    """As one fit is, where that goes for all; else in one step, calibrated by physics."""
    data, laws = frictionid.load_dataset("acrobot_clean"), ["none", "stribeck", frictionid.SINDy()]
    for models, recipe in (
        (laws, "shooting"),
        ([*laws, "lstm"], "calibrated"),
        ([*laws, "blackbox_mlp"], "integral"),
    ):
        assert usual_recipe(data, [identifier_of(model) for model in models]) == recipe


def test_the_file_of_a_robot_is_no_training_data():
    data = frictionid.load_dataset("acrobot_clean")
    source = Provenance(data={"run1.csv": "1f", "arm.urdf": "c0"})
    friction = Friction(NoFriction(), np.zeros((2, 0)), provenance=source)
    for file, digest, seen in (("run2.csv", "2f", False), ("run1.csv", "1f", True)):
        scored = replace(data, hashes={file: digest, "arm.urdf": "c0"})
        (note,) = [*training_notes({"mine": friction}, scored)] or [""]
        assert ("fitted to 1 of the 1 files" in note) == seen == bool(note)
