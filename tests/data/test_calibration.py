"""What a fit found of machine and sensors: undone in the data, added to it, kept in files."""

import json
from dataclasses import replace

import numpy as np
import pytest
from fixtures.dataset_files import assert_same
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.integrals import averages
from frictionid.data.plants import (
    Calibration,
    calibrated_dataset,
    calibrated_plant,
    plant_of,
    stack_calibrations,
)
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.friction.model_files import load_model, save_model
from frictionid.mechanics import mechanism_of

ACROBOT = {"kind": "acrobot", "parameters": {"m4": 0.084}}
NONE = Signal(np.arange(60) / 60, np.zeros((60, 2)))  # of torque


def dataset(torque, **overrides):
    angle = Signal(np.arange(50) / 60, np.ones((50, 2)))
    return Dataset("rig", ACROBOT, (Recording("a", angle, torque, parameters=overrides),))


@pytest.mark.parametrize("hold", ["linear", "previous"])
def test_a_corrected_torque_acts_later_stronger_and_beside_its_zero(hold):
    time = np.arange(60) / 60
    torque = Signal(time, np.stack([0 * time, np.sin(9 * time)], axis=-1), hold)
    calibration = replace(Calibration.ideal(2), delay=0.013, gain=[3.0, 1.1], bias=[9.0, 0.02])
    felt = calibrated_dataset(dataset(torque), calibration[None][0]).recordings[0].torque
    edges = np.linspace(0.1, 0.8, 40)
    expected = 1.1 * averages(torque, edges - 0.013)[:, 1] + 0.02
    assert_allclose(averages(felt, edges)[:, 1], expected, atol=1e-12)
    assert_array_equal(felt.value[:, 0], 0.0)  # joint 1 has no motor


def test_an_ideal_calibration_corrects_nothing():
    data = dataset(Signal(np.arange(60) / 60, np.ones((60, 2)) * [0.0, 0.3]))
    assert_same(calibrated_dataset(data, Calibration.ideal(2)).recordings[0], data.recordings[0])


def test_corrected_angles_have_lost_the_offset():
    data = dataset(NONE)
    calibration = replace(Calibration.ideal(2), offset=np.array([0.1, -0.2]))
    assert_allclose(
        calibrated_dataset(data, calibration).recordings[0].angle.value, [[0.9, 1.2]] * 50
    )


def test_what_a_recording_changes_adds_to_fitted_base_parameters():
    usual, heavy = dataset(NONE), dataset(NONE, m4=0.184)
    mechanism = mechanism_of(ACROBOT)
    base = 1.1 * plant_of(usual).p[0]
    found = calibrated_plant(heavy, Calibration.ideal(2, base)).p[0]
    added = mechanism.base({"m4": 0.184}) - mechanism.base({"m4": 0.084})
    assert_allclose(found, base + added, rtol=1e-12)
    assert_array_equal(calibrated_plant(heavy, Calibration.ideal(2)).p, plant_of(heavy).p)


def test_base_parameters_of_another_mechanism_are_refused():
    data = dataset(NONE)
    with assert_refused("has 2 base parameters, this mechanism has 6"):
        calibrated_plant(data, Calibration.ideal(2, np.ones(2)))


def test_an_index_into_friction_picks_its_calibration_too():
    calibrations = [
        replace(Calibration.ideal(1, np.ones(2) * k), delay=np.array(k), motor=np.array([k, 4.0]))
        for k in range(3)
    ]
    friction = Friction(
        CoulombViscous(), np.zeros((3, 1, 2)), calibration=stack_calibrations(calibrations)
    )
    assert friction[2].calibration is not None
    assert float(friction[2].calibration.delay) == 2.0
    assert_array_equal(friction[1].calibration.base, [1.0, 1.0])
    assert_array_equal(friction[1].calibration.motor, [1.0, 4.0])
    assert friction[1].calibration.envelope is None
    assert friction[[0, 2]].calibration.gain.shape == (2, 1)


def save_calibrated(calibration, path):
    friction = Friction(CoulombViscous(), [[0.1, 0.2]], calibration=calibration)
    save_model(friction, path)


@pytest.mark.parametrize("base", [None, np.array([0.1, 0.2, 0.3])])
def test_a_model_file_keeps_the_calibration(tmp_path, base):
    arrays = {"delay": 0.0123, "bias": [0.5], "motor": [0.4, 3.0], "envelope": [[0.4, 2.0, 5.0]]}
    arrays = {name: np.array(value) for name, value in arrays.items()}
    calibration = replace(Calibration.ideal(1, base), **arrays)
    save_calibrated(calibration, tmp_path / "m.json")
    again = load_model(tmp_path / "m.json").calibration
    for name in ("gain", "delay", "bias", "offset", "motor", "envelope", "base"):
        assert_array_equal(getattr(again, name), getattr(calibration, name))


@pytest.mark.parametrize(
    "change, words",
    [
        ({"delay": None}, "calibration.delay must be finite"),
        ({"gain": [float("nan")]}, "calibration.gain must be finite"),
        ({"extra": 1}, '"calibration" must have base, gain, delay, bias, offset'),
    ],
)
def test_a_damaged_calibration_is_refused_in_one_line(tmp_path, change, words):
    save_calibrated(Calibration.ideal(1), tmp_path / "m.json")
    table = json.loads((tmp_path / "m.json").read_text())
    table["calibration"] |= change
    (tmp_path / "m.json").write_text(json.dumps(table))
    with assert_refused(words):
        load_model(tmp_path / "m.json")
