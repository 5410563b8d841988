"""The simulated drive at its pseudo-terminal, and signals played to it."""

import os
import subprocess
import sys
import termios
import threading
import tomllib
from functools import partial

import numpy as np
import pytest
from fixtures.drive_ports import logger, setup, until
from fixtures.mistakes import changes, mistakes, rows
from fixtures.paths import ROOT
from fixtures.refusals import assert_one_line, assert_refused
from hypothesis import given
from hypothesis import strategies as st

from frictionid.data.readers.dataset import load_dataset
from frictionid.data.signals import Signal, sample
from frictionid.rig.logfile import read_log
from frictionid.rig.playback import PlaySettings, excite, keys, load_signal, torque_of
from frictionid.rig.rig_settings import framed, parsed, rig_settings_of
from frictionid.rig.virtual_drive import (
    RAMP,
    SILENCE,
    Controller,
    Drive,
    Playback,
    Terminal,
    broken_line,
)

QUIET = ["-c", "import sys; from frictionid.__main__ import main; sys.exit(main())"]


def sine(length=1.0, rate=200.0):
    time = np.arange(0.0, length + 1e-9, 1 / rate)
    return Signal(time, 0.1 * np.sin(7 * time)[:, None], "previous")


def values(controller, k):
    """Time, command and torque of the k-th line."""
    made = controller.drive.rig
    cells = [float(c) for c in parsed(made.protocol, b"", controller.line(k))[0][0]]
    return cells[0] * 1e-6, cells[1], cells[2] * made.motors[0].per_measured


def obey(controller, k, value, template="u,{value}"):
    """Send a command to the drive before the k-th line."""
    text = template.replace("{value}", f"{value:.6f}")
    controller.obey(k, framed(controller.drive.rig.protocol, text)[:-1])


# --- What it says --------------------------------------------------------------------------------


@given(st.floats(-100.0, 0.0), st.floats(-1e-3, 1e-3), st.floats(0.5, 1.5), st.floats(0.0, 0.02))
def test_it_reports_the_measured_torque_by_its_own_clock(offset, drift, gain, lag):
    torque = sine()
    drive = Drive(setup(), torque, offset=offset, drift=drift, gain=gain, bias=0.01, lag=lag)
    controller = Controller(drive)
    for k in (0, 17, 400, 900):
        time, command, measured = values(controller, k)
        t = k / drive.rate
        assert time == pytest.approx((t - offset) / (1 + drift), abs=1e-6)
        assert measured == pytest.approx(float(sample(torque, [t])[0, 0]), abs=1e-6)
        before = float(sample(torque, [min(t + lag, 1.0)])[0, 0])
        assert gain * command + 0.01 == pytest.approx(before, abs=1e-5)


def test_it_obeys_within_its_limits_until_the_host_is_silent():
    drive = Drive(setup(), sine(3.0), gain=0.9)
    controller = Controller(drive)
    most = drive.rig.motors[0].limit
    obey(controller, 500, 0.2)
    assert values(controller, 501)[1:] == pytest.approx((0.2, 0.18), abs=1e-6)
    obey(controller, 510, 5.0)
    assert values(controller, 511)[2] == pytest.approx(most, abs=1e-6)
    obey(controller, 520, 0.2)
    silent = 520 + int(1000 * SILENCE)
    torques = [values(controller, k)[1] for k in range(silent - 1, silent + 400, 10)]
    assert torques[0] == pytest.approx(0.2)
    assert np.all(np.diff(torques) <= 1e-9)
    assert torques[-1] == 0.0
    assert values(controller, silent + int(500 * RAMP))[1] == pytest.approx(0.1, abs=1e-3)


def test_a_stopped_drive_obeys_no_more_until_it_is_begun_again():
    controller = Controller(Drive(setup(), sine(3.0)))

    def torque_after(k, text):
        obey(controller, k, 0.2, text)
        return values(controller, k + 1)[2]

    assert torque_after(1, "u,{value}") == pytest.approx(0.2, abs=1e-6)
    assert torque_after(2, "stop") == 0.0
    assert torque_after(3, "u,{value}") == 0.0
    assert torque_after(4, "start") == 0.0
    assert torque_after(5, "u,{value}") == pytest.approx(0.2, abs=1e-6)
    # what is no command changes nothing
    controller.obey(6, b"$u,0.4*0000")
    assert torque_after(7, "u,{value},7") == pytest.approx(0.2, abs=1e-6)
    assert torque_after(8, "u,nan") == pytest.approx(0.2, abs=1e-6)


