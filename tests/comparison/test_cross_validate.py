"""The comparison: independent of what is held out, the same however it is run, strict."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from fixtures.tiny_pendulums import TRUTH, dataset, disturbed, recordings, shortened, still

from frictionid.comparison.cross_validate import Benchmark, prepare_benchmark, run
from frictionid.comparison.tasks import Task, prepare_benchmarks, run_tasks
from frictionid.data.state_estimators import RTS, SavitzkyGolay
from frictionid.evaluation import Protocol, Split, make_folds, score_frame, true_friction
from frictionid.files import read_json
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.identifiers import Frictionless, LeastSquares, Published
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY, Recipe
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, Stribeck

PROTOCOL = Protocol(horizons=(0.1, 0.3))
FIT = LeastSquares(CoulombViscous())
RECIPES = (STUDY, INTEGRAL)


def benchmark(data=None, split=None, protocol=PROTOCOL, tests=()):
    data = data or dataset()
    return Benchmark(data, make_folds(data.recordings, split or Split(count=3)), protocol, tests)


# --- Independent of what is held out -------------------------------------------------------------


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_a_fold_does_not_depend_on_the_recordings_that_it_holds_out(recipe):
    whole = benchmark()
    before = run(whole, FIT, recipe)
    for held in (0, 7):
        parts = list(recordings())
        parts[held] = disturbed(parts[held], 0.3)
        other = run(benchmark(dataset(recordings=tuple(parts))), FIT, recipe)
        fold = int(whole.folds.labels[held][0])
        same = [np.array_equal(before.friction.theta[f], other.friction.theta[f]) for f in range(3)]
        assert same == [f == fold for f in range(3)]
        assert not np.array_equal(before.overall.theta, other.overall.theta)


# --- The same however it is run ------------------------------------------------------------------


def test_fixed_friction_is_scored_once_and_written_for_each_recipe_and_seed(tmp_path):
    whole = benchmark()
    calls = []

    @dataclass(frozen=True)
    class Counted(Frictionless):
        def fit(self, problem, weights, seed):
            calls.append(seed)
            return super().fit(problem, weights, seed)

    none, given = Counted(), Published(true_friction(TRUTH))
    tasks = [
        Task(whole, name, identifier, recipe, seed)
        for name, identifier in (("none", none), ("truth", given))
        for recipe in RECIPES
        for seed in (0, 1)
    ]
    run_tasks(tasks, prepare_benchmarks(tasks), tmp_path, jobs=1)
    assert len(calls) == 1 and len(list(tmp_path.iterdir())) == 8
    for task in tasks[1::2]:
        alone = run(whole, task.identifier, task.recipe, task.seed)
        found = read_json(tmp_path / task.file)
        assert (found["fit"], found["seed"]) == (task.recipe.name, task.seed)
        assert found["digest"] == task.digest
        assert score_frame(found["rows"]["tiny"]).equals(alone.scores)


def test_the_true_law_is_far_ahead_of_none():
    none, best = (
        run(benchmark(), identifier, INTEGRAL)
        for identifier in (Frictionless(), LeastSquares(Stribeck()))
    )
    assert best.value("curve_error", "rms", joint="1") < 0.05
    ahead = ("rollout_angle", "median", 0.3)
    assert best.value(*ahead) < 0.2 * none.value(*ahead)
    assert best.friction.theta.shape == (3, 1, 4) and best.overall.theta.shape == (1, 4)
    assert best.curves.shape == (4, 401, 1)
    with assert_refused("no score 'rollout', 'median' at 0.3 s for joint all"):
        best.value("rollout", "median", 0.3)


def test_a_fold_without_torque_has_no_share_of_it():
    data = dataset(recordings=(*still()[:1], *recordings()[1:4]))
    scores = run(benchmark(data, Split(count=4)), FIT, INTEGRAL).scores
    shares = scores[(scores.score == "torque_left") & (scores.statistic == "share")]
    assert sorted(shares[shares.joint == "all"].fold) == ["0", "2", "3", "all"]


def test_a_test_set_is_scored_with_the_friction_of_all_data():
    test = dataset(name="test", recordings=recordings()[:3])
    result = run(benchmark(tests=(test,)), FIT, INTEGRAL)
    assert set(result.tests) == {"test"}
    assert set(result.tests["test"].fold) == {"all"}
    alone = run(benchmark(tests=(test,)), Published(result.overall), INTEGRAL)
    assert alone.tests["test"].equals(result.tests["test"])
    shown = {motion["dataset"]: motion["friction_of"] for motion in result.motions}
    assert shown == {"tiny": "fold", "test": "all"}


def test_models_with_their_own_mechanism_are_scored_with_it():
    friction = replace(true_friction(TRUTH), parameters={"mass": 0.4})
    wrong, right = (
        run(benchmark(), Published(given), INTEGRAL) for given in (friction, true_friction(TRUTH))
    )
    for name in ("one_step_integral", "one_step_euler"):
        assert wrong.value(name, "rms") > 2 * right.value(name, "rms")
    ahead = ("rollout_angle", "median", 0.3)
    assert wrong.value(*ahead) > 2 * right.value(*ahead)


# --- Recipes -------------------------------------------------------------------------------------


@pytest.mark.parametrize("states", [RTS(), SavitzkyGolay()])
def test_smoothed_states_go_with_either_scheme(states):
    for scheme in ("euler", "integral"):
        result = run(benchmark(), FIT, Recipe("mine", states, scheme))
        assert result.value("curve_error", "rms", joint="1") < 0.3


# --- Benchmarks that cannot be prepared ----------------------------------------------------------

ABSURD = {
    "long horizons": ({"protocol": Protocol(horizons=(9.0,))}, "9.15 s of motion"),
    "long history": ({"protocol": Protocol(history=1e19)}, "no recording"),
    "long sample time": ({"protocol": Protocol(sample_time=9.0)}, "lower sample_time"),
    "few blocks": (
        {"split": Split(count=60, kind="blocks"), "protocol": Protocol(horizons=(0.4,))},
        "no fold holds out 0.4 s of motion in one piece",
    ),
    "wide gap": (
        {
            "data": dataset(recordings=recordings()[:1]),
            "split": Split(count=2, kind="blocks", gap=1.0),
        },
        "fold 0 leaves nothing to train on: choose a smaller folds.gap",
    ),
    "truth of two joints": (
        {"data": dataset(truth={**TRUTH, **{k: v * 2 for k, v in TRUTH.items() if k != "kind"}})},
        r"\[truth\] is not that of 1 joints",
    ),
    "half a truth": ({"data": dataset(truth={**TRUTH, "viscous": "x"})}, r"\[truth\] viscous"),
    "incomplete mechanism": (
        {"data": dataset(mechanism={"kind": "pendulum", "parameters": {"mass": 0.4}})},
        r"pendulum needs length \[m\]",
    ),
}


@pytest.mark.parametrize("change, words", ABSURD.values(), ids=ABSURD)
def test_benchmarks_that_cannot_be_prepared_are_refused_before_anything_is_fitted(change, words):
    change = {"protocol": PROTOCOL, **change}
    with assert_refused(words):
        prepare_benchmark(benchmark(**change), RECIPES)


def test_recordings_may_differ_in_length():
    parts = recordings()
    uneven = tuple(shortened(r, 0.5 + 0.09 * i) for i, r in enumerate(parts))
    result = run(benchmark(dataset(recordings=uneven)), FIT, INTEGRAL)
    assert result.value("curve_error", "rms", joint="1") < 0.1
    assert set(result.scores.fold) == {"0", "1", "2", "all"}


# --- Identifiers that violate the protocol -------------------------------------------------------


def made(theta):
    @dataclass(frozen=True)
    class Made(Identifier):
        def fit(self, problem, weights, seed):
            return Friction(CoulombViscous(), theta(len(weights)))

    return Made()


BROKEN = {
    "one for all folds": (lambda _: np.ones((1, 1, 2)), r"shape \(1, 1, 2\), it must be \(4, 1,"),
    "two joints": (lambda F: np.ones((F, 2, 2)), r"shape \(4, 2, 2\), it must be"),
    "a lost fold": (lambda F: np.full((F, 1, 2), np.nan), "fit failed: .*not finite"),
    "endless": (lambda F: np.full((F, 1, 2), np.inf), "fit failed: .*not finite"),
}


@pytest.mark.parametrize("theta, words", BROKEN.values(), ids=BROKEN)
def test_the_friction_of_an_identifier_is_checked(theta, words, tmp_path):
    whole = benchmark()
    task = Task(whole, "broken", made(theta), INTEGRAL, 0)
    with assert_refused(words) as caught:
        run_tasks([task], prepare_benchmarks([task]), tmp_path, jobs=1)
    assert str(caught.value).startswith("tiny, broken by integral: ")
    assert not list(tmp_path.iterdir())
