"""The real acrobot: fitted on identification runs, judged on swing-ups that no fit has seen."""

import pandas as pd
import pytest
from fixtures import result_folders as made
from fixtures.paths import ROOT

from frictionid.cli.compare import compare

HORIZONS = (0.1, 0.25, 0.5, 1.0)
FITTED = ("coulomb_viscous", "stribeck", "stribeck_asymmetric")
PUBLISHED = ("model_1.0", "model_2.0")


@pytest.fixture(scope="module")
def scores(real_data, tmp_path_factory):
    """Scores of comparisons/dfki_c1.toml, its tables found through --data."""
    folder = tmp_path_factory.mktemp("dfki_c1")
    data = real_data / "dfki_double_pendulum"
    with pytest.MonkeyPatch.context() as patch:
        made.leave_blank(patch)
        compare(ROOT / "comparisons" / "dfki_c1.toml", data=data, out=folder, jobs=1)
    table = pd.read_csv(folder / "scores.csv", dtype={"fold": str, "joint": str})
    return table[(table.fold == "all") & (table.joint == "all")]


def median(scores, dataset, identifier, horizon):
    """Median rollout error against the measured angles [rad]."""
    row = scores[
        (scores.dataset == dataset)
        & (scores.identifier == identifier)
        & (scores.horizon_s == horizon)
        & (scores.score == "rollout_angle")
        & (scores.statistic == "median")
    ]
    return float(row.value.item())


@pytest.mark.parametrize("identifier", FITTED)
def test_fitted_friction_beats_none_at_every_horizon(scores, identifier):
    for dataset in ("dfki_c1", "dfki_c1_swingup"):
        for horizon in HORIZONS:
            own = median(scores, dataset, identifier, horizon)
            assert own < median(scores, dataset, "none", horizon)


@pytest.mark.parametrize("identifier", FITTED)
def test_unseen_swing_ups_are_predicted_no_worse_than_by_the_published_models(scores, identifier):
    best = min(median(scores, "dfki_c1_swingup", p, 0.5) for p in PUBLISHED)
    assert median(scores, "dfki_c1_swingup", identifier, 0.5) <= best
