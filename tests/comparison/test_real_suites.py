"""Suites of public recordings: fitted friction predicts blocks and recordings that no fit saw."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from fixtures.paths import ROOT
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.comparison.results import descriptions_of
from frictionid.comparison.suite import load_suite, tasks_of
from frictionid.comparison.tasks import content_of, prepare_benchmarks, results_of
from frictionid.evaluation import Split, make_folds

pytestmark = pytest.mark.real

LAWS_OF_C1 = ("coulomb_viscous", "stribeck", "stribeck_asymmetric")


class Real(NamedTuple):
    """A shipped suite, run with two folds and fewer predictions than it asks for."""

    folder: str  # of its recordings
    every: float  # [s] between predictions
    horizons: tuple[float, ...]  # [s]
    fitted: tuple[str, ...]
    share: float  # of the errors without friction, at most
    published: tuple[str, ...] = ()


SUITES = {
    "emps": Real("emps", 1.0, (0.5, 1.0), ("asymmetric",), 1.0, ("janot_2019",)),
    "simple_pendulum": Real(
        "dfki_simple_pendulum", 0.25, (0.5, 1.0), ("coulomb_viscous",), 1.0, ("published",)
    ),
    "dfki_c1": Real("dfki_double_pendulum", 0.5, (0.1, 0.25, 0.5, 1.0), LAWS_OF_C1, 1.0),
    "tx40": Real("staubli_tx40", 1.0, (0.05, 0.1), ("coulomb_viscous", "figaroh"), 0.2),
    "tiago": Real("tiago_arm", 8.0, (0.1, 0.25), ("coulomb_viscous",), 0.2),
}
ARMS = ["tx40", "tiago"]


@pytest.fixture(scope="module", params=SUITES)
def compared(request, real_data):
    """A suite's name, its prepared data, and results of its tasks by name."""
    name = request.param
    real = SUITES[name]
    file = ROOT / f"comparisons/{name}.toml"
    every = tasks_of(load_suite(file), file, real_data / real.folder)
    whole = every[0].benchmark
    protocol = replace(whole.protocol, every=real.every, horizons=real.horizons)
    folds = make_folds(whole.dataset.recordings, Split(count=2, kind="blocks", gap=0.25))
    benchmark = whole._replace(protocol=protocol, folds=folds)
    asked = {"none", *real.fitted, *real.published, "model_1.0", "model_2.0"}
    tasks = [t._replace(benchmark=benchmark) for t in every if t.name in asked]
    prepared = prepare_benchmarks(tasks)
    return name, prepared, {t.name: (t, r) for t, r in results_of(tasks, prepared, jobs=1)}


def errors(compared, identifier, dataset=None):
    """Median error of the positions at each horizon, of all folds together."""
    name, _, results = compared
    result = results[identifier][1]
    table = result.scores if dataset is None else result.tests[dataset]
    table = table[(table.fold == "all") & (table.joint == "all")]
    rows = table[(table.score == "rollout_angle") & (table.statistic == "median")]
    assert len(rows) == len(SUITES[name].horizons)
    return rows.sort_values("horizon_s").value.to_numpy()


def test_fitted_friction_beats_none_and_what_was_published_with_the_recordings(compared):
    real = SUITES[compared[0]]
    for law in real.fitted:
        assert (errors(compared, law) < real.share * errors(compared, "none")).all()
        for published in real.published:
            assert (errors(compared, law) < errors(compared, published)).all()


@pytest.mark.parametrize("compared", ["dfki_c1"], indirect=True)
@pytest.mark.parametrize("law", LAWS_OF_C1)
def test_unseen_swing_ups_are_predicted_no_worse_than_by_the_published_models(compared, law):
    own, none, *published = (
        errors(compared, identifier, "dfki_c1_swingup")
        for identifier in (law, "none", "model_1.0", "model_2.0")
    )
    assert (own < none).all()
    half = SUITES["dfki_c1"].horizons.index(0.5)
    assert own[half] <= np.min(published, axis=0)[half]


def test_units_are_those_of_the_joint(compared):
    name, _, results = compared
    metres = {"m", "m/s", "1"}
    units = set(results["none"][1].scores.unit) - {"N m", "N"}
    assert units == (metres if name == "emps" else {"rad", "rad/s", "1"})


@pytest.mark.parametrize("compared", ARMS, indirect=True)
def test_reports_know_all_places_with_friction(compared):
    name, prepared, results = compared
    places = [f"joint_{j}" for j in range(1, 7)] + ["motor_6"]
    places = places if name == "tx40" else [f"arm_{j}_joint" for j in range(1, 5)]
    described = descriptions_of(prepared)[name]
    assert described["joints"] == places
    refined = content_of(*results["coulomb_viscous"])["refined"]
    found = [p.name for p in refined["parameters"] if p.block == "friction"]
    assert found == [f"{own} of {place}" for place in places for own in ("coulomb", "viscous")]
    assert np.shape(refined["bands"].simultaneous) == np.shape(described["velocity"])


@pytest.mark.parametrize("compared", ["tx40"], indirect=True)
def test_friction_is_near_that_of_the_published_fit(compared):
    """Levels are up to 18 % higher: windows in which a joint turns round do not count."""
    _, _, results = compared
    ours, theirs = (np.asarray(results[k][1].overall.theta) for k in ("coulomb_viscous", "figaroh"))
    large = theirs > 0.5  # not those of joint 6, whose friction is that of its motor
    assert_allclose(ours[large], theirs[large], rtol=0.2)


@pytest.mark.parametrize("name", ARMS)
def test_missing_recordings_are_named_in_a_line(name, monkeypatch, tmp_path):
    monkeypatch.setenv("FRICTIONID_DATA", str(tmp_path))
    with assert_refused(f"{SUITES[name].folder}.*--data FOLDER"):
        fid.run_suite(name, out=tmp_path / "out")
