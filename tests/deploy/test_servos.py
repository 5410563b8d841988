"""Torque from outside of servos, whose torques are computed from targets that act late."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from drive_logs import ServoPendulum
from fixtures.dataset_files import DESCRIPTION, write
from fixtures.refusals import assert_one_line
from fixtures.servo_logs import by_controller

import frictionid as fid
from frictionid.data.plants import Calibration
from frictionid.friction.laws import CoulombViscous
from frictionid.friction.model_files import save_model

RIG = ServoPendulum()
LOG = RIG.log(4.0, 0.05, seed=0)


@pytest.fixture
def friction():
    """As a fit by shooting leaves it, which found the delay of the targets."""
    found = replace(Calibration.ideal(1), target_delay=np.array(RIG.delay))
    return fid.Friction(CoulombViscous(), [[0.03, 0.02]], calibration=found)


def test_targets_are_as_late_as_the_fit_found_them(friction):
    """As if the data set had said so."""
    sets = [by_controller(RIG, {"a": LOG}, P=4.0, D=0.05, delay=s) for s in (0, RIG.delay)]
    frames = [fid.external_torque(friction, data, quiet=data).frame for data in sets]
    pd.testing.assert_frame_equal(*frames)


def test_a_stream_is_refused_before_it_begins(friction, tmp_path, run):
    save_model(friction, tmp_path / "model.json")
    document = DESCRIPTION | {
        "mechanism": {"kind": "pendulum", "parameters": {"mass": RIG.mass, "length": RIG.length}},
        "columns": {"time": "t", "angle": "q"},
        "actuator": {"target": "target", "output": "torque", "P": 4.0, "D": 0.05},
    }
    write(tmp_path, document, a_csv=LOG)
    said = run(tmp_path, "watch model.json . --follow a.csv --idle 0")
    assert_one_line(said, "[actuator]", "stream a column of torques")
