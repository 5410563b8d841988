"""The momentum observer: what acts from outside comes out, live as in batches, in C too."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from fixtures.changed_data import changed, each, subset
from fixtures.driven_pendulum import simulated
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.shared import shared
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.arrays import picked
from frictionid.data.signals import taken
from frictionid.deploy.cli import _show_stream
from frictionid.deploy.external_torque import interval_torques, noises
from frictionid.deploy.momentum_observer import Observed
from frictionid.deploy.watch import Chunk, watch_of, watched, write_code
from frictionid.friction.laws import Dahl
from frictionid.simulate import Camera, Drive, Multisine, Run, Variation, write_dataset

PUSH, BEGIN, END = 0.3, 4.0, 5.0  # N m, s


def recorded(count=4, seconds=12.0, noise=2e-4, seed=1, scatter=0.0, coulomb=0.1):
    """A pendulum with Coulomb and viscous friction, at 200 samples a second."""
    torque = Multisine(1.2, (0.7, 1.1, 1.6))
    runs = (Run(f"r{i}", (0.2 * i,), torques=(torque,)) for i in range(count))
    camera = Camera(int(seconds * 200) + 1, 200.0, noise)
    varied = Variation(scatter=scatter) if scatter else None
    settings = {"variation": varied, "seed": seed, "substeps": 1, "drive": Drive(rate=200.0)}
    return simulated(coulomb, 0.02, camera, runs, **settings)


def pushed(recording):
    """The log without a torque that acted: as if somebody had pushed."""
    value, time = recording.torque.value.copy(), recording.torque.time
    value[(time >= BEGIN) & (time < END)] -= PUSH
    return replace(recording, torque=recording.torque._replace(value=value))


@shared
def quiet():
    return recorded()


@shared
def fit(quiet):
    return fid.fit(quiet, "coulomb_viscous")


@shared
def watch(fit, quiet):
    return watch_of(fit.friction, quiet, 0.1, 1.0)


@shared
def contact(quiet):
    return each(subset(quiet, 1, 2), pushed)


def test_a_push_comes_out_as_it_went_in_and_nothing_else_does(fit, quiet, contact):
    said = fid.external_torque(fit, contact, quiet=quiet)
    (only,) = said.contacts
    assert BEGIN < only.begin < BEGIN + 0.15
    assert END < only.end < END + 0.3
    frame = said.frame
    within = frame[(frame.time > BEGIN + 0.4) & (frame.time < END)]
    # friction that rests may hold a part of it
    assert within.torque1.median() == pytest.approx(PUSH, rel=0.05)
    assert not fid.external_torque(fit, quiet, quiet=quiet).contacts


def test_the_lag_is_the_response(fit, quiet, contact):
    """Half of a step is there a little before the response, the mean delay."""
    said = fid.external_torque(fit, contact, quiet=quiet, response=0.2)
    frame = said.frame
    after = frame[frame.time > BEGIN]
    half = after.time[after.torque1 > PUSH / 2].iloc[0] - BEGIN
    assert half == pytest.approx(0.17, abs=0.03)


def test_noise_of_angles_is_told_from_errors_of_the_model_though_someone_touches():
    """An arm that stretches: its inertia makes more torque of the same noise."""
    rng, count = np.random.default_rng(0), 8000
    noise, shake = np.array([0.5, 0.2]), np.array([1.0, 2.0])
    M = np.zeros((count, 2, 2))
    M[:, 0, 0], M[:, 1, 1] = rng.uniform(0.2, 3.0, count), rng.uniform(0.05, 0.5, count)
    M[:, 0, 1] = M[:, 1, 0] = rng.uniform(-0.3, 0.3, count)
    torque = rng.standard_normal((count, 2)) * np.sqrt(noise**2 + M**2 @ shake**2)
    torque[::100] += 30.0
    nothing = np.zeros((count, 2))
    settled = np.ones(count, dtype=bool)
    time = np.arange(count) / 10.0
    said = Observed(time, torque, nothing, nothing, M, 0.0 * settled, settled, nothing)
    for estimate, true in zip(noises(said), (noise, shake), strict=True):
        assert_allclose(estimate, true, rtol=0.15)


def test_without_quiet_recordings_the_band_is_by_recordings_that_were_not_fitted():
    """Two recordings with different friction: each half explains itself, and not the other."""
    varied = recorded(2, scatter=0.2)
    loose = fid.fit(varied, "coulomb_viscous", method="one_step")
    seen = fid.external_torque(loose, varied, quiet=varied).band_of
    unseen = fid.external_torque(loose, varied).band_of
    size, other = (float(np.hypot(b.noise, 0.05 * b.shake)[0]) for b in (seen, unseen))
    assert other > 1.5 * size
    single = subset(varied, 0, 1)
    alone = fid.fit(single, "coulomb_viscous", method="one_step")
    assert fid.external_torque(alone, single).band_of.hours < seen.hours


def test_a_gap_in_the_log_is_no_contact(fit, quiet):
    """Between its ends nothing is known; behind it the filters settle anew."""

    def paused(r):
        keep = (r.angle.time < 4.0) | (r.angle.time > 7.0)
        angle, torque = (taken(x, keep) for x in (r.angle, r.torque))
        return replace(r, angle=angle, torque=torque, truth=None)

    said = fid.external_torque(fit, each(subset(quiet, 0, 1), paused), quiet=quiet)
    assert not said.contacts
    unknown = said.frame.torque1.isna() & (said.frame.time > 1.0)
    assert 7.0 < said.frame.time[unknown].min() < said.frame.time[unknown].max() < 7.6


@shared
def jumped(quiet):
    """A log in which the encoder is set anew by 400 turns at 6 s."""
    later = np.arange(2401)[:, None] > 1200
    return changed(subset(quiet, 0, 1), "angle", lambda q: q + 800 * np.pi * later)


def test_an_encoder_that_is_set_anew_is_no_contact(fit, quiet, jumped):
    """At the jump nothing is known; the filters settle anew."""
    said = fid.external_torque(fit, jumped, quiet=quiet)
    unknown = said.frame.time[said.frame.torque1.isna() & (said.frame.time > 2.0)]
    assert 6.0 < unknown.min() < 6.01 and 6.3 < unknown.max() < 7.6
    alone = fid.external_torque(fit, quiet, quiet=quiet).frame
    assert not alone.torque1[alone.time > 2.0].isna().any()


def test_uncertain_parameters_widen_the_band(quiet):
    plain = fid.fit(quiet, "coulomb_viscous", method="one_step")
    loose = replace(quiet, mechanism=replace(quiet.mechanism, tolerances={"mass": 5.0}))
    narrow, wide = (fid.external_torque(plain, x, quiet=x) for x in (quiet, loose))
    assert (wide.band_of.spread > 2.0 * narrow.band_of.spread).all()


@shared
def folder(quiet, contact, shared_path):
    write_dataset(quiet, shared_path / "quiet")
    write_dataset(contact, shared_path / "contact")
    write_dataset(changed(contact, "angle", lambda q: q % (2 * np.pi)), shared_path / "wrapped")
    return shared_path


def in_pieces(content, size):
    """Reads a content some bytes at a time, then nothing."""
    parts = iter([content[a : a + size] for a in range(0, len(content), size)])
    return lambda: next(parts, b"")


@pytest.mark.parametrize("name, size", [("contact", 50), ("contact", 4096), ("wrapped", 4096)])
def test_a_stream_says_what_the_batch_says(fit, watch, quiet, folder, name, size):
    """Angles that wrap at a turn are no others."""
    new = fid.load_dataset(folder / "contact")
    batch = fid.external_torque(fit, new, quiet=quiet)
    (table,) = (folder / name).glob("*.csv")
    content = table.read_bytes()[: 60_000 if size == 50 else None]
    seen = list(watched(watch, folder / "quiet", in_pieces(content, size), 0.0))
    torque, band = (np.concatenate([getattr(s, k) for s in seen]) for k in ("torque", "band"))
    rows, rounding = len(torque), 1e-5 if name == "wrapped" else 1e-9
    assert_allclose(torque, batch.torque[0][:rows], atol=rounding, equal_nan=True)
    assert_allclose(band, batch.band[0][:rows], atol=rounding, equal_nan=True)


def test_the_live_estimate_is_the_same_however_the_samples_come(watch, folder):
    """In one piece, in small ones, as a file that grows: stretches end at the same samples."""
    content = sorted((folder / "quiet").glob("*.csv"))[0].read_bytes()
    ends = [
        [s for s in watched(watch, folder / "quiet", in_pieces(content, size), 0.0) if s.estimate]
        for size in (1500, 10**9)
    ]
    slow, once = (each[-1].estimate for each in ends)
    assert_allclose(slow.share, once.share, rtol=1e-9)
    assert_allclose(slow.band, once.band, rtol=1e-9)
    assert once.seconds > 11.9  # the last two seconds count, too
    assert len(ends[0]) > len(ends[1])
    assert np.isinf(ends[0][0].estimate.band).all()  # one stretch does not say how they scatter


def test_a_jump_ends_a_stretch_of_the_live_estimate(watch, quiet, jumped, tmp_path):
    """It hardly moves the estimate; before and behind it what the samples say counts."""
    sound, ends = subset(quiet, 0, 1), []
    for data, size in (sound, 10**9), (jumped, 10**9), (jumped, 1500):
        place = tmp_path / str(len(ends))
        write_dataset(data, place)
        (table,) = place.glob("*.csv")
        seen = list(watched(watch, place, in_pieces(table.read_bytes(), size), 0.0))
        ends.append([s.estimate for s in seen if s.estimate][-1])
    assert_allclose(ends[1].share, ends[2].share, rtol=1e-9)
    assert_allclose(ends[1].share, ends[0].share, atol=0.01)
    assert ends[0].seconds - 1.1 < ends[1].seconds < ends[0].seconds


def samples_of(recording):
    return Chunk(recording.angle.time, recording.angle.value, recording.torque.value)


@pytest.mark.parametrize(
    "coulomb, change, said",
    [
        (0.1, pushed, ["contact"]),
        (0.14, lambda r: r, ["friction"]),
        (0.14, pushed, ["friction", "contact"]),
    ],
)
def test_worn_friction_is_named_friction_and_a_push_a_contact(
    watch, tmp_path, capsys, coulomb, change, said
):
    write_dataset(each(recorded(1, seed=9, coulomb=coulomb), change), tmp_path)
    source = in_pieces((tmp_path / "r0.csv").read_bytes(), 9999)
    _show_stream(watched(watch, tmp_path, source, 0.0), watch.mechanism.joints, json=True)
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    events = [(k, line["time"]) for line in lines for k in ("contact", "friction") if k in line]
    assert [kind for kind, _ in events] == said
    assert all(BEGIN < time < BEGIN + 0.15 for kind, time in events if kind == "contact")


def test_memory_is_that_of_a_stretch(watch, quiet):
    """What is kept after a stretch is as large as after ten."""
    live = watch.friction
    said, size, whole = live.start(), [], samples_of(quiet.recordings[0])
    for a in range(0, 2000, 400):
        said = live.added(said, picked(whole, slice(a, a + 401)))
        size.append(sum(np.size(x) for x in said))
    assert len(set(size)) == 1


def test_the_live_estimate_ends_at_the_batch_and_says_so(fit, quiet):
    """Friction 10 % below the model's, live and from all data at once."""
    less = replace(fit.friction, theta=fit.friction.theta / 0.9)
    live = watch_of(less, subset(quiet, 0, 1), 0.1, 1.0).friction
    said, estimates = live.start(), []
    for r in recorded(8, seed=3).recordings:
        for a in range(0, 2000, 1000):
            said = live.added(said, picked(samples_of(r), slice(a, a + 1001)))
            estimates.append(live.estimate(said))
    done = next(e for e in estimates if e.converged)
    batch = estimates[-1].share
    assert (np.abs(done.share - batch) < done.band).all()
    assert batch == pytest.approx(0.9, abs=0.02)


