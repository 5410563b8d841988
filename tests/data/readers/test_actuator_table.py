"""[actuator] in a dataset.toml and in Python: what it says becomes a servo, or one clear line."""

import re
import tomllib

import numpy as np
import pandas as pd
import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.paths import ROOT
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.data.readers.machine_toml import Actuator
from frictionid.data.servo import motor_torque, play
from frictionid.data.signals import Signal

TIME = np.arange(0.0, 2.0, 0.01)
FRAME = pd.DataFrame(
    {
        "t": TIME,
        "q": np.sin(3 * TIME),
        "aim": np.sin(3 * TIME) + 0.2 * np.cos(5 * TIME),
        "rate": np.cos(TIME),
        "more": 0.1 * np.sin(TIME),
        "vin": 7.0 - 0.2 * np.sin(2 * TIME),
        "on": (TIME < 1.0).astype(float),
    }
)
RIG = {"kind": "pendulum", "parameters": {"mass": 0.5, "length": 0.1}}
W = np.gradient(FRAME["q"].to_numpy(), TIME)
ERROR = (FRAME["aim"] - FRAME["q"]).to_numpy()
PD = dict(target="aim", output="torque", P=3.0, hold="linear")
DUTY = dict(target="aim", output="duty", P=1.5, kt=0.4, R=3.0, supply=7.0, hold="linear")


def read(actuator, frames=FRAME, **more):
    return fid.Dataset.from_frames(frames, RIG, time="t", angle="q", actuator=actuator, **more)


def torque(actuator):
    return read(actuator).recordings[0].torque.value[:, 0]


@pytest.mark.parametrize(
    "actuator, expected",
    [
        (PD, 3.0 * ERROR),
        ({**PD, "limit": 0.3}, np.clip(3.0 * ERROR, -0.3, 0.3)),
        (
            {**PD, "D": 0.2, "target_velocity": "rate", "feedforward": "more"},
            3.0 * ERROR + 0.2 * (FRAME["rate"] - W) + FRAME["more"],
        ),
        ({**PD, "scale": 0.5, "efficiency": 0.8, "enabled": "on"}, 1.2 * ERROR * FRAME["on"]),
        (
            {**PD, "output": "current", "kt": 0.05, "gear": 20.0, "limit": 0.4},
            0.05 * 20.0 * np.clip(3.0 * ERROR, -0.4, 0.4),
        ),
        (
            {**PD, "output": "voltage", "kt": 0.02, "R": 2.0, "gear": 20.0},
            motor_torque(3.0 * ERROR, W, 0.4, 2.0),
        ),
        (DUTY, motor_torque(7.0 * np.clip(1.5 * ERROR, -1, 1), W, 0.4, 3.0)),
        (
            {**DUTY, "supply": "vin", "limit": 0.2, "current_limit": 0.3},
            np.clip(
                motor_torque(FRAME["vin"] * np.clip(1.5 * ERROR, -0.2, 0.2), W, 0.4, 3.0),
                -0.12,
                0.12,
            ),
        ),
        (
            dict(target="rate", kind="velocity", output="torque", P=0.4, hold="linear"),
            0.4 * (FRAME["rate"] - W),
        ),
    ],
    ids=["P", "limit", "mit", "scale", "current", "voltage", "duty", "sag", "velocity"],
)
def test_each_controller_makes_the_torque_of_its_equation(actuator, expected):
    assert_allclose(torque(actuator), np.asarray(expected), atol=1e-12)


def test_held_targets_step_when_they_arrive():
    held = read({**PD, "hold": "previous", "delay": 0.004}).recordings[0]
    at = np.searchsorted(held.torque.time, 0.5 + 0.004)
    jump = held.torque.value[at, 0] - held.torque.value[at - 1, 0]
    assert jump == pytest.approx(3.0 * (FRAME["aim"][50] - FRAME["aim"][49]), rel=1e-3)


def test_gains_of_recordings_are_their_own():
    data = read({**PD, "recordings": {"stiff*": {"P": 6.0}}}, {"soft": FRAME, "stiff 1": FRAME})
    soft, stiff = (r.torque.value for r in data.recordings)
    assert_allclose(stiff, 2.0 * soft)
    again = data.with_frames({"stiff 2": FRAME})
    assert_array_equal(again.recordings[0].torque.value, stiff)


