"""The monitor on simulated recordings: what it finds, what it does not call wear, what it keeps."""

from __future__ import annotations

import json
import os
import signal
from dataclasses import replace

import numpy as np
import pytest
from drive_logs import ServoPendulum
from fixtures.changed_data import changed, each, on_later_clock, subset
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.servo_logs import by_controller
from fixtures.seven_joints import MASS, urdf_text
from fixtures.shared import shared
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.data.signals import taken
from frictionid.deploy.monitor.baseline import load_baseline, machine_of, save_baseline
from frictionid.deploy.monitor.changes import prepared_data, recording_changes
from frictionid.deploy.monitor.judgement import judge
from frictionid.deploy.monitor.monitor import load_state
from frictionid.deploy.monitor.monitored import totals
from frictionid.friction.provenance import Segment
from frictionid.mechanics import urdf
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
    settings = {"variation": varied, "seed": seed, "substeps": 1}
    return Rig("rig", {"kind": "acrobot"}, true, camera, runs, **settings)


@shared
def first():
    """Healthy recordings, and from the twentieth on 20 % more of the levels of joint 1."""
    return simulate(rig(1, COUNT + 10, wear=(0.2, 0.0), worn_from=COUNT + 5, sudden=True))


@shared
def healthy(first):
    return subset(first, 0, COUNT)


@shared
def fresh(first):
    """Five other healthy recordings."""
    return subset(first, COUNT, COUNT + 5)


@shared
def worn(first):
    """Five recordings with 20 % more of the levels of each joint."""
    return subset(first, COUNT + 5, None), simulate(rig(2, 5, wear=(0.0, 0.2), sudden=True))


@shared
def known(healthy):
    return fid.baseline(healthy)


def logged(data, early=0.0, factor=1.0, tilt=0.0):
    """Recordings as other sensors would have made them."""
    other = changed(data, "torque", lambda u: u * factor, -early)
    return changed(other, "angle", lambda q: q + [tilt, 0.0])


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


def test_healthy_recordings_are_called_unchanged(known, fresh):
    found = fid.monitor(known, fresh)
    assert found.answer == "unchanged"
    assert found.judgement.p > 0.01
    assert found.judgement.causes == ()


@pytest.mark.parametrize(
    "sensors, cause, size",
    [
        ({"early": 0.005}, "the torque's delay", 5.0),  # ms
        ({"factor": 1.0 / 1.06}, "the torque's gain of joint 2", 6.0),  # %
        ({"tilt": 0.02}, "the angle's offset of joint 1", 0.02),
    ],
)
def test_what_the_sensors_did_is_called_by_its_name(known, healthy, fresh, sensors, cause, size):
    """Logged early, too small, by a tilted camera: never friction, and of the right size."""
    found = fid.monitor(known, logged(fresh, **sensors))
    assert found.answer == "other"
    assert [c.partition(":")[0] for c in found.judgement.causes] == [cause]
    assert "Friction has not changed" in str(found)
    (text,) = fid.monitor(known, logged(healthy, **sensors)).judgement.causes
    assert float(text.partition(": ")[2].split()[0]) == pytest.approx(size, rel=0.1)


def test_a_payload_is_called_by_its_name(known):
    """Ten per cent more of the last mass."""
    heavy = rig(1, 5)
    heavy = simulate(replace(heavy, true_parameters={"m4": 1.15 * 0.084}))
    found = fid.monitor(known, heavy)
    assert found.answer != "changed"
    assert any("payload" in cause for cause in found.judgement.causes)


def test_pushes_are_no_friction_and_are_left_out(known, fresh):
    """0.15 N m for 0.2 s on joint 2, which no log has."""

    def pushed(r):
        value, time = r.torque.value.copy(), r.torque.time
        value[(time > 5.0) & (time < 5.2), 1] -= 0.15
        return replace(r, torque=r.torque._replace(value=value))

    new = each(fresh, pushed)
    found = fid.monitor(known, new)
    assert found.answer == "unchanged"
    assert "disturbed, not friction: " in str(found)
    for clock in (0.0, 7.0):  # times are from the first sample
        prepared = prepared_data(on_later_clock(subset(new, 0, 1), clock))
        (one,) = recording_changes(prepared, known.reference, (), known.changes.disturbed)[1]
        assert one.begin < 5.0 < 5.2 < one.end < 6.0


def test_where_much_is_disturbed_another_cause_is_named(known):
    stretches = [Segment("r", 0.0, 3.0, 1.0)]
    few, many = (judge(known, known.changes, 0.01, stretches, t) for t in (60.0, 10.0))
    assert few.answer == "unchanged" and many.answer == "cannot_tell"
    assert "30 % of the time is disturbed: backlash" in many.notes[-1]


