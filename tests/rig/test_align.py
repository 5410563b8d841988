"""One clock: offset and drift put in come back, and what cannot be told is refused."""

from functools import partial

import numpy as np
import pandas as pd
import pytest
from fixtures.driven_pendulum import TABLE, aligned, logged_pendulum, write_log
from fixtures.mistakes import rows
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.shared import shared
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.signals import Signal, cut
from frictionid.rig.align.align_files import load_rig, read_angles
from frictionid.rig.align.clock import Clock, align
from frictionid.rig.align.cross_correlation import check_spans
from frictionid.rig.align.drifting_clocks import lost_frames
from frictionid.rig.align.drive_response import drive_response
from frictionid.rig.align.recording_folder import add_recording, check_place
from frictionid.simulate import Steps

RATE = 200.0
OFFSET, DRIFT = 0.137, 50e-6


@shared
def motion():
    """Angles at 60 Hz and the drive's torque, 30 s on one clock."""
    recording = logged_pendulum(Steps(1.1, 0.4), 30.0)
    return recording.angle, recording.torque


def logged(torque, offset=OFFSET, drift=DRIFT):
    """The torque by a clock of its own."""
    return torque._replace(time=(torque.time - offset) / (1.0 + drift))


# --- Clocks from the motion ----------------------------------------------------------------------


def test_offset_and_drift_come_back_from_the_motion(motion):
    angle, torque = motion
    found = align(TABLE, angle, logged(torque))
    begin, end = found.span
    for time in (begin, found.clock.at, end):
        off = found.clock.offset_at(time) - (OFFSET + DRIFT * time)
        assert abs(off) < 1e-3
        # three times the 95 % interval: one seed says no more (200: comparisons/clocks.py)
        assert abs(off) < 3 * found.t_quantile * found.error_at(time)
        assert found.t_quantile * found.error_at(time) < 2e-3
    assert abs(found.clock.drift - DRIFT) < 3 * found.t_quantile * found.drift_error
    assert found.converged and found.step is None
    assert found.coarse.unexplained < 0.05
    # a torque that comes later looks like more friction or less, and is refitted by no more
    assert 0 < abs(found.viscous_slope[0]) * 1e-3 < 0.012
    assert found.viscous[0] == pytest.approx(0.012, rel=0.2)


@pytest.mark.parametrize("time, size", [(9.0, -1 / 60), (17.0, -2 / 60), (21.0, 0.02)])
def test_a_step_of_the_clock_is_named_and_lost_frames_are_found(motion, time, size):
    """Constant stamps of a film that lost frames; and a torque that comes later from a time on."""
    angle, torque = motion
    lost = max(round(-60 * size), 0)
    kept = (angle.time <= time) | (angle.time > time + (lost + 0.5) / 60)
    film = Signal(angle.time[: kept.sum()], angle.value[kept])
    late = torque.time + (size if size > 0 else 0.0) * (torque.time > time)
    found = align(TABLE, film, logged(torque._replace(time=late)))
    assert_allclose(np.divide(found.step, (1.0, 4e-3)), (time, -abs(size) / 4e-3), atol=0.5)
    # the log's loss shows in no frame
    assert (lost_frames(film, found.step) is None) == (size > 0)
    if lost:
        assert_allclose(lost_frames(film, found.step), (time, lost / 60), atol=1e-3)


def test_a_motion_is_found_in_a_long_log_whatever_the_zeros_of_the_clocks(motion):
    angle, torque = motion
    part = cut(angle, 10.0, 18.0)
    part = part._replace(time=part.time - 10.0 + 1.7e9)
    found = align(TABLE, part, logged(torque, -3000.0, 0.0))
    true = 1.7e9 - 10.0 - 3000.0
    assert found.clock.offset == pytest.approx(true, abs=2e-3)


def test_a_log_that_ends_early_is_used_as_far_as_it_goes(motion):
    angle, torque = motion
    found = align(TABLE, cut(angle, 0.0, 14.0), logged(cut(torque, 3.0, 12.0), 0.4, 0.0))
    assert found.clock.offset == pytest.approx(0.4, abs=2e-3)
    assert found.span[1] - found.span[0] < 9.2


