"""Comparisons of public recordings run from the command line, and say what the recordings say."""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd
import pytest

from frictionid.cli import main
from frictionid.suite import load_suite

pytestmark = pytest.mark.real

ROOT = Path(__file__).parents[1]
COLLECTION = {
    "bam_xl330": "bam_xl330",
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
    best = {"bam_xl330": "motor_load", "emps": "asymmetric", "simple_pendulum": "coulomb_viscous"}
    published = {"bam_xl330": "M1", "emps": "janot_2019", "simple_pendulum": "published"}
    for horizon in (0.5, 1.0):
        own = median(table, name, best[name], horizon)
        assert own < median(table, name, "none", horizon)
        assert own < median(table, name, published[name], horizon)


def test_units_are_those_of_the_joint(scores):
    name, table = scores
    metres = {"m", "m/s", "1"}
    assert set(table.unit) == (metres if name == "emps" else {"rad", "rad/s", "1"})


def test_passive_swings_are_tested_on_what_was_fitted_while_driven(scores):
    name, table = scores
    tested = set(table.dataset)
    assert tested == ({name, "bam_xl330_passive"} if name == "bam_xl330" else {name})


@pytest.mark.parametrize("name", ["ibm", "phy180"])
def test_the_other_comparisons_are_written_right(name, real_data):
    suite = load_suite(ROOT / "comparisons" / f"{name}.toml")
    assert suite.name == name
    assert {entry["kind"] for entry in suite.identifiers} == {"none", "coulomb_viscous"}