def test_a_stretch_that_is_mostly_disturbed_says_nothing(watch, quiet):
    """Few rows that are left would be fitted by as many numbers as they are."""
    live = watch.friction
    sound = picked(samples_of(quiet.recordings[0]), slice(1001))
    pushes = np.repeat(np.random.default_rng(0).standard_normal(21), 50)[:1001] * (sound.time > 0.7)
    said = live.added(live.start(), sound)
    assert live.added(said, sound).stretches == 2
    assert live.added(said, sound._replace(torque=sound.torque - pushes[:, None])) is said


def test_no_length_of_a_stream_tells_what_the_quiet_recordings_do_not(watch, quiet):
    """How noise draws gain, masses and friction together: an error that all stretches share."""
    live = watch.friction
    said = start = live.start()
    for r in quiet.recordings:
        said = live.added(said, picked(samples_of(r), slice(1001)))
    curvature, most = said.precision - start.precision, 1e6
    longer = said._replace(precision=start.precision + most * curvature, pull=most * said.pull)
    near, far = live.estimate(said), live.estimate(longer)
    assert (np.abs(far.share - near.share) < near.band).all()
    assert (near.band / 3 < far.band).all() and (far.band < near.band).all()


def test_an_estimate_that_moved_over_half_of_the_data_has_not_converged(watch, quiet):
    """Also in the moment in which the next half begins."""
    live = watch.friction
    said = live.start()
    for _ in range(8):
        said = live.added(said, picked(samples_of(quiet.recordings[0]), slice(1001)))
    assert said.at == said.stretches == 8
    assert live.estimate(said).converged
    moved = said._replace(checkpoints=said.checkpoints - [[0.5], [0.0]])
    assert not live.estimate(moved).converged


