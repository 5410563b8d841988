"""Films, pictures and rig.toml: what cannot be used is one line, the rest is read right."""

import itertools
import tomllib
from dataclasses import replace
from importlib import import_module

import cv2
import numpy as np
import pandas as pd
import pytest
from fixtures.mistakes import mistakes, rows
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.shared import shared
from fixtures.simulated_films import LENGTHS, SMALL, Film, errors, marker_setup_of, motion
from fixtures.tiny_pendulums import changed, write_toml
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid import load_dataset
from frictionid.rig.camera.film import load_film, shots, write_film
from frictionid.rig.camera.scene import SyncLed
from frictionid.rig.camera.source import Source, open_source

FILM = Film(LENGTHS, view=SMALL)
MOTION = motion(60)
RIG = """
[[markers]]
name = "pivot"
at = [320.0, 240.0]
[[markers]]
name = "elbow"
hue = 0.0
[[markers]]
name = "tip"
hue = 210.0
[links]
lengths = [0.153, 0.175]
"""


@shared
def place(shared_path):
    write_film(FILM, MOTION, shared_path / "even")
    write_film(replace(FILM, codec="mpeg4"), MOTION, shared_path / "squeezed")
    write_film(replace(FILM, dropped=0.2, jitter=0.002), MOTION, shared_path / "uneven")
    (shared_path / "rig.toml").write_text(RIG)
    return shared_path


@pytest.mark.parametrize("name", ["even.mov", "squeezed.mp4", "uneven.mov"])
def test_videos_give_their_own_times_and_right_angles(place, name):
    tracked = fid.track(place / name, place / "rig.toml")
    angles = tracked.angles
    expected = MOTION.angle.time
    if name.startswith("uneven"):
        assert len(angles.time) < len(expected) and np.ptp(np.diff(angles.time)) > 0.01
    else:
        assert_allclose(angles.time, expected, atol=1e-5)
        assert abs(tracked.source.rate - 60) < 0.5
    assert np.abs(errors(angles, MOTION)).max() < 0.5


def test_a_folder_of_pictures_is_a_video(place, tmp_path):
    for k, frame in enumerate(open_source(str(place / "even.mov")).frames()):
        cv2.imwrite(str(tmp_path / f"{k:04d}.png"), frame.image)
    rig = place / "rig.toml"
    video = fid.track(place / "even.mov", rig).angles
    pictures = fid.track(open_source(str(tmp_path), 60.0), rig).angles
    assert_allclose(video.q, pictures.q, atol=1e-8)
    assert_allclose(video.time, pictures.time, atol=1e-5)


def test_the_command_writes_angles_that_a_data_set_reads(place, tmp_path, run):
    words = ("--out", tmp_path / "a.csv", "--sheet", tmp_path / "s.png")
    status, out, err = run(place, "track even.mov", *words)
    assert status == 0 and not err and "60 frames" in out
    (tmp_path / "dataset.toml").write_text(
        'name = "seen"\n[mechanism]\nkind = "acrobot"\n[columns]\ntime = "time"\n'
        'angle = ["q1", "q2"]\nsigma = ["sigma1", "sigma2"]\ntorque = ["", ""]\nmissing = "drop"\n'
        '[recordings]\npatterns = ["a.csv"]\n'
    )
    angle = load_dataset(tmp_path).recordings[0].angle
    assert angle.sigma.shape == angle.value.shape
    assert np.abs(angle.value - MOTION.angle.value[: len(angle.value)]).max() < 0.01
    assert cv2.imread(str(tmp_path / "s.png")) is not None
    same = fid.track(place / "even.mov", place / "rig.toml")  # the command calls it
    assert str(same) in out
    pd.testing.assert_frame_equal(same.frame, pd.read_csv(tmp_path / "a.csv"))


