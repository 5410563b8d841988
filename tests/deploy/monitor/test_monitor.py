"""The monitor on simulated recordings: what it finds, what it does not call wear, what it keeps."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import frictionid as fid
from frictionid.__main__ import main
from frictionid.comparison.registry import LAWS
from frictionid.data.signals import Signal
from frictionid.deploy.monitor.baseline import (
    load_baseline,
    make_baseline,
    save_baseline,
)
from frictionid.deploy.monitor.changes import PARTS, prepared_data, recording_changes
from frictionid.deploy.monitor.monitor import load_state
from frictionid.simulate import (
    Camera,
    Curve,
    Rig,
    Run,
    Sine,
    Stribeck,
    Variation,
    simulate,
    write_dataset,
)

CURVE = Curve((0.165, 0.055), (0.165, 0.05), (0.004, 0.0008), (0.0, 0.028), (0.0, 0.036))
COUNT = 14


def rig(seed, count=COUNT, seconds=12.0, **variation):
    """Recordings of random sines with a scatter of 3 %; truth and monitor share no step."""
    rng = np.random.default_rng(seed)
    runs = tuple(
        Run(f"r{seed}-{i}", tuple(rng.uniform(-2, 2, 2)), torques=(Sine(0.14, 0.95 + 0.01 * i),))
        for i in range(count)
    )
    camera = Camera(int(seconds * 60) + 1, 60.0, 0.0016)
    varied = Variation(**({"scatter": 0.03} | variation))
    true = Stribeck(CURVE)
    settings = {"variation": varied, "seed": seed, "substeps": 3}
    return Rig("rig", {"kind": "acrobot"}, true, camera, runs, **settings)


def some(data, first, last):
    """Some recordings of a data set."""
    return replace(data, recordings=data.recordings[first:last])


@pytest.fixture(scope="module")
def first():
    """Healthy recordings, and from the twentieth on 20 % more of the levels of joint 1."""
    return simulate(rig(1, COUNT + 10, wear=(0.2, 0.0), worn_from=COUNT + 5, sudden=True))


@pytest.fixture(scope="module")
def healthy(first):
    return some(first, 0, COUNT)


@pytest.fixture(scope="module")
def worn(first):
    """Five recordings with 20 % more of the levels of each joint."""
    return (
        some(first, COUNT + 5, None),
        simulate(rig(2, 5, wear=(0.0, 0.2), sudden=True)),
    )


@pytest.fixture(scope="module")
def known(healthy):
    return fid.baseline(healthy)


def off(known, data):
    """Mean change of each joint's parts against the healthy recordings, over the usual friction."""
    new = recording_changes(prepared_data(data), known.reference, ())
    return (new.parts.mean(axis=0) - known.changes.parts.mean(axis=0)) / known.level[:, None]


@pytest.mark.parametrize("joint", [0, 1])
def test_a_change_of_one_joint_is_found_in_that_joint_and_by_its_size(known, worn, joint):
    """Five recordings, 20 % more of the levels of one joint, 3 % scatter."""
    found = fid.monitor(known, worn[joint])
    assert found.answer == "changed"
    assert found.judgement.joints == (joint,)
    total = found.frame.query("part == 'total'").iloc[joint]
    true = 20.0 * (0.165, 0.055)[joint] / known.level[joint]
    assert total.low_95 > 0
    assert total.per_cent == pytest.approx(true, abs=6.0)


def test_healthy_recordings_are_called_unchanged(known, first):
    found = fid.monitor(known, some(first, COUNT, COUNT + 5))
    assert found.answer == "unchanged"
    assert found.judgement.promised < 0.01 < found.judgement.p


def test_what_the_sensors_did_does_not_pass_for_wear(known, healthy):
    """The same recordings, logged 5 ms early, by a camera tilted by 1 degree, 3 % too small."""
    tilt = np.array([np.deg2rad(1.0), 0.0])

    def changed(f):
        return off(known, replace(healthy, recordings=tuple(map(f, healthy.recordings))))

    late = changed(lambda r: replace(r, torque=r.torque._replace(time=r.torque.time - 0.005)))
    gain = changed(lambda r: replace(r, torque=r.torque._replace(value=r.torque.value / 1.03)))
    tilted = changed(lambda r: replace(r, angle=r.angle._replace(value=r.angle.value + tilt)))
    for name, change in (("late", late), ("gain", gain), ("tilted", tilted)):
        assert np.abs(change[:, :2].sum(axis=-1)).max() < 0.012, name
    new = recording_changes(prepared_data(healthy), known.reference, ())
    assert new.delay.mean() == pytest.approx(0.0, abs=1e-3)


