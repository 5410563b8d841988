"""One model fitted to a whole data set: the same friction as in a comparison, with provenance."""

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from fixtures.tiny_pendulums import TRUTH, dataset, recordings
from numpy.testing import assert_allclose

from frictionid.comparison.cross_validate import Benchmark, run
from frictionid.comparison.fit_model import fit_model
from frictionid.evaluation import Protocol, Split, make_folds, true_friction
from frictionid.fitting.identifiers import BlackBox, LeastSquares, Published, SparseDynamics
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY
from frictionid.fitting.parameters import DelayBlock, FrictionBlock
from frictionid.fitting.shooting import CalibratedRecipe, Settings, Shooting
from frictionid.friction.laws import CoulombViscous

DATA = dataset(recordings=recordings()[:4])
FIT = LeastSquares(CoulombViscous())
SHOOTING = Shooting(
    blocks=(FrictionBlock(), DelayBlock()),
    settings=Settings(windows=(0.2,), iterations=4, significance=1.0),
)
CALIBRATED = CalibratedRecipe("corrected", INTEGRAL, SHOOTING, FIT, use=("delay",))


@pytest.mark.parametrize(
    "recipe", [STUDY, INTEGRAL, SHOOTING, CALIBRATED], ids=lambda recipe: recipe.name
)
def test_it_is_the_friction_that_a_comparison_fits_to_all_data(recipe):
    folds = make_folds(DATA.recordings, Split(count=2))
    compared = run(Benchmark(DATA, folds, Protocol((0.3,))), FIT, recipe).overall
    friction = fit_model(DATA, FIT, recipe)
    assert_allclose(friction.theta, compared.theta, rtol=1e-9)
    if recipe.needs_intervals:
        delay = compared.calibration.delay
        assert friction.calibration.delay == pytest.approx(delay, rel=1e-9) and delay != 0.0
    else:
        assert friction.calibration is None


def test_its_provenance_names_data_identifier_and_recipe():
    friction = fit_model(DATA, FIT, SHOOTING, seed=3)
    source = friction.provenance
    assert (source.dataset, source.seed) == (DATA.name, 3)
    assert source.identifier == repr(FIT) and source.recipe == repr(SHOOTING)
    (value,) = [e.value for e in source.refined.parameters if e.block == "delay"]
    assert value == friction.calibration.delay


def test_given_friction_is_refined_where_the_recipe_shoots():
    given = Published(true_friction(TRUTH))
    assert np.array_equal(fit_model(DATA, given).theta, given.friction.theta)
    refined = fit_model(DATA, given, SHOOTING)
    assert refined.calibration is not None
    assert not np.array_equal(refined.theta, given.friction.theta)


def test_models_without_a_mechanism_cannot_be_refined():
    box = BlackBox(SparseDynamics(degree=1))
    assert fit_model(DATA, box).mechanism == "unit"
    with assert_refused("shooting needs the physics"):
        fit_model(DATA, box, SHOOTING)
