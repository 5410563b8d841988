"""A sync LED in the picture and pulses of torque as markers: from the film to the clocks."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest
from fixtures.driven_pendulum import TABLE, aligned, logged_pendulum, write_log
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.shared import shared
from fixtures.simulated_films import (
    BLUE,
    LENGTHS,
    RED,
    SMALL,
    Film,
    Look,
    View,
    marker_setup_of,
    motion,
    taken,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.check.motion import motions_of, unit_rows
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal
from frictionid.mechanics import mechanism_of
from frictionid.rig.align.clock import align
from frictionid.rig.align.cross_correlation import coarse_offset
from frictionid.rig.align.drifting_clocks import clock_from_edges, edges_of
from frictionid.rig.camera.angles import angles_csv
from frictionid.rig.camera.film import write_film
from frictionid.rig.camera.marker_setup import Links, load_marker_setup, marker_setup_text
from frictionid.rig.camera.marker_setup import SyncLed as TrackedLed
from frictionid.rig.camera.scene import SyncLed
from frictionid.simulate import Steps

OFFSET, DRIFT = 0.137, 50e-6
SWITCHES = (0.413, 1.01, 1.606, 2.118, 2.6, 3.341, 3.64, 4.377, 5.0013, 5.5)
VIEW = View(size=(320, 240), pivot=(160.0, 120.0), scale=330.0)
PENDULUM = Film(
    (0.3,),
    exposure=0.008,
    view=VIEW,
    look=Look(dots=((), RED), radius=5.0, link_width=10.0),
    sync_led=SyncLed((290.0, 20.0), SWITCHES, radius=5.0),
)
RIG = """
[mechanism]
kind = "pendulum"
parameters = { mass = 0.5, length = 0.3 }
[motor]
kt = 0.025
gear = 20.0
[protocol]
columns = ["time", "command", "current", "led"]
[[markers]]
name = "pivot"
at = [160.0, 120.0]
[[markers]]
name = "tip"
hue = 0.0
radius = 5.0
[camera]
exposure = 0.008
[sync_led]
at = [290.0, 20.0]
radius = 4.0
name = "led"
"""


@shared
def place(shared_path):
    """A film of six seconds with a sync LED, and the drive's log by a clock of its own."""
    recording = logged_pendulum(Steps(1.1, 0.4), 6.0)
    write_film(PENDULUM, recording.truth, shared_path / "film")
    on = np.searchsorted(SWITCHES, recording.torque.time) % 2
    write_log(
        shared_path / "log.csv", recording.torque, time=recording.torque.time - OFFSET, led=on
    )
    (shared_path / "rig.toml").write_text(RIG)
    return shared_path


# --- From the film to the clocks -----------------------------------------------------------------


def test_a_sync_led_on_film_ties_the_clocks(place, run):
    status, _, err = run(place, "track film.mov --out a.csv")
    assert (status, err) == (0, "")
    words = "align a.csv log.csv --out data --hold previous --marker led"
    out, document = aligned(run(place, words), place / "data/a.align.toml")
    assert "marker   10 edges" in out
    led, clock = document["marker"], document["clock"]
    assert abs(led["offset"] - OFFSET) < 1.96 * led["error"] < 3e-3
    low, high = clock["offset_interval"]
    assert low < OFFSET < high


def test_where_nothing_moves_the_led_alone_ties_the_clocks(place, tmp_path, run):
    time = np.arange(360) / 60
    on = np.searchsorted(SWITCHES, time) % 2
    still = default_rng(0).normal(0.0, 1e-3, len(time))
    pd.DataFrame({"time": time, "q1": still, "led": on}).to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "rig.toml").write_text(RIG)
    log = place / "log.csv"
    assert_one_line(run(tmp_path, "align --out data a.csv", log))
    outcome = run(tmp_path, "align --out data --marker led a.csv", log)
    out, document = aligned(outcome, tmp_path / "data/a.align.toml")
    assert "aligned by the marker alone" in out and "viscous" not in out
    low, high = document["clock"]["offset_interval"]
    assert low < OFFSET < high and high - low < 0.02 and "viscous" not in document