def test_delay_gain_and_tilt_are_estimated(known, healthy):
    moved = tuple(
        replace(
            r,
            torque=r.torque._replace(time=r.torque.time - 0.005, value=r.torque.value / 1.03),
            angle=r.angle._replace(value=r.angle.value + np.array([0.02, 0.0])),
        )
        for r in healthy.recordings
    )
    data = replace(healthy, recordings=moved)
    new = recording_changes(prepared_data(data), known.reference, ())
    before = known.changes
    assert np.mean(new.delay - before.delay) == pytest.approx(0.005, rel=0.1)
    assert np.mean(new.gain[:, 1] - before.gain[:, 1]) == pytest.approx(0.03, abs=0.006)
    assert np.mean(new.offset[:, 0] - before.offset[:, 0]) == pytest.approx(0.02, rel=0.1)


def test_a_recording_changes_alone_as_it_does_among_others(known, healthy):
    """What exchangeability needs: no number of a recording depends on those it came with."""
    alone = recording_changes(prepared_data(some(healthy, 3, 4)), known.reference, ())
    np.testing.assert_array_equal(alone.parts[0], known.changes.parts[3])


def test_a_temperature_explains_what_follows_it():
    """Friction falls by 1 % a kelvin; new recordings are as warm as some healthy ones."""
    warm = tuple(float(20 + (3 * i) % COUNT) for i in range(COUNT))
    data = simulate(rig(6, seconds=8.0, temperature=warm, per_kelvin=-0.01, scatter=0.01))
    old, new = some(data, 0, 10), some(data, 10, None)
    base = fid.baseline(old)
    assert base.covariates == ("temperature",)
    found = fid.monitor(base, new)
    assert found.answer == "unchanged"
    without = {r.name: replace(r, covariates={}) for r in data.recordings}
    blind = fid.baseline(replace(old, recordings=tuple(without[r.name] for r in old.recordings)))
    assert np.ptp(blind.changes.parts[:, 0, :2].sum(-1)) > 0.05 * blind.level[0]


def test_too_few_recordings_say_which_rate_they_allow(healthy):
    base = fid.baseline(some(healthy, 0, 3))
    found = fid.monitor(base, some(healthy, 3, 4))
    assert found.answer == "cannot_tell"
    assert found.judgement.promised == 0.25
    assert "0.01 needs 99 healthy ones" in str(found)
    rare = fid.monitor(base, some(healthy, 3, 4), rate=1e-9)
    assert rare.answer == "cannot_tell"
    assert "1e-09 needs 999999999 healthy ones, and no rate is below 1e-07" in str(rare)


def test_recordings_unlike_the_healthy_ones_are_named(known, healthy):
    one = healthy.recordings[0]
    short = replace(one, angle=Signal(one.angle.time[:300], one.angle.value[:300]))
    found = fid.monitor(known, replace(healthy, recordings=(short,)))
    assert "not exchangeable with healthy ones of 12 to 12 s" in str(found)


def test_other_motion_is_named_and_the_same_motion_is_not(known, first):
    """The same paths in twice the time."""
    part = some(first, COUNT, COUNT + 5)

    def slowed(recording):
        both = (recording.angle, recording.torque)
        angle, torque = (signal._replace(time=2.0 * signal.time) for signal in both)
        return replace(recording, angle=angle, torque=torque)

    slow = replace(part, recordings=tuple(map(slowed, part.recordings)))
    assert "moves slower than in the baseline" in str(fid.monitor(known, slow))
    assert "than in the baseline" not in str(fid.monitor(known, part))


def test_no_rate_holds_for_an_alarm_of_shorter_recordings(known, worn):
    """Their changes scatter more than those of the healthy ones, whatever friction did."""

    def first(seconds):
        count = int(60 * seconds) + 1
        signals = [(r, r.angle) for r in worn[1].recordings]
        cut = (replace(r, angle=Signal(a.time[:count], a.value[:count])) for r, a in signals)
        return fid.monitor(known, replace(worn[1], recordings=tuple(cut)))

    assert first(9.0).answer == "changed"
    short = first(6.0)
    assert short.judgement.p <= 0.01
    assert short.answer == "cannot_tell"
    assert "take parts as long as those" in str(short)


