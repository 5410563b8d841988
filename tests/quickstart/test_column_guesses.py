"""Columns of tables are guessed by names and numbers, and by what the motion says of them."""

import numpy as np
import pandas as pd
import pytest
from fixtures.driven_pendulum import simulated
from fixtures.lab_tables import MACHINE, write_lab_tables
from fixtures.refusals import assert_refused

from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.table import Table
from frictionid.quickstart.column_guesses import guess_columns
from frictionid.quickstart.describe_tables import Known, describe_tables
from frictionid.quickstart.robot_columns import robot_columns, robot_file
from frictionid.quickstart.tables import tables_at
from frictionid.simulate import Camera, Drive, Run, Sine

TIME = np.arange(200) / 100.0
Q, W, U = np.sin(5 * TIME), 5 * np.cos(5 * TIME), 0.3 * np.cos(2 * TIME)


def guessed(columns, driven=(True,), unit="rad", named=None):
    columns = {name: np.asarray(c, float) for name, c in columns.items()}
    table = Table("a.csv", np.arange(len(TIME)), columns)
    return guess_columns(table, driven, (unit,) * len(driven), named or {})


NAMED = {
    "plain": ({"t": TIME, "q": Q, "u": U}, "t in s, q in rad, u in N m"),
    "microseconds": ({"stamp": 1e6 * TIME, "q": Q, "tau": U}, "stamp in us, q in rad, tau in N m"),
    "as a bag of ROS": (
        {"%time": 1.7e18 + 1e9 * TIME, "field.position0": Q, "field.effort0": U},
        "%time in ns, field.position0 in rad, field.effort0 in N m",
    ),
    "by range": ({"t": TIME, "pos": 57.3 * 4 * Q, "u": U}, "t in s, pos in deg, u in N m"),
    "counts of a servo": (
        {"t": TIME, "present_position": np.rint(2300 + 400 * Q), "u": U},
        "t in s, present_position in counts, u in N m",
    ),
    "counts of 300 degrees": (
        {"t": TIME, "pos": np.rint(500 + 400 * Q), "u": U},
        "t in s, pos in counts, u in N m",
    ),
    "counts": (
        {"t": TIME, "enc_cnt": np.rint(400 * Q), "u": U},
        "t in s, enc_cnt in counts, u in N m",
    ),
    "whole degrees": ({"t": TIME, "pos": np.rint(90 * Q), "u": U}, "t in s, pos in deg, u in N m"),
    "units named": (
        {"time [ms]": 1e3 * TIME, "Angle [deg]": Q, "Torque [mNm]": U},
        "time [ms] in ms, Angle [deg] in deg, Torque [mNm] in mN m",
    ),
    "milliamperes": ({"t": TIME, "q": Q, "I": 900 * U}, "t in s, q in rad, I in mA"),
    "commands are second": (
        {"t": TIME, "q_ref": Q, "q": Q, "u_cmd": U, "u": U},
        "t in s, q in rad, u in N m",
    ),
    "only a command": ({"t": TIME, "q": Q, "u_cmd": U}, "t in s, q in rad, u_cmd in N m"),
    "a sensor before others": (
        {"t": TIME, "q_filt": W, "q": Q, "tau_con": 2 * U, "tau_fric": 0.1 * U, "tau_meas": U},
        "t in s, q in rad, tau_meas in N m",
    ),
    "torque before current": (
        {"t": TIME, "q": Q, "i": U, "torque": U},
        "t in s, q in rad, torque in N m",
    ),
    "what is left": ({"t": TIME, "q": Q, "M": U}, "t in s, q in rad, M in N m"),
    "by units": (
        {"t": TIME, "P": W, "rod [deg]": Q, "M [mNm]": U},
        "t in s, rod [deg] in deg, M [mNm] in mN m",
    ),
    "by slope": ({"a": TIME, "b": Q, "c": W, "u": U}, "a in s, b in rad, u in N m"),
}


@pytest.mark.parametrize("columns, expected", NAMED.values(), ids=NAMED)
def test_columns_and_units_are_told_by_names_and_numbers(columns, expected):
    guesses = guessed(columns)
    parts = (guesses.time, guesses.angle, guesses.torque)
    assert ", ".join(f"{part.columns[0]} in {part.unit}" for part in parts) == expected
    assert sorted([*guesses.unused, *(part.columns[0] for part in parts)]) == sorted(columns)


def test_motors_get_the_torques_and_other_joints_none():
    columns = {"t": TIME, "q1": Q, "q2": W / 9, "u2": U}
    assert guessed(columns, (False, True)).torque.columns == ("", "u2")
    assert guessed({**columns, "u1": U}, (True, True)).torque.columns == ("u2", "u1")
    assert guessed(columns, (False, False)).torque.columns == ("", "")


