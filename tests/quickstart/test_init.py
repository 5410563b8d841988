"""frictionid init: tables as labs write them become a data set with the numbers that were meant."""

import re
import shutil
import tomllib
from functools import partial
from importlib import import_module

import numpy as np
import pandas as pd
import pytest
from fixtures.lab_tables import GEAR, INIT, KT, MACHINE, MOTOR, recordings, write_lab_tables
from fixtures.mistakes import mistakes
from fixtures.reader_files import mat_bytes
from fixtures.refusals import assert_one_line, assert_refused

from frictionid.comparison.suite import load_suite
from frictionid.comparison.suite_tasks import tasks_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.table import Table
from frictionid.quickstart.column_guesses import guess_columns
from frictionid.quickstart.describe_tables import Known, describe_tables, tables_at
from frictionid.quickstart.quick import BY_ANGLES
from frictionid.simulate import Camera, Curve, Drive, Rig, Run, Sine, Stribeck, simulate

TIME = np.arange(200) / 100.0
Q, W, U = np.sin(5 * TIME), 5 * np.cos(5 * TIME), 0.3 * np.cos(2 * TIME)


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Folder of tables in ms, degrees and amperes; the current of `turned` counts against them."""
    folder = tmp_path_factory.mktemp("lab")
    write_lab_tables(folder / "arm")
    write_lab_tables(folder / "turned", sign=-1.0, separator=";", comma=True)
    write_lab_tables(folder / "single", only=1)
    for name, text in (
        ("words", "t_ms,pos_deg,u\n0,1,2\n10,lost,2\n"),
        ("nameless", "0,1,5\n10,1,2\n"),
        (
            "repeated",
            "t_ms,pos_deg,u\n" + "".join(f"{k - k % 3},{k % 7},{k % 2}\n" for k in range(99)),
        ),
    ):
        (folder / name).mkdir()
        for ending in ("csv", "MCAP"):  # a name that no reader of bags knows
            (folder / name / f"run1.{ending}").write_text(text)
    return folder


@pytest.fixture
def call(lab, tmp_path, run):
    """Call the command line in a copy of the tables."""
    shutil.copytree(lab, tmp_path, dirs_exist_ok=True)
    return partial(run, tmp_path)


def written(folder):
    """The dataset.toml of a folder."""
    return tomllib.loads((folder / "dataset.toml").read_text())


def same_motion(folder):
    """Whether the data set in a folder is what was simulated, in SI units."""
    data = load_dataset(folder)
    assert [r.name for r in data.recordings] == [r.name for r in recordings()]
    for mine, true in zip(data.recordings, recordings(), strict=True):
        sign = np.sign(mine.angle.value[0] * true.angle.value[0])
        np.testing.assert_allclose(sign * mine.angle.value, true.angle.value, atol=1e-6)
        at = np.searchsorted(true.torque.time, mine.torque.time, side="right") - 1
        off = sign * mine.torque.value - true.torque.value[at]
        assert np.abs(off).max() < 6 * 0.002 * KT * GEAR
    return data


# --- The command ----------------------------------------------------------------------------------


def test_milliseconds_degrees_and_amperes_are_recognised(call, tmp_path):
    code, out, err = call(f"init arm {INIT} {MOTOR}")
    assert (code, err) == (0, "") and out.endswith("next: frictionid quick arm\n")
    document = written(tmp_path / "arm")
    assert document["units"] == {"time": "ms", "angle": "deg", "torque": "A"}
    assert document["columns"] == {"time": "t_ms", "angle": "pos_deg", "torque": "I_motor"}
    assert document["mechanism"] == MACHINE
    data = same_motion(tmp_path / "arm")
    assert data.name == "arm"


def test_columns_of_structures_in_mat_files_are_recognised(call, tmp_path):
    for file in (tmp_path / "arm").iterdir():
        table = pd.read_csv(file).drop(columns="state").to_dict("list")
        file.with_suffix(".mat").write_bytes(mat_bytes({"log": table, "gains": [[1.0, 2.0]]}))
        file.unlink()
    assert call(f"init arm {INIT} {MOTOR}")[0] == 0
    columns = written(tmp_path / "arm")["columns"]
    assert columns == {"time": "log.t_ms", "angle": "log.pos_deg", "torque": "log.I_motor"}
    same_motion(tmp_path / "arm")


@pytest.mark.parametrize("separator", [",", ";", "  "])
def test_tables_without_a_header_have_counted_columns(call, tmp_path, separator):
    for file in (tmp_path / "arm").iterdir():
        lines = pd.read_csv(file).drop(columns="state").astype(str).to_numpy().tolist()
        file.write_text("".join(f"{separator.join(line)}{separator.strip()}\n" for line in lines))
    assert call(f"init arm {INIT} {MOTOR} --angle 2 --torque 4")[::2] == (0, "")
    document = written(tmp_path / "arm")
    assert document["columns"] == {"header": False, "time": "1", "angle": "2", "torque": "4"}
    assert document["units"]["torque"] == "A"  # as it has a torque constant
    same_motion(tmp_path / "arm")


def test_a_line_that_counts_the_columns_as_pandas_does_is_their_header(call, tmp_path):
    for file in (tmp_path / "arm").iterdir():
        values = pd.read_csv(file).drop(columns="state").to_numpy()
        pd.DataFrame(values).to_csv(file, index=False)
    assert call(f"init arm {INIT} {MOTOR} --angle 1 --torque 3")[0] == 0
    document = written(tmp_path / "arm")
    assert document["columns"] == {"time": "0", "angle": "1", "torque": "3"}
    same_motion(tmp_path / "arm")


def test_signs_that_contradict_the_motion_are_turned_and_said(call, tmp_path):
    assert call(f"init turned {INIT} {MOTOR}")[0] == 0
    text = (tmp_path / "turned" / "dataset.toml").read_text()
    assert "corrected: " in text and "has the wrong sign" in text
    assert list(tomllib.loads(text)["signs"].values()) == [-1]
    same_motion(tmp_path / "turned")


def test_the_first_suite_can_be_compared(call, tmp_path):
    for folder, count in (("arm", 5), ("single", 10)):
        call(f"init {folder} {INIT} {MOTOR}")
        suite = tmp_path / folder / "suite.toml"
        tasks = tasks_of(load_suite(suite), suite)
        assert {task.benchmark.folds.count for task in tasks} == {count}
        assert {task.name for task in tasks} == {law.label for law in BY_ANGLES.laws}
        assert {task.recipe.name for task in tasks} == {"shooting"}


def test_what_is_there_is_never_overwritten(call, tmp_path):
    for name in ("dataset.toml", "suite.toml"):
        file = tmp_path / "arm" / name
        file.write_text("mine")
        assert_one_line(call(f"init arm {INIT} {MOTOR}"), f"arm/{name} is there already")
        assert file.read_text() == "mine"
        file.unlink()


MISSING = r"""
arm                          => needs the mechanism: --mechanism acrobot or .* or pendulum
arm --mechanism pendulm      => did you mean 'pendulum'
arm --mechanism pendulum
    => needs mass \[kg\] .*, length \[m\] .*: add --set mass=\.\.\. --set length=\.\.\.
