"""Statements on public recordings, held against what their README says of them."""

from __future__ import annotations

import pytest
from fixtures.paths import DATA

from frictionid.check import check
from frictionid.data.readers.dataset import load_dataset

ARM = (DATA / "dfki_c1" / "dataset.toml").read_text()

# Findings that the README bears out: kinds, by data set and collection.
ALLOWED = {
    # nominal: a published model, of which three of one design differ by a factor of four
    ("dfki_c1_swingup", "dfki_double_pendulum"): {"nominal_mechanism", "angle_outliers"},
    ("simple_pendulum", "dfki_simple_pendulum"): set(),
    # torque is computed, friction depends on the load (published M2, M4, M6)
    # from kt and R, which are tied, and both gain sets move one mass at one length
    ("bam_xl330", "bam_xl330"): {"modelled_torque", "load", "tied_constants", "one_payload"},
    ("bam_xl330_passive", "bam_xl330"): set(),
    ("emps", "emps"): set(),
    ("phy180", "phy180_camera_pendulum"): set(),
}


@pytest.mark.parametrize(("name", "collection"), ALLOWED)
def test_no_finding_contradicts_the_authors(real_data, name, collection):
    verdict = check(load_dataset(DATA / name, real_data / collection))
    assert {f.kind for f in verdict.findings} <= ALLOWED[name, collection]
    assert all(q.passed is not False or "measured" in q.question for q in verdict.questions)
    friction = next(e for e in verdict.identifiable if e.what == "friction of joint 1")
    # "practically only air drag": below what accelerations show
    assert friction.possible == (name != "phy180"), friction.reason
    if name in ("bam_xl330_passive", "phy180"):
        bodies = next(e for e in verdict.identifiable if e.what == "inertia combinations")
        assert bodies.reason == "ratios to gravity only, which no torque shows"


def of_the_arm(tmp_path, patterns):
    before, _ = ARM.split("[recordings]")
    (tmp_path / "dataset.toml").write_text(f"{before}[recordings]\npatterns = {patterns}\n")
    return tmp_path


def test_a_coarse_clock_is_no_early_torque_and_no_frozen_sensor(real_data, tmp_path):
    """Swing-ups at 33 Hz from rest: joints leave it within one sample, torques are held."""
    folder = of_the_arm(tmp_path, '["design_C.1/leaderboard_pendubot_v2_mcpilco/*.csv*"]')
    verdict = check(load_dataset(folder, real_data / "dfki_double_pendulum"))
    kinds = {f.kind for f in verdict.findings}
    assert not kinds & {"delay", "frozen_sensor", "frozen_torque"}
    hold = next(f for f in verdict.findings if f.kind == "hold")
    assert "held or interpolated between samples, or late" in hold.text


def test_estimates_of_runs_that_end_in_balancing_hold_their_bias(real_data, tmp_path):
    """Pendubot runs: gravity of joint 1 comes out at 1.6 with the balancing, 1.9 without."""
    folder = of_the_arm(tmp_path, '["design_C.1/leaderboard_pendubot_v2_ilqr_tvlqr_lqr/*.csv*"]')
    verdict = check(load_dataset(folder, real_data / "dfki_double_pendulum"))
    gravity, error = verdict.estimate.at("gravity_1")
    assert abs(gravity - 1.9) < 2 * error
    low, high = verdict.delay.interval
    assert low < 0.0 < high
    assert "delay" not in {f.kind for f in verdict.findings}


def test_one_recording_of_a_sine_is_not_called_late_by_half_a_second(real_data, tmp_path):
    """Any misfit of a nearly periodic torque is smaller at some far delay."""
    folder = of_the_arm(tmp_path, '["design_C.1/sys_id_20230629/20230629-143339.csv*"]')
    verdict = check(load_dataset(folder, real_data / "dfki_double_pendulum"))
    assert "delay" not in {f.kind for f in verdict.findings}
    delay = next(e for e in verdict.identifiable if e.what == "torque delay")
    assert not delay.possible and delay.reason == "no delay explains the motion clearly"
