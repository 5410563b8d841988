"""Tuning: it finds the best, sees nothing of what judges it, and goes on where it was stopped."""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.paths import ROOT
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.shared import shared
from fixtures.tiny_pendulums import QUICK, dataset, disturbed, tasks_in, write_suite
from numpy.testing import assert_array_equal

import frictionid as fid
from frictionid.comparison.cross_validate import Benchmark
from frictionid.comparison.registry import IDENTIFIERS
from frictionid.comparison.search_space import Objective, Space, Tuning
from frictionid.comparison.suite import IdentifierEntry, load_suite, tasks_of
from frictionid.comparison.tuning import tune
from frictionid.comparison.tuning_task import TuningTask, training_benchmark, tuning_tasks
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.fitting.one_step.recipe import INTEGRAL
from frictionid.report.sensitivity import score_table, settings_tables

OWN = """
from dataclasses import dataclass, replace
from frictionid.errors import InputError
from frictionid import Identifier
from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction.laws import CoulombViscous

@dataclass(frozen=True)
class Scaled(Identifier):
    "Fitted friction times a factor: best is one."
    factor: float = 0.5
    mood: str = "good"

    def fit(self, problem, weights, seed):
        if self.mood == "bad":
            raise InputError("in no mood to fit")
        fitted = LeastSquares(CoulombViscous()).fit(problem, weights, seed)
        return replace(fitted, theta=self.factor * fitted.theta)
"""
FACTOR = {"factor": {"low": 0.0, "high": 2.0}}


@shared
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tuning")
    (folder / "own_scaled.py").write_text(OWN)
    return folder


def benchmark(split=Split(count=3), recordings=None):
    data = dataset(**({} if recordings is None else {"recordings": recordings}))
    folds = make_folds(data.recordings, split)
    return Benchmark(data, folds, Protocol((0.1,), every=0.5))


def tuning_task(place, own=None, search=None, **settings):
    entry = IdentifierEntry(kind="own_scaled:Scaled", search=search or FACTOR, **settings)
    return TuningTask(own or benchmark(), "scaled", entry, INTEGRAL, 0, place)


def flat(trials, **settings):
    """A search in two folds of all recordings."""
    return Tuning(trials=trials, folds=2, nested=False, **settings)


def values(results):
    return [(r.sampler, r.fold, [(dict(t.settings), t.value) for t in r.trials]) for r in results]


def suite(place):
    identifier = {"kind": "own_scaled:Scaled", "name": "scaled", "search": FACTOR}
    given = {"identifiers": [{"kind": "none"}, identifier], "tune": {"trials": 2, "folds": 2}}
    file = write_suite(place, {**changes(QUICK), **given})
    return load_suite(file), file


# --- The best settings ---------------------------------------------------------------------------


@pytest.mark.parametrize("sampler, trials", [("tpe", 15), ("gp", 9)])
def test_samplers_find_the_best_setting_and_stay_near_it(place, tmp_path, sampler, trials):
    tuning = flat(trials, samplers=[sampler, "random"])
    results = {f.sampler: f for f in tune([tuning_task(place)], tuning, tmp_path)}
    off = {n: [abs(t.settings["factor"] - 1.0) for t in f.trials] for n, f in results.items()}
    assert off[sampler][:5] == off["random"][:5]  # all begin at random
    assert np.mean(off[sampler][5:]) < 0.6 * np.mean(off["random"][5:])
    assert min(off[sampler]) < 0.1
    for f in results.values():
        assert f.best.value == min(t.value for t in f.trials) and len(f.trials) == trials


def test_the_suites_own_settings_are_the_first_trial(place, tmp_path):
    tuning = flat(2)
    suites, other = tuning_task(place, factor=0.9), tuning_task(place, factor=3.0)
    (result,) = tune([suites], tuning, tmp_path / "a")
    assert (
        result.trials[0].settings == {"factor": 0.9}
        and result.suite_value == result.trials[0].value
    )
    (result,) = tune([other], tuning, tmp_path / "b")
    assert all(t.settings["factor"] != 3.0 for t in result.trials) and math.isnan(
        result.suite_value
    )


def test_the_example_of_the_page_can_be_tuned_and_begins_with_what_the_suite_leaves_out(place):
    page = (ROOT / "docs/identifiers.md").read_text()
    example = tomllib.loads(
        page.split("## Choosing settings")[1].split("```toml")[1].split("```")[0]
    )
    assert Tuning.model_validate(example["tune"]) == Tuning()
    file = write_suite(
        place, {**example, **changes('recipes = [{name = "integral"}]')}, "page.toml"
    )
    tasks = tuning_tasks(load_suite(file), file)
    assert [u.name for u in tasks] == ["mlp", "lstm"]
    for u in tasks:
        assert set(u.suite_settings) == set(u.search)
        assert all(space.holds(u.suite_settings[key]) for key, space in u.search.items())