def test_setup_proposes_a_rig_that_tracks(tmp_path, run):
    write_film(FILM, motion(150), tmp_path / "film")
    status, out, _ = run(tmp_path, "track film.mov --setup")
    assert status == 0 and "elbow" in out
    again = run(tmp_path, "track film.mov --setup")
    assert_one_line(again, "rig.toml exists: choose another name")
    rig, drive = tmp_path / "rig.toml", "# ours\n[motor]\nkt = 0.02\n"
    proposed = rig.read_text()
    rig.write_text(drive)
    assert run(tmp_path, "track film.mov --setup")[0] == 0
    assert rig.read_text() == f"{drive}\n{proposed}"
    rig.write_text(drive + proposed.replace("moves = false", "moves = true"))
    assert run(tmp_path, "track film.mov --setup --replace")[0] == 0
    assert tomllib.loads(rig.read_text()) == tomllib.loads(drive + proposed)
    status, *_ = run(tmp_path, "track film.mov --out a.csv")
    assert status == 0


def test_an_overlay_has_every_frame(place, tmp_path, run):
    out = tmp_path / "new/over.mp4"
    words = (tmp_path / "a.csv", "--overlay", out)
    assert run(place, "track uneven.mov --out", *words)[0] == 0
    assert open_source(str(out)).count == open_source(str(place / "uneven.mov")).count


def test_a_contact_sheet_shows_frames_without_a_dot(place):
    film = replace(FILM, hidden=0.3)
    write_film(film, MOTION, place / "hidden")
    sheet = fid.track(place / "hidden.mov", marker_setup_of(film)).sheet()
    assert sheet.shape[1] == 4 * 480 and sheet.std() > 5


LED = '[sync_led]\nat = [290.0, 20.0]\nradius = 4.0\nname = "led"\n'
RIGS = r"""
markers.2.hue = 120.0             => is in no frame
markers.2.hue = 20.0              => cannot be distinguished
markers.0.at = [900.0, 240.0]     => lies outside the picture
links.lengths = [0.153, 0.4]      => have the ratio
markers.2.hue =                   => neither a colour nor a place
markers.2.saturation = 0.1        => grey
markers.1.heu = 0.0               => did you mean 'hue'
links =; markers = [{name = "p", at = [1.0, 2.0]}] => at least 2
links =; markers =                => the key 'markers' is missing
links.lengths = [0.153]           => give one for each pair
sync_led.at = [640.0, 20.0]       => the sync LED at (640, 20) lies outside the picture
sync_led.name = "q1"              => 'q1' is another column of the table
sync_led.name = "state"           => 'state' is another column of the table
sync_led.name = "a,b"             => must have letters, digits, - and _ only
sync_led.radius = 0.0             => sync_led.radius
sync_let = {}                     => unknown table [sync_let]; did you mean 'sync_led'?
sync_led.at =                     => the key 'sync_led.at' is missing
"""


@mistakes(RIGS)
def test_a_mistake_in_the_rig_is_one_line(place, tmp_path, run, wrong, words):
    document = changed(tomllib.loads(RIG + LED), wrong)
    file = write_toml(tmp_path / "rig.toml", document)
    outcome = run(place, "track even.mov --rig", file, "--out", tmp_path / "a.csv")
    assert_one_line(outcome, "frictionid: ", words)
    assert not (tmp_path / "a.csv").exists()


VIDEOS = """
nothing.mp4              => no such file
text.mp4                 => no video that can be read
cut.mp4                  => no video that can be read, or has lost its end
empty                    => no pictures there
even.mov --rig text.mp4  => no TOML
"""