def test_the_code_computes_what_the_program_does(fit, watch, quiet, contact, tmp_path):
    source, _ = write_code(watch, tmp_path / "watch.c", [], replace=False)
    library = tmp_path / "watch.so"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, "-o", library, source, "-lm"], check=True)
    code, (r,) = ctypes.CDLL(str(library)), contact.recordings
    array, number = ctypes.c_double * 1, ctypes.c_double
    memory, torques = (number * 32)(), interval_torques(r.torque, r.angle.time)
    base, mechanism = watch.momentum_observer.members.base[0], quiet.mechanism
    out, q, w, torque, band = [], array(), array(), array(), array()
    for k in range(len(r.angle.time)):
        dt = number(r.angle.time[k] - r.angle.time[k - 1] if k else 0.0)
        u, angle = array(*torques[max(k - 1, 0)]), array(*r.angle.value[k])
        code.observer_filter(memory, angle, u, dt, q, w)
        terms = mechanism.terms(base, np.array(q[:]), np.array(w[:]))
        code.observer_update(memory, array(*terms.M[0]), array(*terms.dLdq), dt, torque, band)
        out.append((torque[0], band[0]))
    said = fid.external_torque(fit, contact, quiet=quiet)
    settled = np.isfinite(said.torque[0][:, 0])
    mine, mine_band = np.array(out)[1:][settled].T
    assert_allclose(mine, said.torque[0][settled, 0], atol=1e-9)
    assert_allclose(mine_band, said.band[0][settled, 0], rtol=0.1)


