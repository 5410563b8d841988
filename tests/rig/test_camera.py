"""Angles from films whose truth is known: how accurate, how honest, and nothing is invented."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.shared import shared
from fixtures.simulated_films import (
    BLUE,
    LENGTHS,
    RED,
    SMALL,
    Film,
    Look,
    errors,
    marker,
    marker_setup_of,
    motion,
    rms,
    taken,
    tracked,
)
from numpy.random import default_rng
from numpy.testing import assert_allclose

from frictionid.data.recordings import TrueMotion
from frictionid.rig.camera.angles import angles_csv, calibrate_view, flattened, joined_turns
from frictionid.rig.camera.film import write_film
from frictionid.rig.camera.marker_setup import Camera, Links, Marker, MarkerSetup
from frictionid.rig.camera.propose import propose
from frictionid.rig.camera.scene import chain
from frictionid.rig.camera.source import Source
from frictionid.rig.camera.track import follow_by_thresholds, track

EASY = Film(LENGTHS, view=SMALL)


@shared
def easy():
    movement = motion(120, speed=1.6, seed=1)
    return movement, taken(EASY, movement)


def test_angles_are_right_twice_as_good_as_the_study_s_and_their_deviations_honest(easy):
    movement, shots = easy
    angles = tracked(EASY, shots)
    assert np.mean(np.array(angles.state) == "found") > 0.98
    e = errors(angles, movement)
    # links are 92 and 105 pixels long: 0.02 pixels are 0.01 degrees
    assert (rms(e) < 0.05).all()
    stated = np.degrees(np.sqrt(np.nanmean(angles.sigma**2, axis=0)))
    ratio = (e - e.mean(axis=0)).std(axis=0) / stated
    assert ((ratio > 1 / 1.5) & (ratio < 1.5)).all()
    study = errors(tracked(EASY, shots, followed=follow_by_thresholds), movement)
    assert (rms(e) < 0.5 * rms(study)).all()


def test_blur_of_the_exposure_does_not_move_a_dot():
    """Whirling at 20 rad/s for 8 ms a tip draws a streak longer than its dot."""
    film = replace(EASY, noise=0.0, exposure=0.008)
    movement = motion(50, whirl=20.0)
    assert np.abs(errors(tracked(film, taken(film, movement)), movement)).max() < 0.15


def test_what_hides_is_not_invented_and_tilt_and_lens_are_found():
    view = replace(SMALL, tilt=(3.0, -4.0), distortion=0.02)
    look = Look(background="wall", gradient=0.5, shadow=0.3)
    film = replace(EASY, dropped=0.05, jitter=0.001, hidden=0.06, view=view, look=look)
    movement = motion(260, speed=1.2, seed=2)
    shots = taken(film, movement)
    angles = tracked(film, shots)
    e = errors(angles, movement)
    assert (rms(e) < 0.08).all() and np.abs(e).max() < 0.5
    hidden = np.array([s.hidden.any() for s in shots])
    assert hidden.sum() > 5
    seen = np.array([s == "found" for s in angles.state])
    assert seen[~hidden].mean() > 0.97
    assert np.isnan(angles.q[~seen]).any(axis=1).all()
    uncalibrated = tracked(film, shots, marker_setup_of(film, camera=Camera(calibrate=False)))
    assert (rms(errors(uncalibrated, movement)) > 2 * rms(e)).any()


def test_dots_of_one_colour_that_pass_each_other_do_not_swap():
    look = Look(dots=(RED, RED, RED))
    film = Film((0.153, 0.155), view=SMALL, look=look)
    setup = MarkerSetup(
        markers=[marker("pivot", RED, moves=False), marker("elbow", RED), marker("tip", RED)],
        links=Links(pixels=[91.8, 93.0]),
    )
    for seed, whirl in ((0, 14.0), (1, -18.0)):
        movement = motion(100, whirl=whirl, seed=seed)
        angles = tracked(film, taken(film, movement), setup)
        e = errors(angles, movement)
        e -= 360 * np.round(e[0] / 360)  # how often a link went round before is not seen
        assert np.abs(e).max() < 0.5
        assert np.mean(np.array(angles.state) == "found") > 0.8


@pytest.mark.parametrize(
    "camera, sign, turned",
    [(Camera(), 1, 0.0), (Camera(mirrored=True), -1, 0.0), (Camera(down=30.0), 1, 30.0)],
    ids=["same", "mirrored", "on its side"],
)
def test_the_side_and_the_direction_of_gravity_turn_the_first_joint(easy, camera, sign, turned):
    _, shots = easy
    plain = tracked(EASY, shots[:40])
    other = tracked(EASY, shots[:40], marker_setup_of(EASY, camera=camera))
    assert_allclose(
        other.q, sign * plain.q - np.radians([turned, 0.0]), atol=1e-12 if camera != Camera() else 0
    )


@pytest.mark.parametrize("stamp, late", [("start", 0.002), ("middle", 0.0), ("end", -0.002)])
def test_times_are_the_middles_of_exposures(easy, stamp, late):
    _, shots = easy
    angles = tracked(EASY, shots[:20], marker_setup_of(EASY, camera=Camera(stamp=stamp)))
    assert_allclose(angles.time, [s.time + late for s in shots[:20]], atol=1e-12)


def test_calibration_finds_the_plane_that_keeps_links_as_long_as_they_are():
    rng = default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (300, 2))
    view = replace(SMALL, tilt=(6.0, 3.0), distortion=0.03)
    markers = view.pixels(chain(q, np.array(LENGTHS)))
    markers[:, 1:] += 0.03 * rng.standard_normal(markers[:, 1:].shape)
    all_seen, sigma = np.ones(markers.shape[:2], bool), np.full(markers.shape[:2], 0.03)
    known = {"fixed": True, "lengths": np.array(LENGTHS)}
    found = calibrate_view(markers, sigma, all_seen, view.size, **known)
    plain = calibrate_view(markers, sigma, all_seen, view.size, view=False, **known)
    assert np.nanstd(found.residual) < 0.06 < 0.3 * np.nanstd(plain.residual)
    flat = flattened(markers, found.size, found.shape)
    length = np.linalg.norm(np.diff(flat, axis=1), axis=-1)
    assert_allclose(length.mean(0) / length.mean(0)[0], [1, 175 / 153], rtol=1e-3)


class Pictures(Source):
    """A source whose frames are in memory."""

    def __init__(self, taken_frames, size, rate):
        super().__init__("film", "video", size, rate, len(taken_frames))
        object.__setattr__(self, "taken", taken_frames)

    def frames(self, buffers=0):
        return iter(self.taken)


@pytest.mark.parametrize("seed", range(3))
def test_a_proposal_finds_dots_pivot_and_links(seed):
    rng = default_rng(seed)
    hue = rng.uniform(0, 360)
    look = Look(
        dots=((), (hue, 0.8, 0.7), ((hue + rng.uniform(70, 290)) % 360, 0.7, 0.8)),
        radius=rng.uniform(6, 9),
        background=("plate", "wall", "workshop")[seed],
        wall=(rng.uniform(0, 360), 0.1, rng.uniform(0.4, 0.8)),
        gradient=0.3,
    )
    film = replace(EASY, look=look, seed=seed)
    shots = taken(film, motion(150, seed=seed))[::3]
    setup = propose(Pictures(shots, SMALL.size, 20.0))
    assert [m.name for m in setup.markers] == ["pivot", "elbow", "tip"]
    assert_allclose(setup.markers[0].at, SMALL.pivot, atol=3)
    assert_allclose(setup.links.pixels, 600 * np.array(LENGTHS), rtol=0.04)
    assert_allclose([m.radius for m in setup.markers[1:]], look.radius, rtol=0.2)


@pytest.mark.parametrize("tip", [RED, BLUE])
def test_a_proposal_tracks_and_gives_dots_of_one_colour_one_hue(tip):
    film = replace(EASY, look=Look(dots=((), RED, tip)))
    movement = motion(150, seed=2)
    shots = taken(film, movement)
    setup = propose(Pictures(shots[::3], SMALL.size, 20.0))
    assert (setup.markers[1].hue == setup.markers[2].hue) == (tip == RED)
    e = errors(tracked(film, shots, setup), movement)
    assert np.abs(e - np.median(e, axis=0)).max() < 0.3


def test_the_table_is_empty_where_a_dot_was_not_found():
    film = replace(EASY, hidden=0.2, seed=3)
    angles = tracked(film, taken(film, motion(80)))
    lines = angles_csv(angles).splitlines()
    assert lines[0] == "time,q1,q2,sigma1,sigma2,predicted1,predicted2,state"
    missing = 0
    for line, q in zip(lines[1:], angles.q, strict=True):
        cells = line.split(",")
        for cell, value in zip(cells[1:3], q, strict=True):
            assert (cell == "") == bool(np.isnan(value))
        if cells[-1] != "found":
            missing += 1
            assert "" in cells[1:3]
    assert missing > 3


def test_a_still_chain_is_found_where_it_is():
    still = motion(12)
    still = TrueMotion(
        still.angle._replace(value=np.full((12, 2), 0.4)),
        still.velocity._replace(value=np.zeros((12, 2))),
    )
    angles = tracked(
        EASY, taken(EASY, still), marker_setup_of(EASY, camera=Camera(calibrate=False))
    )
    assert_allclose(np.degrees(angles.q), np.degrees(0.4), atol=0.1)


def test_colour_at_full_resolution_is_more_exact(tmp_path):
    slow, off = motion(60, speed=0.05, seed=3), []
    for codec in ("jpeg", "jpeg444"):
        film = replace(EASY, codec=codec, noise=0.0)
        film_path = write_film(film, slow, tmp_path / codec)
        # what dots show of the grid of pixels, not what a turned view does
        off.append(np.std(errors(track(film_path, marker_setup_of(film)).angles, slow)[1:], axis=0))
    assert (off[1] < 0.6 * off[0]).all()


@pytest.mark.parametrize("round_and_round", [False, True])
def test_one_link_is_a_pendulum(round_and_round):
    """A circle that is seen whole looks like one through other perspectives and lenses, too."""
    look = Look(dots=((), BLUE))
    film = Film((0.2,), view=SMALL, look=look)
    m = motion(60)
    turn = 12.0 * round_and_round
    time = m.angle.time[:, None]
    movement = TrueMotion(
        m.angle._replace(value=m.angle.value[:, :1] + turn * time),
        m.velocity._replace(value=m.velocity.value[:, :1] + turn),
    )
    setup = MarkerSetup(markers=[Marker(name="pivot", at=list(SMALL.pivot)), marker("bob", BLUE)])
    assert np.abs(errors(tracked(film, taken(film, movement), setup), movement)).max() < 0.1


@pytest.mark.parametrize("last", [1, 2, 40], ids="{} frames behind".format)
def test_whole_turns_across_a_gap_are_those_of_the_motion(last):
    """Up to 45 rad/s, some 500 rad/s^2, three or four frames lost, a guide that is turns off."""
    rng = default_rng(5)
    for _ in range(50):
        time = np.arange(44 + last) / 60.0
        speed = rng.uniform(-30, 30) + rng.uniform(-8, 8) * np.sin(rng.uniform(3, 60) * time)
        true = np.cumsum(speed)[:, None] / 60.0
        found = np.ones_like(true, dtype=bool)
        found[40 : 40 + rng.integers(3, 5)] = False
        astray = true + 2 * np.pi * rng.integers(-2, 3) * (np.arange(len(time)) >= 40)[:, None]
        joined = joined_turns(time, astray, found)
        assert_allclose(joined[found], true[found], atol=1e-9)
    assert_allclose(joined_turns(time, true, np.ones_like(found)), true)
