"""Shooting as part of comparisons: folds, suites, files and the command line."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from fixtures.changed_data import with_value
from fixtures.driven_pendulum import driven_pendulum
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from fixtures.result_folders import leave_blank
from numpy.testing import assert_allclose

from frictionid.comparison.cross_validate import Benchmark, prepare_benchmark, run
from frictionid.comparison.suite_recipes import CALIBRATED, RecipeEntry, recipe_of, recipes_of
from frictionid.errors import NoFitError
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.fitting.identifiers import Frictionless, LeastSquares
from frictionid.fitting.parameters import DelayBlock, FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import Settings, Shooting, refine_folds
from frictionid.fitting.shooting.sample_intervals import intervals_of
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.simulate import write_dataset

TRUE = np.array([[0.02, 0.002]])
BOTH = Shooting(
    blocks=(FrictionBlock(), InertiaBlock(), DelayBlock()), settings=Settings(windows=(0.2, 0.33))
)


@cache
def dataset():
    return driven_pendulum(120, delay=0.01)


@cache
def benchmark():
    folds = make_folds(dataset().recordings, Split(count=3))
    return Benchmark(dataset(), folds, Protocol(horizons=(0.25,)))


@pytest.fixture(scope="module")
def result():
    return run(benchmark(), LeastSquares(CoulombViscous()), BOTH)


def test_friction_inertia_and_delay_come_out_in_every_fold(result):
    theta, calibration = result.friction.theta, result.friction.calibration
    assert theta.shape == (3, 1, 2) and calibration.delay.shape == (3,)
    assert_allclose(theta[..., 0], TRUE[0, 0], rtol=0.06)
    assert_allclose(theta[..., 1], TRUE[0, 1], rtol=0.2)
    assert_allclose(calibration.delay, 0.01, atol=1.5e-3)
    assert_allclose(calibration.base, [[0.012, 0.5886]] * 3, rtol=0.02)


def test_it_predicts_better_than_the_one_step_fit_that_it_began_with(result):
    before = run(benchmark(), LeastSquares(CoulombViscous()), BOTH.start)
    scores = [r.value("rollout_angle_truth", "median", 0.25) for r in (result, before)]
    assert scores[0] < scores[1]
    errors = [np.abs(r.overall.theta - TRUE).max() for r in (result, before)]
    assert errors[0] < errors[1]


def test_a_fit_that_begins_with_its_calibration_ends_alike_and_sooner():
    begun = replace(BOTH, start=CALIBRATED)
    data = prepare_benchmark(benchmark(), [BOTH, begun]).training
    soon, late = (r.fit(LeastSquares(CoulombViscous()), data, 0) for r in (begun, BOTH))
    assert_allclose(soon.friction.theta, late.friction.theta, rtol=0.01)
    for part in ("delay", "base"):
        ends = [getattr(fit.friction.calibration, part) for fit in (soon, late)]
        assert_allclose(*ends, rtol=0.01)
    # a window with a kink that only one of them leaves out
    assert_allclose(soon.folds.theta, late.folds.theta, rtol=0.05)
    assert soon.diagnostics.iterations < 0.8 * late.diagnostics.iterations


def test_a_fold_is_blind_to_the_recordings_that_it_holds_out(result):
    fold = 1
    held = [i for i, label in enumerate(benchmark().folds.labels) if (label == fold).all()]
    changed = tuple(
        with_value(r, "angle", lambda q: 0.9 * q) if i in held else r
        for i, r in enumerate(dataset().recordings)
    )
    other = benchmark()._replace(dataset=replace(dataset(), recordings=changed))
    again = run(other, LeastSquares(CoulombViscous()), BOTH)
    error = result.refined.covariance.error[:2]
    off = np.abs(again.friction.theta[fold] - result.friction.theta[fold])[0]
    assert (off < 1e-6 * error).all()
    for name in ("base", "delay"):
        mine, other = (getattr(x.friction.calibration, name)[fold] for x in (result, again))
        assert_allclose(mine, other, rtol=1e-9)
    assert (np.abs(again.overall.theta - result.overall.theta)[0] > error).any()


def test_given_friction_stays_as_it_is():
    nothing = run(benchmark(), Frictionless(), BOTH)
    assert nothing.refined is None and nothing.friction.calibration is None


SUITE = """
name = "s"
initial_states = "model"
horizons = [0.25]
[folds]
count = 2
[[datasets]]
path = "data"
[[recipes]]
name = "integral"
[[recipes]]
name = "ours"
by = "shooting"
free = ["friction", "delay"]
windows = [0.33]
[[identifiers]]
kind = "coulomb_viscous"
"""


def test_a_suite_a_fit_and_an_evaluation_from_the_command_line(tmp_path, monkeypatch, run):
    leave_blank(monkeypatch)
    write_dataset(dataset(), tmp_path / "data")
    (tmp_path / "s.toml").write_text(SUITE)
    out = tmp_path / "out"
    assert run(tmp_path, "compare", tmp_path / "s.toml", "--out", out, "--jobs", 1)[0] == 0
    task = json.loads((out / "tasks/pendulum--coulomb_viscous--ours--seed0.json").read_text())
    delay = next(p for p in task["refined"]["parameters"] if p["block"] == "delay")
    assert delay["interval_95"][0] < 0.01 < delay["interval_95"][1]
    assert np.shape(task["refined"]["correlation"]) == (3, 3)
    model = out / "models/pendulum--coulomb_viscous--ours--seed0.json"
    scores = tmp_path / "e.csv"
    assert run(tmp_path, "evaluate", model, tmp_path / "data", "--out", scores)[0] == 0
    line = ("fit", tmp_path / "data", "--identifier", "coulomb_viscous", "--by", "shooting")
    free = ("--free", "friction,inertia,delay", "--out", tmp_path / "m.json")
    code, out, _ = run(tmp_path, *line, *free)
    assert code == 0 and "torque delay" in out
    kept = json.loads((tmp_path / "m.json").read_text())
    assert kept["calibration"]["delay"] == pytest.approx(0.01, abs=1.5e-3)


SENSELESS = r"""
free = ["fricton"] => block 'fricton' is unknown; did you mean 'friction'
free = ["friction", "friction"] => two blocks are called 'friction'
free = ["friction"]; fixed = ["inertia.x"] => of a free block
free = ["friction"]; fixed = ["coulomb"] => must be inertia.NAME or friction.NAME
free = ["friction"]; priors = {gain = 0.1} => prior of block 'gain', which is not
start = "shooting" => must be a one-step recipe, or
scheme = "euler" => scheme belongs to one-step recipes
windows = [0.3, 0.1] => must grow
by = ; name = "integral"; free = ["friction"] => free needs by = "shooting"
"""


@mistakes(SENSELESS)
def test_recipes_that_make_no_sense_are_refused_in_one_line(wrong, words):
    table = {"name": "ours", "by": "shooting", **changes(wrong)}
    with assert_refused(words):
        recipe_of(RecipeEntry(**table))


def test_a_recipe_says_what_is_free_fixed_and_known_beforehand():
    made = recipe_of(
        RecipeEntry(
            name="ours",
            by="shooting",
            free=["friction", "inertia", "gain"],
            fixed=["inertia.gravity", "friction.viscous"],
            priors={"gain": 0.02},
            windows=[0.1, 0.2],
            iterations=7,
        )
    )
    friction, inertia, gain = made.blocks
    assert friction.fixed == ("viscous",) and inertia.fixed == ("gravity",) and gain.prior == 0.02
    assert made.settings.windows == (0.1, 0.2) and made.settings.iterations == 7


def test_shooting_may_begin_with_a_one_step_recipe_of_its_suite():
    own = {"scheme": "integral", "velocity_threshold": 0.01, "states": {"kind": "rts"}}
    slow = RecipeEntry(name="slow", **own)
    ours = {"name": "ours", "by": "shooting"}
    first, second = recipes_of([slow, RecipeEntry(**ours, start="slow")])
    assert second.start == first and first.velocity_threshold == 0.01
    with assert_refused("recipe 'slo' is unknown; did you mean 'slow'"):
        recipes_of([slow, RecipeEntry(**ours, start="slo")])


def test_unknown_parameters_to_fix_are_named():
    recipe = recipe_of(RecipeEntry(name="ours", by="shooting", fixed=["friction.viscos"]))
    with assert_refused("has no parameter 'viscos' to fix"):
        run(benchmark(), LeastSquares(CoulombViscous()), recipe)


def test_a_fold_whose_fit_fails_keeps_what_it_began_with_and_costs_no_other_one():
    intervals = intervals_of(dataset())
    training = np.ones((3, len(intervals.dt)))
    training[:2] = intervals.recording[None] != np.arange(2)[:, None]
    theta = np.stack([TRUE * [[1.0, 1e12]], TRUE, TRUE])
    start = Friction(CoulombViscous(), theta)
    fit = refine_folds(start, intervals, BOTH, training)
    assert_allclose(fit.folds.theta[0], theta[0])
    assert_allclose(fit.folds.theta[1:, 0, 0], TRUE[0, 0], rtol=0.06)
    assert fit.folds.calibration.delay[0] == 0.0 != fit.folds.calibration.delay[1]
    (warning,) = (w for w in fit.diagnostics.warnings if "fold 0 keeps" in w)
    assert "substeps" in warning
    with pytest.raises(NoFitError):
        refine_folds(start[::-1], intervals, BOTH, training[::-1])
