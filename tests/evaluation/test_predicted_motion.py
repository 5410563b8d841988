"""Predicted motion as a table: that of the rollouts that are scored, of the true model exact."""

import numpy as np
import pandas as pd
import pytest
from fixtures import driven_wrist
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.tiny_pendulums import TRUTH, dataset, write_dataset

from frictionid.evaluation import Protocol, prepare, score_model, score_value
from frictionid.evaluation.predicted_motion import predicted_motion
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, FilmLag, Stribeck
from frictionid.friction.model_files import save_model

TRUE = Friction(Stribeck(symmetric=False), [[v[0] for k, v in TRUTH.items() if k != "kind"]])
WRONG = Friction(CoulombViscous(), [[0.05, 0.0]])


def test_errors_of_the_table_are_the_scores():
    data = dataset()
    table = predicted_motion(WRONG, data, 0.3, 0.25)
    ends = table.groupby(["recording", "start_s"]).tail(1)
    assert ends.ahead_s.to_numpy() == pytest.approx(0.3, abs=1e-9)
    off = (ends.q1 - ends.measured_q1).abs()
    scores, *_ = score_model(WRONG, prepare(data, Protocol(horizons=(0.3,), every=0.25)))
    median = score_value(scores, "rollout_angle", "median", 0.3)
    assert median == pytest.approx(float(off.median()))


def test_the_true_model_predicts_what_was_measured():
    table = predicted_motion(TRUE, dataset(), 0.5)
    off, wrong = (
        (t.q1 - t.measured_q1).abs().quantile(0.9)
        for t in (table, predicted_motion(WRONG, dataset(), 0.5))
    )
    assert off < 0.01 and off < 0.2 * wrong
    # one begins where the one before ends
    first = table[table.recording == "00"]
    assert sorted(first.start_s.unique()) == pytest.approx([0.15, 0.65], abs=1 / 60)
    assert (first.time_s - first.start_s).to_numpy() == pytest.approx(first.ahead_s.to_numpy())


def test_whole_recordings_are_simulated_to_their_end():
    data = dataset()
    table = predicted_motion(TRUE, data, whole=True)
    for recording in data.recordings:
        own = table[table.recording == recording.name]
        assert own.start_s.nunique() == 1
        assert own.time_s.iloc[-1] == pytest.approx(recording.angle.time[-1])
        at = np.searchsorted(recording.angle.time, own.time_s - 1e-9)
        np.testing.assert_allclose(own.measured_q1, recording.angle.value[at, 0])
    assert (table.q1 - table.measured_q1).abs().median() < 0.03


def test_memory_of_a_motor_that_turns_with_two_joints_goes_on_at_each_start(tmp_path):
    """A film without lag is no memory: the four parts of three joints move as without it."""
    arm = driven_wrist.mechanism(tmp_path)
    data = driven_wrist.dataset(arm, driven_wrist.frame(arm, 3.0))
    levels = np.stack([driven_wrist.COULOMB, 0 * driven_wrist.COULOMB, np.ones(4)], axis=1)
    theta = np.column_stack([levels, driven_wrist.VISCOUS])
    lagging = Friction(FilmLag(), np.column_stack([theta, np.full(4, 1e-6)]))
    q = ["q1", "q2", "q3"]
    tables = [
        predicted_motion(f, data, 0.1, 1.0)[q] for f in (Friction(Stribeck(), theta), lagging)
    ]
    assert np.abs(tables[0] - tables[1]).to_numpy().max() < 1e-4


def test_a_model_of_other_joints_is_refused():
    two = Friction(CoulombViscous(), np.full((2, 2), 0.01))
    with assert_refused("has 1 joints, the model has 2"):
        predicted_motion(two, dataset())


@pytest.mark.parametrize("name", ["out.csv", "out.parquet"])
def test_the_command_writes_the_table(tmp_path, name, run):
    write_dataset(tmp_path / "tiny")
    save_model(TRUE, tmp_path / "model.json")
    words = ("predict", "model.json", "tiny", "--out", name, "--horizon", 0.3)
    code, out, err = run(tmp_path, *words)
    assert (code, err) == (0, "") and out.endswith(f"written to {name}\n")
    read = pd.read_csv if name.endswith("csv") else pd.read_parquet
    table = read(tmp_path / name)
    assert str(len(table)) in out
    assert list(table.columns) == [
        "recording",
        "start_s",
        "time_s",
        "ahead_s",
        "q1",
        "w1",
        "measured_q1",
    ]
    assert_one_line(run(tmp_path, *words), "exists: choose another name, or --replace")
    assert_one_line(run(tmp_path, *words[:-1], 9, "--replace"), "choose other horizons")
