"""A model that cannot be fitted is named beside the others, whose results stay."""

import json
from dataclasses import dataclass, replace

import pytest
from fixtures.forked import contents
from fixtures.refusals import assert_refused
from fixtures.result_folders import leave_blank
from fixtures.tiny_pendulums import dataset

import frictionid as fid
from frictionid.errors import NoFitError
from frictionid.report import results_json, show
from frictionid.report.sections import sections_of
from frictionid.report.write import warning_lines

TINY = replace(dataset(), truth=None)
SETTINGS = {"recipes": "integral", "folds": 2, "horizons": [0.1], "jobs": 1}


@dataclass(frozen=True)
class Lost(fid.Identifier):
    """An identifier that fits nothing."""

    def fit(self, problem, weights, seed):
        raise NoFitError("too steep")


@pytest.mark.parametrize("folder", [None, "out"])
def test_the_others_are_compared(folder, tmp_path, capsys, monkeypatch):
    leave_blank(monkeypatch)
    place = None if folder is None else tmp_path / folder
    results = fid.compare(TINY, [Lost(), "coulomb_viscous"], folder=place, **SETTINGS).results
    why = "tiny, Lost by integral: too steep"
    assert results.not_fitted == (why,) and not results.missing
    assert [task["identifier"] for task in results.tasks] == ["coulomb_viscous"]
    show(results)
    assert f"not fitted: {why}" in " ".join(capsys.readouterr().out.split())
    assert f"Not fitted: {why}." in warning_lines(results, sections_of(results))
    assert json.loads(results_json(results))["not_fitted"] == [why]


def test_without_any_fit_the_reason_is_what_is_said_and_earlier_results_stay(tmp_path, monkeypatch):
    leave_blank(monkeypatch)
    fid.compare(TINY, ["coulomb_viscous"], folder=tmp_path / "out", **SETTINGS)
    before = contents(tmp_path / "out")
    for folder in (None, tmp_path / "out"):
        with assert_refused("tiny, Lost by integral: too steep"):
            fid.compare(TINY, [Lost()], folder=folder, **SETTINGS)
    assert before.items() <= contents(tmp_path / "out").items()
