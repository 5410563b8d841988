"""The simulated rig around the physics: commands, drive, camera, settings, files, command line."""

import copy
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import tomli_w
from fixtures.mistakes import mistakes
from fixtures.refusals import assert_refused
from fixtures.tiny_pendulums import changed
from fixtures.true_curves import plain_friction
from numpy.random import default_rng

from frictionid.data.integrals import averages
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.signals import Signal, holds
from frictionid.report.experiment_design import DECIMALS, csv_of
from frictionid.simulate import (
    Camera,
    Chirp,
    Curve,
    Drive,
    LuGre,
    Multisine,
    Noise,
    Rig,
    Run,
    Sine,
    Steps,
    Stribeck,
    load_rig,
    noise_free,
    simulate,
    write_dataset,
)
from frictionid.simulate.dataset_folder import check_dataset_folder, rig_of

RUNS = (
    Run("fall", (2.0, 0.3)),
    Run("sine", (0.5, -0.4), torques=(Sine(0.12, 1.1),)),
    Run("steps", (-1.0, 0.0), (1.0, -2.0), (Steps(0.14, 0.1),)),
)
RIG = Rig(
    name="small",
    mechanism={"kind": "acrobot", "parameters": {"m4": 0.05}},
    friction=plain_friction((0.16, 0.05), (0.004, 0.001)),
    camera=Camera(samples=21, angle_noise=0.002),
    recordings=RUNS,
    true_parameters={"rotor": 1e-6},
    drive=Drive(delay=0.01, gain=0.9),
    seed=3,
    substeps=8,
    description="A small one.",
)
# A wheel of 1 kg m^2 without gravity and friction: its velocity is the integral of the torque.
WHEEL = Rig(
    name="wheel",
    mechanism={"kind": "pendulum", "parameters": {"g": 0.0}},
    friction=plain_friction(0.0, 0.0),
    camera=Camera(samples=31, rate=50.0),
    recordings=(Run("steps", (0.0,), (5.0,), (Steps(1.0, 0.07),)),),
    drive=Drive(rate=130.0, delay=0.033, gain=1.2),
    substeps=4,
)


@pytest.fixture(scope="module")
def small():
    return simulate(RIG)


@pytest.fixture(scope="module")
def other():
    return simulate(RIG, seed=9)


def signals(dataset):
    return [
        signal
        for r in dataset.recordings
        for signal in (r.angle, r.torque, r.truth.angle, r.truth.velocity)
    ]


def same(a, b):
    pairs = zip(signals(a), signals(b), strict=True)
    return all(np.array_equal(x.value, y.value) for x, y in pairs)


def test_the_mechanism_feels_the_logged_torque_late_and_scaled():
    recording = simulate(WHEEL).recordings[0]
    log, time = recording.torque, recording.angle.time
    assert len(set(log.value[:, 0])) > 5
    felt = Signal(log.time + 0.033, 1.2 * log.value, hold="previous")
    steps = averages(felt, time) * np.diff(time)[:, None]
    expected = 5.0 + np.concatenate([[[0.0]], np.cumsum(steps, axis=0)])
    assert recording.truth.velocity.value == pytest.approx(expected, abs=1e-12)


def test_seeds_reproduce_and_differ(small, other):
    assert same(simulate(RIG, seed=3), small)
    assert not same(other, small)
    assert other.truth["rig"]["seed"] == 9


def test_a_recording_does_not_depend_on_the_others(small):
    alone = simulate(replace(RIG, recordings=RUNS[2:])).recordings[0]
    among = small.recordings[2]
    assert np.array_equal(alone.torque.value, among.torque.value)
    assert alone.angle.value == pytest.approx(among.angle.value, abs=1e-11)


def test_the_noise_free_twin_has_the_same_motion(small):
    exact = simulate(noise_free(RIG))
    assert exact.name == "small_noise_free"
    errors = []
    for a, b in zip(small.recordings, exact.recordings, strict=True):
        assert np.array_equal(b.angle.value, b.truth.angle.value)
        assert np.array_equal(a.truth.angle.value, b.truth.angle.value)
        errors.append(a.angle.value - b.angle.value)
    assert np.std(errors) == pytest.approx(0.002, rel=0.2)


def test_what_the_rig_does_not_tell_is_in_the_truth(small):
    assert small.mechanism.table == {"kind": "acrobot", "parameters": {"m4": 0.05}}
    rig = {"torque_delay": 0.01, "torque_gain": 0.9, "parameters": {"rotor": 1e-6}}
    rig |= {"angle_noise": 0.002, "seed": 3}
    assert small.truth == {**RIG.friction.table(), "rig": rig}