def test_what_no_motion_can_tell_is_refused(motion):
    angle, torque = motion
    short = cut(angle, 0.0, 12.0)
    other = np.random.default_rng(5).uniform(-1, 1, 100)[(torque.time / 0.4).astype(int)]
    cases = (
        (short, torque._replace(value=other[:, None]), "no stretch of the log explains"),
        (short, torque._replace(value=-torque.value), "with its sign reversed"),
        (short, torque._replace(value=0 * torque.value), "never changes"),
        (short, cut(torque, 20.0, 22.0), "less than half of the motion"),
        (short._replace(value=0 * short.value + 0.1), torque, "hardly move"),
    )
    for a, u, said in cases:
        with assert_refused(said):
            align(TABLE, a, u)


def test_a_motion_that_repeats_itself_needs_a_marker(motion):
    angle, torque = motion
    once = cut(torque, 5.0, 15.0)
    gap = once.time[-1] - once.time[0] + 1 / RATE
    twice = Signal(
        np.concatenate([once.time, once.time + gap]), np.tile(once.value, (2, 1)), "previous"
    )
    part = cut(angle, 5.0, 15.0)
    with assert_refused("does not repeat itself, or a marker"):
        align(TABLE, part, twice)
    known = align(TABLE, part, twice, start=Clock(0.2, 0.0, 10.0))
    assert known.clock.offset == pytest.approx(0.0, abs=2e-3)


@given(st.floats(-1e4, 1e4), st.floats(-1e-3, 1e-3), st.floats(0, 1e4), st.floats(-0.01, 0.01))
def test_clocks_go_both_ways(offset, drift, at, delay):
    clock = Clock(offset, drift, at)
    time = np.linspace(-100.0, 1e4, 7)
    assert_allclose(clock.to_log(clock.to_angles(time)), time, atol=1e-6)
    later = clock.later(delay, 1e-4)
    # what is left is found on the angles' clock: delay + drift (t - middle)
    angles = clock.to_angles(time)
    middle = clock.to_angles(np.array(at))
    wanted = angles + delay + 1e-4 * (angles - middle)
    assert_allclose(later.to_angles(time), wanted, atol=1e-6)


# --- Command against measured torque -------------------------------------------------------------


@pytest.mark.parametrize("limits", [(-np.inf, np.inf), (-0.1, 0.12), (-np.inf, 0.08)])
def test_what_a_drive_does_to_its_command_comes_back(limits):
    generator = np.random.default_rng(3)
    time = np.arange(0.0, 10.0, 2e-3)
    command = np.repeat(generator.uniform(-0.15, 0.15, 200), 25)
    late = np.interp(time - 0.0123, time, command)
    measured = np.clip(0.96 * late + 0.004, *limits) + 0.003 * generator.standard_normal(len(time))
    found = drive_response(time, command, measured)
    for value, true, error in zip(found[:3], (0.96, 0.004, 0.0123), found.error, strict=True):
        assert abs(value - true) < 4 * error + 1e-4 * abs(true)
    assert (found.low, found.high) == pytest.approx(limits, rel=0.01)
    assert found.rms == pytest.approx(0.003, rel=0.1)
    assert found.error[0] < 0.002


def test_a_command_that_never_changes_has_no_response():
    time = np.arange(0.0, 10.0, 2e-3)
    assert drive_response(time, 0 * time + 0.1, np.sin(time)) is None


# --- Files and the command -----------------------------------------------------------------------

RIG = """
[mechanism]
kind = "pendulum"
parameters = { mass = 0.5, length = 0.3 }
[motor]
kt = 0.025
gear = 20.0
"""


def write_angles(path, angle, lost=slice(0), **columns):
    table = pd.DataFrame({"time": angle.time, "q1": angle.value[:, 0], **columns})
    table.loc[table.index[lost], "q1"] = np.nan
    table.to_csv(path, index=False)


@pytest.fixture
def call(tmp_path, run):
    (tmp_path / "rig.toml").write_text(RIG)

    return partial(run, tmp_path)