arm --mechanism no.xml       => --mechanism no.xml: no such file
arm --mechanism double_pendulum --set m1=1 => double_pendulum needs m2
arm INIT                     => I_motor holds currents \[A\]: .*--kt .*--gear
arm INIT --angle pos         => no column of numbers 'pos'; did you
arm INIT --angle state       => no column of numbers 'state'
arm INIT --time pos_deg      => row 3: 'pos_deg' goes back
arm INIT --angle t_ms,pos_deg => --angle names 2 columns
arm INIT --set mas=1         => --set mas: pendulum .* mean 'mass'
arm/run9.csv INIT            => arm/run9.csv: no such file
arm/run1.csv single/run1.csv INIT => lie in 2 folders
. INIT                       => \. has no table that ends with \.csv
words/run1.MCAP INIT         => run1\.MCAP: no table that ends with .*\.mcap
words INIT                   => run1.csv, row 3: column 'pos_deg' holds 'lost', which is no
repeated INIT --torque u     => run1.csv, row 3: .* .66 such rows: 3
nameless INIT                => run1.csv: 0 columns look like angles, .* there are '1' \(0 to 10\)
"""


@mistakes(MISSING)
def test_what_is_missing_is_one_line_with_the_option(call, tmp_path, wrong, words):
    before = sorted(tmp_path.rglob("*"))
    outcome = call(f"init {wrong}".replace("INIT", INIT))
    assert_one_line(outcome)
    assert re.search(words, outcome[2]), outcome
    assert sorted(tmp_path.rglob("*")) == before


def test_a_terminal_is_asked_for_what_is_missing(call, tmp_path, monkeypatch):
    answers = {"mechanism": "pendulum", "mass,": 0.4, "length": 0.25, "kt": KT, "gear": GEAR}
    asked = []

    def prompt(text, **_):
        asked.append(text)
        return next(value for key, value in answers.items() if text.startswith(key))

    command = import_module("frictionid.cli.init")
    monkeypatch.setattr(command, "_is_asked", lambda: True)
    monkeypatch.setattr(command.typer, "prompt", prompt)
    assert call("init arm")[0] == 0
    assert len(asked) == len(answers)
    same_motion(tmp_path / "arm")


def test_positions_of_the_motor_are_told_by_the_motion(call, tmp_path):
    for path in (tmp_path / "arm").glob("*.csv"):
        table = pd.read_csv(path)
        table.assign(pos_deg=GEAR * table["pos_deg"]).to_csv(path, index=False)
    code, out, _ = call(f"init arm {INIT} {MOTOR}")
    assert code == 0 and "corrected: angles are those of the motors" in out
    assert written(tmp_path / "arm")["motor"]["angle"] == "motor"
    same_motion(tmp_path / "arm")


# --- Guesses --------------------------------------------------------------------------------------


def guessed(columns, driven=(True,), unit="rad", named=None):
    columns = {name: np.asarray(c, float) for name, c in columns.items()}
    table = Table("a.csv", np.arange(len(TIME)), columns)
    return guess_columns(table, driven, (unit,) * len(driven), named)


NAMED = {
    "plain": ({"t": TIME, "q": Q, "u": U}, "t in s, q in rad, u in N m"),
    "microseconds": (
        {"stamp": 1e6 * TIME, "q": Q, "tau": U},
        "stamp in us, q in rad, tau in N m",
    ),
    "as a bag of ROS": (
        {"%time": 1.7e18 + 1e9 * TIME, "field.position0": Q, "field.effort0": U},
        "%time in ns, field.position0 in rad, field.effort0 in N m",
    ),
    "by range": ({"t": TIME, "pos": 57.3 * 4 * Q, "u": U}, "t in s, pos in deg, u in N m"),
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


@pytest.mark.parametrize(("columns", "expected"), NAMED.values(), ids=NAMED)
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
    ("name", "torque", "hold"),
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


def test_targets_in_place_of_a_torque_are_a_controllers(call, tmp_path):
    (tmp_path / "servo").mkdir()
    frame = pd.DataFrame({"t": TIME, "goal": Q, "pos": 0.9 * Q})
    frame.to_csv(tmp_path / "servo" / "run.csv", index=False)
    code, out, _ = call(f"init servo {INIT} --gains 4,0.05 {MOTOR}")
    assert "# MISSING: output of the controller" in out and "missing: output of" in out
    document = written(tmp_path / "servo")
    assert code == 0 and "torque" not in document["columns"] and "not used" not in out
    assert document["actuator"] == {"target": "goal", "output": "torque", "P": 4.0, "D": 0.05}
    (tmp_path / "servo" / "dataset.toml").unlink()
    (tmp_path / "servo" / "suite.toml").unlink()
    out = call(f"init servo {INIT}")[1]
    assert "missing: gains of the controller" in out and "output of" not in out
    assert "next: write the gains into dataset.toml, then frictionid quick" in out


def test_elements_of_vectors_are_columns_as_those_of_lerobot(call, tmp_path):
    (tmp_path / "servo").mkdir()
    columns = {"observation.state": Q[:, None], "timestamp": TIME, "action": 0.9 * Q[:, None]}
    vectors = pd.DataFrame({name: list(values) for name, values in columns.items()})
    vectors.to_parquet(tmp_path / "servo" / "file-000.parquet")
    assert call(f"init servo {INIT} --gains 4,0.05")[0] == 0
    document = written(tmp_path / "servo")
    assert document["actuator"]["target"] == "action[0]"
    angle = load_dataset(tmp_path / "servo").recordings[0].angle.value[:, 0]
    np.testing.assert_array_equal(np.abs(angle), np.abs(Q))  # signs are guessed


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


@pytest.mark.parametrize(("columns", "words"), UNTOLD.values(), ids=UNTOLD)
def test_what_cannot_be_told_is_said_with_the_columns_there_are(columns, words):
    with assert_refused(words):
        guessed(columns, (False, True) if "2 joints" in words else (True,))


def test_a_lerobot_data_set_is_refused_with_the_reader_that_reads_it(call, tmp_path):
    (tmp_path / "episodes" / "data" / "chunk-000").mkdir(parents=True)
    (tmp_path / "episodes" / "data" / "chunk-000" / "file-000.parquet").write_bytes(b"PAR1")
    (tmp_path / "episodes" / "meta").mkdir()
    (tmp_path / "episodes" / "meta" / "info.json").write_text('{"fps": 30}')
    outcome = call(f"init episodes {INIT}")
    assert_one_line(outcome, "is a LeRobot data set", "data/*/*.parquet", 'kind = "lerobot"')


def test_given_columns_count(lab):
    g = guessed({"t": TIME, "q": Q, "u": U, "b": W}, named={"angle": ["b"], "torque": ["q"]})
    assert g.angle.columns == ("b",) and g.torque.columns == ("q",)
    known = Known({"torque": ["vel"]})
    described = describe_tables(tables_at([lab / "arm" / "run1.csv"]), MACHINE, known)
    assert described.draft.guesses.torque.unit == "N m" and not described.draft.motor


def test_an_interrupted_call_can_be_made_again(call, tmp_path):
    for _ in range(2):
        assert call(f"init arm {INIT} {MOTOR}")[0] == 0
        (tmp_path / "arm" / "dataset.toml").unlink()  # written last


# --- Several runs in one table --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("columns", "split"),
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


@pytest.mark.parametrize(("rate", "hold"), [(100.0, "previous"), (1000.0, "linear")])
def test_noise_and_motion_tell_a_held_torque_from_samples_of_one_that_is_not(rate, hold, tmp_path):
    """Rows are 10 ms apart; the drive changes its torque at this rate."""
    pendulum = {"kind": "pendulum", "parameters": {"mass": 0.5, "length": 0.2}}
    friction = Stribeck(Curve((0.03,), (0.03,), (0.01,)))
    runs = tuple(Run(f"{k}", (0.3 * k,), torques=(Sine(0.5, 0.8 + 0.3 * k),)) for k in range(3))
    camera, drive = Camera(601, 100.0, 2e-4), Drive(rate, torque_noise=0.004)
    for recording in simulate(
        Rig("held", pendulum, friction, camera, runs, drive=drive)
    ).recordings:
        time, u = recording.angle.time, recording.torque
        at = np.searchsorted(u.time, time + 1e-9) - 1
        columns = {"t": time, "q": recording.angle.value[:, 0], "u [Nm]": u.value[at, 0]}
        pd.DataFrame(columns).to_csv(tmp_path / f"{recording.name}.csv", index=False)
    described = describe_tables(tables_at([tmp_path]), pendulum, Known())
    assert described.draft.guesses.hold == hold
    assert f'torque = "{hold}"' in described.dataset_toml