@pytest.mark.parametrize(
    "command",
    [
        Sine(0.1, 2.0, phase=0.3),
        Chirp(0.1, 0.5, 4.0),
        Steps(0.1, 0.2),
        Multisine(0.1, (0.7, 1.9)),
        Noise(0.1, (0.5, 3.0)),
        Noise(0.1, (0.0, 3.0)),
    ],
    ids=repr,
)
def test_commands_reach_their_amplitude_and_stay_within(command):
    time = np.arange(600) / 60
    wave = command.values(time, default_rng(1))
    assert wave.shape == time.shape
    assert 0.09 < np.abs(wave).max() <= 0.1 + 1e-15
    assert wave.min() < -0.03 < 0.03 < wave.max()


def test_frequencies_are_those_asked_for():
    time, rng = np.arange(6000) / 60, default_rng(0)
    frequency = np.fft.rfftfreq(6000, 1 / 60)

    def power(wave):
        return np.abs(np.fft.rfft(wave)) ** 2

    peaks = frequency[np.argsort(power(Multisine(1.0, (0.5, 2.0)).values(time, rng)))[-2:]]
    assert sorted(peaks) == [0.5, 2.0]
    noise = power(Noise(1.0, (1.0, 4.0)).values(time, rng))
    inside = (frequency > 0.7) & (frequency < 6.0)
    assert noise[inside].sum() > 0.8 * noise.sum()
    chirp = Chirp(1.0, 0.5, 4.0).values(time, rng)
    crossings = np.flatnonzero(np.diff(np.sign(chirp)))
    halves = np.diff(time[crossings])
    assert 0.5 / halves[:3].mean() == pytest.approx(0.5, rel=0.1)
    assert 0.5 / halves[-9:].mean() == pytest.approx(4.0, rel=0.1)


def test_a_table_plays_what_suggest_writes_sample_for_sample_then_nothing(tmp_path):
    wave = np.round(0.1 * default_rng(0).standard_normal(91), DECIMALS)
    frame = pd.DataFrame({"time": np.arange(91) / 60, "u2": wave})
    (tmp_path / "signal.csv").write_text(csv_of(frame))
    document = copy.deepcopy(DOCUMENT) | {"camera": {"samples": 121}}
    document["recordings"][0]["torques"] = [{"kind": "table", "file": "signal.csv", "column": "u2"}]
    (tmp_path / "rig.toml").write_text(tomli_w.dumps(document))
    torque = simulate(load_rig(tmp_path / "rig.toml")).recordings[0].torque.value
    assert np.array_equal(torque[:, 1], np.append(wave, np.zeros(30))) and not torque[:, 0].any()
    (tmp_path / "signal.csv").unlink()
    with assert_refused("signal.csv cannot be read"):
        simulate(load_rig(tmp_path / "rig.toml"))


# Files


@pytest.mark.parametrize("rig", [RIG, WHEEL], ids=["one clock", "two clocks"])
def test_a_written_data_set_reads_back(rig, tmp_path):
    dataset = simulate(rig)
    write_dataset(dataset, tmp_path / "set", {"rig.toml": b"# settings"})
    again = load_dataset(tmp_path / "set")
    for name in ("name", "mechanism", "origin", "truth"):
        assert getattr(again, name) == getattr(dataset, name)
    assert [r.name for r in again.recordings] == [r.name for r in dataset.recordings]
    for x, y in zip(signals(dataset), signals(again), strict=True):
        assert np.array_equal(x.time, y.time)
        assert np.abs(x.value - y.value).max() < 1e-8
        assert holds(x) == holds(y)  # what is not stated is stated in the file
    assert (tmp_path / "set/rig.toml").read_bytes() == b"# settings"


