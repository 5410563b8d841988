"""Films, pictures and rig.toml: what cannot be used is one line, the rest is read right."""

import itertools
from dataclasses import replace
from importlib import import_module

import cv2
import numpy as np
import pandas as pd
import pytest
from fixtures.refusals import refused
from fixtures.simulated_films import LENGTHS, SMALL, Film, Look, errors, marker_setup_of, motion

import frictionid as fid
from frictionid import load_dataset
from frictionid.rig.camera.film import shots, write_film
from frictionid.rig.camera.marker_setup import load_marker_setup
from frictionid.rig.camera.source import Source, open_source
from frictionid.rig.camera.track import track
from frictionid.rig.camera.tracked import contact_sheet

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


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("films")
    write_film(FILM, MOTION, folder / "even")
    write_film(replace(FILM, codec="mpeg4"), MOTION, folder / "squeezed")
    write_film(replace(FILM, dropped=0.2, jitter=0.002), MOTION, folder / "uneven")
    (folder / "rig.toml").write_text(RIG)
    return folder


@pytest.mark.parametrize("name", ["even.mov", "squeezed.mp4", "uneven.mov"])
def test_videos_give_their_own_times_and_right_angles(place, name):
    source = open_source(str(place / name))
    angles = track(source, load_marker_setup(place / "rig.toml"))
    expected = MOTION.angle.time
    if name.startswith("uneven"):
        assert len(angles.time) < len(expected) and np.ptp(np.diff(angles.time)) > 0.01
    else:
        np.testing.assert_allclose(angles.time, expected, atol=1e-5)
        assert abs(source.rate - 60) < 0.5
    assert np.abs(errors(angles, MOTION)).max() < 0.5


def test_a_folder_of_pictures_is_a_video(place, tmp_path):
    for k, frame in enumerate(open_source(str(place / "even.mov")).frames()):
        cv2.imwrite(str(tmp_path / f"{k:04d}.png"), frame.image)
    rig = load_marker_setup(place / "rig.toml")
    video = track(open_source(str(place / "even.mov")), rig)
    pictures = track(open_source(str(tmp_path), 60.0), rig)
    np.testing.assert_allclose(video.q, pictures.q, atol=1e-8)
    np.testing.assert_allclose(video.time, pictures.time, atol=1e-5)


def test_the_command_writes_angles_that_a_data_set_reads(place, tmp_path, run):
    words = (
        "track",
        "even.mov",
        "--out",
        str(tmp_path / "a.csv"),
        "--sheet",
        str(tmp_path / "s.png"),
    )
    status, out, err = run(place, *words)
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
    status, out, _ = run(tmp_path, "track", "film.mov", "--setup")
    assert status == 0 and "elbow" in out
    status, _, err = run(tmp_path, "track", "film.mov", "--setup")
    assert status == 2 and "rig.toml exists: choose another name" in err
    status, *_ = run(tmp_path, "track", "film.mov", "--out", "a.csv")
    assert status == 0


def test_an_overlay_has_every_frame(place, tmp_path, run):
    out = tmp_path / "new" / "over.mp4"
    words = ("track", "uneven.mov", "--out", str(tmp_path / "a.csv"), "--overlay", str(out))
    assert run(place, *words)[0] == 0
    assert open_source(str(out)).count == open_source(str(place / "uneven.mov")).count


def test_a_contact_sheet_shows_frames_without_a_dot(place):
    film = replace(FILM, hidden=0.3)
    write_film(film, MOTION, place / "hidden")
    source = open_source(str(place / "hidden.mov"))
    angles = track(source, marker_setup_of(film))
    sheet = contact_sheet(source.frames(), angles, source.size)
    assert sheet.shape[1] == 4 * 480 and sheet.std() > 5