def test_play_follows_late_and_by_no_more_than_its_width():
    q = Signal(TIME, np.sin(7 * TIME)[:, None])
    z = play(q, 0.3).value
    seen = q.value - z
    assert np.abs(z).max() == pytest.approx(0.15) and np.ptp(seen) < np.ptp(q.value)
    # hysteresis is one of the path, not of the rate
    assert_array_equal(play(q._replace(time=2 * TIME), 0.3).value, z)
    assert_array_equal(play(q, 0.0).value, 0.0)


def test_a_dataset_toml_says_the_same_as_python(tmp_path):
    for name in ("soft", "stiff"):
        FRAME.to_csv(tmp_path / f"{name}.csv", index=False)
    (tmp_path / "dataset.toml").write_text(
        """
name = "servo"
[mechanism]
kind = "pendulum"
parameters = { mass = 0.5, length = 0.1 }
[columns]
time = "t"
angle = "q"
[actuator]
target = "aim"
output = "duty"
P = 1.5
D = 0.01
kt = 0.4
R = 3.0
supply = "vin"
delay = 0.003
[actuator.recordings.stiff]
P = 3.0
[recordings]
patterns = ["*.csv"]
"""
    )
    found = fid.load_dataset(tmp_path)
    actuator = {**DUTY, "hold": "previous", "D": 0.01, "supply": "vin", "delay": 0.003}
    actuator["recordings"] = {"stiff": {"P": 3.0}}
    same = read(actuator, {"soft": FRAME, "stiff": FRAME})
    for a, b in zip(found.recordings, same.recordings, strict=True):
        assert_allclose(a.torque.value, b.torque.value)
        assert a.servo.gain == b.servo.gain and np.any(a.torque.value)


MISTAKES = r"""
target = "goal" => has no column 'goal'
P = -1.0 => actuator\.P.*greater than or equal to 0, not -1
P = 0.0 => P = 0 without D and feedforward never moves a motor
kt = 0.4 => kt says nothing where output = "torque"; delete it
output = "duty"; kt = 0.4; R = 2.0 => needs the key 'supply'; add it
kind = "velocity"; D = 0.1 => kind = "velocity" has P only
target = ["aim", "rate"] => names 2 columns for 1 joint
P = [1.0, 2.0] => has 2 numbers for 1 joint
recordings = {run = {P = 2.0}} => 'run' matches no recording
recordings = {recording = {target = "q"}} => none of the keys that may differ
recordings = {recording = {P = -2.0}} => recordings.recording: P:
"""


@mistakes(MISTAKES)
def test_what_cannot_be_is_refused_in_one_line(wrong, words):
    with assert_refused(words):
        read({**PD, **changes(wrong)})


def test_a_measured_torque_beside_an_actuator_is_refused():
    with assert_refused(r"\[actuator\] and columns.torque exclude each other"):
        read(PD, torque="more")


def test_targets_that_do_not_cover_the_recording_are_refused():
    late = FRAME.assign(clock=TIME + 0.5)
    with assert_refused("targets are known from 0.5 to 2.49 s only"):
        read({**PD, "time": "clock"}, late)


def test_targets_with_a_clock_of_their_own_may_stand_in_rows_of_their_own():
    seen = FRAME[["t", "q"]].iloc[::2]
    aims = FRAME[["t", "aim"]].rename(columns={"t": "clock"})
    mixed = pd.concat([aims, seen], ignore_index=True)
    found = read({**PD, "time": "clock"}, mixed).recordings[0]
    assert_array_equal(found.angle.time, TIME[::2])
    assert_allclose(
        found.servo.torque(TIME[::2], found.angle.value, 0 * found.angle.value)[:, 0],
        3.0 * ERROR[::2],
        atol=1e-12,
    )


def test_a_missing_target_is_named_by_its_row():
    holes = FRAME.assign(aim=FRAME["aim"].where(FRAME["t"] != TIME[7]))
    with assert_refused("row 7.*'aim' is empty"):
        read(PD, holes)


PAGE = (ROOT / "docs/actuators.md").read_text()
TABLES = re.findall(r"^```toml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("text", TABLES)
def test_the_tables_of_the_page_are_actuators(text):
    actuator = Actuator(**tomllib.loads(text)["actuator"])
    actuator.check_joints(["q"])
    assert len(TABLES) == 3
