"""What `check` says of measured recordings, held against what their authors say of them."""

import json
from functools import cache

import pytest
from fixtures.changed_data import changed
from fixtures.dataset_files import shipped_with
from fixtures.paths import DATA
from fixtures.verdicts import identifiable, kinds

from frictionid.check import check
from frictionid.data.readers.dataset import load_dataset
from frictionid.report.diagnostics import as_json

COMMANDED = """
name = "commanded"
collection = "dfki_simple_pendulum"
[mechanism]
kind = "pendulum"
[mechanism.parameters]
mass = 0.7
length = 0.5
[columns]
time = "time"
angle = ["position"]
torque = ["torque"]
[recordings]
patterns = ["gravity_compensation_torque_is_commanded*"]
"""


@cache
def verdict_of(name, folder):
    """What is said of a shipped data set."""
    return check(load_dataset(DATA / name, folder))


def test_the_real_double_pendulum_is_usable(real_data):
    verdict = verdict_of("dfki_c1", real_data / "dfki_double_pendulum")
    assert verdict.level != "unusable"
    assert all(entry.possible for entry in verdict.identifiable)
    # nominal from its published model: torques push the right way, at the right size and time
    gains = [e for e in verdict.model_errors if e.kind == "gain"]
    assert all(e.size == pytest.approx(1.0, abs=0.1) for e in gains)
    assert abs(verdict.delay.seconds) < 0.006


def test_a_commanded_torque_leaves_nothing_to_identify(real_data, tmp_path):
    (tmp_path / "dataset.toml").write_text(COMMANDED)
    verdict = check(load_dataset(tmp_path, real_data / "dfki_simple_pendulum"))
    assert verdict.level == "unusable"
    assert verdict.findings[0].text.startswith(
        "nothing to identify: the torque equals a gravity model"
    )
    assert [entry.possible for entry in verdict.identifiable] == [False]


def test_the_simple_pendulum_is_heavier_than_its_published_model(real_data):
    verdict = verdict_of("simple_pendulum", real_data / "dfki_simple_pendulum")
    inertia, gravity = (verdict.estimate.at(name)[0] for name in ("inertia", "gravity"))
    assert 0.16 < inertia < 0.19 and 0.33 < gravity / 9.81 < 0.37


def test_least_squares_of_the_carriage_agree_with_the_published_ones(real_data):
    """M, Fc, Fv and offset within 1 %, as the command says them; speeds are in metres."""
    verdict = verdict_of("emps", real_data / "emps")
    assert verdict.identifiable[0].reason.endswith(" m/s")
    printed = json.loads(as_json(verdict))["estimate"]
    estimate = dict(zip(printed["names"], printed["value"], strict=True))
    published = {"mass": 95.1089, "coulomb_1": 20.3935, "viscous_1": 203.5034, "offset_1": -3.1648}
    assert verdict.level == "good"
    assert estimate == pytest.approx(published, rel=0.01)
    assert all(error is not None for error in printed["error"])


@pytest.mark.parametrize(
    ("times", "words"), [(1e3, "are in mm, not m"), (1e-3, "are in m, not mm")]
)
def test_a_carriage_in_the_wrong_unit_is_unusable(real_data, times, words):
    dataset = load_dataset(DATA / "emps", real_data / "emps")
    verdict = check(changed(dataset, "angle", lambda q: times * q))
    assert verdict.level == "unusable"
    assert verdict.findings[0].text.startswith(f"positions {words}: corrected")


# Findings that the README bears out: kinds, by data set and collection.
ALLOWED = {
    # nominal: a published model, of which three of one design differ by a factor of four
    ("dfki_c1_swingup", "dfki_double_pendulum"): {"nominal_mechanism", "angle_outliers"},
    ("simple_pendulum", "dfki_simple_pendulum"): set(),
    # torque is computed, friction depends on the load (published M2, M4, M6)
    # from kt and R, which are tied, and both gain sets move one mass at one length
    # the voltage of the higher gain is at its limit in 1 % of the samples
    ("bam_xl330", "bam_xl330"): {
        *("modelled_torque", "load", "tied_constants", "one_payload", "motor_limit"),
    },
    ("bam_xl330_passive", "bam_xl330"): set(),
    ("emps", "emps"): set(),
    ("phy180", "phy180_camera_pendulum"): set(),
}


@pytest.mark.parametrize(("name", "collection"), ALLOWED)
def test_no_finding_contradicts_the_authors(real_data, name, collection):
    verdict = verdict_of(name, real_data / collection)
    assert kinds(verdict).keys() <= ALLOWED[name, collection]
    assert all(q.passed is not False or "measured" in q.question for q in verdict.questions)
    friction = identifiable(verdict, "friction of joint 1")
    # "practically only air drag": below what accelerations show
    assert friction.possible == (name != "phy180"), friction.reason
    if name in ("bam_xl330_passive", "phy180"):
        bodies = identifiable(verdict, "inertia combinations")
        assert bodies.reason == "ratios to gravity only, which no torque shows"


def of_the_arm(real_data, tmp_path, patterns):
    """What is said of other recordings of the arm."""
    usual = '["design_C.1/sys_id_20230629/*.csv*"]'
    folder = shipped_with(tmp_path, "dfki_c1", (usual, patterns))
    return check(load_dataset(folder, real_data / "dfki_double_pendulum"))


def test_a_coarse_clock_is_no_early_torque_and_no_frozen_sensor(real_data, tmp_path):
    """Swing-ups at 33 Hz from rest: joints leave it within one sample, torques are held."""
    verdict = of_the_arm(
        real_data, tmp_path, '["design_C.1/leaderboard_pendubot_v2_mcpilco/*.csv*"]'
    )
    findings = kinds(verdict)
    assert not findings.keys() & {"delay", "frozen_sensor", "frozen_torque"}
    hold = findings["hold"]
    assert "held or interpolated between samples, or late" in hold.text


def test_estimates_of_runs_that_end_in_balancing_hold_their_bias(real_data, tmp_path):
    """Pendubot runs: gravity of joint 1 comes out at 1.6 with the balancing, 1.9 without."""
    verdict = of_the_arm(
        real_data, tmp_path, '["design_C.1/leaderboard_pendubot_v2_ilqr_tvlqr_lqr/*.csv*"]'
    )
    gravity, error = verdict.estimate.at("gravity_1")
    assert abs(gravity - 1.9) < 2 * error
    low, high = verdict.delay.interval
    assert low < 0.0 < high
    assert "delay" not in kinds(verdict)


def test_one_recording_of_a_sine_is_not_called_late_by_half_a_second(real_data, tmp_path):
    """Any misfit of a nearly periodic torque is smaller at some far delay."""
    verdict = of_the_arm(real_data, tmp_path, '["design_C.1/sys_id_20230629/20230629-143339.csv*"]')
    assert "delay" not in kinds(verdict)
    delay = identifiable(verdict, "torque delay")
    assert not delay.possible and delay.reason == "no delay explains the motion clearly"