def test_two_files_become_a_recording_of_a_data_set(call, motion, tmp_path):
    angle, torque = motion
    write_angles(tmp_path / "day.csv", cut(angle, 0.0, 15.0), lost=slice(7, 9))
    log = logged(cut(torque, 0.0, 15.0))
    write_log(tmp_path / "log.csv", log, command=log.value[:, 0] / 0.97)
    words = "align day.csv log.csv --out data --hold previous"
    out, document = aligned(call(words), tmp_path / "data/day.align.toml")
    for said in ("offset   0.1", "drift", "viscous  of joint 1: 1 ms", "measured = 0.9700"):
        assert said in out
    dataset = load_dataset(tmp_path / "data")
    recording = dataset.recordings[0]
    assert recording.name == "day"
    # one row of 901 lies behind the log's last
    assert len(recording.angle.time) in (898, 899)
    near = np.interp(recording.torque.time[100:-100], torque.time, torque.time)
    k = np.searchsorted(torque.time, near + 2.5e-3) - 1
    assert np.mean(recording.torque.value[100:-100, 0] == torque.value[k, 0]) > 0.97
    low, high = document["clock"]["offset_interval"]
    assert low < document["clock"]["offset"] < high
    assert document["command"][0]["gain"] == pytest.approx(0.97, abs=1e-4)
    for kind in ("clock", "command"):
        picture = (tmp_path / f"data/day.{kind}.png").read_bytes()
        assert picture.startswith(b"\x89PNG")
        assert len(picture) > 10_000

    def again(log):
        return fid.align(*(tmp_path / name for name in ("day.csv", log, "rig.toml")))

    same = again("log.csv")
    assert same.document == document and str(same) in out  # the command calls this function
    assert_allclose(same.dataset.recordings[0].torque.time, recording.torque.time, atol=1e-8)
    # a log of another program knows no time of arrival
    foreign = pd.read_csv(tmp_path / "log.csv").drop(columns="host")
    foreign.to_csv(tmp_path / "foreign.csv", index=False)
    assert again("foreign.csv").document["clock"] == document["clock"]
    foreign.drop(columns="torque").to_csv(tmp_path / "foreign.csv", index=False)
    other = again("foreign.csv").torque.value  # kt gear current
    assert_allclose(other, same.torque.value, atol=1e-9)
    # a second recording joins; the same name only when it may replace
    assert_one_line(call(words), "has a recording 'day'")
    head = load_rig(tmp_path / "rig.toml").head("previous")
    check_place(tmp_path / "data", "night", head, False)
    add_recording(tmp_path / "data", "night", head, recording.angle, recording.torque)
    first, second = load_dataset(tmp_path / "data").recordings
    assert (first.name, second.name) == ("day", "night")
    assert_allclose(second.angle.value, first.angle.value, atol=1e-8)
    assert_allclose(second.torque.time, first.torque.time, atol=1e-8)


def test_frames_that_a_film_lost_come_back(call, motion, tmp_path):
    angle, torque = (cut(x, 0.0, 20.0) for x in motion)
    kept = np.arange(len(angle.time)) != 480
    film = Signal(angle.time[:-1], angle.value[kept])
    write_angles(tmp_path / "a.csv", film)
    write_log(tmp_path / "log.csv", logged(torque), command=0.0)
    out, document = aligned(call("align a.csv log.csv --out data"), tmp_path / "data/a.align.toml")
    assert "frames seem to be lost at 7.98 s: the clock steps by 16.7 ms" in out
    assert abs(document["clock"]["drift"] - DRIFT) < 1e-4 and document["warnings"]
    time = load_dataset(tmp_path / "data").recordings[0].angle.time
    assert_allclose(time, angle.time[kept][: len(time)], atol=1e-6)