def test_what_cannot_be_watched_is_refused(fit, watch, quiet, tmp_path):
    with assert_refused("name recordings without contact"):
        fid.external_torque(fit.friction, quiet)
    with assert_refused("rate = 0 must be a positive number"):
        fid.external_torque(fit, quiet, rate=0)
    two = fid.Friction(fit.friction.law, np.tile(fit.friction.theta, (2, 1)))
    with assert_refused("has 1 joints, the model has 2"):
        watch_of(two, quiet, 0.1, 1.0)
    short = each(subset(quiet, 0, 1), lambda r: replace(r, angle=taken(r.angle, range(90))))
    with assert_refused("too short for a band: give 2 s and more beside 0.52 s"):
        fid.external_torque(fit, quiet, quiet=short)
    dahl = fid.Friction(Dahl(), np.full((1, len(Dahl().names)), 0.1))
    other = watch._replace(momentum_observer=watch.momentum_observer._replace(friction=dahl))
    with assert_refused("code is for static laws"):
        write_code(other, tmp_path / "a.c", [], replace=False)


def test_the_command_follows_a_file(fit, folder, tmp_path, run):
    fit.save(tmp_path / "model.json")
    (table,) = (folder / "contact").glob("*.csv")
    machine = (tmp_path, "watch model.json", folder / "quiet")
    code, out, _ = run(*machine, "--follow", table, "--idle", 0.05)
    assert code == 0
    assert "s: contact at joint 1, +0." in out
    assert "s: its end at joint 1 after 1." in out
    assert "+0.3" in out.split("its end")[1].splitlines()[0]
    assert "of data: friction of the model's" in out
    code, out, _ = run(*machine, "--follow", table, "--idle", 0.05, "--json")
    assert {"contact", "torque"} < set(json.loads(out.splitlines()[0]))
    code, out, _ = run(*machine, "--code", "own.c")
    assert code == 0
    assert (tmp_path / "own.h").exists()
    (tmp_path / "none.csv").write_text(table.read_text().splitlines()[0] + "\n")
    for words, said in (
        ((), "--follow FILE"),
        (("--follow", table, "--response", 0), "response = 0.0 must be a positive number"),
        (("--follow", table, "--rate", -1), "rate = -1.0 must be a positive number"),
        (("--follow", "none.csv", "--idle", 0), "no sample came"),
    ):
        assert_one_line(run(*machine, *words), said)