def test_choices_whole_numbers_and_rollouts(place, tmp_path):
    entry = IdentifierEntry(
        kind="spline",
        search={
            "degree": Space(low=1, high=3),
            "knots": Space(choices=[[1.0, 9.0], [0.5, 2.0, 8.0]]),
        },
    )
    own = TuningTask(benchmark(), "spline", entry, INTEGRAL, 0, place)
    objective = Objective(score="rollout_angle", horizon=0.1)
    (result,) = tune([own], flat(3, objective=objective), tmp_path)
    for trial in result.trials:
        assert trial.settings["degree"] in (1, 2, 3) and 0 < trial.value < 0.1
        assert trial.settings["knots"] in ([1.0, 9.0], [0.5, 2.0, 8.0])


def test_settings_that_cannot_be_fitted_fail_alone(place, tmp_path):
    search = {**FACTOR, "mood": {"choices": ["good", "bad"]}}
    tuning = flat(6, samplers=["random"])
    (result,) = tune([tuning_task(place, search=search)], tuning, tmp_path / "a")
    failed = [t for t in result.trials if math.isnan(t.value)]
    assert {t.settings["mood"] for t in failed} == {"bad"}
    assert all("no mood" in t.error for t in failed)
    assert result.best.settings["mood"] == "good"
    never = tuning_task(place, search={"mood": {"choices": ["bad"]}}, mood="bad")
    with assert_refused("no trial has a score: in no mood to fit"):
        tune([never], tuning, tmp_path / "b")


# --- What it may see -----------------------------------------------------------------------------


def test_held_out_recordings_change_nothing_of_their_folds_study(place, tmp_path):
    own = benchmark()
    held = [i for i, label in enumerate(own.folds.labels) if label[0] == 1]
    recordings = list(own.dataset.recordings)
    for i in held:
        recordings[i] = disturbed(recordings[i], 0.3)
    other = benchmark(recordings=tuple(recordings))
    tuning = Tuning(trials=1, folds=2)
    a = {f.fold: f for f in tune([tuning_task(place, own)], tuning, tmp_path / "a")}
    b = {f.fold: f for f in tune([tuning_task(place, other)], tuning, tmp_path / "b")}
    assert a[1].trials == b[1].trials
    assert a[1].held_out != b[1].held_out
    for fold in (None, 0, 2):
        assert a[fold].trials[0].value != b[fold].trials[0].value


def test_nested_folds_leave_out_the_held_out_block_and_its_gap():
    gap = 0.1
    own = benchmark(Split(count=3, kind="blocks", gap=gap))
    for fold in range(3):
        part = training_benchmark(own, fold, Split(count=2))
        (test,) = part.tests
        held, seen = samples(test), samples(part.dataset)
        for name, times in held.items():
            for other in seen.get(name, ()):
                assert np.abs(times - other).min() >= gap - 1e-9
        assert sum(map(len, held.values())) > 0 and sum(map(len, seen.values())) > 0
        assert part.dataset.truth is None
        assert all(r.truth is None for r in (*part.dataset.recordings, *test.recordings))


@pytest.mark.parametrize("kind", ["blocks", "recordings"])
def test_samples_keep_their_own_deviations(kind):
    def deviating(r):
        sigma = 1e-4 * (1.0 + np.arange(len(r.angle.time))[:, None] % 3)
        return replace(r, angle=r.angle._replace(sigma=sigma))

    own = benchmark(Split(count=2, kind=kind, gap=0.1))
    own = own._replace(
        dataset=replace(own.dataset, recordings=tuple(map(deviating, own.dataset.recordings)))
    )
    (first, *_) = training_benchmark(own, 1, Split(count=2)).dataset.recordings
    whole = next(r for r in own.dataset.recordings if r.name == first.name.split(",")[0])
    rows = np.isin(whole.angle.time, first.angle.time)
    assert_array_equal(first.angle.sigma, np.asarray(whole.angle.sigma)[rows])


def samples(part):
    """Times of the samples of each recording that pieces came from."""
    out = {}
    for recording in part.recordings:
        name = recording.name.split(",")[0]
        out[name] = np.concatenate([out.get(name, np.empty(0)), recording.angle.time])
    return out


def test_tuning_cannot_be_nested_in_shuffled_folds(place, tmp_path):
    shuffled = tuning_task(place, benchmark(Split(count=3, kind="shuffled")))
    with assert_refused("nested .* shuffled .*tune.nested = false"):
        tune([shuffled], Tuning(trials=1, folds=2), tmp_path)
    (result,) = tune([shuffled], flat(1), tmp_path / "new")
    assert result.fold is None


# --- Interruptions -------------------------------------------------------------------------------


SEVEN = flat(7, samplers=["tpe"])