def test_every_frame_has_a_brightness_whatever_the_dots_and_the_method(tmp_path):
    led = SyncLed((600.0, 40.0), (0.2, 0.5335))
    film = replace(Film(LENGTHS, view=SMALL), sync_led=led, hidden=0.3, noise=2.0)
    movement = motion(60)
    write_film(film, movement, tmp_path / "film")
    setup = marker_setup_of(film).model_copy(
        update={"sync_led": TrackedLed(at=[600.0, 40.0], radius=4.0)}
    )
    video = tmp_path / "film.mov"
    angles = {m: fid.track(video, setup, method=m).angles for m in ("follow", "study")}
    name, bright = angles["follow"].sync_led
    time = angles["follow"].time
    share = np.array([led.share(t - 0.002, t + 0.002) for t in time])
    assert name == "sync_led" and (angles["follow"].q.shape[0],) == bright.shape
    assert set(angles["follow"].state) > {"found"}
    # linear in the share of the exposure: what is lit in part lies between
    dark, lit = bright[share == 0].mean(), bright[share == 1].mean()
    assert lit - dark > 0.3
    assert_allclose((bright - dark) / (lit - dark), share, atol=0.03)
    assert ((share > 0) & (share < 1)).any()
    assert_array_equal(bright, angles["study"].sync_led[1])
    lines = angles_csv(angles["follow"]).splitlines()
    assert lines[0].endswith(",state,sync_led") and {line.count(",") for line in lines} == {8}
    assert [float(line.rpartition(",")[2]) for line in lines[1:]] == pytest.approx(bright, abs=1e-5)
    plain = angles_csv(fid.track(video, marker_setup_of(film)).angles)
    assert (
        "sync_led" not in plain
        and [line.rpartition(",")[0] for line in lines] == plain.splitlines()
    )


def test_a_film_without_a_led_is_as_it_was():
    film, movement = Film(LENGTHS, view=SMALL), motion(3)
    lit = replace(film, sync_led=SyncLed((600.0, 40.0), (0.0,)))
    for one, other in zip(taken(film, movement), taken(lit, movement), strict=True):
        differs = (one.image != other.image).any(axis=-1)
        y, x = np.nonzero(differs)
        assert np.hypot(x - 600, y - 40).max() < 8
        assert one.time == other.time


# --- Edges of a brightness -----------------------------------------------------------------------


@settings(max_examples=25)
@given(
    st.integers(0, 10**6),
    st.floats(-50.0, 50.0),
    st.sampled_from([0.001, 0.004, 0.012]),
    st.booleans(),
    st.sampled_from([0.0, 0.01, 0.1]),
)
def test_a_noisy_brightness_gives_offset_and_drift(seed, offset, exposure, known, noise):
    rng = default_rng(seed)
    switches = np.cumsum(rng.uniform(0.2, 2.0, 14))
    led, drift = SyncLed((1.0, 1.0), tuple(switches)), rng.uniform(-2e-4, 2e-4)
    camera = np.arange(0.0, switches[-1] + 1.0, 1 / 60)
    share = np.array([led.share(t - exposure / 2, t + exposure / 2) for t in camera])
    bright = 0.2 + 0.6 * (share + noise * rng.standard_normal(len(camera)))
    drive = np.arange(0.0, switches[-1] + 1.0, 1e-3)
    on = (np.searchsorted(switches, drive) % 2).astype(float)
    seen = edges_of(camera, bright, "angles.csv", exposure if known else 0.0)
    # each edge lies where it is said to, but for the noise of what seemed clear
    slack = exposure / 2 if noise else 1e-9
    assert (np.abs(seen.time - switches) <= seen.half + slack).all()
    found = clock_from_edges(seen, edges_of((drive - offset) / (1 + drift), on, "log.csv"))
    assert found.edges == 14
    assert abs(found.offset - offset - drift * found.at) < 4.5 * found.error
    assert abs(found.drift - drift) < 4.5 * found.drift_error + 1e-9
    assert found.error < 1 / 60 / np.sqrt(12)


def test_frames_lit_in_part_are_more_exact_where_the_exposure_is_known():
    led = SyncLed((1.0, 1.0), tuple(np.cumsum(default_rng(1).uniform(0.2, 2.0, 40))))
    time = np.arange(0.0, 50.0, 1 / 60)
    bright = np.array([led.share(t - 0.004, t + 0.004) for t in time])
    known, unknown = (edges_of(time, bright, "a", exposure) for exposure in (0.008, 0.0))
    assert_array_equal(known.time, unknown.time)
    part = known.half < unknown.half
    assert 2 < part.sum() < 30 and known.half[part] == pytest.approx(0.004)