@pytest.mark.parametrize(
    "name, torque, hold",
    [
        ("u", U, "previous"),  # as everywhere, where nothing says that a sensor took the samples
        ("u_cmd", U, "previous"),
        ("tau_meas", U, "linear"),
        ("current", U, "linear"),
        ("current", np.repeat(np.sin(np.arange(20.0)), 10), "previous"),
        ("u", 0 * U, "previous"),
    ],
)
def test_torques_are_held_but_for_the_samples_of_a_sensor(name, torque, hold):
    assert guessed({"t": TIME, "q": Q, name: torque}).hold == hold


def test_rows_without_an_angle_are_gaps(tmp_path):
    q = Q.copy()
    q[[7, 8, 90]] = np.nan
    assert guessed({"t": TIME, "q": q, "u": U}).missing == 3
    pd.DataFrame({"t": TIME, "q": q, "u": U}).to_csv(tmp_path / "a.csv", index=False)
    described = describe_tables(tables_at([tmp_path]), MACHINE, Known())
    assert 'missing = "drop"' in described.dataset_toml
    assert len(described.dataset.recordings[0].angle.time) == len(TIME) - 3


def test_a_sliding_joint_is_in_metres():
    g = guessed({"t": TIME, "x": 300 * Q, "force": U}, unit="m")
    assert (g.angle.unit, g.torque.unit) == ("mm", "N")
    assert guessed({"t": TIME, "x_m": Q, "force": U}, unit="m").angle.unit == "m"


UNTOLD = {
    "no time": (
        {"q": Q, "u": U},
        "no column increases.*name it with --time, or say --time '100 Hz' .*; there are 'q' \\(-",
    ),
    "two rows the other way round": (
        {"t": TIME[[*range(9), 10, 9, *range(11, len(TIME))]], "q": Q, "u": U},
        "a.csv, row 10: 't' goes back from 0.1 to 0.09: put the rows into the order of time",
    ),
    "rows of a counter": (
        {"n": np.arange(float(len(TIME))), "t": TIME[[1, 0, *range(2, len(TIME))]], "q": Q, "u": U},
        "a.csv, row 1: 't' goes back from 0.01 to 0",
    ),
    "no angle": ({"t": TIME, "a": U, "u": U}, "0 columns look like angles.*--angle"),
    "too few angles": ({"t": TIME, "q": Q, "u": U}, "1 columns look like angles, for 2 joints"),
    "one of two": ({"t": TIME, "q": Q, "M": U, "P": W}, "0 columns look like torques"),
    "no torque": ({"t": TIME, "q": Q}, "0 columns look like torques or currents, for 1 motors"),
}


@pytest.mark.parametrize("columns, words", UNTOLD.values(), ids=UNTOLD)
def test_what_cannot_be_told_is_said_with_the_columns_there_are(columns, words):
    with assert_refused(words):
        guessed(columns, (False, True) if "2 joints" in words else (True,))


def test_given_columns_count(tmp_path):
    write_lab_tables(tmp_path)
    g = guessed({"t": TIME, "q": Q, "u": U, "b": W}, named={"angle": ["b"], "torque": ["q"]})
    assert g.angle.columns == ("b",) and g.torque.columns == ("q",)
    known = Known({"torque": ["vel"]})
    described = describe_tables(tables_at([tmp_path / "run1.csv"]), MACHINE, known)
    assert described.draft.guesses.torque.unit == "N m" and not described.draft.motor


# --- Several runs in one table --------------------------------------------------------------------


@pytest.mark.parametrize(
    "columns, split",
    [
        ({"t": np.tile(TIME, 2)}, "t"),
        ({"t": np.arange(400) / 100.0, "trial": np.repeat([3.0, 5.0], 200)}, "trial"),
        ({"t": np.tile(TIME, 2), "run": np.repeat([1.0, 2.0], 200)}, "run"),
        ({"t": np.tile(TIME, 2), "run": np.repeat([1.0, 2.0, 1.0, 2.0], 100)}, "run"),
        ({"t": np.tile(TIME, 2), "run": np.repeat([1.0, 2.0, 2.0, 3.0], 100)}, "t"),
        ({"t": np.arange(400) / 100.0}, None),
    ],
)
def test_runs_are_told_apart(columns, split):
    table = Table("a.csv", np.arange(400), columns | {"q": np.tile(Q, 2), "tau": np.tile(U, 2)})
    guesses = guess_columns(table, [True], ["rad"])
    assert guesses.split is None if split is None else guesses.split.columns == (split,)
    assert guesses.time.columns == ("t",) and guesses.angle.columns == ("q",)


