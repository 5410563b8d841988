"""Names that cannot be shown, numbers that no sensor reports and pictures without measure."""

import os

import numpy as np
import pytest
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.tiny_pendulums import dataset, recordings, write_dataset

from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal
from frictionid.rig.camera.scene import View
from frictionid.simulate import Steps
from frictionid.simulate.torques import Multisine, Noise


def test_a_table_named_in_bytes_that_are_no_text_is_refused(tmp_path, run):
    write_dataset(tmp_path / "odd")
    os.rename(tmp_path / "odd/00.csv", os.fsencode(tmp_path / "odd") + b"/\xff\x1b[31m.csv")
    outcome = run(tmp_path, "check", "odd")
    assert_one_line(outcome, "\\udcff\\x1b[31m", "rename it")
    assert "\x1b" not in outcome[2]


@pytest.mark.parametrize("name", ["\x1b[31mred", "a\nb", "\u202eevil", "\x00"])
def test_names_that_steer_a_terminal_are_refused(name):
    with assert_refused("has characters that cannot be shown: rename it"):
        dataset(name=name)


@pytest.mark.parametrize("quantity, value", [("angle", 1e308), ("torque", -1e308), ("time", 1e100)])
def test_numbers_that_no_sensor_reports_are_refused(quantity, value):
    r = recordings()[0]
    time, angle, torque = (x.copy() for x in (r.angle.time, r.angle.value, r.torque.value))
    {"angle": angle, "torque": torque, "time": time}[quantity][-1] = value
    with assert_refused("which no sensor reports"):
        Recording("x", Signal(time, angle), Signal(r.torque.time, torque))


def test_settings_without_measure_are_refused():
    for make in (
        lambda: View(size=(20_000, 20_000)),
        lambda: Steps(-1.0, 0.1),
        lambda: Noise(-1.0, 1.0, 2.0),
        lambda: Multisine(-1.0, (1.0, 2.0)),
    ):
        with assert_refused("it should be (less|greater) than or equal to"):
            make()
    assert np.isfinite(Steps(1.0, 0.1).values(np.arange(9.0), np.random.default_rng(0))).all()