def test_a_restart_sets_the_clock_back_once():
    drive = Drive(setup(), sine(), restarts=1, seed=4, offset=-50.0)
    controller = Controller(drive)
    time = np.array([values(controller, k)[0] for k in range(drive.lines)])
    back = np.flatnonzero(np.diff(time) < 0)
    assert len(back) == 1
    assert time[back[0] + 1] == 0.0
    assert np.delete(np.diff(time), back) == pytest.approx(1e-3)


@given(st.integers(0, 10**6))
def test_a_damaged_line_is_another_one(seed):
    line = b"$1000,0.050000,0.200000*DBC5\n"
    assert broken_line(line, np.random.default_rng(seed)) != line


def test_torques_of_data_sets_are_those_of_the_driven_joints():
    dataset = load_dataset(ROOT / "data/acrobot_clean")
    torque = torque_of(dataset, "05_sine")
    own = next(r for r in dataset.recordings if r.name == "05_sine")
    np.testing.assert_array_equal(torque.value[: len(own.torque.time), 0], own.torque.value[:, 1])
    assert torque.time[-1] == own.angle.time[-1]
    with assert_refused("no recording '05_sin'; did you mean '05_sine'"):
        torque_of(dataset, "05_sin")


DRIVES = """
rate = 0.0     => rate: it should be greater than 0
lag = -1.0     => lag: it should be greater than or equal to 0
rate = inf     => rate: it should be a finite number
rate = 1e12    => lower it
offset = nan   => offset: it should be a finite number
drift = 1.0    => drift: it should be less than 0.5
damaged = 1.0  => damaged: it should be less than 1
unplugged = -1 => unplugged: it should be greater than or equal to 0
"""


@mistakes(DRIVES)
def test_a_drive_that_cannot_be_is_refused(wrong, words):
    with assert_refused(words):
        Drive(setup(), sine(), **changes(wrong))


def test_torques_of_other_joints_are_refused():
    with assert_refused(r"drives 2 joints, \[motor\] has 1"):
        Drive(setup(), Signal(np.arange(3.0), np.zeros((3, 2))))


# --- Played to -----------------------------------------------------------------------------------


@pytest.fixture
def rig(tmp_path):
    """A drive that runs beside the test, faster than its time, and a logger of it."""
    terminal = Terminal(tmp_path / "port")
    drive = Drive(setup(), sine(600.0))
    running = threading.Thread(target=partial(_play, drive, terminal), daemon=True)
    running.start()
    log = logger(terminal.link, tmp_path / "log.csv", drive.rig)
    yield log, drive.rig, terminal
    log.close()
    terminal.unplug()
    running.join(20.0)
    assert not running.is_alive()


def _play(drive, terminal):
    try:
        Playback(drive, terminal).run()
    except (OSError, ValueError):  # the test has pulled the cable
        return


def played(log, length=60.0, ramp=0.1, asked=lambda: ""):
    """Why the playback of 0.3 N m ended."""
    torque = Signal(np.array([0.0, length]), np.full((2, 1), 0.3), "previous")
    return excite(log, torque, PlaySettings(ramp=ramp, silence=20.0), asked)


def test_a_signal_is_played_logged_and_ramped(rig, tmp_path):
    log, made, _ = rig
    assert played(log, 0.4, 0.2) == ""
    until(lambda: log.pump(0.05) and float(log.counts.last[1]) == 0.0)
    command = read_log(tmp_path / "log.csv").columns["command"]
    assert 0 < command.max() <= 0.3 + 1e-9
    assert command[-1] == 0.0
    # ramps have values between nothing and all, however late the machine is at times
    assert len(np.unique(command)) > 3


@pytest.mark.parametrize(
    "asked, said",
    [
        ("emergency stop by the key ' '", "emergency stop by the key ' '"),
        ("ramp", "stopped on request"),
    ],
)
def test_a_stop_ends_everything_with_zero_torque(rig, asked, said):
    log, _, _ = rig
    answers = iter([""] * 20)
    assert played(log, asked=lambda: next(answers, asked)) == said
    until(lambda: log.pump(0.05) and float(log.counts.last[1]) == 0.0)


def test_a_pressed_key_is_seen_and_the_terminal_left_as_it_was(monkeypatch):
    master, slave = os.openpty()
    before = termios.tcgetattr(slave)
    with os.fdopen(slave) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        with keys() as key:
            assert key() == ""
            os.write(master, b"x")
            until(lambda: key() == "x")
        assert termios.tcgetattr(slave) == before
    os.close(master)


