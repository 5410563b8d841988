"""The calibration of one fit in another; blocks of sensors that show nothing."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from fixtures import tiny_pendulums as tiny
from fixtures.changed_data import changed
from fixtures.refusals import assert_refused
from fixtures.true_curves import plain_friction
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.comparison.fit_model import fit_model
from frictionid.comparison.suite import Suite
from frictionid.comparison.suite_recipes import RecipeEntry, recipe_of, recipes_of
from frictionid.data.servo import Servo
from frictionid.data.signals import Signal
from frictionid.fitting.covariance import least_significant
from frictionid.fitting.fit import Covariance
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL
from frictionid.fitting.parameter_block import Parameter
from frictionid.fitting.parameters import BiasBlock, DelayBlock, FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import CalibratedRecipe, Settings, Shooting, refine
from frictionid.fitting.shooting.recipe import known_calibration
from frictionid.fitting.shooting.refine import NOT_FREE
from frictionid.fitting.shooting.settings import DEFAULT_BLOCKS, applicable
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.friction.model_files import load_model, save_model
from frictionid.simulate import Camera, Rig, Run, simulate

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


# --- Blocks that show nothing ---------------------------------------------------------------------

START = Friction(CoulombViscous(), [[0.02, 0.002]])
BRIEF = Settings(windows=(0.1, 0.3))


def covariance_of(values, error, freedom=9, prior=np.inf):
    """Covariance of a torque delay and the torque biases of two joints."""
    parameters = (
        Parameter("delay", "torque delay", "s", values[0], tolerance=prior),
        Parameter("bias", "torque bias of joint 1", "N m", values[1], place=(0,)),
        Parameter("bias", "torque bias of joint 2", "N m", values[2], place=(1,)),
    )
    D = len(parameters)
    return Covariance(
        *(parameters, np.array(values), np.diag(np.square(error)), freedom, np.ones(D)),
        *((), np.zeros(D, dtype=bool), freedom + 1, np.zeros(D, dtype=bool)),
    )


def test_the_least_significant_block_is_named():
    blocks = (BiasBlock(), DelayBlock())
    found = least_significant(covariance_of((0.01, 0.1, 0.1), (0.02, 0.08, 0.2)), blocks, 0.05)
    assert found.block == "delay"
    assert found.p_value == pytest.approx(0.629, abs=0.001)  # two-sided t(9) beyond 0.5
    assert least_significant(covariance_of((0.1, 1.0, 0.0), (0.02, 0.1, 0.1)), blocks, 0.05) is None
    lost = covariance_of((0.1, 1.0, 0.0), (0.02, np.inf, 0.1))
    assert least_significant(lost, blocks, 0.05) == ("bias", 1.0)
    known = covariance_of((0.0, 1.0, 0.0), (0.02, 0.1, 0.1), prior=0.001)
    assert least_significant(known, blocks, 0.05) is None


def test_p_values_of_ideal_sensors_are_uniform():
    """Of estimates that scatter by their own standard errors, 400 draws."""
    rng = np.random.default_rng(0)
    p = []
    for _ in range(400):
        scale = np.sqrt(rng.chisquare(9) / 9)
        own = covariance_of(tuple(rng.standard_normal(3)), scale * np.ones(3))
        p.append(least_significant(own, (BiasBlock(),), -1.0).p_value)
    assert abs(np.mean(np.array(p) < 0.05) - 0.05) < 0.03
    assert abs(np.mean(p) - 0.5) < 0.05


def test_what_shows_nothing_is_left_out_as_if_it_had_never_been_offered():
    data = tiny.dataset()
    offered = (FrictionBlock(), BiasBlock())
    found = refine(START, data, offered, BRIEF)
    assert [own.block for own in found.diagnostics.dropped] == ["bias"]
    alone = refine(START, data, (FrictionBlock(),), BRIEF)
    off = np.abs(found.friction.theta - alone.friction.theta).ravel()
    assert (off < 0.1 * alone.covariance.error).all()  # two ways there, each to 0.05
    kept = refine(START, data, offered, replace(BRIEF, significance=1.0))
    assert not kept.diagnostics.dropped
    assert len(kept.covariance.parameters) == 3


def test_by_default_the_delay_is_offered_where_a_torque_is_sampled_and_stays_where_it_is_late():
    late = tiny.dataset(recordings=tiny.late(LATE))
    found = refine(START, late, settings=BRIEF)
    assert float(found.calibration.delay) == pytest.approx(LATE, abs=1e-3)
    assert "bias" in [own.block for own in found.diagnostics.dropped]
    recipe = recipe_of(RecipeEntry(name="shooting", by="shooting"))
    assert recipe.blocks == Shooting().blocks == DEFAULT_BLOCKS
    offered = [b.name for b in applicable(DEFAULT_BLOCKS, late)]
    assert offered == ["friction", "inertia", "delay", "bias"]


def test_by_default_nothing_is_offered_that_no_recording_shows():
    still = tiny.still()
    goal, on = (Signal(r.angle.time, np.ones((len(r.angle.time), 1))) for r in still[:2])
    servo = Servo(goal, on, gain=4.0, limit=1.0, supply=7.0, kt=0.4, R=4.0)
    driven = tuple(replace(r, servo=servo) for r in tiny.recordings())
    off = replace(servo, enabled=on._replace(value=0.0 * on.value))
    loose = tuple(replace(r, servo=off) for r in still)
    for recordings, beside in ((still, ["offset"]), (driven, []), (loose, ["offset"])):
        offered = applicable(DEFAULT_BLOCKS, tiny.dataset(recordings=recordings))
        assert [b.name for b in offered] == ["friction", "inertia", *beside]


@pytest.mark.parametrize("zero", [0.0, 0.01], ids=str)
def test_where_no_motor_drives_a_zero_that_is_off_is_found_by_default(zero):
    """It would be a torque of gravity that changes sides with no velocity, as levels by side do."""
    machine = {"kind": "pendulum", "driven": False, "parameters": tiny.PENDULUM["parameters"]}
    runs = tuple(Run(f"{k}", (0.5 + 0.3 * k,)) for k in range(4))
    friction, camera = plain_friction(0.03, 0.004), Camera(300, 60.0, 1e-3)
    data = simulate(Rig("p", machine, friction, camera, runs, substeps=2))
    data = changed(data, "angle", lambda q: q + zero)
    fit = refine(START, data, settings=BRIEF)
    blocks = [p.block for p in fit.covariance.parameters]
    assert ("offset" in blocks) == (zero > 0.0)
    names = [p.name for p in fit.covariance.parameters if p.block == "inertia"]
    assert names == ["inertia"]  # only its ratio to gravity shows
    off = np.abs(float(fit.calibration.offset[0]) - zero)
    assert off == 0.0 or off < 3.0 * fit.covariance.error[blocks.index("offset")]
    errors = fit.covariance.error[[block == "friction" for block in blocks]]
    assert (np.abs(fit.friction.theta[0] - [0.03, 0.004]) < 4.0 * errors).all()


@pytest.mark.parametrize("zero", [0.0, 0.05], ids=str)
def test_where_a_motor_drives_a_zero_is_free_where_it_would_show(zero):
    """As by a tilted base, of which a bias of the torque takes up but the mean."""
    data = changed(tiny.dataset(), "angle", lambda q: q + zero)
    fit = refine(START, data, settings=BRIEF)
    blocks = [p.block for p in fit.covariance.parameters]
    assert ("offset" in blocks) == (zero > 0.0) and "bias" not in blocks
    if zero:
        error = fit.covariance.error[blocks.index("offset")]
        assert abs(float(fit.calibration.offset[0]) - zero) < 3.0 * error < 0.01
    assert not any(NOT_FREE in words for words in fit.diagnostics.warnings)


def test_no_bias_is_offered_beside_levels_of_each_direction():
    """Both say the same: u + b, and levels that differ by 2 b."""
    names = {
        symmetric: [b.name for b in applicable(DEFAULT_BLOCKS, tiny.dataset(), law)]
        for symmetric in (True, False)
        for law in [CoulombViscous(symmetric=symmetric)]
    }
    assert set(names[True]) - set(names[False]) == {"bias"}
