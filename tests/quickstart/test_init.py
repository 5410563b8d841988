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
from fixtures.refusals import assert_one_line
from fixtures.shared import shared
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.comparison.suite import load_suite, tasks_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.quickstart.plan import BY_ANGLES

ARM = f"init arm {INIT} {MOTOR}"
TIME = np.arange(200) / 100.0
Q, W, U = np.sin(5 * TIME), 5 * np.cos(5 * TIME), 0.3 * np.cos(2 * TIME)


@shared
def lab(shared_path):
    """Folder of tables in ms, degrees and amperes; the current of `turned` counts against them."""
    write_lab_tables(shared_path / "arm")
    write_lab_tables(shared_path / "turned", sign=-1.0, separator=";", comma=True)
    write_lab_tables(shared_path / "single", only=1)
    for name, text in (
        ("words", "t_ms,pos_deg,u\n0,1,2\n10,lost,2\n"),
        ("nameless", "0,1,5\n10,1,2\n"),
        ("headed", "t,state,q\n0,a,5\nt,state,q\n1,a,2\n"),
        (
            "repeated",
            "t_ms,pos_deg,u\n" + "".join(f"{k - k % 3},{k % 7},{k % 2}\n" for k in range(99)),
        ),
    ):
        (shared_path / name).mkdir()
        for ending in ("csv", "MCAP"):  # a name that no reader of bags knows
            (shared_path / name / f"run1.{ending}").write_text(text)
    return shared_path


@pytest.fixture
def call(lab, tmp_path, run):
    """Call the command line in a copy of the tables."""
    shutil.copytree(lab, tmp_path, dirs_exist_ok=True)
    return partial(run, tmp_path)


def written(folder):
    """The dataset.toml of a folder."""
    return tomllib.loads((folder / "dataset.toml").read_text())


def tables_of_numbers(folder):
    """Files of a folder, each with the columns of its table that hold numbers."""
    return [(file, pd.read_csv(file).drop(columns="state")) for file in folder.iterdir()]


def same_motion(folder):
    """Whether the data set in a folder is what was simulated, in SI units."""
    data = load_dataset(folder)
    assert [r.name for r in data.recordings] == [r.name for r in recordings()]
    for mine, true in zip(data.recordings, recordings(), strict=True):
        sign = np.sign(mine.angle.value[0] * true.angle.value[0])
        assert_allclose(sign * mine.angle.value, true.angle.value, atol=1e-6)
        at = np.searchsorted(true.torque.time, mine.torque.time, side="right") - 1
        off = sign * mine.torque.value - true.torque.value[at]
        assert np.abs(off).max() < 6 * 0.002 * KT * GEAR
    return data


# --- The command ----------------------------------------------------------------------------------


def test_milliseconds_degrees_and_amperes_are_recognised(call, tmp_path):
    code, out, err = call(ARM)
    assert (code, err) == (0, "") and out.endswith("next: frictionid quick arm\n")
    document = written(tmp_path / "arm")
    assert document["units"] == {"time": "ms", "angle": "deg", "torque": "A"}
    assert document["columns"] == {"time": "t_ms", "angle": "pos_deg", "torque": "I_motor"}
    assert document["mechanism"] == MACHINE
    data = same_motion(tmp_path / "arm")
    assert data.name == "arm"


def test_columns_of_structures_in_mat_files_are_recognised(call, tmp_path):
    for file, table in tables_of_numbers(tmp_path / "arm"):
        variables = {"log": table.to_dict("list"), "gains": [[1.0, 2.0]]}
        file.with_suffix(".mat").write_bytes(mat_bytes(variables))
        file.unlink()
    assert call(ARM)[0] == 0
    columns = written(tmp_path / "arm")["columns"]
    assert columns == {"time": "log.t_ms", "angle": "log.pos_deg", "torque": "log.I_motor"}
    same_motion(tmp_path / "arm")


@pytest.mark.parametrize("separator", [",", ";", "  "])
def test_tables_without_a_header_have_counted_columns(call, tmp_path, separator):
    for file, table in tables_of_numbers(tmp_path / "arm"):
        lines = table.astype(str).to_numpy().tolist()
        file.write_text("".join(f"{separator.join(line)}{separator.strip()}\n" for line in lines))
    assert call(f"init arm {INIT} {MOTOR} --angle 2 --torque 4")[::2] == (0, "")
    document = written(tmp_path / "arm")
    assert document["columns"] == {"header": False, "time": "1", "angle": "2", "torque": "4"}
    assert document["units"]["torque"] == "A"  # as it has a torque constant
    same_motion(tmp_path / "arm")


def test_a_line_that_counts_the_columns_as_pandas_does_is_their_header(call, tmp_path):
    for file, table in tables_of_numbers(tmp_path / "arm"):
        pd.DataFrame(table.to_numpy()).to_csv(file, index=False)
    assert call(f"init arm {INIT} {MOTOR} --angle 1 --torque 3")[0] == 0
    document = written(tmp_path / "arm")
    assert document["columns"] == {"time": "0", "angle": "1", "torque": "3"}
    same_motion(tmp_path / "arm")


def test_signs_that_contradict_the_motion_are_turned_and_said(call, tmp_path):
    assert call(f"init turned {INIT} {MOTOR}")[0] == 0
    text = (tmp_path / "turned/dataset.toml").read_text()
    assert "corrected: " in text and "has the wrong sign" in text
    assert list(tomllib.loads(text)["signs"].values()) == [-1]
    same_motion(tmp_path / "turned")


