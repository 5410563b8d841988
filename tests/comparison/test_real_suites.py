"""Comparisons of public recordings run from the command line, and say what the recordings say."""

import sys

import pandas as pd
import pytest
from fixtures import result_folders as made
from fixtures.paths import ROOT

from frictionid.__main__ import main

pytestmark = pytest.mark.real

COLLECTION = {
    "emps": "emps",
    "simple_pendulum": "dfki_simple_pendulum",
}


@pytest.fixture(scope="module", params=COLLECTION)
def scores(request, real_data, tmp_path_factory):
    """Name of a comparison and its held-out scores, as scores.csv has them."""
    name = request.param
    out = tmp_path_factory.mktemp(name)
    file = ROOT / "comparisons" / f"{name}.toml"
    with pytest.MonkeyPatch.context() as patch:
        made.leave_blank(patch)
        data = str(real_data / COLLECTION[name])
        command = ["frictionid", "compare", str(file), "--data", data, "--out", str(out)]
        patch.setattr(sys, "argv", [*command, "--jobs", "1"])
        assert main() == 0
    table = pd.read_csv(out / "scores.csv")
    return name, table[(table.fold == "all") & (table.joint == "all")]


def median(table, dataset, identifier, horizon):
    """Median rollout error."""
    rows = table[(table.score == "rollout_angle") & (table.statistic == "median")]
    rows = rows[(rows.dataset == dataset) & (rows.identifier == identifier)]
    return float(rows[rows.horizon_s == horizon].value.item())


def test_fitted_friction_beats_none_and_the_published_model(scores):
    name, table = scores
    best = {"emps": "asymmetric", "simple_pendulum": "coulomb_viscous"}
    published = {"emps": "janot_2019", "simple_pendulum": "published"}
    for horizon in (0.5, 1.0):
        own = median(table, name, best[name], horizon)
        assert own < median(table, name, "none", horizon)
        assert own < median(table, name, published[name], horizon)


def test_units_are_those_of_the_joint(scores):
    name, table = scores
    metres = {"m", "m/s", "1"}
    assert set(table.unit) == (metres if name == "emps" else {"rad", "rad/s", "1"})
