"""The suites of two real arms: friction predicts blocks of time that it has not seen."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.paths import ROOT

from frictionid.api.suites import open_suite
from frictionid.comparison.registry import LAWS
from frictionid.comparison.results import descriptions_of
from frictionid.comparison.tasks import document, prepare_benchmarks, results_of
from frictionid.errors import InputError
from frictionid.evaluation import Split, make_folds

pytestmark = pytest.mark.real

COLLECTION = {"tx40": "staubli_tx40", "tiago": "tiago_arm"}
EVERY = {
    "tx40": 1.0,
    "tiago": 8.0,
}  # [s]: fewer and shorter predictions than the suite's, and folds, for time's sake


@pytest.fixture(scope="module", params=COLLECTION)
def arm(request, real_data):
    """A suite's name, its prepared data, and results by name of some of its tasks."""
    name = request.param
    suite = open_suite(ROOT / "comparisons" / f"{name}.toml", data=real_data / COLLECTION[name])
    whole = suite.tasks[0].benchmark
    protocol = replace(whole.protocol, every=EVERY[name], horizons=whole.protocol.horizons[:2])
    folds = make_folds(whole.dataset.recordings, Split(count=2, kind="blocks", gap=0.1))
    benchmark = replace(whole, protocol=protocol, folds=folds)
    some = ("none", "coulomb_viscous", "figaroh")
    tasks = [t._replace(benchmark=benchmark) for t in suite.tasks if t.name in some]
    prepared = prepare_benchmarks(tasks)
    return name, prepared, {t.name: (t, r) for t, r in results_of(tasks, prepared, jobs=1)}


def errors(result):
    """Median error of the angles at each horizon, of all folds together."""
    table = result.scores
    table = table[(table.fold == "all") & (table.joint == "all")]
    rows = table[(table.score == "rollout_angle") & (table.statistic == "median")]
    return rows.sort_values("horizon_s").value.to_numpy()


def test_friction_predicts_blocks_that_no_fit_has_seen(arm):
    _, _, results = arm
    none = errors(results["none"][1])
    assert len(none) == 2
    for name, (_, result) in results.items():
        assert name == "none" or (errors(result) < 0.2 * none).all()


def test_reports_know_all_places_with_friction(arm):
    name, prepared, results = arm
    places = [f"joint_{j}" for j in range(1, 7)] + ["motor_6"]
    places = places if name == "tx40" else [f"arm_{j}_joint" for j in range(1, 5)]
    described = descriptions_of(prepared)[name]
    assert described["joints"] == places
    refined = document(*results["coulomb_viscous"], LAWS)["refined"]
    found = [p.name for p in refined["parameters"] if p.block == "friction"]
    assert found == [f"{own} of {place}" for place in places for own in ("coulomb", "viscous")]
    assert np.shape(refined["bands"].simultaneous) == np.shape(described["velocity"])


@pytest.mark.parametrize("arm", ["tx40"], indirect=True)
def test_friction_is_near_that_of_the_published_fit(arm):
    """Levels are up to 18 % higher: windows in which a joint turns round do not count."""
    _, _, results = arm
    ours, theirs = (np.asarray(results[k][1].overall.theta) for k in ("coulomb_viscous", "figaroh"))
    large = theirs > 0.5  # not those of joint 6, whose friction is that of its motor
    np.testing.assert_allclose(ours[large], theirs[large], rtol=0.2)


@pytest.mark.parametrize("name", COLLECTION)
def test_missing_recordings_are_named_in_a_line(name, monkeypatch, tmp_path):
    monkeypatch.setenv("FRICTIONID_DATA", str(tmp_path))
    with pytest.raises(InputError, match=f"{COLLECTION[name]}.*--data FOLDER"):
        open_suite(name).tasks  # noqa: B018