def test_a_recording_changes_alone_as_it_does_among_others(known, healthy):
    """What exchangeability needs: no number of a recording depends on those it came with."""
    alone, _ = recording_changes(prepared_data(subset(healthy, 3, 4)), known.reference, ())
    assert_array_equal(alone.value[0], known.changes.value[3])


def test_a_temperature_explains_what_follows_it():
    """Friction falls by 1 % a kelvin; new recordings are as warm as some healthy ones."""
    warm = tuple(float(20 + (3 * i) % COUNT) for i in range(COUNT))
    data = simulate(rig(6, seconds=8.0, temperature=warm, per_kelvin=-0.01, scatter=0.01))
    old, new = subset(data, 0, 10), subset(data, 10, None)
    base = fid.baseline(old)
    assert base.covariates == ("temperature",)
    found = fid.monitor(base, new)
    assert found.answer == "unchanged"
    blind = fid.baseline(each(old, lambda r: replace(r, covariates={})))
    assert np.ptp(totals(blind.changes, blind.reference.speeds)[:, 0]) > 0.05 * blind.level[0]


@pytest.mark.parametrize("rate", [0.01, 1e-9])
def test_few_recordings_raise_no_alarm_at_any_rate(healthy, rate):
    base = fid.baseline(subset(healthy, 0, 3))
    assert fid.monitor(base, subset(healthy, 3, 4), rate=rate).judgement.causes == ()


def test_faster_motion_than_any_healthy_one_cannot_be_judged(known, worn):
    """The same paths in half the time, and in half as much more: slower ones are judged."""

    def at(share):
        def moved(r):
            angle, torque = (x._replace(time=x.time / share) for x in (r.angle, r.torque))
            return replace(r, angle=angle, torque=torque)

        return each(worn[0], moved)

    fast = fid.monitor(known, at(2.0))
    assert fast.answer == "cannot_tell"
    assert "cannot judge: the new recordings are faster (joint 1)" in str(fast)
    assert "cannot judge" not in str(fid.monitor(known, at(0.9)))


def test_a_baseline_survives_its_file(known, tmp_path):
    path = tmp_path / "baseline.json"
    save_baseline(known, path, {})
    again = load_baseline(path)
    assert again.joints == known.joints
    assert_allclose(again.changes.value, known.changes.value, rtol=1e-12)
    assert again.reference.effects == known.reference.effects
    assert path.stat().st_size / len(known.names) < 100e6 / 1000  # 1,000 recordings: 100 MB


def test_other_machines_and_formats_are_refused(known, healthy, tmp_path):
    pendulum = replace(healthy, mechanism=fid.mechanisms.double_pendulum(m1=0.5, l1=0.3))
    with assert_refused("baseline is of 'acrobot'"):
        fid.monitor(known, pendulum)
    heavy = replace(healthy, mechanism=fid.mechanisms.acrobot(m4=0.05))
    with assert_refused("the mechanism of the baseline differs"):
        fid.monitor(known, heavy)
    path = tmp_path / "baseline.json"
    save_baseline(known, path, {})
    for change, said in (
        ({"format": "frictionid baseline 0"}, "make the baseline again"),
        ({"recordings": [{"name": "a"}]}, "is damaged"),
    ):
        path.write_text(json.dumps(json.loads(path.read_text()) | change))
        with assert_refused(said):
            fid.monitor(path, heavy)
        save_baseline(known, path, {})


def test_a_killed_monitor_goes_on_where_it_was(known, worn, tmp_path):
    write_dataset(worn[0], tmp_path / "new")
    base, state = tmp_path / "baseline.json", tmp_path / "state.json"
    save_baseline(known, base, {})
    seen = []

    def done(name):
        seen.append(name)
        if len(seen) == 2:
            os.kill(os.getpid(), signal.SIGKILL)

    child = os.fork()
    if not child:
        try:
            fid.monitor(base, tmp_path / "new", state=state, done=done)
        finally:
            os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
    assert len(load_state(state, known)) == 2
    resumed = fid.monitor(base, tmp_path / "new", state=state)
    at_once = fid.monitor(base, tmp_path / "new", state=tmp_path / "other.json")
    assert [a.log_evidence for a in resumed.arrivals] == [a.log_evidence for a in at_once.arrivals]
    assert len(resumed.arrivals) == 5
    again = fid.monitor(base, tmp_path / "new", state=state)
    assert len(again.arrivals) == 5