BAD = """
a.csv gone.csv                      => gone.csv: no such file
gone.csv log.csv                    => gone.csv: no such file
log.csv log.csv                     => has no column 'q1'
a.csv a.csv                         => has no column 'torque', nor 'current'
lost.csv log.csv                    => has 0 rows with all of time, q1
epoch.csv log.csv                   => share no moment
a.csv log.csv --rig bare.toml       => [motor] is missing
a.csv log.csv --rig none.toml       => [mechanism] is missing
a.csv log.csv --rig two.toml        => has 2 motors
a.csv log.csv --hold next           => known: linear, previous
a.csv log.csv --name ../x           => letters, digits
a.csv log.csv --marker led          => no column 'led'
a.csv log.csv --out taken           => holds another data set
a.csv log.csv --out rig.toml        => is a file; name a folder
a.csv log.csv --out new --offset nan => must be a finite number
"""


def test_bad_input_to_the_command_is_one_line_and_nothing_is_written(call, motion, tmp_path):
    angle, torque = motion
    short, log = cut(angle, 0.0, 3.0), cut(torque, 0.0, 3.0)
    write_angles(tmp_path / "a.csv", short)
    write_log(tmp_path / "log.csv", log)
    write_angles(tmp_path / "epoch.csv", short._replace(time=short.time + 1.7e9))
    write_angles(tmp_path / "lost.csv", short, lost=slice(200))
    (tmp_path / "bare.toml").write_text(RIG.partition("[motor]")[0])
    (tmp_path / "none.toml").write_text("[motor]\nkt = 1.0\n")
    (tmp_path / "two.toml").write_text(
        RIG.replace("[motor]", "[[motor]]") + "[[motor]]\nkt = 1.0\n"
    )
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken/dataset.toml").write_text('name = "precious"\n')
    for wrong, words in rows(BAD):
        extra = "" if "--out" in wrong else "--out data"
        assert_one_line(call(f"align {wrong} {extra}"), words)
    assert not (tmp_path / "data").exists()
    assert (tmp_path / "taken/dataset.toml").read_text() == 'name = "precious"\n'


def test_angles_may_be_named_and_in_degrees(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"{k / 60:.4f},{k},{k % 2}" for k in range(20)]
    path.write_text("\n".join(["t,theta,led", *rows]) + "\n")
    own = {"time": "t", "columns": ["theta"], "unit": "deg"}
    angle, marker = read_angles(path, own, 1, "led")
    assert_allclose(angle.value[:, 0], np.radians(np.arange(20.0)))
    assert marker.value.sum() == 10
    with assert_refused("must name one column for each of 1 joints"):
        read_angles(path, {**own, "columns": ["theta", "led"]}, 1)


def test_a_sync_led_and_the_motion_tell_a_delay_of_the_drive(call, motion, tmp_path):
    angle, torque = motion
    part, log = cut(angle, 0.0, 10.0), cut(torque, 0.0, 10.0)
    lit, on = (np.searchsorted([1.013, 1.71, 4.006, 8.52], x.time) % 2 for x in (part, log))
    write_angles(tmp_path / "a.csv", part, led=lit)
    # the LED's clock is that of the log, but the torque acts 12 ms after it is logged
    u = np.interp(log.time + 0.012, torque.time, torque.value[:, 0])
    late = log._replace(value=u[:, None])
    write_log(tmp_path / "log.csv", late, time=log.time - 0.4, command=0.5, led=on)
    (tmp_path / "rig.toml").write_text(
        RIG + '[protocol]\ncolumns = ["time", "command", "current", "led"]\n'
    )
    outcome = call("align a.csv log.csv --out data --marker led")
    out, document = aligned(outcome, tmp_path / "data/a.align.toml")
    assert "marker   4 edges: offset 0." in out
    assert "by the motion the torque acts" in out
    assert "does not change: nothing to compare" in out
    assert document["marker"]["offset"] == pytest.approx(0.4, abs=1e-2)
    assert document["clock"]["offset"] == pytest.approx(0.412, abs=3e-3)


@pytest.mark.parametrize("spans", [(20.0, 30e3 * 60), (12e6, 12.0), (1e9, 1e300), (50.0, 5e4)])
def test_spans_in_another_unit_are_named_before_they_fill_the_memory(spans):
    with assert_refused(r"the angles span .* s and the log .*: convert the columns of time to s"):
        check_spans(*spans)