def test_a_drive_that_falls_silent_is_ramped_down(rig):
    log, made, terminal = rig
    count = iter(range(10**9))

    def show(*_):
        if next(count) == 30:
            terminal.unplug()

    log.show = show
    assert played(log) == "the drive fell silent"


SIGNALS = """
time,u2 / 0,0.1 / 1,-0.6   => row 3: u2 = -0.6 N m exceeds the limit of 0.5
time,u1,u2 / 0,0.1,1       => a signal for 1 motors has time and one torque
u2 / 0                     => has the columns u2
time,u2 / 1,0.1 / 1,0.2    => row 3: time must increase
time,u2 / 0,0.1 / 1,       => row 3: 'u2' is empty
time,u2 / 0,0.1            => has 1 rows
"""


def test_signals_beyond_limits_or_without_them_are_refused(tmp_path):
    path = tmp_path / "signal.csv"
    for text, words in rows(SIGNALS):
        path.write_text(text.replace(" / ", "\n") + "\n")
        with assert_refused(words):
            load_signal(path, setup())
    path.write_text("time,u2\n0,0.1\n1,0.2\n")
    with assert_refused(r"\[motor\] has no limit: add limit"):
        load_signal(path, rig_settings_of({"motor": {"kt": 0.01}}, "rig.toml"))
    with assert_refused("ramp: it should be greater than 0"):
        PlaySettings(ramp=0)
    with assert_refused("rate: it should be a finite number"):
        PlaySettings(rate=float("inf"))


# --- The commands --------------------------------------------------------------------------------


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("rig.toml", "simulated.toml"):
        (tmp_path / name).write_bytes((ROOT / "docs/tutorial" / name).read_bytes())
    time = np.arange(0.0, 0.5, 1 / 60)
    rows = [f"{t:.6f},0,{0.2 * np.sin(9 * t):.6f}" for t in time]
    (tmp_path / "run.csv").write_text("\n".join(["time,q1,u1", *rows]) + "\n")
    (tmp_path / "dataset.toml").write_text(
        'name = "d"\n[mechanism]\nkind = "pendulum"\n[columns]\ntime = "time"\nangle = ["q1"]\n'
        'torque = ["u1"]\n[recordings]\npatterns = ["run.csv"]\n'
    )
    return tmp_path


def test_the_drive_as_a_process_is_logged_by_the_command(place, run):
    drive = subprocess.Popen(
        [sys.executable, *QUIET, "simulate-drive", ".", "--port", "drive", "--sent", "sent.txt"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert drive.stdout is not None
    assert "483 lines at drive" in drive.stdout.readline() or drive.poll() is None
    code, out, _ = run(place, *"log --port drive --out log.csv --patience 4".split())
    assert code == 0
    sent = (place / "sent.txt").read_bytes().count(b"\n")
    assert f"{sent} lines, 0 damaged" in out
    assert "undamaged lines were sent" in drive.communicate(timeout=60)[0]
    assert drive.returncode == 0
    assert len(read_log(place / "log.csv").columns["time"]) == sent
    assert not (place / "drive").exists()


COMMANDS = """
simulate-drive . --port drive --recording rum => no recording 'rum'
simulate-drive . --port drive --speed 0       => --speed 0 must be positive
simulate-drive . --port drive --sent .        => . is a folder: name a file in it
simulate-drive . --port drive --sent file/s   => file/s: cannot be written (Not a dir
simulate-drive . --port drive --sent file     => file exists: choose another name, or
simulate-drive . --port file                  => file exists and is no link to a port
simulate-drive . --port drive --rig gone.toml => gone.toml does not exist
excite --port /dev/ttyNO --signal signal.csv --out o.csv => exceeds the limit of 1.5
excite --port /dev/ttyNO --signal gone.csv --out o.csv   => gone.csv cannot be read
"""


def test_bad_input_to_the_commands_is_one_line(place, run):
    (place / "signal.csv").write_text("time,u1\n0,0.1\n1,99\n")
    (place / "file").write_text("precious")
    for line, words in rows(COMMANDS):
        assert_one_line(run(place, line), words)
    assert (place / "file").read_text() == "precious"
    assert not (place / "o.csv").exists()


def test_the_settings_of_the_tutorial_are_those_of_one_rig():
    folder = ROOT / "docs/tutorial"
    real, simulated = (
        tomllib.loads((folder / name).read_text()) for name in ("rig.toml", "simulated.toml")
    )
    assert real["mechanism"] == simulated["mechanism"]
    most = max(t["amplitude"] for r in simulated["recordings"] for t in r["torques"])
    assert most <= real["motor"]["limit"]
