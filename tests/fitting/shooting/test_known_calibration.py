"""The calibration of one fit in another: held, or free near it by its standard errors."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from fixtures import tiny_pendulums as tiny
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.comparison.fit_model import fit_model
from frictionid.comparison.suite import Suite
from frictionid.comparison.suite_recipes import recipes_of
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.formulation import INTEGRAL
from frictionid.fitting.parameters import DelayBlock, FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import CalibratedRecipe, Settings, Shooting
from frictionid.fitting.shooting.recipe import known_calibration
from frictionid.friction.laws import CoulombViscous
from frictionid.friction.model_files import load_model, save_model

LATE = 0.012  # [s]
FIT = LeastSquares(CoulombViscous())
SHORT = Settings(windows=(0.2,), iterations=6, significance=1.0)
FRICTION = (FrictionBlock(),)
BOTH = Shooting(blocks=(FrictionBlock(), InertiaBlock(), DelayBlock()), settings=SHORT)
BASE = (tiny.INERTIA, tiny.GRAVITY)


def data(first, last):
    """Some of the pendulums, whose torque is late and whose nominal mass is wrong."""
    return tiny.dataset(recordings=tiny.late(LATE)[first:last], mechanism=tiny.heavier(1.2))


@cache
def first_fit():
    return fit_model(data(0, 9), FIT, BOTH)


def parameters_of(friction):
    return {e.name: e for e in friction.provenance.refined.parameters}


def test_what_is_known_is_held():
    known = known_calibration(first_fit(), "model")
    assert_allclose(known.calibration.base, BASE, rtol=0.05)
    held = fit_model(data(9, 12), FIT, Shooting(blocks=FRICTION, settings=SHORT, held=known))
    assert_array_equal(held.calibration.base, known.calibration.base)
    assert held.calibration.delay == known.calibration.delay
    assert set(parameters_of(held)) == {"coulomb of joint 1", "viscous of joint 1"}
    own = fit_model(data(9, 12), FIT, Shooting(blocks=FRICTION, settings=SHORT))
    off = [abs(f.curve(np.array([5.0]))[0, 0] / tiny.true_torque(5.0) - 1) for f in (held, own)]
    assert off[0] < 0.05 < off[1]


def test_free_blocks_have_the_standard_errors_as_priors():
    known, before = known_calibration(first_fit(), "model"), parameters_of(first_fit())
    few = data(9, 11)
    alone = parameters_of(fit_model(few, FIT, BOTH))
    near = parameters_of(fit_model(few, FIT, replace(BOTH, held=known)))
    for name in ("inertia", "gravity", "torque delay"):
        prior, own, found = (p[name] for p in (before, alone, near))
        assert found.prior == pytest.approx(prior.error)
        assert own.prior is None
        assert abs(found.value - prior.value) < abs(own.value - prior.value)
    assert near["coulomb of joint 1"].prior is None


def test_a_one_step_fit_under_a_known_calibration_is_that_of_the_calibrated_recipe():
    some = data(0, 4)
    by = Shooting(blocks=(*FRICTION, DelayBlock()), settings=SHORT)
    estimated = CalibratedRecipe("own", INTEGRAL, by, FIT, use=("delay",))
    known = known_calibration(fit_model(some, FIT, by), "model")
    given = CalibratedRecipe(
        "given", INTEGRAL, Shooting(blocks=(), held=known), FIT, use=("delay",)
    )
    thetas = [fit_model(some, FIT, recipe).theta for recipe in (estimated, given)]
    assert_allclose(*thetas, rtol=1e-9)


def test_calibrations_of_no_machine_or_another_one_are_refused():
    with assert_refused("one-step has no calibration: fit it by shooting"):
        known_calibration(fit_model(data(0, 4), FIT), "one-step")
    known = known_calibration(first_fit(), "model")
    other = replace(known, calibration=replace(known.calibration, base=np.ones(3)))
    with assert_refused("1 joints with 3 base parameters, pendulum has 1 and 2"):
        fit_model(data(0, 4), FIT, Shooting(blocks=FRICTION, settings=SHORT, held=other))


def test_fit_takes_the_calibration_of_a_model_file(tmp_path, run):
    tiny.write_dataset(tmp_path / "tiny")
    save_model(first_fit(), tmp_path / "first.json")
    words = ("fit", "tiny", "--identifier", "coulomb_viscous", "--calibration", "first.json")
    code, out, err = run(tmp_path, *words, "--out", "second.json")
    assert (code, err) == (0, "")
    read = known_calibration(load_model(tmp_path / "second.json"), "second")
    assert_allclose(read.calibration.base, first_fit().calibration.base)
    words = (*words, "--by", "shooting", "--windows", "0.2", "--iterations", "3")
    code, out, err = run(tmp_path, *words, "--out", "third.json")
    assert code == 0 and "torque delay" not in out
    code, out, err = run(tmp_path, *words[:4], "--by", "one_step", "--out", "plain.json")
    words = (*words[:5], "plain.json", "--out", "fourth.json")
    code, out, err = run(tmp_path, *words)
    assert (code, out) == (2, "") and "plain.json has no calibration" in err


def test_a_suite_names_the_model_file_from_its_folder(tmp_path):
    save_model(first_fit(), tmp_path / "first.json")
    tables = [
        {"name": "held", "by": "shooting", "known": "first.json"},
        {"name": "corrected", "like": "integral", "known": "first.json"},
    ]
    suite = Suite.model_validate(tiny.suite([("recipes", tables)]))
    held, corrected = recipes_of(suite.recipes, tmp_path)
    assert [b.name for b in held.blocks] == ["friction"]
    for known in (held.held, corrected.by.held):
        assert_allclose(known.calibration.base, first_fit().calibration.base)
        assert {name for name, _ in known.errors} == {"inertia", "gravity", "torque delay"}