def test_leds_that_do_not_agree_are_refused():
    time = np.arange(0.0, 10.0, 0.01)
    a, b = (
        edges_of(time, np.searchsorted(switches, time) % 2.0, "a")
        for switches in ([1.0, 2.0, 4.0, 7.0], [1.0, 3.3, 3.9, 8.0])
    )
    with assert_refused("edges do not agree"):
        clock_from_edges(a, b)


def test_an_led_that_blinks_evenly_needs_a_rough_offset():
    camera, drive = np.arange(0.0, 20.0, 1 / 60), np.arange(0.0, 60.0, 1e-3)
    seen = edges_of(camera, 1.0 * ((camera + 20.3) % 1.5 < 0.5), "a")
    log = edges_of(drive, 1.0 * (drive % 1.5 < 0.5), "b")
    with assert_refused("as well as with .* --offset"):
        clock_from_edges(seen, log)
    assert clock_from_edges(seen, log, roughly=-20.0).offset == pytest.approx(-20.3, abs=0.01)
    # one edge may be any of several
    with assert_refused("as well as with"):
        clock_from_edges(edges_of(camera, 1.0 * (camera > 7.0), "a"), log)


# --- Mistakes ------------------------------------------------------------------------------------


def test_a_led_that_never_switches_is_one_line(place, tmp_path, run):
    # a place where no LED is: noise has no two levels
    (tmp_path / "rig.toml").write_text(RIG.replace("290.0, 20.0", "290.0, 220.0"))
    assert run(tmp_path, "track --out a.csv", place / "film.mov")[0] == 0
    outcome = run(tmp_path, "align --out data --marker led a.csv", place / "log.csv")
    assert_one_line(outcome, "a.csv: the marker never changes")
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize(
    "value",
    [
        np.ones(500),
        np.sin(np.arange(500.0) / 9),
        np.linspace(0, 1, 500),
        0.3 + 1e-4 * (np.arange(500) % 2),
    ],
)
def test_what_has_no_two_levels_is_no_led(value):
    with assert_refused("never changes from one level to another"):
        edges_of(np.arange(500) / 60, value, "a.csv")


def test_a_marker_setup_survives_its_file(tmp_path):
    setup = marker_setup_of(Film(LENGTHS, view=SMALL, look=Look(dots=((), RED, BLUE))))
    led, links = TrackedLed(at=[10.5, 20.0], name="led"), Links(pixels=[91.75, 105.25])
    setup = setup.model_copy(update={"sync_led": led, "links": links})
    (tmp_path / "rig.toml").write_text(marker_setup_text(setup, ["a note"]))
    assert load_marker_setup(tmp_path / "rig.toml") == setup


# --- Pulses of torque ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Pulses:
    """Short pulses of torque, to one side and to the other."""

    starts: tuple[float, ...]
    height: float = 1.5
    width: float = 0.15

    def values(self, time, generator):
        out = np.zeros(len(time))
        for k, start in enumerate(self.starts):
            out[(time > start) & (time < start + self.width)] = (-1) ** k * self.height
        return out


def pulsed(*starts):
    """Angles and log of a joint at rest that answers pulses of torque, a clock each."""
    recording = logged_pendulum(Pulses(starts), 10.0, start=0.0)
    time, value = recording.torque.time, recording.torque.value
    noise = 0.003 * default_rng(0).standard_normal(value.shape)
    return recording.angle, Signal((time - OFFSET) / (1 + DRIFT), value + noise, "previous")


def test_a_few_pulses_of_torque_tell_the_offset():
    found = align(TABLE, *pulsed(2.0, 4.1, 7.4))
    off = found.clock.offset - (OFFSET + DRIFT * found.clock.at)
    assert abs(off) < min(1e-3, found.t_quantile * found.error_at(found.clock.at))


def test_one_pulse_of_torque_is_found_in_the_log():
    angle, log = pulsed(4.0)
    mechanism = mechanism_of(TABLE)
    still = Recording("motion", angle, Signal(angle.time, 0 * angle.value))
    nominal = mechanism.base(mechanism.nominal())
    found = coarse_offset(mechanism, nominal, unit_rows(mechanism, motions_of([still])), angle, log)
    assert found.offset == pytest.approx(OFFSET, abs=5e-3)
    assert found.unexplained < 0.1 and found.runner_up[1] > 0.2