def test_a_set_that_was_interrupted_is_refused_until_it_is_written_again(
    small, other, tmp_path, monkeypatch
):
    write_dataset(small, tmp_path)
    original = os.replace

    def killed(source, target):
        if Path(target).name == "dataset.toml":
            raise KeyboardInterrupt
        original(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", killed)
        with pytest.raises(KeyboardInterrupt):
            write_dataset(other, tmp_path)
    with assert_refused("is not the described file: its SHA-256"):
        load_dataset(tmp_path)
    write_dataset(other, tmp_path)
    assert load_dataset(tmp_path).truth == other.truth


def test_changed_files_are_replaced_on_request_only(small, tmp_path):
    write_dataset(small, tmp_path)
    (tmp_path / "sine.csv").write_text("mine")
    with assert_refused(r"sine\.csv was changed, or is none that was written"):
        write_dataset(small, tmp_path)
    write_dataset(small, tmp_path, replace=True)
    assert len(load_dataset(tmp_path).recordings) == 3
    with assert_refused(r"sine\.csv is a file"):
        check_dataset_folder(tmp_path / "sine.csv")


# Settings

DOCUMENT = {
    "name": "small",
    "mechanism": {"kind": "acrobot"},
    "friction": {
        "kind": "stribeck",
        "curve": dict.fromkeys(("coulomb_positive", "coulomb_negative"), [0.1, 0.1])
        | {"viscous": [0, 0]},
    },
    "camera": {"samples": 5},
    "recordings": [
        {"name": "a", "start_angle": [1.0, 0.0], "torques": [{"kind": "chirp", "amplitude": 0.1,
         "start_frequency": 1.0, "stop_frequency": 2}]}
    ],
}  # fmt: skip


def test_a_rig_toml_gives_the_rig_of_the_same_names(tmp_path):
    (tmp_path / "rig.toml").write_text(tomli_w.dumps(DOCUMENT))
    run = Run("a", (1.0, 0.0), torques=(Chirp(0.1, 1.0, 2.0),))
    curve = Curve((0.1, 0.1), (0.1, 0.1), (0.0, 0.0))
    assert load_rig(tmp_path / "rig.toml") == Rig(
        "small", {"kind": "acrobot"}, Stribeck(curve), Camera(5), (run,)
    )


MISTAKES = """
nane = 1                              => unknown key 'nane'; did you mean 'name'?
camera.angle_noise = -1.0             => camera.angle_noise: it should be greater than or equal
camera.samples = 1                    => samples: it should be greater than or equal to 2, not 1
camera.rate = inf                     => rate: it should be less than
mechanism.kind = "acrobt"             => did you mean 'acrobot'?
true_parameters = {rotr = 1e-6}       => has no parameter 'rotr'; did you mean 'rotor'?
friction.kind = "strib"               => unknown kind 'strib'; did you mean 'stribeck'?
friction.kind =                       => friction: the key "kind" is missing; add it
friction.kind = "film_lag"            => the key 'friction.lag' is missing
friction.curve.viscous = [0]          => viscous = [0.0] needs one number for each of 2
mechanism.kind = "pendulum"           => friction has numbers for 2 joints, the pendulum has 1
recordings = []                       => a rig needs at least one recording
recordings = [{name = "a", start_angle = [0, 0]}, {name = "a", start_angle = [0, 0]}]
    => two recordings are called 'a'
recordings.0.name = "../a"            => a name has letters, digits, - and _ only
recordings.0.start_angle = [1.0]      => start_angle = [1.0] needs one number for each
recordings.0.start_angle = ["up"]     => start_angle[0]: it should be a valid number
recordings.0.torques.0.kind = "sinus" => torques[0]: unknown kind 'sinus'; did you mean 'sine'?
recordings.0.torques.0.amplitude =    => the key 'recordings[0].torques[0].amplitude' is missing
recordings.0.torques = [{kind = "table", file = "a"}, {kind = "table", file = "b"}]
    => 2 torques for 1
"""


@mistakes(MISTAKES)
def test_mistakes_are_named_with_place_and_way_out(wrong, words):
    document = changed(copy.deepcopy(DOCUMENT), wrong)
    with assert_refused("^rig.toml: .*" + re.escape(words)):
        rig_of(document, "rig.toml")


def test_the_command_writes_a_set_and_its_noise_free_twin(tmp_path, run):
    settings = tmp_path / "rig.toml"
    settings.write_text(tomli_w.dumps({**DOCUMENT, "camera": {"samples": 5, "angle_noise": 0.01}}))
    for options, name in (([], "noisy"), (["--noise-free", "--seed", "7"], "exact")):
        code, out, _ = run(tmp_path, "simulate", settings, "--out", name, *options)
        assert code == 0 and "1 recordings, 5 samples" in out
    noisy, exact = (load_dataset(tmp_path / name) for name in ("noisy", "exact"))
    assert (tmp_path / "noisy/rig.toml").read_bytes() == settings.read_bytes()
    assert not (tmp_path / "exact/rig.toml").exists()
    assert np.array_equal(signals(exact)[0].value, signals(exact)[2].value)
    assert not np.allclose(signals(noisy)[0].value, signals(exact)[0].value)


def test_a_motion_that_diverges_is_refused_with_the_way_out():
    bristles = LuGre(Curve((0.01,), (0.01,), (0.0,)), (1e4,), (0.0,), (1.0,))
    stiff = replace(WHEEL, friction=bristles, substeps=2, recordings=(Run("fast", (0.0,), (5.0,)),))
    with assert_refused("'fast': .* diverges, .* raise substeps = 2"):
        simulate(stiff)