def damaged(folder, tmp_path):
    data = (folder / "squeezed.mp4").read_bytes()
    (tmp_path / "cut.mp4").write_bytes(data[: len(data) // 2])
    (tmp_path / "text.mp4").write_text("no video")
    (tmp_path / "rig.toml").write_text(RIG)
    (tmp_path / "empty").mkdir()
    (tmp_path / "even.mov").symlink_to(folder / "even.mov")


WRONG = {
    "no file": ("nothing.mp4", RIG, "no such file"),
    "no video": ("text.mp4", RIG, "no video that can be read"),
    "cut off": ("cut.mp4", RIG, "no video that can be read, or has lost its end"),
    "no pictures": ("empty", RIG, "no pictures there"),
    "no dot": ("even.mov", RIG.replace("210.0", "120.0"), "is in no frame"),
    "same hue": ("even.mov", RIG.replace("210.0", "20.0"), "cannot be distinguished"),
    "outside": ("even.mov", RIG.replace("320.0", "900.0"), "lies outside the picture"),
    "lengths": ("even.mov", RIG.replace("0.175", "0.4"), "have the ratio"),
    "no colour": ("even.mov", RIG.replace("hue = 210.0", ""), "neither a colour nor a place"),
    "grey": ("even.mov", RIG.replace("hue = 210.0", "hue = 210.0\nsaturation = 0.1"), "grey"),
    "unknown key": ("even.mov", RIG.replace("hue = 0.0", "heu = 0.0"), "did you mean 'hue'"),
    "one marker": ("even.mov", '[[markers]]\nname = "p"\nat = [1.0, 2.0]', "at least 2"),
    "no table": ("even.mov", "", "the key 'markers' is missing"),
    "no TOML": ("even.mov", "[[", "no TOML"),
    "count": ("even.mov", RIG.replace("[0.153, 0.175]", "[0.153]"), "give one for each pair"),
}


@pytest.mark.parametrize(("video", "rig", "words"), WRONG.values(), ids=WRONG.keys())
def test_a_mistake_is_one_line(place, tmp_path, run, video, rig, words):
    damaged(place, tmp_path)
    (tmp_path / "rig.toml").write_text(rig)
    status, out, err = run(tmp_path, "track", video, "--out", "a.csv")
    assert status == 2 and not out
    assert err.startswith("frictionid: ") and err.count("\n") == 1 and words in err
    assert not (tmp_path / "a.csv").exists()


def test_a_video_that_ends_early_is_refused(place, tmp_path, run):
    whole = (place / "even.mov").read_bytes()
    (tmp_path / "rig.toml").write_text(RIG)
    # the index of frames stands at the end: with it, but without the frames' bytes
    (tmp_path / "holes.mov").write_bytes(
        whole[:1000] + b"\0" * (len(whole) // 2) + whole[len(whole) // 2 + 1000 :]
    )
    status, _, err = run(tmp_path, "track", "holes.mov", "--out", "a.csv")
    assert status == 2 and err.count("frictionid: ") == 1
    assert "damaged" in err or "no video that can be read" in err
    assert not (tmp_path / "a.csv").exists()


def test_a_camera_toml_is_checked(tmp_path, run):
    (tmp_path / "camera.toml").write_text("lengths = [0.1]\nnoize = 3.0\n")
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "dataset.toml").touch()
    words = ("render", "data", "--camera", "camera.toml", "--out", "v")
    status, _, err = run(tmp_path, *words)
    assert status == 2 and "did you mean 'noise'" in err


class Live(Source):
    """A camera that somebody stops by Ctrl-C after some frames."""

    def frames(self, buffers=0):
        yield from itertools.islice(open_source(self.files[0]).frames(), 25)
        raise KeyboardInterrupt


def test_an_interrupt_ends_a_live_camera_and_loses_nothing(place):
    setup = load_marker_setup(place / "rig.toml")
    film = str(place / "even.mov")
    angles = track(Live("0", "live", SMALL.size, 0.0, None, (film,)), setup)
    assert len(angles.time) == 25
    np.testing.assert_allclose(angles.q, track(open_source(film), setup).q[:25], atol=1e-3)
    with pytest.raises(KeyboardInterrupt):
        track(Live("film", "video", SMALL.size, 60.0, None, (film,)), setup)


def test_nothing_that_exists_is_lost_to_an_output(place, run):
    film, rig = (place / "even.mov").read_bytes(), (place / "rig.toml").read_bytes()
    for words, said in [
        (["--out", "even.mov"], "belongs to what is read"),
        (["--out", "lost.csv", "--overlay", "./even.mov"], "belongs to what is read"),
        (["--out", "rig.toml", "--replace"], "belongs to what is read"),
        (["--out", "lost.csv", "--sheet", "lost.csv"], "is written by two options"),
        (["--out", "lost.csv", "--sheet", "."], "is a folder"),
    ]:
        status, out, err = run(place, "track", "even.mov", *words)
        assert status == 2 and said in err and err.count("\n") == 1 and not out
    assert not (place / "lost.csv").exists()
    assert (place / "even.mov").read_bytes() == film
    assert (place / "rig.toml").read_bytes() == rig


def test_no_word_of_the_decoder_comes_beside_the_line(tmp_path, capfd):
    (tmp_path / "junk.mov").write_bytes(b"junk")
    with refused("no video"):
        open_source(str(tmp_path / "junk.mov"))
    with refused("gives no pictures"):
        open_source("97")
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Film((-0.1, 0.1)), "lengths"),
        (lambda: replace(SMALL, scale=0.0), "scale"),
        (lambda: replace(SMALL, size=(0, 10)), "size"),
        (lambda: replace(SMALL, pivot=(9e39, 100.0)), "pivot"),
        (lambda: replace(SMALL, pivot=(100.0, -1e5)), "pivot"),
        (lambda: Look(dots=((), (0.0, 0.85))), "look.dots"),
        (lambda: Look(dots=((), (0.0, 8.5, 0.85))), "look.dots"),
        (lambda: Look(radius=-3.0), "radius"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(make, said):
    with refused(said):
        make()


def test_a_film_that_broke_off_is_none(tmp_path, monkeypatch):
    def broken(*_):
        yield from itertools.islice(shots(FILM, MOTION), 3)
        raise KeyboardInterrupt

    monkeypatch.setattr(import_module("frictionid.rig.camera.film"), "shots", broken)
    with pytest.raises(KeyboardInterrupt):
        write_film(FILM, MOTION, tmp_path / "half")
    assert not list(tmp_path.iterdir())