def test_a_baseline_survives_its_file(known, tmp_path):
    path = tmp_path / "baseline.json"
    save_baseline(known, path, LAWS, {})
    again = load_baseline(path, LAWS)
    assert again.joints == known.joints
    np.testing.assert_allclose(again.changes.parts, known.changes.parts, rtol=1e-12)
    assert path.stat().st_size / len(known.names) < 100e6 / 1000  # 1,000 recordings: 100 MB


def test_other_machines_and_formats_are_refused(known, healthy, tmp_path):
    pendulum = replace(healthy, mechanism=fid.mechanisms.double_pendulum(m1=0.5, l1=0.3))
    with pytest.raises(fid.InputError, match="baseline is of 'acrobot'"):
        fid.monitor(known, pendulum)
    heavy = replace(healthy, mechanism=fid.mechanisms.acrobot(m4=0.05))
    with pytest.raises(fid.InputError, match="the mechanism of the baseline differs"):
        fid.monitor(known, heavy)
    path = tmp_path / "baseline.json"
    save_baseline(known, path, LAWS, {})
    for change, said in (
        ({"format": "frictionid baseline 0"}, "make the baseline again"),
        ({"settings": {"parts": ["coulomb"], "priors": [1, 2, 3]}}, "other settings"),
        ({"recordings": [{"name": "a"}]}, "is damaged"),
    ):
        path.write_text(json.dumps(json.loads(path.read_text()) | change))
        with pytest.raises(fid.InputError, match=said):
            fid.monitor(path, heavy)
        save_baseline(known, path, LAWS, {})


KILLED = """
import os, sys
import frictionid as fid
seen = []
def done(name):
    seen.append(name)
    if len(seen) == 2:
        os.kill(os.getpid(), 9)
fid.monitor(sys.argv[1], sys.argv[2], state=sys.argv[3], done=done)
"""


def test_a_killed_monitor_goes_on_where_it_was(known, worn, tmp_path):
    write_dataset(worn[0], tmp_path / "new")
    base, state = tmp_path / "baseline.json", tmp_path / "state.json"
    save_baseline(known, base, LAWS, {})
    words = [sys.executable, "-c", KILLED, base, tmp_path / "new", state]
    assert subprocess.run(words, check=False).returncode == -signal.SIGKILL
    assert len(load_state(state, known)) == 2
    resumed = fid.monitor(base, tmp_path / "new", state=state)
    at_once = fid.monitor(base, tmp_path / "new", state=tmp_path / "other.json")
    assert [a.log_evidence for a in resumed.arrivals] == [a.log_evidence for a in at_once.arrivals]
    assert len(resumed.arrivals) == 5
    again = fid.monitor(base, tmp_path / "new", state=state)
    assert len(again.arrivals) == 5


def test_the_commands_say_it_by_their_exit_status(healthy, worn, tmp_path, monkeypatch, capsys):
    write_dataset(healthy, tmp_path / "healthy")
    write_dataset(worn[1], tmp_path / "worn")

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["frictionid", *map(str, words)])
        return main(), *capsys.readouterr()

    base = tmp_path / "b.json"
    code, out, _ = run("baseline", tmp_path / "healthy", "--out", base)
    assert code == 0
    assert "14 healthy recordings" in out
    against = ("--baseline", base)
    code, out, _ = run("monitor", tmp_path / "worn", *against, "--out", tmp_path / "page")
    assert code == 1
    assert "Friction has changed: joint 2" in out
    page = (tmp_path / "page" / "index.html").read_text()
    assert "Friction has changed: joint 2" in page
    assert "http" not in page.replace("http://www.w3.org", "")
    code, out, _ = run("monitor", tmp_path / "worn", *against, "--json", "--only", "r2-0")
    assert code == 3
    assert json.loads(out)["answer"] == "cannot_tell"
    code, _, err = run("monitor", tmp_path / "worn", *against, "--rate", "2")
    assert code == 2
    assert "rate = 2" in err


def test_a_baseline_of_one_recording_is_refused(healthy):
    with pytest.raises(fid.InputError, match="two or more"):
        make_baseline(
            prepared_data(some(healthy, 0, 1)),
            fid.fit(healthy, "stribeck", method="one_step").friction,
        )
    assert PARTS[0] == "coulomb"
