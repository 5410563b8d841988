"""Horizons and sample time follow the data, where nobody has said which."""

from dataclasses import replace

import numpy as np
from fixtures import driven_wrist as wrist
from fixtures.changed_data import each
from fixtures.result_folders import leave_blank
from fixtures.tiny_pendulums import dataset

import frictionid as fid
from frictionid.data.signals import Signal
from frictionid.evaluation import Protocol, Split, make_folds, prepare, protocol_for

SUITE = """
name = "arm"
[[datasets]]
path = "."
[[recipes]]
name = "inverse_dynamics"
[[identifiers]]
kind = "coulomb_viscous"
"""


def faster(data, factor):
    """The data set with its clocks running faster, so that it is shorter."""

    def sped(signal):
        return signal._replace(time=signal.time / factor)

    fast = each(data, lambda r: replace(r, angle=sped(r.angle), torque=sped(r.torque), truth=None))
    return replace(fast, truth=None)


def test_every_horizon_that_is_kept_can_be_predicted_and_no_other_is_left():
    usual = Protocol()
    for factor in (1.0, 1.5, 4.0):
        data = faster(dataset(), factor)
        folds = make_folds(data.recordings, Split(count=3))
        protocol = protocol_for(usual, [(data, folds)])
        prepare(data, protocol)
        longest = 1.5 / factor - usual.history - usual.every
        assert protocol.horizons == tuple(h for h in usual.horizons if h <= longest) or (0.1,)
        assert protocol.sample_time is None


def test_what_a_user_says_stays():
    data = dataset()
    said = Protocol(horizons=(0.3, 20.0), sample_time=0.05)
    assert protocol_for(said, [(data, None)]) == said


def test_fast_logs_of_arms_are_thinned_and_predicted_briefly(tmp_path):
    arm = wrist.mechanism(tmp_path)
    data = wrist.dataset(arm, wrist.frame(arm, seconds=6.0))
    assert protocol_for(Protocol(), [(data, None)]).horizons == (0.05, 0.1, 0.2)
    time = np.arange(0.0, 0.9, 2e-4)
    still = Signal(time, np.zeros((len(time), 3)))
    fast = replace(data, recordings=(replace(data.recordings[0], angle=still, torque=still),))
    assert protocol_for(Protocol(), [(fast, None)]).sample_time == 0.002


def test_a_suite_of_an_arm_that_says_nothing_else_runs(tmp_path, monkeypatch):
    """One recording of few seconds: folds, horizons and windows are those that it holds."""
    leave_blank(monkeypatch)
    arm = wrist.uncoupled(tmp_path)
    wrist.frame(arm, seconds=6.0, rate=100.0).to_csv(tmp_path / "run.csv", index=False)
    angle, torque = (str(names).replace("'", '"') for names in wrist.COLUMNS)
    (tmp_path / "dataset.toml").write_text(
        f"""name = "arm"
        [mechanism]
        urdf = "wrist.urdf"
        [columns]
        time = "t"
        angle = {angle}
        torque = {torque}
        [motor]
        coupling = {wrist.GEARS.tolist()}
        offset = {wrist.ZERO.tolist()}
        angle = "motor"
        torque = "motor"
        [mechanism.parameters]
        rotor_one = 0.4
        [recordings]
        patterns = ["run.csv"]
        """
    )
    (tmp_path / "suite.toml").write_text(SUITE)
    bench = fid.run_suite(tmp_path / "suite.toml", out=tmp_path / "report", jobs=1)
    assert set(bench.scores["horizon_s"].dropna()) == {0.05, 0.1}
    assert (tmp_path / "report/tables/torque--arm.md").is_file()
    left = bench.scores.query("score == 'torque_left' and joint == 'all' and fold == 'all'")
    assert (left["value"] < 0.03).all()


def test_a_frame_of_a_second_can_be_evaluated():
    short = faster(dataset(), 2.0)
    fit = fid.fit(short, "coulomb_viscous")
    scores = fid.evaluate(fit, short)
    assert set(scores["horizon_s"].dropna()) == {0.1, 0.25}
