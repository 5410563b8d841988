"""Logging: every good line once and in order, and nothing that was written is ever lost."""

import json
import os
import signal
import subprocess
import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from fixtures.drive_ports import MOTOR, Rows, logger, setup, until
from fixtures.mistakes import mistakes, rows
from fixtures.paths import ROOT
from fixtures.refusals import assert_one_line, assert_refused
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.rig.log import Counts, Port, log_until, progress, progress_line, stop_requests
from frictionid.rig.logfile import Appender, Log, log_header, log_row, read_log
from frictionid.rig.rig_settings import parsed, written
from frictionid.rig.virtual_drive import Terminal

PORTS = ROOT / "tests/fixtures/drive_ports.py"


def start(*arguments):
    """A script of drive_ports.py as a process of its own."""
    return subprocess.Popen(
        [sys.executable, str(PORTS), *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finished(process):
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return out


@pytest.fixture
def protocol(tmp_path):
    """A drive's end of a cable whose other end is tmp_path/port."""
    terminal = Terminal(tmp_path / "port")
    yield terminal
    terminal.unplug()


@pytest.fixture
def opened(protocol, tmp_path):
    """A function of changes to the protocol: a logger of the cable to log.csv, and the format."""
    with ExitStack() as stack:

        def make(**changes):
            log = logger(protocol.link, tmp_path / "log.csv", setup(begin="", **changes))
            stack.callback(log.close)
            return log, log.rig.protocol

        yield make


def feed(terminal, content):
    while content:
        content = content[terminal.send(content, 5.0) :]


# --- What the issue asks for --------------------------------------------------------------------


def test_every_undamaged_line_once_and_in_order_through_three_disconnections(tmp_path):
    lines, made = 20_000, setup()
    drive = start("flood", tmp_path, lines, 0.01, 3)
    until(lambda: (tmp_path / "port").exists() or drive.poll() is not None)
    log = logger(tmp_path / "port", tmp_path / "log.csv", made)
    while drive.poll() is None:
        log.pump(0.02)
    log.pump(0.0)
    log.close()
    finished(drive)
    sent, rejected, _ = parsed(made.protocol, b"", (tmp_path / "sent.txt").read_bytes())
    assert not rejected
    assert 0.985 * lines < len(sent) < lines
    logged = read_log(tmp_path / "log.csv").columns
    assert_array_equal(
        np.stack([logged[name] for name in ("time", "command", "current")], axis=1),
        np.array(sent, dtype=float) / [1e6, 1.0, 1.0],
    )
    assert log.counts.unplugged >= 3
    assert 0.005 * lines < log.counts.rejected < 0.02 * lines
    assert_allclose(logged["torque"], MOTOR["kt"] * MOTOR["gear"] * logged["current"], rtol=1e-8)


def test_a_log_killed_at_any_moment_loads_and_lacks_at_most_a_second(tmp_path):
    results = json.loads(finished(start("kill", tmp_path, 50, 11)))
    assert len(results) == 50
    short = 0
    for one in results:
        time = read_log(Path(one["file"])).columns["time"]
        assert_array_equal(time, np.round(1e-3 * np.arange(len(time)), 6))
        assert 0 <= one["sent"] - len(time) <= 1000  # at 1 kHz
        short += len(time) < one["sent"]
    assert short  # some were killed before everything was read


# --- The file -----------------------------------------------------------------------------------


@given(st.integers(0, 10_000), st.integers(1, 9))
def test_a_torn_file_loads_and_goes_on_behind_its_whole_rows(tmp_path, cut, rows):
    made, path = setup(), tmp_path / "log.csv"
    header = log_header(made)
    path.unlink(missing_ok=True)
    text = f"{header}\n" + "".join(
        log_row(made, f"{k}.000000", (str(k * 10**6).encode(), b"0.1", b"0.25"))
        for k in range(rows)
    )
    torn = text[: cut % (len(text) + 1)]
    path.write_text(torn)
    whole = max(torn.count("\n") - 1, 0)
    if whole:
        assert read_log(path).columns["time"].tolist() == list(range(whole))
    if torn and "\n" not in torn and torn != header:
        with assert_refused("has other columns"):
            Appender(path, header, append=True)
        return
    file = Appender(path, header, append=True)
    file.append([log_row(made, "99.000000", (b"99000000", b"0.1", b"0.25"))])
    file.close()
    assert read_log(path).columns["time"].tolist() == [*range(whole), 99.0]


def test_all_clock_runs_a_log_are_unified_that_only_goes_on():
    host = 1e9 + np.array([0.0, 1.0, 2.0, 2.5, 3.5, 4.5])
    # the second run came sooner after it was sent, so that its first row falls before the last
    time = np.array([7.0, 8.0, 9.0, 0.0, 1.0, 2.0])
    host[:3] += 0.8
    log = Log("log.csv", {"host": host, "time": time, "torque": np.arange(6.0)})
    rows, (_, number, _), _ = log.unified(4294.967296)
    assert number.tolist() == [0, 0, 0, 1, 1, 1]
    assert np.all(np.diff(rows.columns["time"]) > 0)
    assert set(rows.columns["torque"]) >= {0.0, 1.0, 2.0, 4.0, 5.0}


def test_a_full_disk_is_reported_with_the_rows_that_are_safe():
    with assert_refused(r"No space left.*0 rows before are safe"):
        Appender(Path("/dev/full"), "host,time", append=True)


DAMAGES = """
host,time / 1,2 / 3,x => row 3: column 'time' holds 'x'
host,time / 1,2 / 3,  => row 3: 'time' is empty
host,time / 1,2 / 3   => row 3: 1 cells where the first line has 2
host,time             => has no rows
host,u2 / 0,1         => no column 'time'
"""


@mistakes(DAMAGES)
def test_what_was_changed_by_hand_is_named_by_its_row(tmp_path, wrong, words):
    path = tmp_path / "log.csv"
    path.write_text(wrong.replace(" / ", "\n") + "\n")
    with assert_refused(words):
        read_log(path)


# --- The port -----------------------------------------------------------------------------------


def test_rows_are_in_the_file_as_soon_as_they_are_counted(opened, protocol, tmp_path):
    log, form = opened()
    rows, seen = Rows(tmp_path / "log.csv"), 0
    for k in range(20):
        feed(protocol, written(form, (str(k), "0", "0")))
        while seen <= k:
            seen += len(log.pump(5.0))
        assert rows() == seen


def test_a_half_line_before_and_after_unplugging_is_no_line(opened, protocol, tmp_path):
    log, _ = opened(mark="", checksum="none")
    feed(protocol, b"1,2,3\n4,5")
    until(lambda: log.pump(0.1))
    protocol.unplug()
    until(lambda: not (log.pump(0.01) or log.connected))
    protocol.plug()
    until(lambda: log.pump(0.01) or log.connected)
    feed(protocol, b",6\n7,8,9\n")
    until(lambda: log.pump(0.1))
    assert (log.counts.rows, log.counts.rejected, log.counts.unplugged) == (2, 1, 1)
    assert read_log(tmp_path / "log.csv").columns["current"].tolist() == [3.0, 9.0]


def test_a_restart_of_the_controller_is_counted(opened, protocol):
    log, _ = opened(checksum="none", mark="")
    # the last step back is that of a counter of 32 bits
    feed(protocol, b"5,0,0\n6,0,0\nbooting ...\n0,0,0\n1,0,0\n4294967295,0,0\n2,0,0\n")
    until(lambda: log.pump(0.1) is not None and log.counts.rows == 6)
    assert (log.counts.restarts, log.counts.rejected) == (1, 1)
    assert "6 lines, 1 damaged" in progress(("time",), log.counts, 1.0)


@pytest.mark.parametrize(
    "content, said",
    [(b"\x00\xfe\x9c" * 3000, "nothing but garbage"), (b"1,2,3\n" * 30, "do not follow the")],
)
def test_unreadable_lines_are_reported_and_end_the_log(content, said, opened, protocol):
    log, _ = opened()
    feed(protocol, content)
    with assert_refused(f"{protocol.link}: .*{said}"):
        until(lambda: log.pump(0.1))


def test_garbage_behind_good_lines_does_not_end_the_log(opened, protocol, tmp_path):
    log, form = opened()
    line = written(form, ("1", "2", "3"))
    feed(protocol, line + b"\xff" * 6000 + b"\n" + line)
    until(lambda: log.pump(0.1) is not None and log.counts.rows == 2)
    assert len(read_log(tmp_path / "log.csv").columns["time"]) == 2


def test_a_port_that_is_missing_or_busy_is_reported_in_one_line(protocol, tmp_path):
    with assert_refused("there is no port /dev/ttyNONE"):
        Port("/dev/ttyNONE", 115200)
    with assert_refused("has no rate of 12345678901 baud"):
        Port(str(protocol.link), 12345678901)
    first = Port(str(protocol.link), 115200)
    with assert_refused("is busy: another program has it open"):
        Port(str(protocol.link), 115200)
    first.close()
    Port(str(protocol.link), 115200).close()
    with assert_refused("cannot be opened"):
        Port(str(tmp_path), 115200)


# --- The command --------------------------------------------------------------------------------


@pytest.fixture
def call(tmp_path, run):
    (tmp_path / "rig.toml").write_text(
        "[motor]\nkt = 0.01\ngear = 18.0\n[protocol]\nchecksum = 'crc16'\nmark = '$'\n"
    )

    return partial(run, tmp_path)


OPTIONS = """
/dev/ttyNONE            => there is no port
PORT --rig none.toml    => none.toml does not exist
PORT --rig bare.toml    => [motor] is missing
PORT --rig broken.toml  => is no TOML
PORT --patience 0.01    => no line came in
"""


def test_bad_input_to_the_command_is_one_line_and_leaves_no_file(call, protocol, tmp_path):
    out, port = tmp_path / "new.csv", str(protocol.link)
    (tmp_path / "bare.toml").write_text("name = 'x'\n")
    (tmp_path / "broken.toml").write_text("[motor\n")
    for options, words in rows(OPTIONS):
        assert_one_line(call(f"log --out new.csv --port {options.replace('PORT', port)}"), words)
        assert not out.exists()
    out.write_text("precious")
    assert_one_line(call("log --out", out, "--port", port), "exists and is not overwritten")
    assert out.read_text() == "precious"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_request_to_stop_ends_the_log_with_all_rows_safe(opened, protocol, tmp_path, number):
    log, form = opened()
    feed(protocol, b"".join(written(form, (str(k), "0", "0")) for k in range(7)))

    def show(counts, _):
        if counts.rows == 7:
            os.kill(os.getpid(), number)

    log.show = show
    with stop_requests() as stop:
        log_until(log, stop)
    assert len(read_log(tmp_path / "log.csv").columns["time"]) == 7


def test_what_is_shown_names_what_happens(capsys):
    with progress_line(("time",)) as show:
        for connected in (True, False, True):
            show(Counts(), connected)
    assert capsys.readouterr().err.splitlines() == [
        "the port is gone: waiting for it",
        "the port is back",
    ]
