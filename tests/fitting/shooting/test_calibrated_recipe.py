"""Recipes on corrected data: a late torque is found and taken away, and is no memory any more."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from fixtures import tiny_pendulums as tiny
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.comparison.cross_validate import Benchmark, prepare_benchmark, run
from frictionid.comparison.result_folder import write_sealed
from frictionid.comparison.suite import load_suite, tasks_of
from frictionid.comparison.suite_recipes import CALIBRATED, RecipeEntry, recipes_of
from frictionid.comparison.tasks import Task, content_of, prepare_benchmarks
from frictionid.evaluation import Protocol, Split, make_folds, training_of, with_calibration
from frictionid.fitting.identifiers import Flexible, Frictionless, LeastSquares, SINDy
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY
from frictionid.fitting.parameters import BiasBlock, DelayBlock, FrictionBlock
from frictionid.fitting.shooting import CalibratedRecipe, Settings, Shooting
from frictionid.friction.laws import CoulombViscous
from frictionid.report.write import fold_settings

LATE = 0.012  # [s]
FEW = Settings(iterations=4)
BY = Shooting(blocks=(FrictionBlock(), DelayBlock()), settings=FEW)
RUBS = LeastSquares(CoulombViscous())
CORRECTED = CalibratedRecipe("corrected", INTEGRAL, BY, RUBS, use=("delay",))


def late_contest(kind="recordings"):
    """Pendulums whose torque was logged too early by some milliseconds."""
    data = tiny.dataset(recordings=tiny.late(LATE))
    split = Split(count=3, kind=kind)
    return Benchmark(data, make_folds(data.recordings, split), Protocol((0.3,), every=0.5))


@pytest.fixture(scope="module")
def results():
    benchmark = late_contest()
    shared = prepare_benchmark(benchmark, [INTEGRAL, CORRECTED])
    plain = run(benchmark, RUBS, INTEGRAL, 0, shared)
    return benchmark, shared, plain, run(benchmark, RUBS, CORRECTED, 0, shared)


def test_the_delay_is_found_in_each_fold_and_corrects_the_data(results):
    _, shared, plain, corrected = results
    calibration = shared.training.calibrations["corrected"]
    assert (
        calibration.delay.shape == (4,) and np.ptp(calibration.delay) > 0
    )  # each fold has its own
    assert_allclose(calibration.delay, LATE, atol=1e-3)
    assert calibration.base is None and not calibration.bias.any() and (calibration.gain == 1).all()
    for score in (("one_step_integral", "rms"), ("rollout_angle", "median", 0.3)):
        assert corrected.value(*score) < 0.7 * plain.value(*score)
    assert (
        corrected.friction.calibration.delay.shape == (3,)
        and corrected.overall.calibration.delay.shape == ()
    )


def test_a_fold_of_a_corrected_fit_never_sees_its_held_out_recordings(results):
    benchmark, _, _, corrected = results
    held = [i for i, label in enumerate(benchmark.folds.labels) if label[0] == 1]
    recordings = list(benchmark.dataset.recordings)
    for i in held:
        recordings[i] = tiny.disturbed(recordings[i], 0.3)
    other = benchmark._replace(dataset=replace(benchmark.dataset, recordings=tuple(recordings)))
    again = run(other, RUBS, CORRECTED)
    assert again.friction.calibration.delay[1] == corrected.friction.calibration.delay[1]
    assert_array_equal(again.friction.theta[1], corrected.friction.theta[1])
    assert abs(again.friction.calibration.delay[0] - corrected.friction.calibration.delay[0]) > 1e-4


def test_shuffled_folds_share_the_rig_of_all_data_and_one_fit():
    benchmark = late_contest("shuffled")
    recipe = replace(CORRECTED, step=STUDY)
    shared = prepare_benchmark(benchmark, [recipe])
    assert np.ptp(shared.training.calibrations["corrected"].delay) == 0.0
    found = run(benchmark, RUBS, recipe, 0, shared)
    assert_allclose(found.friction.calibration.delay, LATE, atol=1e-3)


def test_the_built_in_calibration_is_right_within_its_intervals():
    benchmark = late_contest()
    heavy = replace(benchmark.dataset, mechanism=tiny.heavier(1.2))
    data = prepare_benchmark(benchmark._replace(dataset=heavy), [CALIBRATED.by]).training
    overall = CALIBRATED.estimate(data, -1)
    covariance = overall.covariance
    names = [p.name for p in covariance.parameters]
    truth = {"torque delay": LATE, "inertia": tiny.INERTIA, "gravity": tiny.GRAVITY}
    for name, value in truth.items():
        low, high = covariance.interval()[names.index(name)]
        assert low < value < high and high - low < 0.1 * value
    assert_allclose(overall.calibration.base, [tiny.INERTIA, tiny.GRAVITY], rtol=0.02)


@pytest.fixture(scope="module")
def alike():
    """Recipes that ask the same calibration, what is prepared for them, and fits on the way."""
    calls, fit = [], Flexible.fit
    tables = [
        {"name": "calibrated"},
        {"name": "by study", "like": "study", "calibration": {}},
        {"name": "clock", "like": "integral", "calibration": {"use": ["delay"]}},
        {"name": "refined", "by": "shooting", "free": ["friction", "delay"], "start": "calibrated"},
    ]
    recipes = recipes_of([RecipeEntry(**table) for table in tables])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Flexible, "fit", lambda *x: calls.append(x) or fit(*x))
        shared = prepare_benchmark(late_contest(), recipes)
    return recipes, shared, calls


def test_recipes_that_ask_the_same_calibration_share_one_for_each_fold(alike):
    (calibrated, *others, refined), shared, calls = alike
    assert refined.start == calibrated == CALIBRATED
    assert len(calls) == 4  # three folds, and all data
    shared = shared.training.calibrations
    assert list(shared) == ["calibrated", "by study", "clock"]
    for recipe in others:
        assert_array_equal(shared[recipe.name].delay, shared["calibrated"].delay)
    assert shared["clock"].base is None and shared["by study"].base is not None


def test_a_sparse_sum_is_refined_with_the_terms_that_corrected_data_choose(alike):
    """Its terms on data that are late are not those of the truth; refined, its delay is its own."""
    (calibrated, *_, refined), shared, _ = alike
    first, last = (
        run(late_contest(), SINDy(), r, 0, shared).overall for r in (calibrated, refined)
    )
    chosen = [np.flatnonzero(friction.theta) for friction in (first, last)]
    assert_array_equal(*chosen)
    assert last.calibration.delay == pytest.approx(LATE, abs=1e-3)
    (named,) = recipes_of([RecipeEntry(name="calibrated", by="shooting")])
    assert isinstance(named, Shooting)  # a name does not make a recipe of it
    with assert_refused("like = 'calibrated' must be a one-step recipe"):
        recipes_of([RecipeEntry(name="twice", like="calibrated", calibration={})])


def test_parameters_of_the_calibration_count_for_every_family(results):
    _, shared, plain, corrected = results
    counts = [r.value("effective_parameters", "count") for r in (plain, corrected)]
    assert counts == pytest.approx([2.0, 3.0])  # coulomb, viscous; the delay
    assert shared.training.determined == {"corrected": 1}


def test_what_is_finished_is_not_calibrated_anew(results, tmp_path):
    benchmark, _, _, corrected = results
    task = Task(benchmark, "rubs", RUBS, CORRECTED, 0)
    write_sealed(tmp_path / task.file, {"digest": task.digest, **content_of(task, corrected)})
    (prepared,) = prepare_benchmarks([task], kept=[tmp_path]).values()
    assert not prepared.training.calibrations


def test_no_friction_is_left_as_it_is(results):
    benchmark, shared, _, _ = results
    assert run(benchmark, Frictionless(), CORRECTED, 0, shared).friction.calibration is None


def test_sindy_may_choose_other_terms_in_each_fold(results):
    benchmark, shared, _, _ = results
    # the recordings hardly decide
    hasty = SINDy(thresholds=(0.02,), search_sets=False, n_standard_errors=0.0)
    found = run(benchmark, hasty, CORRECTED, 0, shared)
    terms = [tuple(np.flatnonzero(theta[0])) for theta in found.friction.theta]
    assert len(set(terms)) > 1 and all(terms)
    assert_array_equal(
        found.friction.calibration.delay, shared.training.calibrations["corrected"].delay[:-1]
    )
    # each fold is what the identifier finds on its own corrected data, whatever the others have
    for fold in range(len(terms)):
        own = training_of(
            with_calibration(shared.prepared, found.friction[fold].calibration), INTEGRAL
        )
        weights = shared.training.weights["integral"][fold : fold + 1]
        assert_array_equal(found.friction.theta[fold], hasty.fit(own, weights, 0).theta[0])


def test_sindy_finds_the_terms_once_the_clock_is_right(results):
    benchmark, shared, _, _ = results
    found = run(benchmark, SINDy(), CORRECTED, 0, shared)
    late = run(benchmark, SINDy(), INTEGRAL, 0, shared)
    has = [name for name, x in zip(SINDy().library.names, found.overall.theta[0], strict=True) if x]
    assert has[:2] == ["coulomb", "viscous"] and [name[:5] for name in has[2:]] == ["peak_"]
    score = ("rollout_angle", "median", 0.3)
    assert found.value(*score) < 0.7 * late.value(*score)


def test_only_parts_that_are_free_can_correct():
    with assert_refused("use = 'inertia' must be one of delay"):
        CalibratedRecipe("c", INTEGRAL, BY, RUBS, use=("inertia",))
    with assert_refused("use must name a part"):
        CalibratedRecipe("c", INTEGRAL, BY, RUBS, use=())
    both = Shooting(blocks=(FrictionBlock(), DelayBlock(), BiasBlock()))
    assert CalibratedRecipe("c", INTEGRAL, both, RUBS, use=("bias",)).use == ("bias",)


# --- Suites ---------------------------------------------------------------------------------------

RECIPE = {"name": "fair", "like": "study", "calibration": {"free": ["friction", "delay"]}}


FAIR = {"recipes": [{"name": "study"}, RECIPE]}


def test_a_suite_names_the_recipe_and_the_rig_that_corrects_it(tmp_path):
    file = tiny.write_suite(tmp_path, FAIR)
    made_ = {task.recipe.name: task.recipe for task in tiny.tasks_in(file)}
    fair = made_["fair"]
    assert isinstance(fair, CalibratedRecipe) and fair.step == STUDY and fair.use == ("delay",)
    assert [block.name for block in fair.by.blocks] == ["friction", "delay"]


def test_one_data_set_stands_there_twice_with_folds_and_recipes_of_its_own(tmp_path):
    twice = [
        {"path": "tiny"},
        {"path": "tiny", "name": "again", "folds": {"count": 4}, "recipes": ["study"]},
    ]
    file = tiny.write_suite(tmp_path, [("datasets", twice)])
    suite = load_suite(file)
    tasks = tasks_of(suite, file)
    again = [task for task in tasks if task.benchmark.dataset.name == "again"]
    assert {task.recipe.name for task in again} == {"study"} and again[0].benchmark.folds.count == 4
    assert {t.recipe.name for t in tasks if t not in again} == {"study", "integral"}
    provenance = {"settings": suite.model_dump(mode="json")}
    counts = {name: fold_settings(provenance, name)["count"] for name in ("again", "tiny")}
    assert counts == {"again": 4, "tiny": 3}


MISTAKES = """
recipes.1.like = => 'fair': the key 'like' is missing
recipes.1.calibration = => 'fair': the key 'calibration' is missing
recipes.1.like = "studi" => 'studi' is unknown; did you mean 'study'
recipes.1.by = "shooting" => by does not go with calibration
recipes.1.calibration = {free = ["friction", "dely"]}
    => 'fair', calibration: block 'dely' is unknown; did you mean 'delay'
datasets.0.recipes = ["studi"]
    => data set 'tiny': the suite has no recipe 'studi'; did you mean 'study'
datasets.0.folds = {cuont = 3} => 'cuont'; did you mean 'count'
"""


@mistakes(MISTAKES)
def test_each_mistake_is_one_line(tmp_path_factory, wrong, words):
    folder = tmp_path_factory.getbasetemp() / "mistakes"
    folder.mkdir(exist_ok=True)
    file = tiny.write_suite(folder, deepcopy(FAIR) | changes(wrong))
    with assert_refused(words):
        tiny.tasks_in(file)