def test_the_first_suite_can_be_compared(call, tmp_path):
    for folder, count in (("arm", 5), ("single", 10)):
        call(f"init {folder} {INIT} {MOTOR}")
        suite = tmp_path / folder / "suite.toml"
        tasks = tasks_of(load_suite(suite), suite)
        assert {task.benchmark.folds.count for task in tasks} == {count}
        laws = (*BY_ANGLES.laws, *BY_ANGLES.further)
        assert {task.name for task in tasks} == {law.label for law in laws}
        assert {task.recipe.name for task in tasks} == {"shooting"}


def test_what_is_there_is_overwritten_with_replace_only(call, tmp_path):
    for name in ("dataset.toml", "suite.toml"):
        file = tmp_path / "arm" / name
        file.write_text("mine")
        assert_one_line(call(ARM), f"arm/{name} is there already")
        assert file.read_text() == "mine"
        assert call(f"{ARM} --replace")[0] == 0
        assert "mine" not in file.read_text()
        (tmp_path / "arm/dataset.toml").unlink()


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
arm INIT --kt 1 --set limit=2 => --set limit=2: no columns of targets
arm/run9.csv INIT            => arm/run9.csv: no such file
arm/run1.csv single/run1.csv INIT => lie in 2 folders
. INIT                       => \. has no table that ends with \.csv
words/run1.MCAP INIT         => run1\.MCAP: no table that ends with .*\.mcap
words INIT                   => run1.csv, row 3: column 'pos_deg' holds 'lost', which is no
headed INIT                  => row 3: column 'q' holds 'q', .*; delete the row, which repeats
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

    command = import_module("frictionid.cli.start")
    monkeypatch.setattr(command, "_is_asked", lambda: True)
    monkeypatch.setattr(command.typer, "prompt", prompt)
    assert call("init arm")[0] == 0
    assert len(asked) == len(answers)
    same_motion(tmp_path / "arm")


def test_positions_of_the_motor_are_told_by_the_motion(call, tmp_path):
    for path in (tmp_path / "arm").glob("*.csv"):
        table = pd.read_csv(path)
        table.assign(pos_deg=GEAR * table["pos_deg"]).to_csv(path, index=False)
    code, out, _ = call(ARM)
    assert code == 0 and "corrected: angles are those of the motors" in out
    assert written(tmp_path / "arm")["motor"]["angle"] == "motor"
    same_motion(tmp_path / "arm")


def test_targets_in_place_of_a_torque_are_a_controllers(call, tmp_path):
    (tmp_path / "servo").mkdir()
    frame = pd.DataFrame({"t": TIME, "goal": Q, "pos": 0.9 * Q})
    frame.to_csv(tmp_path / "servo/run.csv", index=False)
    code, out, _ = call(f"init servo {INIT} --gains 4,0.05 --set limit=2 {MOTOR}")
    assert "# MISSING: output of the controller" in out and "missing: output of" in out
    document = written(tmp_path / "servo")
    assert code == 0 and "torque" not in document["columns"] and "not used" not in out
    gains = {"P": 4.0, "D": 0.05, "limit": 2}
    assert document["actuator"] == {"target": "goal", "output": "torque", **gains}
    assert "placeholders" not in call("check servo")[1]
    out = call(f"init servo {INIT} --replace")[1]
    assert "missing: gains of the controller" in out and "output of" not in out
    assert "next: write the gains into dataset.toml, then frictionid quick" in out
    assert "placeholders until the gains" in call("check servo")[1]


def test_counts_and_a_current_of_a_servo_make_a_controllers_file(call, tmp_path):
    (tmp_path / "servo").mkdir()
    q = np.rint(2048 + 4096 / (2 * np.pi) * Q)
    frame = pd.DataFrame({"t": TIME, "goal_position": q, "present_position": q, "I_mA": 900 * U})
    frame.to_csv(tmp_path / "servo/run.csv", index=False)
    code, out, _ = call(f"init servo {INIT}")
    document = written(tmp_path / "servo")
    assert code == 0 and document["actuator"]["target"] == "goal_position"
    assert "# I_mA is a current" in out and "torque" not in document["columns"]
    assert document["motor"] == {"counts_per_turn": 4096, "offset": -3.141593}
    recording = load_dataset(tmp_path / "servo").recordings[0]
    for signal in (recording.angle, recording.servo.goal):
        assert_allclose(signal.value[:, 0], Q, atol=np.pi / 4096 + 1e-6)


def test_elements_of_vectors_are_columns_as_those_of_lerobot(call, tmp_path):
    (tmp_path / "servo").mkdir()
    columns = {"observation.state": Q[:, None], "timestamp": TIME, "action": 0.9 * Q[:, None]}
    vectors = pd.DataFrame({name: list(values) for name, values in columns.items()})
    vectors.to_parquet(tmp_path / "servo/file-000.parquet")
    assert call(f"init servo {INIT} --gains 4,0.05")[0] == 0
    document = written(tmp_path / "servo")
    assert document["actuator"]["target"] == "action[0]"
    angle = load_dataset(tmp_path / "servo").recordings[0].angle.value[:, 0]
    assert_array_equal(np.abs(angle), np.abs(Q))  # signs are guessed


def test_a_lerobot_data_set_is_refused_with_the_reader_that_reads_it(call, tmp_path):
    (tmp_path / "episodes/data/chunk-000").mkdir(parents=True)
    (tmp_path / "episodes/data/chunk-000/file-000.parquet").write_bytes(b"PAR1")
    (tmp_path / "episodes/meta").mkdir()
    (tmp_path / "episodes/meta/info.json").write_text('{"fps": 30}')
    outcome = call(f"init episodes {INIT}")
    assert_one_line(outcome, "is a LeRobot data set", "data/*/*.parquet", 'kind = "lerobot"')


def test_an_interrupted_call_can_be_made_again(call, tmp_path):
    for _ in range(2):
        assert call(ARM)[0] == 0
        (tmp_path / "arm/dataset.toml").unlink()  # written last