@shared
def whole(place, tmp_path_factory):
    """A search that nothing interrupts."""
    return tune([tuning_task(place)], SEVEN, tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize("after", [1, 7])
def test_an_interrupted_search_is_resumed_with_the_same_trials(place, tmp_path, whole, after):
    finished = []

    def stop(name):
        finished.append(name)
        if len(finished) == after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tune([tuning_task(place)], SEVEN, tmp_path / "part", done=stop)
    again = []
    resumed = tune([tuning_task(place)], SEVEN, tmp_path / "part", resume=True, done=again.append)
    assert values(resumed) == values(whole) and len(again) == 7


def test_a_trial_that_was_killed_is_made_again(place, tmp_path, monkeypatch):
    from frictionid.comparison import tuning as studies

    tuning = flat(3)
    whole = tune([tuning_task(place, factor=0.9)], tuning, tmp_path / "whole")

    def killed(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(studies, "score_trial", killed)
        with pytest.raises(KeyboardInterrupt):
            tune([tuning_task(place, factor=0.9)], tuning, tmp_path / "part")
    resumed = tune([tuning_task(place, factor=0.9)], tuning, tmp_path / "part", resume=True)
    assert values(resumed) == values(whole) and resumed[0].suite_value == whole[0].suite_value > 0


def test_other_data_or_settings_begin_anew_and_more_trials_go_on(place, tmp_path):
    few, more = (flat(trials) for trials in (2, 3))
    first = tune([tuning_task(place)], few, tmp_path)[0].trials
    (longer,) = tune([tuning_task(place)], more, tmp_path, resume=True)
    assert longer.trials[:2] == first and len(longer.trials) == 3
    other = tuning_task(place, benchmark(recordings=dataset().recordings[:8]))
    (anew,) = tune([other], few, tmp_path, resume=True)
    assert len(anew.trials) == 2 and anew.trials[0].value != first[0].value


# --- Suites and pages ----------------------------------------------------------------------------


MISTAKES = r"""
search = => no identifier has a search table: add one
search = {fctor = {low = 0, high = 1}} => fctor
search = {factor = {lo = 0, high = 1}} => search\.factor: unknown key 'lo'; did you mean 'low'
search = {factor = {low = 0}} => factor: needs low and high, or choices
search = {factor = {low = 1, high = 0}} => low = 1 must be below high = 0
search = {factor = {low = 0, high = 1, log = true}} => log needs a positive
search = {factor = {low = 0, choices = [1]}} => choices stand alone
search = {factor = {low = 0, high = 4, step = 0.5}} => whole number
tune = {folds = 1} => tune\.folds: .*greater than or equal to 2
tune = {objective = {score = "rollout_angle"}} => needs a horizon
tune = {objective = {score = "rollout_angle", horizon = 0.3, statistic = "rms"}}
    => rollout_angle has no rms: choose median or q90
kind = "stribeck"; search = {widht = {low = 0.1, high = 1.0}}
    => unknown setting 'widht'; did you mean 'width'
kind = "stribeck"; search = {width = {low = 0.0, high = 1.0}}
    => 'scaled': .*width = 0\.0 .* must be positive.*\(search\.width at 0\.0\)
"""


@mistakes(MISTAKES)
def test_each_mistake_is_one_line_that_names_the_way_out(place, wrong, words):
    entry = {"kind": "own_scaled:Scaled", "name": "scaled", "search": FACTOR}
    given = {k if k == "tune" else f"identifiers.0.{k}": v for k, v in changes(wrong).items()}
    usual = changes('recipes = [{name = "integral"}]; tune = {}')
    file = write_suite(place, {"identifiers": [entry], **usual, **given}, "wrong.toml")
    with assert_refused(words) as caught:
        tuning_tasks(load_suite(file), file)
    assert "wrong.toml" in str(caught.value)


@pytest.mark.parametrize("kind", IDENTIFIERS)
def test_every_setting_can_be_written_in_a_suite_and_tuned(kind):
    settings = set(IDENTIFIERS[kind].settings)
    assert not settings & set(IdentifierEntry.model_fields)


def test_a_comparison_does_not_read_what_tuning_searches(place):
    table, file = suite(place)
    scaled = next(t for t in tasks_of(table, file, trust=True) if t.name == "scaled")
    assert scaled.identifier.factor == 0.5


def test_the_command_writes_a_page_and_a_suite_that_runs_with_the_chosen_settings(place, run):
    table, file = suite(place)
    words = "tune suite.toml --jobs 1 --trust --out"
    code, out, _ = run(place, words, "t")
    assert code == 0 and str(place / "t/summary.md") in out
    # what the command calls
    tuned = fid.tune("suite.toml", out="t", jobs=1, resume=True, trust=True)
    assert str(tuned) in out and len(tuned.studies) == 4
    assert len(tuned.frame) == len(pd.read_csv(place / "t/trials.csv")) == 4 * 2
    whole = next(study for study in tuned.studies if study.fold is None)
    tasks = tasks_in(place / "t/tiny.toml")
    chosen = {task.name: task.identifier for task in tasks}
    assert chosen["scaled"].factor == whole.best.settings["factor"] and "none" in chosen
    (first, *_) = tuning_tasks(table, file, trust=True)
    assert tasks[0].benchmark.folds.hash == first.benchmark.folds.hash
    text = tuned.page.read_text()
    best = score_table(tuned.studies, tuned.objective).lines[0].cells
    assert all(cell.text in text for cell in best)
    (settings,) = settings_tables(tuned.studies)
    assert settings.lines[0].cells[0].text == "factor" and "0 to 2" in text
    for name, size in (("progress.png", 1000), ("journal.log", 100)):
        assert (place / "t" / name).stat().st_size > size
    assert_one_line(run(place, words, "."), "holds no tuning but")
