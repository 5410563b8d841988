"""Measured, commanded, modelled or cannot tell: what a logged torque shows of its own origin."""

import re
from dataclasses import replace

import numpy as np
import pytest
from fixtures.dataset_files import shipped_with
from fixtures.one_joint_sets import Setup, one_recording, sets
from fixtures.paths import DATA
from fixtures.verdicts import kinds

from frictionid.check import check
from frictionid.check.facts import deviations, noise_of, unexplained_noise
from frictionid.check.torque_source import torque_sources
from frictionid.comparison.fit_model import fit_model
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import resolution
from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction.laws import CoulombViscous
from frictionid.report import show_fit

COUNT = 40


def sources(dataset):
    return {(s.joint, s.source) for s in torque_sources(dataset)}


@pytest.mark.parametrize(
    ("setup", "source"),
    [
        (Setup(), "measured"),
        (Setup(feedback=True, lag=0.003), "measured"),
        (Setup(logged="command", lag=0.005), "commanded"),
        (Setup(logged="exact"), "commanded"),
        (Setup(logged="command", lag=0.005, feedback=True), "commanded"),
        (Setup(logged="voltage"), "modelled"),
    ],
)
def test_the_source_of_the_torque_is_recognised(setup, source):
    """Forty sets of each, seed 3: a sensor with steps and noise, a command, a motor model."""
    found = [torque_sources(dataset)[0].source for dataset in sets(setup, COUNT, seed=3)]
    assert np.mean([f == source for f in found]) >= 0.95
    assert np.mean([f not in (source, "cannot tell") for f in found]) <= 0.02


def arm(tmp_path, columns):
    """The real double pendulum with other columns as its torque."""
    return shipped_with(tmp_path, "dfki_c1", ('["tau_meas1", "tau_meas2"]', columns))


@pytest.mark.parametrize(
    ("columns", "allowed"),
    [
        ('["tau_con1", "tau_con2"]', {"commanded"}),
        ('["tau_meas1", "tau_meas2"]', {"measured", "cannot tell"}),
    ],
)
def test_commands_of_a_real_arm_are_commands_in_each_recording(
    real_data, tmp_path, columns, allowed
):
    dataset = load_dataset(arm(tmp_path, columns), real_data / "dfki_double_pendulum")
    for recording in dataset.recordings:
        one = replace(dataset, recordings=(recording,))
        assert {source for _, source in sources(one)} <= allowed, recording.name
    together = {source for _, source in sources(dataset)}
    assert together == {"commanded" if "commanded" in allowed else "measured"}


def test_measured_torques_of_a_shipped_arm_are_not_held(real_data):
    """A fit to held ones finds half a sample of delay, however late they are."""
    dataset = load_dataset(DATA / "tiago", real_data / "tiago_arm")
    assert {source for _, source in sources(dataset)} == {"measured"}
    assert {recording.torque.hold for recording in dataset.recordings} == {"linear"}


def test_a_commanded_arm_is_not_called_good(real_data, tmp_path):
    folder = arm(tmp_path, '["tau_con1", "tau_con2"]')
    verdict = check(load_dataset(folder, real_data / "dfki_double_pendulum"))
    assert verdict.level == "doubtful"
    assert "commanded_torque" in kinds(verdict)
    first = verdict.questions[0]
    assert first.question == "is the torque measured" and first.passed is False
    assert re.search(r"commanded .*no quantisation step, and noise of only \S+e-0\d", first.words)


@pytest.mark.parametrize(
    ("name", "collection", "source"),
    [
        ("emps", "emps", {"modelled"}),
        ("bam_xl330", "bam_xl330", {"modelled"}),
        ("bam_xl330_whole", "bam_xl330", {"modelled"}),
        ("bam_xl330_passive", "bam_xl330", set()),
        ("simple_pendulum", "dfki_simple_pendulum", {"measured"}),
        ("dfki_c1_swingup", "dfki_double_pendulum", {"measured"}),
        ("ibm", "ibm_double_pendulum_chaotic", set()),
    ],
)
def test_public_recordings_are_what_their_authors_say(real_data, name, collection, source):
    found = sources(load_dataset(DATA / name, real_data / collection))
    assert {s for _, s in found} == source


def test_torque_steps_that_are_held_are_commands_and_a_rounded_curve_is_undecided():
    time = np.arange(1000) * 0.01
    angle = np.sin(2 * time)
    held = np.sign(np.sin(3 * time)) * 0.4
    assert sources(one_recording(time, angle, held)) == {(1, "commanded")}
    steps = np.where(time // 0.8 % 5 == 4, 0.0, np.where(time // 0.8 % 2, 0.4, -0.4))
    (source,) = torque_sources(one_recording(time, angle, steps))
    assert "it is held for 80 samples at a time" in source.words
    rounded = np.round(np.sin(3 * time) / 0.02) * 0.02
    assert sources(one_recording(time, angle, rounded)) == {(1, "cannot tell")}


def test_a_controller_that_feeds_back_noise_is_told_from_a_sensor():
    """The same noise on the torque: once from the angle's readings, once the sensor's own."""
    rng = np.random.default_rng(0)
    time = np.arange(3000) * 0.002
    angle = np.sin(2 * time) + 1e-3 * rng.standard_normal(3000)
    fed_back = np.cos(3 * time) - 0.01 * np.gradient(angle, time)[np.r_[0, 0:2999]]
    own = np.cos(3 * time) + np.std(np.diff(fed_back, 2)) / 6**0.5 * rng.standard_normal(3000)
    assert unexplained_noise(time, fed_back, angle[:, None]) < 0.05
    assert unexplained_noise(time, own, angle[:, None]) > 0.9
    assert sources(one_recording(time, angle, fed_back)) == {(1, "commanded")}
    assert sources(one_recording(time, angle, own)) <= {(1, "measured"), (1, "cannot tell")}


def test_deviations_of_white_noise_have_its_standard_deviation_on_any_clock():
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.5, 1.5, 20000)) * 0.01
    noise = 0.3 * rng.standard_normal(20000)
    smooth = 5 * np.sin(time)
    for neighbours in (1, 2, 3):
        assert deviations(time, noise[:, None], neighbours).std() == pytest.approx(0.3, rel=0.03)
    assert noise_of(time, smooth + noise).level == pytest.approx(0.3, rel=0.05)
    assert noise_of(time, smooth).level < 1e-5
    assert resolution(np.round(smooth / 0.25) * 0.25) == pytest.approx(0.25)


def test_without_motor_or_torque_the_question_is_not_tested():
    time = np.arange(300) / 60
    angle, none = Signal(time, np.sin(3 * time)[:, None]), Signal(time, np.zeros((300, 1)))
    for driven, words in ((False, "no joint has a motor"), (True, "no torque acts")):
        machine = {
            "kind": "pendulum",
            "driven": driven,
            "parameters": {"mass": 1.0, "length": 1.0},
        }
        first = check(Dataset("d", machine, (Recording("a", angle, none),))).questions[0]
        assert (first.passed, first.words) == (None, words)


def test_a_fit_repeats_where_its_torque_comes_from(capsys):
    dataset = sets(Setup(logged="command", lag=0.005), 1, seed=4)[0]
    friction = fit_model(dataset, LeastSquares(CoulombViscous()))
    (sentence,) = friction.provenance.torque
    assert sentence.startswith("torque 1 is commanded: no quantisation step, and noise of only")
    show_fit(friction)
    assert sentence in capsys.readouterr().out