def test_what_is_no_video_or_no_rig_is_one_line(place, run):
    data = (place / "squeezed.mp4").read_bytes()
    (place / "cut.mp4").write_bytes(data[: len(data) // 2])
    (place / "text.mp4").write_text("no video")
    (place / "empty").mkdir()
    for wrong, words in rows(VIDEOS):
        assert_one_line(run(place, f"track {wrong} --out lost.csv"), "frictionid: ", words)
    assert not (place / "lost.csv").exists()


def test_a_video_that_ends_early_is_refused(place, tmp_path, run):
    whole = (place / "even.mov").read_bytes()
    (tmp_path / "rig.toml").write_text(RIG)
    # the index of frames stands at the end: with it, but without the frames' bytes
    (tmp_path / "holes.mov").write_bytes(
        whole[:1000] + b"\0" * (len(whole) // 2) + whole[len(whole) // 2 + 1000 :]
    )
    status, _, err = run(tmp_path, "track holes.mov --out a.csv")
    assert status == 2 and err.count("frictionid: ") == 1
    assert "damaged" in err or "no video that can be read" in err
    assert not (tmp_path / "a.csv").exists()


class Live(Source):
    """A camera that somebody stops by Ctrl-C after some frames."""

    def frames(self, buffers=0):
        yield from itertools.islice(open_source(self.files[0]).frames(), 25)
        raise KeyboardInterrupt


def test_an_interrupt_ends_a_live_camera_and_loses_nothing(place):
    rig, film = place / "rig.toml", str(place / "even.mov")
    angles = fid.track(Live("0", "live", SMALL.size, 0.0, None, (film,)), rig).angles
    assert len(angles.time) == 25
    assert_allclose(angles.q, fid.track(film, rig).angles.q[:25], atol=1e-3)
    with pytest.raises(KeyboardInterrupt):
        fid.track(Live("film", "video", SMALL.size, 60.0, None, (film,)), rig)


OUTPUTS = """
even.mov                      => belongs to what is read
lost.csv --overlay ./even.mov => belongs to what is read
rig.toml --replace            => belongs to what is read
lost.csv --sheet lost.csv     => is written by two options
lost.csv --sheet .            => is a folder
"""


def test_nothing_that_exists_is_lost_to_an_output(place, run):
    film, rig = (place / "even.mov").read_bytes(), (place / "rig.toml").read_bytes()
    for wrong, words in rows(OUTPUTS):
        assert_one_line(run(place, f"track even.mov --out {wrong}"), words)
    assert not (place / "lost.csv").exists()
    assert (place / "even.mov").read_bytes() == film
    assert (place / "rig.toml").read_bytes() == rig


def test_no_word_of_the_decoder_comes_beside_the_line(tmp_path, capfd):
    (tmp_path / "junk.mov").write_bytes(b"junk")
    with assert_refused("no video"):
        open_source(str(tmp_path / "junk.mov"))
    with assert_refused("gives no pictures"):
        open_source("97")
    assert capfd.readouterr().err == ""


CAMERAS = r"""
noize = 3.0                                 => did you mean 'noise'
lengths = [-0.1, 0.1]                       => lengths
view.scale = 0.0                            => scale
view.size = [0, 10]                         => size
view.pivot = [9e39, 100.0]                  => pivot
view.pivot = [100.0, -1e5]                  => pivot
look.dots = [[], [], [0.0, 0.85]]           => look.dots: \[0.0, 0.85\] must be a hue
look.dots = [[], [], [0.0, 8.5, 0.85]]      => look.dots: \[0.0, 8.5, 0.85\] must be a hue
look.dots = [[], [0.0, 0.85, 0.85]]         => look.dots has 2 entries for 2 links
look.radius = -3.0                          => radius
sync_led.at = [1300.0, 9.0]                 => outside the picture of 1280 x 720
sync_led.switches = [2.0, 1.0]              => must increase
sync_led.radius = 0.0                       => sync_led.radius: it should be greater than 0
sync_led.switches =                         => switches
sync_led.switchs = [1.0]                    => did you mean 'switches'
"""
CAMERA = "lengths = [0.1, 0.1]\nsync_led = {at = [9.0, 9.0], switches = [0.5, 2.0]}"


def test_a_simulated_camera_is_read(tmp_path):
    (tmp_path / "camera.toml").write_text(CAMERA)
    film = load_film(tmp_path / "camera.toml")
    assert film == Film((0.1, 0.1), sync_led=SyncLed((9.0, 9.0), (0.5, 2.0)))


@mistakes(CAMERAS)
def test_a_camera_that_cannot_be_is_refused(tmp_path, wrong, words):
    path = write_toml(tmp_path / "camera.toml", changed(tomllib.loads(CAMERA), wrong))
    with assert_refused(f"camera.toml: .*{words}"):
        load_film(path)


def test_a_film_that_broke_off_is_none(tmp_path, monkeypatch):
    def broken(*_):
        yield from itertools.islice(shots(FILM, MOTION), 3)
        raise KeyboardInterrupt

    monkeypatch.setattr(import_module("frictionid.rig.camera.film"), "shots", broken)
    with pytest.raises(KeyboardInterrupt):
        write_film(FILM, MOTION, tmp_path / "half")
    assert not list(tmp_path.iterdir())