def test_the_commands_say_it_by_their_exit_status(healthy, worn, tmp_path, run):
    write_dataset(healthy, tmp_path / "healthy")
    write_dataset(worn[1], tmp_path / "worn")

    code, out, _ = run(tmp_path, "baseline healthy --out b.json")
    assert code == 0
    assert "14 healthy recordings" in out
    code, out, _ = run(tmp_path, "monitor worn --baseline b.json --out page")
    assert code == 1
    assert "Friction has changed: joint 2" in out
    page = (tmp_path / "page/index.html").read_text()
    assert "Friction has changed: joint 2" in page
    assert "http" not in page.replace("http://www.w3.org", "")
    code, out, _ = run(tmp_path, "monitor healthy --baseline b.json --json --only r1-0")
    assert code == 0
    assert json.loads(out)["answer"] == "unchanged"
    assert_one_line(run(tmp_path, "monitor worn --baseline b.json --rate 2"), "rate = 2")


def test_a_baseline_of_one_recording_is_refused(healthy):
    with assert_refused("two or more"):
        fid.baseline(subset(healthy, 0, 1))


def test_pieces_of_healthy_recordings_raise_no_alarm(known, fresh):
    """Thirty samples are hardly more than what may change: the noise is that of healthy ones."""

    for a in range(0, 700, 100):

        def piece(r, rows=range(a, a + 30)):
            return replace(r, angle=taken(r.angle, rows), truth=None)

        pieces = each(fresh, piece)
        assert fid.monitor(known, pieces, rate=1e-3).judgement.causes == ()


def test_recordings_are_chosen_over_all_data_sets(known, first):
    new = [subset(first, COUNT, COUNT + 2), subset(first, COUNT + 2, COUNT + 4)]
    name = new[0].recordings[1].name
    assert fid.monitor(known, new, only=[name]).names == (name,)
    with assert_refused("no recording 'r1'; known: 'r1-14'"):
        fid.monitor(known, new, only=["r1"])
    with assert_refused("name a data set with recordings"):
        fid.monitor(known, [])


def test_what_joints_cannot_tell_is_said(known, fresh):
    """Joint 1 stands still, as under a brake: nothing is said of its friction."""
    braked = changed(fresh, "angle", lambda q: q - q * [1.0, 0.0])
    said = fid.monitor(known, braked).judgement
    assert 0 not in said.joints
    assert any(note.startswith("joint 1: changes smaller") for note in said.notes)


def test_a_change_that_few_recordings_do_not_show_beyond_chance_is_no_sign_of_none(
    healthy, fresh, worn
):
    few = fid.baseline(subset(healthy, 0, 4))
    found = fid.monitor(few, subset(worn[0], 0, 2))
    assert found.answer == "cannot_tell"
    assert "friction may have changed, of joint 1 by +18 %: record" in found.judgement.notes[-1]
    assert fid.monitor(few, subset(fresh, 0, 2)).answer == "unchanged"


def test_servos_whose_targets_are_late_have_the_same_friction_under_other_gains():
    rig = ServoPendulum()

    def data(P, D, seeds):
        logs = {f"{P} {seed}": rig.log(P, D, seed, seconds=4.0) for seed in seeds}
        return by_controller(rig, logs, P=P, D=D)

    usual = fid.baseline(data(4.0, 0.05, range(4)), law="coulomb_viscous")
    found = usual.reference.friction.calibration.target_delay
    assert found == pytest.approx(rig.delay, abs=1e-3)
    assert fid.monitor(usual, data(10.0, 0.15, range(5, 8))).answer == "unchanged"


def test_a_reference_without_friction_is_refused(healthy):
    with assert_refused("a law other than none"):
        fid.baseline(healthy, law="none")


def test_what_a_covariate_explains_is_no_scatter(known):
    """A level that changes by 30 % with a temperature would scatter by 18 %."""
    warmth, value = np.linspace(-1.0, 1.0, COUNT), known.changes.value.copy()
    value[:, 0] += 0.3 * known.level[0] * warmth
    changes = known.changes._replace(value=value, covariates=warmth[:, None])
    warm = replace(known, covariates=("temperature",), changes=changes)
    assert_allclose(warm.scatter, known.scatter, rtol=0.2)


def test_an_unknown_temperature_is_said(known, fresh):
    base = replace(
        known,
        covariates=("temperature",),
        changes=known.changes._replace(covariates=np.arange(20.0, 20 + COUNT)[:, None]),
    )
    notes = fid.monitor(base, fresh).judgement.notes
    assert any("temperature is not said of all new recordings" in note for note in notes)


def test_an_arm_is_the_same_wherever_its_file_stands_and_whether_its_joints_are_named(tmp_path):
    machines = []
    for name, mass in (("a", 0.6), ("b", 0.6), ("c", 0.7)):
        (tmp_path / f"{name}.urdf").write_text(urdf_text([*MASS[:-1], mass]), encoding="utf-8")
        machines.append(urdf(tmp_path / f"{name}.urdf"))
    machines.append(urdf(tmp_path / "a.urdf", joints=list(machines[0].joints)))
    a, b, c, named = map(machine_of, machines)
    assert a == b == named != c