@pytest.mark.parametrize("rate, hold", [(100.0, "previous"), (1000.0, "linear")])
def test_noise_and_motion_tell_a_held_torque_from_samples_of_one_that_is_not(rate, hold, tmp_path):
    """Rows are 10 ms apart; the drive changes its torque at this rate."""
    runs = (Run(f"{k}", (0.3 * k,), torques=(Sine(0.5, 0.8 + 0.3 * k),)) for k in range(3))
    camera, drive = Camera(601, 100.0, 2e-4), Drive(rate, torque_noise=0.004)
    data = simulated(0.03, 0.01, camera, runs, length=0.2, drive=drive)
    for recording in data.recordings:
        time, u = recording.angle.time, recording.torque
        at = np.searchsorted(u.time, time + 1e-9) - 1
        columns = {"t": time, "q": recording.angle.value[:, 0], "u [Nm]": u.value[at, 0]}
        pd.DataFrame(columns).to_csv(tmp_path / f"{recording.name}.csv", index=False)
    described = describe_tables(tables_at([tmp_path]), data.mechanism.table, Known())
    assert described.draft.guesses.hold == hold
    assert f'torque = "{hold}"' in described.dataset_toml


# --- Columns of a robot's joints ------------------------------------------------------------------

LIMITS = {"prismatic": (-0.5, 0.5), "revolute": (-2.0, 2.0)}
LINK = """<link name="{0}"><inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0"
ixz="0" iyz="0"/></inertial></link><joint name="j{0}" type="{1}"><parent link="{2}"/>
<child link="{0}"/><axis xyz="0 0 1"/>{3}</joint>"""
SCARA = ("revolute", "revolute", "prismatic")


def robot(folder, kinds):
    """File of a chain of joints j1, j2, ... of these kinds."""
    limit = '<limit lower="{}" upper="{}" effort="9" velocity="9"/>'
    limits = [limit.format(*LIMITS[kind]) if kind in LIMITS else "" for kind in kinds]
    parts = zip(kinds, limits, strict=True)
    links = [LINK.format(k + 1, kind, k, text) for k, (kind, text) in enumerate(parts)]
    file = folder / "robot.urdf"
    file.write_text(f'<robot name="r"><link name="0"/>{"".join(links)}</robot>')
    return file


UNITS = {
    "a slide beyond its limits": (["prismatic"], {"height [mm]": 900 * Q}, "mm"),
    "a slide by its limits": (["prismatic"], {"pos": 300 * Q}, "mm"),
    "milliradians": (["revolute"], {"phi_mrad": 900 * Q}, "mrad"),
    "counts of a wheel": (["continuous"], {"enc_counts": np.rint(1e5 * TIME)}, "counts"),
    "a wheel that turns": (["continuous"], {"phi_rad": 90 * TIME}, "rad"),
    "by names": (SCARA, {"J1_act_deg": Q, "J2_act_rad": Q, "J3_act_mm": 99 * Q}, "deg rad mm"),
    "by limits": (SCARA, {"q1": 60 * Q, "q2": Q, "q3_mm": 900 * Q}, "deg deg mm"),
    "angles in rad": (SCARA, {"q1": Q, "q2": Q, "q3": 300 * Q}, "rad rad mm"),
}


@pytest.mark.parametrize("kinds, columns, units", UNITS.values(), ids=UNITS)
def test_each_joint_has_the_unit_that_its_name_or_its_limits_say(kinds, columns, units, tmp_path):
    found = robot_columns(robot_file(robot(tmp_path, kinds)).robot, Table("a.csv", TIME, columns))
    assert (" ".join(found.units), found.side) == (units, "joint")
    assert found.angle == tuple(columns) and "12.6" not in found.evidence


def test_degrees_counts_and_millimetres_beside_each_other_are_read(tmp_path, run):
    robot(tmp_path, SCARA)
    q = np.stack([Q, W, 0.3 * Q], axis=1)
    scale = 180 / np.pi, 4096 / (2 * np.pi), 1000
    angles = dict(zip(("j1_deg", "enc2_counts", "j3_mm"), (q * scale).round().T, strict=True))
    others = {"tau1_Nm": U, "tau2_Nm": U, "Z3_force_N": U, "vel1": W}
    (tmp_path / "log").mkdir()
    pd.DataFrame({"t": TIME, **angles, **others}).to_csv(tmp_path / "log/a.csv", index=False)
    call = "init log --mechanism robot.urdf --angle j1_deg,enc2_counts,j3_mm"
    assert run(tmp_path, call)[0] == 0
    (recording,) = load_dataset(tmp_path / "log").recordings
    np.testing.assert_allclose(np.ptp(recording.angle.value - q, axis=0), 0, atol=0.02)
    code, _, err = run(tmp_path, f"{call},vel1 --replace")
    assert code == 2 and "--angle: 'vel1' has no joint" in err


def test_a_torque_that_is_named_has_a_joint_with_an_angle(tmp_path):
    machine = robot_file(robot(tmp_path, SCARA)).robot
    table = Table("a.csv", TIME, {"q1": Q, "q2": Q, "u1": U, "u3": U})
    with assert_refused("--torque: 'u3' has no joint with an angle.*leave the column out"):
        robot_columns(machine, table, named={"torque": ["u1", "u3"]})
    with assert_refused("a.csv: no columns look like angles, and the robot has"):
        robot_columns(machine, table._replace(columns={"u1": U}))
