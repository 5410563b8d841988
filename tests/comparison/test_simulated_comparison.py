"""What the recipes reach on the simulated acrobot whose friction is known."""

from dataclasses import replace

from fixtures.exact_problems import everything
from fixtures.paths import DATA
from fixtures.true_curves import curve_errors

from frictionid import load_dataset
from frictionid.data.plants import plant_of
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY, Recipe, training_problem
from frictionid.friction.laws import Stribeck
from frictionid.simulate import load_rig, noise_free, simulate


def errors(dataset, recipe):
    """Curve error of each joint, fitted to all recordings."""
    problem = training_problem(dataset, plant_of(dataset), recipe)
    law = LeastSquares(Stribeck(symmetric=False))
    return curve_errors(law.fit(problem, everything(problem), 0)[0], dataset)


def test_noise_free_motion_gives_the_curves_to_two_percent():
    rig = load_rig(DATA / "acrobot_clean/rig.toml")
    twin = simulate(noise_free(replace(rig, recordings=rig.recordings[::5], substeps=4)))
    assert (errors(twin, INTEGRAL) < 0.02).all()


def test_with_noise_our_errors_are_at_most_0_6_of_the_studys_and_the_stiction_mask_makes_them_so():
    """The same recipe that fits all rows alike is far off: its friction at rest is no law."""
    data = load_dataset(DATA / "acrobot_clean")  # the right torque clock and inertias
    alike = Recipe("alike", INTEGRAL.states, INTEGRAL.scheme, velocity_threshold=0.0)
    ours, study, unmasked = (errors(data, recipe) for recipe in (INTEGRAL, STUDY, alike))
    assert (ours <= 0.6 * study).all() and (ours < 0.7 * unmasked).all()
