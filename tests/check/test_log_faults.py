"""What `check` says of columns as drives and servos log them: unsigned, coarse, held, with gaps."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.changed_data import changed, on_later_clock, one_changed
from fixtures.one_joint_sets import Setup, sets

from frictionid.check import check
from frictionid.check.log_faults import (
    clock_findings,
    jumping_angles,
    kinks,
    repeated_rows,
    unsigned_torques,
)
from frictionid.check.sensors import coarse_velocities
from frictionid.data.signals import Signal, taken

COUNT = 20
SETUPS = [
    Setup(),
    Setup(logged="command", lag=0.005),
    Setup(feedback=True, noise=(1e-3, 3e-3)),
    Setup(passive=True),
]


@pytest.mark.parametrize("setup", SETUPS[:3], ids=["sensor", "command", "feedback"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_torque_without_its_sign_is_named(setup, sign):
    """In 95 % of 20 sets of each, seed 8."""
    data = sets(setup, COUNT, seed=8)
    found = [
        [f.kind for f in unsigned_torques(changed(d, "torque", lambda u: sign * np.abs(u)))]
        for d in data
    ]
    assert np.mean([kinds == ["unsigned_torque"] for kinds in found]) >= 0.95


@pytest.mark.parametrize("setup", SETUPS, ids=["sensor", "command", "feedback", "passive"])
def test_a_torque_with_its_sign_is_not_called_unsigned(setup):
    """Neither as logged, nor lifted so that it acts in one direction only."""
    for data in sets(setup, COUNT, seed=8):
        assert list(unsigned_torques(data)) == []
        assert list(unsigned_torques(changed(data, "torque", lambda u: u - u.min()))) == []
        assert list(unsigned_torques(changed(data, "torque", lambda u: np.maximum(u, 0.0)))) == []


def with_velocity(data, step):
    """The data set with velocities [rad/s] in steps of a share of their root mean square."""
    slopes = [np.gradient(r.angle.value, r.angle.time, axis=0) for r in data.recordings]
    size = step * np.sqrt(np.mean(np.concatenate(slopes) ** 2))
    values = [size * np.rint(w / size) if step else w for w in slopes]
    recordings = [
        replace(r, velocity=Signal(r.angle.time, w))
        for r, w in zip(data.recordings, values, strict=True)
    ]
    return replace(data, recordings=tuple(recordings))


@pytest.mark.parametrize("samples", range(8))
def test_a_few_samples_have_no_kink(samples):
    assert not len(kinks(np.linspace(1.0, 2.0, samples)))


@pytest.mark.parametrize(("step", "named"), [(0.0, False), (0.01, False), (0.2, True), (0.7, True)])
def test_a_velocity_in_coarse_steps_is_named(step, named):
    for data in sets(Setup(), 5, seed=2):
        found = list(coarse_velocities(with_velocity(data, step)))
        assert [f.kind for f in found] == ["coarse_velocity"] * named
        if named:
            assert found[0].numbers["step"] == pytest.approx(
                step * found[0].numbers["size"], rel=0.1
            )


@pytest.mark.parametrize("rows", [2, 5])
def test_held_samples_of_a_log_faster_than_its_sensor_are_named(rows):
    def held(value):
        return value[np.arange(len(value)) // rows * rows]

    for data in sets(Setup(counts=4096), COUNT, seed=4):
        found = repeated_rows(changed(data, "angle", held))
        assert [(f.kind, f.level) for f in found] == [("repeated_rows", "doubtful")]
        assert list(repeated_rows(data)) == []


def test_all_of_it_is_in_the_verdict_and_gaps_are_counted():
    """A log without signs, with coarse velocities, and half a second that was not written."""
    (data,) = sets(Setup(), 1, seed=6)
    bad = changed(with_velocity(data, 0.3), "torque", np.abs)
    recording, *others = bad.recordings
    time = recording.angle.time
    rows = (time < time[0] + 1.0) | (time > time[0] + 1.5)
    cut = {name: taken(getattr(recording, name), rows) for name in ("angle", "velocity")}
    verdict = check(replace(bad, recordings=(replace(recording, **cut), *others)))
    kinds = {f.kind: f.level for f in verdict.findings}
    assert kinds["unsigned_torque"] == "unusable" == verdict.level
    assert kinds["coarse_velocity"] == "doubtful"
    assert verdict.clock.gaps == 1 and verdict.clock.longest_gap == pytest.approx(0.5, abs=0.03)
    (gap,) = (f for f in verdict.findings if f.kind == "stamp_gaps")
    assert gap.numbers["longest"] == verdict.clock.longest_gap
    assert repr(recording.name) in gap.text


@pytest.mark.parametrize(("unit", "size"), [("rad", 1.0), ("deg", np.pi / 180)])
@pytest.mark.parametrize(("count", "turn"), [(4096, 4096.0), (1024, 1228.8)])
def test_counts_that_are_read_in_another_unit_are_named_before_all_else(unit, size, count, turn):
    (data,) = sets(Setup(), 1, seed=9)
    most = np.abs(np.concatenate([r.angle.value for r in data.recordings])).max()
    columns = changed(data, "angle", lambda q: size * np.rint(count / 2 + count / 3 * q / most))
    (counts,) = (f for f in check(columns).findings if f.level != "good")
    assert f"read as {unit} look like counts" in counts.text
    assert f"counts_per_turn = {turn:g} and offset = {-np.pi * count / turn:.6f}" in counts.remedy


def test_a_second_run_in_a_table_is_named_where_it_begins_and_a_spike_is_none():
    for data in sets(Setup(), 3, seed=9):
        time, q = data.recordings[0].angle.time, data.recordings[0].angle.value[:, 0]
        half = len(q) // 2
        for later, count in ((slice(half, None), 1), (half, 0)):
            found = list(jumping_angles(one_changed(data, "angle", 0, 0, later, q[later] + 0.5)))
            assert [f.joint for f in found] == [1] * count
            for f in found:
                assert f.numbers["largest"] == pytest.approx(0.5, abs=0.2)
                assert f.numbers["start"] == time[half - 1]
        assert list(jumping_angles(data)) == []
        frozen = one_changed(data, "angle", 0, 0, slice(half + 5), q[half] + 0.5)
        assert list(jumping_angles(frozen)) == []


def test_bursts_of_stamps_and_held_torques_are_named():
    """Rows that arrived together, and a torque that is logged four times as often as it changes."""

    def together(recording):
        time = recording.angle.time.copy()
        time[40:50] = time[40] + 1e-6 * np.arange(10)
        return replace(recording, angle=recording.angle._replace(time=time))

    def held(value):
        return np.repeat(value[::4], 4, axis=0)[: len(value)]

    for data in sets(Setup(), 3, seed=8):
        assert list(clock_findings(data)) == []
        burst = replace(data, recordings=(together(data.recordings[0]), *data.recordings[1:]))
        rows = {f.kind: f.numbers for f in clock_findings(burst)}
        assert rows["stamp_bursts"]["rows"] == 9
        assert rows["stamp_bursts"]["start"] == data.recordings[0].angle.time[40]
        found = clock_findings(changed(data, "torque", held))
        assert [(f.kind, f.numbers["rows"]) for f in found] == [("held_torque", 4)]


def test_places_in_time_are_from_the_first_sample_as_start_and_stop_are():
    """A gap, an angle that stands still and energy that rises, on a clock that began earlier."""
    (data,) = sets(Setup(), 1, seed=6)
    q = data.recordings[1].angle.value[:, 0]
    data = one_changed(data, "angle", 1, 0, slice(100, 160), q[100])
    gap = np.r_[0:200, 260 : len(data.recordings[0].angle.time)]
    first, *others = data.recordings
    data = replace(data, recordings=(replace(first, angle=taken(first.angle, gap)), *others))
    later = on_later_clock(data, 50.0)
    kinds = ("stamp_gaps", "frozen_sensor", "energy")
    texts, same = ([f.text for f in check(d).findings if f.kind in kinds] for d in (data, later))
    assert texts == same and len(texts) > 1