def test_a_file_that_is_not_there_yet_is_waited_for(fit, folder, tmp_path, run, monkeypatch):
    """By whoever starts before the logger; nothing else ends it than the file, or Ctrl-C."""
    fit.save(tmp_path / "model.json")
    (table,) = (folder / "contact").glob("*.csv")
    looks = iter([lambda: None, lambda: shutil.copy(table, tmp_path / "log.csv")])
    monkeypatch.setattr("frictionid.deploy.cli.sleep", lambda _: next(looks)())
    words = (tmp_path, "watch model.json", folder / "quiet", "--follow", "log.csv", "--idle", 0.0)
    code, out, said = run(*words)
    assert code == 0 and "s: contact at joint 1, +0." in out
    assert said == "watch: log.csv is not there yet, waiting; Ctrl-C ends it\n"
    assert run(*words)[2] == ""


def test_a_damaged_row_is_left_out_and_named(watch, folder):
    """A serial line that lost some bytes: the others count, and nothing else changes."""
    header, *rows = sorted((folder / "quiet").glob("*.csv"))[0].read_text().splitlines()[:600]
    damaged = [*rows[:300], "0.1;?", *rows[301:]]
    missing = [*rows[:300], *rows[301:]]
    both = []
    for lines in (damaged, missing):
        content = ("\n".join([header, *lines]) + "\n").encode()
        both.append(list(watched(watch, folder / "quiet", in_pieces(content, 4096), 0.0)))
    (sentence,) = [sentence for seen in both[0] for sentence in seen.damaged]
    assert sentence.startswith("row 302, '0.1;?', is left out: ")
    torques = [np.concatenate([seen.torque for seen in each]) for each in both]
    assert_allclose(*torques, atol=1e-9, equal_nan=True)
    wrong = in_pieces(b"a,b\n1,2\n3,4\n", 4096)
    with assert_refused("row 2"):
        list(watched(watch, folder / "quiet", wrong, 0.0))
